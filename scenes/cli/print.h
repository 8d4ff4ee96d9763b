/// printf-like output to streams. Unlike stdio, streams repeat writes that a signal interrupts.
#pragma once

#include <ostream>

namespace supple::tool {

/// As printf.
[[gnu::format(printf, 2, 3)]] void print(std::ostream& out, const char* format, ...);

}  // namespace supple::tool
