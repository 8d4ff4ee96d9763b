/// @file fit.h
/// `supple fit`.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <optional>
#include <string>

namespace supple::tool {

struct FitArguments {
  std::string input, out, picture;
  std::string pieces = "refuse";
  double error = 0.01;           ///< over the diagonal
  std::uint32_t particles = 200, primitives = 2000;
  std::optional<double> iso;
  std::optional<std::array<double, 2>> window;
  std::optional<std::uint32_t> label;
  int threads = 0;
  bool overwrite = false, quiet = false;
};

/// Adds the command with its options.
CLI::App* add_fit(CLI::App& app, FitArguments& arguments);

/// @return the exit code
int fit(const FitArguments& arguments);

}  // namespace supple::tool
