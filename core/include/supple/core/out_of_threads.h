/// @file supple/core/out_of_threads.h
/// What a user reads where the system starts no more threads.
#pragma once

#include "supple/core/error.h"

namespace supple {

inline constexpr const char* kOutOfThreads =
    "threads: expected a system that starts as many as are needed, found no more of them; use fewer with --threads, or allow more processes (ulimit -u)";

/// @throws Error{Limit} with this text
[[noreturn]] inline void throw_out_of_threads() {
  throw Error(ErrorKind::Limit, Fault{.place = {}, .key = {}, .expected = kOutOfThreads, .found = {}, .hint = {}});
}

}  // namespace supple
