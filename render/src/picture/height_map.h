/// @file height_map.h
/// Between which heights items hang over the ground: what a map of it seen from above needs of the triangles. A software
/// rasteriser spends most of its time on triangles of less than a texel; here these cost a look at their boxes.
#pragma once

#include <vector>

#include "picture/draw_list.h"

namespace supple::render {

/// Nothing is above a texel.
inline constexpr float kNoHeight = -1e30F;

/// Minus the lowest and the highest height over the middle of each texel, at least 0; shape [size][size][2], rows along v.
/// @param fit  seen straight down; what lies outside of its box is left out  @param ground  height of the ground, as the vertices
void fill_heights(const DrawList& list, const MapFit& fit, float ground, int size, std::vector<float>& out);

}  // namespace supple::render
