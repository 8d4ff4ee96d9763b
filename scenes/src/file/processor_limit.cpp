#include "file/processor_limit.h"

#include <chrono>

#include "supple/core/cpu_time.h"

namespace supple::scenes {

ProcessorLimit::ProcessorLimit(double seconds, const std::atomic<int>* outer)
    : watcher_([this, end = process_cpu_seconds() + seconds, outer] { watch(end, outer); }) {}

ProcessorLimit::~ProcessorLimit() {
  {
    const std::lock_guard lock(mutex_);
    done_ = true;
  }
  left_.notify_one();
  watcher_.join();
}

void ProcessorLimit::watch(double end, const std::atomic<int>* outer) {
  constexpr std::chrono::milliseconds kBetween{5};
  std::unique_lock lock(mutex_);
  do {
    const int number = outer != nullptr ? outer->load() : 0;
    if (number != 0) raised_ = number;
    if (number == 0 && process_cpu_seconds() >= end) raised_ = kPassed;
  } while (raised_ == 0 && !left_.wait_for(lock, kBetween, [this] { return done_; }));
}

}  // namespace supple::scenes
