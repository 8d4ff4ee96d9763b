/// @file srgb.h
/// The transfer curve of sRGB (IEC 61966-2-1) for pictures of 8 bits.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace supple::render {

/// Light of the values 0 to 255.
[[nodiscard]] const std::array<double, 256>& linear_of_srgb();

/// The value nearest to the curve at light clamped to [0, 1], by a table.
[[nodiscard]] std::uint8_t srgb_of_linear(double light);
/// The same of many. @pre as many values
void srgb_of_linear(std::span<const float> light, std::span<std::uint8_t> values);

}  // namespace supple::render
