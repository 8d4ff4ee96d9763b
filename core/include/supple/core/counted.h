/// @file supple/core/counted.h
/// Counts in messages.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace supple {

/// "1 hole", "2 holes", "0 holes". @param many  the plural, where it is not `one` with an s
[[nodiscard]] std::string counted(std::size_t count, std::string_view one, std::string_view many = {});

}  // namespace supple
