/// @file supple/scenes/view.h
/// The viewer: one page (HTML) that plays a run in a browser, with meshes, contact pressure, forces and plots over time. `supple view`.
#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "supple/scenes/run.h"

namespace supple::scenes {

struct ViewOptions {
  std::filesystem::path folder;                 ///< run folder with saved states
  std::filesystem::path page{};                 ///< file to write; empty: folder/NAME_view.html
  std::set<int> frames{};                       ///< frames to show; empty: all that are saved
  int threads = 0;                              ///< 0: all of the machine; does not change the page
  int cells = 0;                                ///< of the meshes, along the longest side of all surfaces; 0: as many as `size` admits, at most kMostViewCells
  double size = 9.5e6;                          ///< largest page [byte], where `cells` is 0
  double memory = kDefaultMemory;               ///< limit of memory for the scene [byte]
  std::function<void(const Progress&)> progress{};
  const std::atomic<int>* interrupt = nullptr;  ///< non-zero: the call throws Interrupted soon
};
inline constexpr int kMostViewCells = 96;
inline constexpr int kFollowedViewCells = 56;   ///< of a view that follows a run, whose size is not known

/// The frames of a run as the page reads them (viewer/README.md), made from its saved states one after the other.
class RunView {
 public:
  /// @throws as Simulation
  RunView(const Scene& scene, const ViewOptions& options, int cells);
  ~RunView();
  RunView(const RunView&) = delete;
  RunView& operator=(const RunView&) = delete;

  /// Names, colours, cameras and ground, as JSON. @param follows  the page asks for frames as they are made
  [[nodiscard]] std::string head(bool follows) const;
  /// The next frame, compressed (zlib); arrays that stay as they were in the frame before are left out.
  /// Nothing where it has no saved state. @pre frames ascend  @throws as load_state
  [[nodiscard]] std::optional<std::string> frame(int frame);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct ViewResult {
  std::filesystem::path page;
  int frames = 0;
  int cells = 0;           ///< of the meshes
  std::size_t bytes = 0;   ///< of the page
};
/// Writes the page of a run, which needs no other file and no network.
/// @throws Error{Io} without saved states of the scene, Error{Limit} where a page of the fewest cells exceeds options.size
[[nodiscard]] ViewResult write_view(const Scene& scene, const ViewOptions& options);

/// The page of a run that asks its server for frames (`frames?from=N`).
[[nodiscard]] std::string following_page(const RunView& view);

}  // namespace supple::scenes
