/// Serves the view of a run on this machine, also while the run goes on.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>

#include "supple/scenes/view.h"

namespace supple::tool {

/// Answers http://127.0.0.1:PORT/ on a thread of its own, to this machine only, until it is destroyed.
class ViewServer {
 public:
  struct Settings {
    std::filesystem::path folder;                 ///< of the run
    int port = 0;                                 ///< 0: any that is free
    int cells = scenes::kFollowedViewCells;
    double memory = scenes::kDefaultMemory;       ///< limit of memory for the scene [byte]
    const std::atomic<int>* interrupt = nullptr;  ///< non-zero: frames are no longer made
  };
  /// @throws Error{Io} where the port cannot be used
  ViewServer(scenes::Scene scene, Settings settings);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  [[nodiscard]] std::string address() const;
  void begin();   ///< from now on the folder holds states of this run
  void end();     ///< no more states will come
  /// Returns when `interrupt` is not 0.
  void wait() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple::tool
