/// @file usage.h
/// What every benchmark program does with its arguments first.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <span>
#include <string_view>

namespace supple::benchmarks {

struct BenchmarkOption {
  std::string_view name;
  std::size_t values = 0;  ///< arguments that must follow it
};

/// Ends the program where it is asked for its usage (-h, --help), with 0, or given an option that it does not know, one without
/// its values, or more arguments than it takes, with 2. Negative numbers are no options.
/// @param usage  a line for each way to call it   @param most  arguments that it takes, options and their values included
/// @param options  that it knows
inline void answer_usage(int argc, char** argv, std::string_view usage, std::size_t most, std::initializer_list<BenchmarkOption> options = {}) {
  const std::span<char*> arguments(argv + 1, static_cast<std::size_t>(std::max(argc - 1, 0)));
  const auto print = [usage](std::FILE* to) { std::fprintf(to, "usage: %.*s\n", static_cast<int>(usage.size()), usage.data()); };
  for (const std::string_view argument : arguments) {
    if (argument != "-h" && argument != "--help") continue;
    print(stdout);
    std::exit(0);
  }
  const auto refuse = [&](const char* expected, std::string_view found) {
    std::fprintf(stderr, "error: expected %s, found '%.*s'\n", expected, static_cast<int>(found.size()), found.data());
    print(stderr);
    std::exit(2);
  };
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view argument = arguments[i];
    const bool option = argument.size() > 1 && argument[0] == '-' && argument[1] != '.' && std::isdigit(static_cast<unsigned char>(argument[1])) == 0;
    if (!option) continue;
    const auto known = std::find_if(options.begin(), options.end(), [&](const BenchmarkOption& o) { return o.name == argument; });
    if (known == options.end()) refuse("an option of these", argument);
    if (i + known->values >= arguments.size()) refuse("a value after every option", argument);
  }
  if (arguments.size() > most) refuse("no more arguments", arguments[most]);
}

}  // namespace supple::benchmarks
