/// `supple sweep`.
#pragma once

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "supple/implicit/delaunay.h"

namespace supple::tool {

struct SweepArguments {
  std::string what;               ///< scene, or folder of a sweep
  std::vector<std::string> set;
  std::vector<std::filesystem::path> allowed;
  std::string out, sample, measure, plot, svg, fingerprint;
  std::vector<std::string> over;
  std::string progress = "auto";
  std::uint64_t seed = 1;
  int point = 0;                  ///< 0: all
  int jobs = 0, threads = 1;
  double memory = 0.0;            ///< [byte]; 0: not given
  double time_limit = 0.0;        ///< [s]; 0: none
  bool plan_only = false, collect = false, outputs = false, overwrite = false, quiet = false;
};

/// Adds the command with its options.
CLI::App* add_sweep(CLI::App& app, SweepArguments& arguments);

/// @param interrupt  number of the signal that ends the call
/// @return the exit code
int sweep(const SweepArguments& arguments, const implicit::DelaunayMesher& delaunay, const std::atomic<int>& interrupt);

}  // namespace supple::tool
