#include "file/limits/work_limit.h"

#include <unistd.h>

#include <chrono>
#include <fstream>
#include <system_error>

#include "supple/core/cpu_time.h"
#include "supple/core/out_of_threads.h"

namespace supple::scenes {
namespace {

/// 0 where the system does not tell.
double resident_bytes() {
  double all = 0.0, resident = 0.0;  // [pages]
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

}  // namespace

WorkLimit::WorkLimit(double seconds, double bytes, const std::atomic<int>* outer)
try : watcher_([this, last_second = process_cpu_seconds() + seconds, last_byte = resident_bytes() + bytes, outer] { watch(last_second, last_byte, outer); }) {
} catch (const std::system_error&) {
  throw_out_of_threads();
}

WorkLimit::~WorkLimit() {
  {
    const std::lock_guard lock(mutex_);
    done_ = true;
  }
  left_.notify_one();
  watcher_.join();
}

void WorkLimit::watch(double last_second, double last_byte, const std::atomic<int>* outer) {
  constexpr std::chrono::milliseconds kBetween{5};
  std::unique_lock lock(mutex_);
  do {
    const int number = outer != nullptr ? outer->load() : 0;
    if (number != 0) raised_ = number;
    if (number == 0 && !lifted_ && (process_cpu_seconds() >= last_second + more_ || resident_bytes() >= last_byte)) raised_ = kPassed;
  } while (raised_ == 0 && !left_.wait_for(lock, kBetween, [this] { return done_; }));
}

}  // namespace supple::scenes
