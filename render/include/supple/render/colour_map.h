/// @file supple/render/colour_map.h
/// Colour maps. All but `Turbo` change lightness evenly, so that equal steps look equal.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "supple/core/types.h"

namespace supple::render {

/// viridis, magma (van der Walt & Smith 2015), coolwarm (Moreland 2009: for values with a meaningful middle), turbo
/// (Mikhailov 2019) and grey.
enum class ColourMap : std::uint8_t { Viridis, Magma, Coolwarm, Turbo, Grey };
inline constexpr std::array<std::string_view, 5> kColourMapNames = {"viridis", "magma", "coolwarm", "turbo", "grey"};

/// sRGB colour at t in [0, 1]; outside, the colour of the nearer end.
[[nodiscard]] Vec3 colour_of(ColourMap map, double t);

}  // namespace supple::render
