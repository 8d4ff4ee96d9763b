/// @file crease_crossings.h
/// What puts a mesh onto creases is taken back where triangles would cross.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/types.h"
#include "triangle_steps.h"

namespace supple::implicit {

/// Takes back steps until no two triangles cross, of which one is not safe, or run along an edge in the same direction: of each such pair
/// the later step of the two. That ends, as every round takes a step back and none is made; it ends with nothing that crosses, in the
/// limit with the mesh to begin with, which must not cross itself. Looks at what is near triangles that are not safe.
/// @param safe  by number, those from its end on are not: triangles that cross no safe one, also where others are taken back
/// @param cell  size of triangles, about [m]
/// @return triangles that are there again
[[nodiscard]] std::vector<std::uint32_t> take_back_crossings(std::span<const Vec3> position, const std::vector<bool>& safe, double cell, TriangleSteps& steps);

}  // namespace supple::implicit
