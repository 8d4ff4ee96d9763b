/// @file supple/core/cpu_time.h
#pragma once

#include <algorithm>
#include <array>
#include <ctime>

namespace supple {

/// CPU time of the process so far, all threads together [s].
[[nodiscard]] inline double process_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Duration of one reading of that clock: the median of several, measured once [s]. It is subtracted from short intervals.
[[nodiscard]] inline double process_cpu_clock_cost() {
  static const double cost = [] {
    std::array<double, 64> taken{};
    double before = process_cpu_seconds();
    for (double& one : taken) {
      const double now = process_cpu_seconds();
      one = now - before;
      before = now;
    }
    std::nth_element(taken.begin(), taken.begin() + taken.size() / 2, taken.end());
    return taken[taken.size() / 2];
  }();
  return cost;
}

}  // namespace supple
