/// `supple bench`: the benchmarks of the program supple_bench, by group.
#pragma once

#include <span>
#include <string>

namespace supple::tool {

/// One line per group: its name, whether supple_bench is there, what it measures.
[[nodiscard]] std::string list_benchmarks();

/// Replaces this process by the benchmark of a group, "core" or "core/melt", with further arguments; does not return.
/// @throws Error{Usage} for an unknown group, Error{Io} without supple_bench, which is beside the tool or in libexec/supple
[[noreturn]] void run_benchmark(const std::string& group, std::span<const std::string> arguments);

}  // namespace supple::tool
