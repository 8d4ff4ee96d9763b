/// @file process_time.h
/// CPU time of the process, all threads together.
#pragma once

#include <ctime>

namespace supple::render {

[[nodiscard]] inline double process_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Adds the CPU time of a scope.
class CpuClock {
 public:
  explicit CpuClock(double& sum) : sum_(sum), begin_(process_cpu_seconds()) {}
  ~CpuClock() { sum_ += process_cpu_seconds() - begin_; }
  CpuClock(const CpuClock&) = delete;
  CpuClock& operator=(const CpuClock&) = delete;

 private:
  double& sum_;
  double begin_;
};

}  // namespace supple::render
