/// @file supple/core/nearest_word.h
/// Suggestions for misspelt words.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace supple {

/// The word nearest to `word` by edit distance (with transpositions), or "" when none is near. Of several the first.
[[nodiscard]] std::string nearest_word(std::string_view word, std::span<const std::string_view> words);

}  // namespace supple
