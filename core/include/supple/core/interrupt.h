/// @file supple/core/interrupt.h
/// Interruption of long calls.
#pragma once

#include <atomic>
#include <exception>

namespace supple {

/// Thrown by a call that is interrupted: only its unfinished result is lost.
class Interrupted : public std::exception {
 public:
  [[nodiscard]] const char* what() const noexcept override { return "interrupted"; }
};

/// @param interrupt  set by another thread or a signal; null: never @throws Interrupted where it is not 0
inline void heed(const std::atomic<int>* interrupt) {
  if (interrupt != nullptr && interrupt->load(std::memory_order_relaxed) != 0) throw Interrupted();
}

/// During its lifetime, long calls of this thread, and their work on the threads of an executor, throw Interrupted soon after a number becomes non-zero.
/// The innermost scope of a thread applies.
class InterruptScope {
 public:
  /// @param interrupt  set by another thread or a signal, and outlives the scope; null: the calls run to their end
  explicit InterruptScope(const std::atomic<int>* interrupt) noexcept;
  ~InterruptScope();
  InterruptScope(const InterruptScope&) = delete;
  InterruptScope& operator=(const InterruptScope&) = delete;

 private:
  const std::atomic<int>* outer_;
};
/// The number of this thread's innermost scope; null without one.
[[nodiscard]] const std::atomic<int>* interrupt_of_scope() noexcept;
/// @throws Interrupted where that is not 0
inline void heed_scope() { heed(interrupt_of_scope()); }

}  // namespace supple
