// A library to load before a program's own: a call that writes a file to the disk works and never ends.
#include <atomic>

extern "C" int fsync(int /*file*/) {
  static std::atomic<unsigned long> turns{0};
  for (;;) turns.fetch_add(1, std::memory_order_relaxed);
}
