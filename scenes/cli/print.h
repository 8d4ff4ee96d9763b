/// Output to streams that is safe for a terminal. Unlike stdio, streams repeat writes that a signal interrupts.
#pragma once

#include <ostream>
#include <string>
#include <string_view>

namespace supple::tool {

/// `printable` (core/printable.h) line by line: names of files may hold anything.
[[nodiscard]] std::string printable_lines(std::string_view text);

/// As printf, with `printable_lines`.
[[gnu::format(printf, 2, 3)]] void print(std::ostream& out, const char* format, ...);

}  // namespace supple::tool
