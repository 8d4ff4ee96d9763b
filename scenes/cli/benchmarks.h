/// `supple bench`: the benchmark programs beside the tool, by group.
#pragma once

#include <span>
#include <string>

namespace supple::tool {

/// One line per group: its name, whether its program is built, what it measures.
[[nodiscard]] std::string list_benchmarks();

/// Replaces this process by the program of a group, "core" or "core/melt", with further arguments; does not return.
/// @throws Error{Usage} for an unknown group, Error{Io} when its program is not beside the tool
[[noreturn]] void run_benchmark(const std::string& group, std::span<const std::string> arguments);

}  // namespace supple::tool
