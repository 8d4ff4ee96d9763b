/// @file supple/core/io/child_process.h
/// Child programs that never outlive the call that waits for them.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace supple::io {

/// How a program ended.
struct ProgramEnd {
  int status = 0;        ///< as waitpid gives it
  std::string messages;  ///< the end of its error stream
};

/// Where a program is: `name` itself where it holds a slash, otherwise that in the first folder of PATH with a file of this
/// name that may be run. Empty: nowhere.
[[nodiscard]] std::filesystem::path find_program(const std::string& name);

/// Runs a program without a shell to its end. Its input is empty, its output goes nowhere, and of our descriptors it gets none.
/// It leads a process group of its own: what a terminal sends to ours does not reach it.
/// It is killed with all of its group, what it has started included, when this process ends, however that ends.
/// @param words      its arguments, the first one its name
/// @param interrupt  kills it and its group when set by another thread or a signal; null: never
/// @param notice     from a SIGTERM until it is killed for `interrupt`
/// @throws std::system_error when it cannot be started, Interrupted when it was killed for `interrupt`
[[nodiscard]] ProgramEnd run_program(const std::filesystem::path& program, std::vector<std::string> words,
                                     const std::atomic<int>* interrupt,
                                     std::chrono::milliseconds notice = {});

}  // namespace supple::io
