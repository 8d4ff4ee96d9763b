/// @file work_limit.h
/// Limits of processor time and memory for work whose size no count tells, such as solving the first contacts of a scene.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace supple::scenes {

/// Interrupts work (core/interrupt.h) when the process has used so much processor time or memory since the making of this object, or when another
/// interrupt comes. For answers only: what depends on a clock is no part of a state.
class WorkLimit {
 public:
  /// @param seconds  of processor time   @param bytes  of resident memory   @param outer  another interrupt, which is passed on; outlives this, or null
  /// @throws Error{Limit} where the system starts no more threads
  WorkLimit(double seconds, double bytes, const std::atomic<int>* outer);
  ~WorkLimit();
  WorkLimit(const WorkLimit&) = delete;
  WorkLimit& operator=(const WorkLimit&) = delete;

  /// For InterruptScope and SimulationOptions.
  [[nodiscard]] const std::atomic<int>* interrupt() const noexcept { return &raised_; }
  /// Adds processor time.
  void extend(double seconds) noexcept { more_ = seconds; }
  /// From now on other interrupts alone stop the work.
  void lift() noexcept { lifted_ = true; }
  /// Whether a limit, and no other interrupt, stopped the work.
  [[nodiscard]] bool passed() const noexcept { return raised_ == kPassed; }

 private:
  static constexpr int kPassed = -1;  // no number of a signal
  void watch(double last_second, double last_byte, const std::atomic<int>* outer);

  std::atomic<int> raised_{0};
  std::atomic<bool> lifted_{false};
  std::atomic<double> more_{0.0};  // [s]
  std::mutex mutex_;
  std::condition_variable left_;
  bool done_ = false;
  std::thread watcher_;
};

}  // namespace supple::scenes
