/// @file process_time.h
/// CPU time of scopes, all threads of the process together.
#pragma once

#include "supple/core/cpu_time.h"

namespace supple::render {

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
