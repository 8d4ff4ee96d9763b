/// @file spare_memory.h
/// Memory that is set aside for what must not run out of it half-way.
#pragma once

#include <cstddef>

namespace supple::scenes {

inline constexpr std::size_t kSpareForJson = std::size_t{4} << 20;  ///< for what is at work where one value fails, and a report of usual length [byte]

/// For a scope: an allocation that fails, on whatever thread, gets what was set aside and is tried again; further ones fail as they would without. For code
/// of libraries that is broken by an allocation that fails: JSON values whose memory is not there cannot be destroyed. One scope at a time counts.
class SpareMemory {
 public:
  /// @throws std::bad_alloc
  explicit SpareMemory(std::size_t bytes);
  ~SpareMemory();
  SpareMemory(const SpareMemory&) = delete;
  SpareMemory& operator=(const SpareMemory&) = delete;

 private:
  bool counts_ = false;
};

}  // namespace supple::scenes
