/// @file supple/core/printable.h
/// Text that is safe for a terminal.
#pragma once

#include <string>
#include <string_view>

namespace supple {

/// The text with control characters (C0, DEL, C1, separators of lines and controls of the direction) and invalid UTF-8 as `\xNN`: names and
/// contents of files may hold anything.
[[nodiscard]] std::string printable(std::string_view text);

}  // namespace supple
