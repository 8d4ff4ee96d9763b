/// @file first_come.h
/// Numbers of keys in the order in which they come first.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace supple::collision {

/// Room of one thread; an open table of twice as many slots as keys at least.
class FirstCome {
 public:
  /// Forgets all. @param most  different keys
  void start(std::size_t most) {
    bits_ = static_cast<unsigned>(std::bit_width(std::max<std::size_t>(2 * most, 2) - 1));
    slot_.assign(std::size_t{1} << bits_, kFree);
    key_.clear();
  }
  /// @return its number, that of `keys()`
  std::uint32_t number(std::uint64_t key) {
    constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;  // spreads keys (Knuth, The Art of Computer Programming 3, sec. 6.4)
    const std::size_t mask = slot_.size() - 1;
    for (std::size_t at = key * kGolden >> (64 - bits_);; at = (at + 1) & mask) {
      if (slot_[at] == kFree) {
        slot_[at] = static_cast<std::uint32_t>(key_.size());
        key_.push_back(key);
        return slot_[at];
      }
      if (key_[slot_[at]] == key) return slot_[at];
    }
  }
  [[nodiscard]] const std::vector<std::uint64_t>& keys() const { return key_; }

 private:
  static constexpr std::uint32_t kFree = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> slot_;
  std::vector<std::uint64_t> key_;
  unsigned bits_ = 1;
};

}  // namespace supple::collision
