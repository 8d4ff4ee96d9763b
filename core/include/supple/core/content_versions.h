/// @file supple/core/content_versions.h
/// Version numbers that show, from frame to frame, whether a content is unchanged to the bit.
#pragma once

#include <bit>
#include <concepts>
#include <cstdint>
#include <map>
#include <span>
#include <type_traits>
#include <vector>

#include "supple/core/types.h"

namespace supple {

/// All bits of a content, one after the other. Types with arrays add their lengths.
class ContentWords {
 public:
  void add(std::unsigned_integral auto word) { words_.push_back(word); }
  template <class Choice>
    requires std::is_enum_v<Choice>
  void add(Choice choice) {
    add(static_cast<std::uint64_t>(choice));
  }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
  void add(const Vec3& v) {
    for (int k = 0; k < 3; ++k) add(v[k]);
  }
  void add(const Mat3& m) {
    for (int k = 0; k < 9; ++k) add(m.data()[k]);
  }
  void add(const Pose& pose) {
    add(pose.position);
    for (int k = 0; k < 4; ++k) add(pose.orientation.coeffs()[k]);
  }
  template <class T>
  void add(const std::vector<T>& items) {
    add(std::uint64_t{items.size()});
    for (const T& item : items) add(item);
  }
  void clear() { words_.clear(); }
  [[nodiscard]] std::span<const std::uint64_t> view() const { return words_; }

 private:
  std::vector<std::uint64_t> words_;
};

/// Numbers contents: equal numbers, of any frames, mean equal words; a content requested in the previous frame keeps its number.
/// No two numbers of a frame are equal.
class ContentVersions {
 public:
  /// Starts a frame: contents not requested since the last call are forgotten.
  void begin_frame();
  /// The number of a content. A content that occurs twice in a frame has two numbers, in the order of requests.
  [[nodiscard]] std::uint64_t of(std::span<const std::uint64_t> words);

 private:
  struct Content {
    std::vector<std::uint64_t> words;
    std::uint64_t number = 0;
    bool requested = true;  ///< in this frame
  };
  std::multimap<std::uint64_t, Content> content_;  ///< by hash
  std::uint64_t next_ = 0;
};

}  // namespace supple
