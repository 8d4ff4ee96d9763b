/// @file closed_surface.h
/// The boundary of the solid that a closed triangle mesh encloses.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "solids/triangle_tree.h"
#include "supple/core/mesh.h"

namespace supple::implicit {

/// A point is inside where the triangles go around it at least once, either way: shells may lie in one another, and one that runs the other way round
/// than the shell around it bounds a cavity.
struct ClosedSurface {
  std::vector<Vec3> position;                             ///< [m], no two of them at one place
  std::vector<std::array<std::uint32_t, 3>> triangle;     ///< counter-clockwise from outside
  /// Whether a triangle crosses or touches others that are not its neighbours. It may be a piece of one of the mesh, without neighbours of its own.
  std::vector<std::uint8_t> crossing;
  std::shared_ptr<const TriangleTree> around;             ///< of all triangles of the mesh: which winding numbers are of
  std::size_t turned = 0;                                 ///< triangles of the mesh that ran around the other way than most of their shell
  std::size_t crossing_before = 0;                        ///< triangles of the mesh that cross or touch others
  double deviation = 0.0;                                 ///< by which crossing pieces may stand out into the solid or be missing [m]
};

/// Vertices at one place count as one; those without a triangle do not count.
/// @throws Error{Scene}, key `mesh`, for one that is not closed, that has no side or no extent, with the edge concerned
[[nodiscard]] ClosedSurface closed_surface(const Mesh& mesh);

/// Whether x is inside.
[[nodiscard]] bool is_around(const TriangleTree& tree, const Vec3& x);

}  // namespace supple::implicit
