/// @file usage.h
/// Arguments and usage texts of the benchmark programs.
#pragma once

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

namespace supple::benchmarks {

struct BenchmarkOption {
  std::string_view name;
  std::size_t values = 0;  ///< arguments that must follow it
};

inline void print_usage(std::FILE* to, std::string_view usage) {
  std::fprintf(to, "usage: %.*s\n", static_cast<int>(usage.size()), usage.data());
}

/// Reports an invalid argument and ends the program with 2.
[[noreturn]] inline void refuse(std::string_view usage, std::string_view expected, std::string_view found) {
  std::fprintf(stderr, "error: expected %.*s, found '%.*s'\n", static_cast<int>(expected.size()), expected.data(), static_cast<int>(found.size()),
               found.data());
  print_usage(stderr, usage);
  std::exit(2);
}

/// An argument as a whole number; ends the program with 2 where it is none, or too small.
template <class T = int>
T whole_number(std::string_view usage, std::string_view text, T least = 1) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < least) {
    refuse(usage, "a whole number >= " + std::to_string(least), text);
  }
  return value;
}

/// As above, for any number > 0.
inline double positive_number(std::string_view usage, std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool good = error == std::errc() && end == text.data() + text.size() && value > 0.0 && std::isfinite(value);
  if (!good) refuse(usage, "a number > 0", text);
  return value;
}

/// Ends the program with 2 where a word is unknown.
template <class Words>
void expect_word(std::string_view usage, std::string_view word, const Words& known) {
  if (std::find(std::begin(known), std::end(known), word) != std::end(known)) return;
  std::string expected = "one of";
  for (const std::string_view other : known) expected.append(expected.size() > 6 ? ", " : " ").append(other);
  refuse(usage, expected, word);
}

/// Prints the usage and ends the program: with 0 for -h and --help, with 2 for an unknown option, an option without its values, or
/// too many arguments. Negative numbers are no options.
/// @param usage  one line per way to call the program   @param most  largest number of arguments, options and their values included
/// @param options  the known options
inline void answer_usage(int argc, char** argv, std::string_view usage, std::size_t most, std::initializer_list<BenchmarkOption> options = {}) {
  const std::span<char*> arguments(argv + 1, static_cast<std::size_t>(std::max(argc - 1, 0)));
  for (const std::string_view argument : arguments) {
    if (argument != "-h" && argument != "--help") continue;
    print_usage(stdout, usage);
    std::exit(0);
  }
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view argument = arguments[i];
    const bool option = argument.size() > 1 && argument[0] == '-' && argument[1] != '.' && std::isdigit(static_cast<unsigned char>(argument[1])) == 0;
    if (!option) continue;
    const auto known = std::find_if(options.begin(), options.end(), [&](const BenchmarkOption& o) { return o.name == argument; });
    if (known == options.end()) refuse(usage, "an option of these", argument);
    if (i + known->values >= arguments.size()) refuse(usage, "a value after every option", argument);
  }
  if (arguments.size() > most) refuse(usage, "no more arguments", arguments[most]);
}

}  // namespace supple::benchmarks
