/// @file supple/implicit/mesh_routes.h
/// Estimated cost of the two methods for the mesh of a body: marching cubes (march_cubes.h), or an
/// OpenVDB grid (surface_grid.h); and of the search for pieces that a mesh misses (missed_pieces.h).
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "supple/core/types.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit {

struct RouteEstimate {
  double leaves = 0.0;     ///< of 8^3 nodes with surface: estimated by the faces of the supports' bounding box
  double overlap = 0.0;    ///< primitives whose supports contain a node, on average
  double cubes_ms = 0.0;   ///< CPU time of marching cubes
  double openvdb_ms = 0.0; ///< of a grid, OpenVDB's volumeToMesh, and vertices projected onto the surface
  [[nodiscard]] bool prefers_cubes() const noexcept { return cubes_ms <= openvdb_ms; }
};

/// Times are those of `mesh_bench` on one core of an Intel Xeon at 2 to 3 GHz, by node and primitive and by leaf; only their
/// ratio decides, so the choice does not depend on the machine.
/// @param supports  of the placed primitives [m]   @param cell  [m], > 0
[[nodiscard]] RouteEstimate estimate_routes(const Skeleton& skeleton, std::span<const Box> supports, double cell);

/// Estimate of a search from skeletons alone, before any cube is processed.
struct SearchEstimate {
  bool decides = true;      ///< false: cells along a whole surface or along its creases would stay undecided
  double search_ms = 0.0;   ///< CPU time, as in RouteEstimate
  double mesh_ms = 0.0;     ///< CPU time of the mesh
};

/// Cubes are halved where supports span few cells and where many overlap, down to about a thousand per primitive. Fitted to `mesh_bench`,
/// every shape and all shipped scenes, mostly within a factor of two. Undecided are blends by gradients of several nodes and,
/// beside other primitives, curves that bend within their own thickness.
/// @param supports  of the placed primitives [m]   @param cell  of the lattice [m], > 0
[[nodiscard]] SearchEstimate estimate_search(const Skeleton& skeleton, std::span<const Box> supports, double cell);

/// A body that divides space with others.
struct DividingBody {
  const Skeleton* skeleton = nullptr;
  std::span<const Box> supports;  ///< of its placed primitives [m]
};

/// The same for bodies that are searched together, relative to their meshes by tetrahedra. @param pairs  that touch, by index in `bodies`
[[nodiscard]] SearchEstimate estimate_search(std::span<const DividingBody> bodies, std::span<const std::array<std::size_t, 2>> pairs,
                                             double cell);

}  // namespace supple::implicit
