/// @file supple/core/cpu_time.h
#pragma once

#include <ctime>

namespace supple {

/// CPU time of the process so far, all threads together [s].
[[nodiscard]] inline double process_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace supple
