/// @file crease_crossings.h
/// What puts a mesh onto creases is taken back where triangles would cross.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "field/bytes_of.h"
#include "mesh/triangle_steps.h"
#include "supple/core/mesh.h"

namespace supple::implicit {

/// What was looked at in the last call, and what of it collides: that is not looked at again for pairs of triangles that are the same.
struct CrossingMemory {
  using Pair = std::array<std::uint32_t, 2>;
  Mesh mesh;                        ///< its triangles were there before any step was taken back
  std::vector<std::uint8_t> safe;   ///< by triangle
  std::vector<Pair> pair;           ///< triangles that must not both be there
  [[nodiscard]] std::uint64_t bytes() const { return bytes_of(mesh) + bytes_of(safe) + bytes_of(pair); }
};

/// Takes back steps until no two triangles cross, of which one is not safe, or run along an edge in the same direction: of each such pair
/// the later step of the two. That ends, as every round takes a step back and none is made; it ends with nothing that crosses, in the
/// limit with the mesh to begin with, which must not cross itself. Looks at what is near triangles that are not safe.
/// @param mesh  vertices; its triangles are those of the steps
/// @param safe  by number, those from its end on are not: triangles that cross no safe one, also where others are taken back
/// @param cell  size of triangles, about [m]
/// @return triangles that are there again
[[nodiscard]] std::vector<std::uint32_t> take_back_crossings(const Mesh& mesh, const std::vector<bool>& safe, double cell, CrossingMemory& memory,
                                                             TriangleSteps& steps);

}  // namespace supple::implicit
