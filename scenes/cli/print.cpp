#include "print.h"

#include <cstdarg>
#include <cstdio>
#include <string>

namespace supple::tool {

void print(std::ostream& out, const char* format, ...) {
  std::va_list arguments, again;
  va_start(arguments, format);
  va_copy(again, arguments);
  const int length = std::vsnprintf(nullptr, 0, format, arguments);
  va_end(arguments);
  std::string text(length > 0 ? static_cast<std::size_t>(length) : 0, '\0');
  (void)std::vsnprintf(text.data(), text.size() + 1, format, again);
  va_end(again);
  out << text;
}

}  // namespace supple::tool
