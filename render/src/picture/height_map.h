/// @file height_map.h
/// Range of heights of items above the ground, for a map seen from above. A software
/// rasteriser spends most of its time on triangles of less than a texel; here these cost a look at their boxes.
#pragma once

#include <vector>

#include "picture/draw_list.h"

namespace supple::render {

/// No item is above a texel.
inline constexpr float kNoHeight = -1e30F;

/// Minus the lowest and the highest height over the middle of each texel, at least 0; shape [size][size][2], rows along v.
/// @param fit  seen straight down; what lies outside of its box is left out  @param ground  height of the ground, as the vertices
void fill_heights(const DrawList& list, const MapFit& fit, float ground, int size, std::vector<float>& out);

}  // namespace supple::render
