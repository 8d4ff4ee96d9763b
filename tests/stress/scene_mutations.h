/// @file tests/stress/scene_mutations.h
/// Almost valid scenes: trees of keys and values in which some are exchanged, dropped, doubled, misspelt or set to extremes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

namespace supple::stress {

/// Repeats with its seed on every machine, as distributions of the standard library do not.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t number);
  std::size_t below(std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(engine_() % n); }
  bool one_in(std::size_t n) { return below(n) == 0; }
  template <class T>
  const T& of(const std::vector<T>& list) {
    return list[below(list.size())];
  }

 private:
  std::mt19937_64 engine_;
};

/// A YAML value that may be invalid: keys may occur twice, scalars may hold anything.
struct Value {
  enum class Kind { Scalar, List, Map };
  Kind kind = Kind::Scalar;
  std::string text{};              ///< of a scalar, as it is printed
  std::string anchor{};            ///< "&a " before the value; empty: none
  std::vector<std::string> keys{}; ///< of a map, one an item
  std::vector<Value> items{};
};

/// @return nothing where the text is not YAML
[[nodiscard]] std::optional<Value> parse_value(const std::string& text);
[[nodiscard]] std::string print_value(const Value& value);

/// Keys and words of scenes, from the JSON Schema.
struct Vocabulary {
  std::vector<std::string> keys;
  std::vector<std::string> words;
};
[[nodiscard]] Vocabulary scene_vocabulary();

/// One to four changes.
void mutate(Value& value, const Vocabulary& vocabulary, Random& random);
/// One to eight changes of letters and lines.
[[nodiscard]] std::string mutate_text(std::string text, Random& random);

/// The smallest tree that can be reached by dropping items one by one while `fails` holds; asks at most `most` times.
[[nodiscard]] Value minimise(Value value, int most, const std::function<bool(const Value&)>& fails);

}  // namespace supple::stress
