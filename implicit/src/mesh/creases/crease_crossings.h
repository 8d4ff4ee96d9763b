/// @file crease_crossings.h
/// Undoes steps that put a mesh onto creases where triangles would intersect.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "field/bytes_of.h"
#include "mesh/triangle_steps.h"
#include "supple/core/mesh.h"

namespace supple::implicit {

/// Tested pairs of triangles of the last call, and their intersections: unchanged pairs are not tested again.
struct CrossingMemory {
  using Pair = std::array<std::uint32_t, 2>;
  Mesh mesh;                        ///< its triangles were there before any step was taken back
  std::vector<std::uint8_t> safe;   ///< by triangle
  std::vector<Pair> pair;           ///< triangles that must not both be there
  [[nodiscard]] std::uint64_t bytes() const { return bytes_of(mesh) + bytes_of(safe) + bytes_of(pair); }
};

/// Undoes steps until no two triangles of which one is unsafe intersect or have the same orientation along an edge: of each such pair
/// the later step of the two. This terminates, as every round undoes a step and makes none; it ends without intersections, in the
/// limit with the initial mesh, which must not intersect itself. Tests the surroundings of unsafe triangles.
/// @param mesh  vertices; its triangles are those of the steps
/// @param safe  by number, triangles beyond its end are unsafe: triangles that intersect no safe one, even after other steps are undone
/// @param cell  size of triangles, about [m]
/// @return restored triangles
[[nodiscard]] std::vector<std::uint32_t> take_back_crossings(const Mesh& mesh, const std::vector<bool>& safe, double cell, CrossingMemory& memory,
                                                             TriangleSteps& steps);

}  // namespace supple::implicit
