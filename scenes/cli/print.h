/// Text for people. Streams write again what a signal breaks off, which stdio does not.
#pragma once

#include <ostream>

namespace supple::tool {

/// As printf.
[[gnu::format(printf, 2, 3)]] void print(std::ostream& out, const char* format, ...);

}  // namespace supple::tool
