/// @file srgb.h
#pragma once

#include <cstdint>

namespace supple::render {

/// Linear light of an 8-bit sRGB value (IEC 61966-2-1), in [0, 1].
[[nodiscard]] double linear_of_srgb(std::uint8_t value);

}  // namespace supple::render
