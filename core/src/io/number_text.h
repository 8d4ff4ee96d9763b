/// Numbers in text files: the shortest that reads back as the same bits.
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <string>
#include <string_view>

namespace supple::io {

template <class Number>
void append_number(std::string& text, Number value) {
  std::array<char, 32> buffer;
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  text.append(buffer.data(), static_cast<std::size_t>(result.ptr - buffer.data()));
}

/// "1, 2, 3" with the given separator; by default in single precision, as other tools store points.
template <class Number = float, class Vector>
void append_vector(std::string& text, const Vector& v, std::string_view separator) {
  for (int k = 0; k < 3; ++k) {
    if (k > 0) text += separator;
    append_number(text, static_cast<Number>(v[k]));
  }
}

}  // namespace supple::io
