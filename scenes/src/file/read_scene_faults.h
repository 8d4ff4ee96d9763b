/// @file read_scene_faults.h
/// Faults of a scene, collected with their places so that a user sees them all at once, in the order of the file.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/nearest_word.h"

namespace supple::scenes {

/// A position in a text; lines and columns count from 1, columns in bytes (places are given in characters).
struct Mark {
  std::uint32_t source = 0;
  int line = 1;
  int column = 1;
  friend auto operator<=>(const Mark&, const Mark&) = default;
};

/// The texts that marks point into.
class SourceTexts {
 public:
  /// @param whole  shown without line and column   @return Mark::source
  std::uint32_t add(std::string name, std::string text, bool whole);
  [[nodiscard]] const std::string& text(std::uint32_t source) const { return sources_[source].text; }
  /// "file:line:column", or the name of a text that is shown whole.
  [[nodiscard]] std::string place(Mark mark) const;

 private:
  struct Source {
    std::string name;
    std::string text;
    bool whole = false;
  };
  std::deque<Source> sources_;
};

class FaultList {
 public:
  /// @param texts  outlives the list
  explicit FaultList(const SourceTexts& texts) : texts_(texts) {}
  void add(Mark mark, std::string key, std::string expected, std::string found, std::string hint);
  /// The value of this key is not known, because of a fault that is listed at another one.
  void doubt(std::string key);
  [[nodiscard]] std::size_t count() const { return count_; }
  /// A fault at this key, above it or below it is listed, or its value is not known.
  [[nodiscard]] bool has(std::string_view key) const;
  /// @throws Error{Scene} with the first 20 by place, when there is any.
  void raise() const;

 private:
  struct Placed {
    Mark mark;
    Fault fault;
  };

  const SourceTexts& texts_;
  std::vector<Placed> faults_;
  std::vector<std::string> doubted_;
  std::size_t count_ = 0;
};

/// Text safe to show: control characters escaped, at most 60 characters.
[[nodiscard]] std::string shown(std::string_view text);
/// "a length", "an angle".
[[nodiscard]] std::string with_article(std::string_view noun);
/// Shortest text that reads back as the same number.
[[nodiscard]] std::string number_text(double value);
/// Six significant digits, for computed values.
[[nodiscard]] std::string short_text(double value);
/// "expected a particle from 0 to n - 1, or from -n to -1"
[[nodiscard]] std::string particle_range(std::uint32_t n);
/// "a, b, c"
[[nodiscard]] std::string joined(std::span<const std::string_view> words);
/// Hint for a name that there is not: the nearest one, if one is near, and all.
[[nodiscard]] std::string known_hint(std::string_view name, std::span<const std::string_view> names);

}  // namespace supple::scenes
