/// @file processor_limit.h
/// A limit of processor time for work whose duration no count tells, such as solving the first contacts of a scene.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace supple::scenes {

/// Interrupts work (core/interrupt.h) when the process has used so much processor time since the making of this object, or when another
/// interrupt comes. For answers only: what depends on a clock is no part of a state.
class ProcessorLimit {
 public:
  /// @param seconds  of processor time   @param outer  another interrupt, which is passed on; outlives this, or null
  ProcessorLimit(double seconds, const std::atomic<int>* outer);
  ~ProcessorLimit();
  ProcessorLimit(const ProcessorLimit&) = delete;
  ProcessorLimit& operator=(const ProcessorLimit&) = delete;

  /// For InterruptScope and SimulationOptions.
  [[nodiscard]] const std::atomic<int>* interrupt() const noexcept { return &raised_; }
  /// Whether the limit, and no other interrupt, stopped the work.
  [[nodiscard]] bool passed() const noexcept { return raised_ == kPassed; }

 private:
  static constexpr int kPassed = -1;  // no number of a signal
  void watch(double end, const std::atomic<int>* outer);

  std::atomic<int> raised_{0};
  std::mutex mutex_;
  std::condition_variable left_;
  bool done_ = false;
  std::thread watcher_;
};

}  // namespace supple::scenes
