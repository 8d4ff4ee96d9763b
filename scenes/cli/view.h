/// `supple view`.
#pragma once

#include <CLI/CLI.hpp>
#include <atomic>
#include <string>
#include <vector>

#include "progress_bar.h"

namespace supple::tool {

struct ViewArguments {
  std::string run;               ///< run folder or scene
  std::vector<std::string> set, allowed;
  std::string out, page, frames;
  std::string progress = "auto";
  int threads = 0, cells = 0, port = 0;
  double size = 0.0;             ///< [byte]; 0: not given
  bool serve = false;
  bool quiet = false;
};

/// Adds the command with its options.
CLI::App* add_view(CLI::App& app, ViewArguments& arguments);

/// @param interrupt  number of the signal that ends the call
/// @return the exit code
int view(const ViewArguments& arguments, const std::atomic<int>& interrupt);

}  // namespace supple::tool
