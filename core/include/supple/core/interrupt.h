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

}  // namespace supple
