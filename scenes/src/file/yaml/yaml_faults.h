/// @file yaml_faults.h
/// Messages about text that yaml-cpp cannot read: place, expected, found and hint in place of its own words.
#pragma once

#include <cstddef>
#include <string_view>

#include "file/yaml/yaml_tree.h"

namespace supple::scenes {

/// What had been read when the tokeniser stopped.
struct YamlContext {
  std::string_view text;       ///< the whole text
  Mark last;                   ///< of the last node
  const Node* open = nullptr;  ///< the innermost list or mapping that is not complete; null outside
};

/// Tells why yaml-cpp stopped.
/// @param message  of its exception
/// @param at       the place that it names
void add_yaml_fault(std::string_view message, Mark at, const YamlContext& context, FaultList& faults);

/// Byte of a mark; the end of the text where the mark is beyond it.
[[nodiscard]] std::size_t byte_of(std::string_view text, Mark mark);

/// Byte of the quote that opens a text without an end, or npos. yaml-cpp takes the rest of the file as such a text.
/// @param begin  byte from which on texts in quotes are looked for; not inside one
[[nodiscard]] std::size_t unclosed_quote(std::string_view text, std::size_t begin);

/// The fault of a text in quotes that begins at a byte and does not end.
void add_unclosed_quote(std::size_t begin, std::uint32_t source, std::string_view text, FaultList& faults);

}  // namespace supple::scenes
