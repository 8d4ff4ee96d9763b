/// @file fit.h
/// `supple fit`: its options, and the start of its program. That is a program of its own, as it links CGAL and is built on request.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace supple::tool {

struct FitArguments {
  std::string input, out, picture, material, kind = "solid";
  std::optional<double> thickness;
  std::string pieces = "refuse";
  double error = 0.01;           ///< over the diagonal
  std::uint32_t particles = 200, primitives = 2000;
  std::optional<double> iso;
  std::optional<std::array<double, 2>> window;
  std::optional<std::uint32_t> label;
  int threads = 0;
  bool overwrite = false, quiet = false;
};

/// Which piece the option --pieces names: 1 for "largest"; none for other words than numbers from 1.
[[nodiscard]] std::optional<std::uint32_t> piece_in(const std::string& text);

inline constexpr const char* kFitMeaning = "make an object for scenes from a mesh, points or a volume";

/// Adds the command with its options.
CLI::App* add_fit(CLI::App& app, FitArguments& arguments);
/// The options alone.
void add_fit_options(CLI::App& verb, FitArguments& arguments);

/// Replaces this process by the program of fits. @param words  the command line   @param silent  standard output is closed
/// @throws Error{Io} where the program is not built
[[noreturn]] void start_fit(std::span<char* const> words, bool silent);

}  // namespace supple::tool
