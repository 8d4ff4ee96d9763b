/// @file supple/implicit/mesh_routes.h
/// Which way from a body to its mesh costs less, by counts: on the nodes around its surface (march_cubes.h), or through an
/// OpenVDB grid (surface_grid.h); and what a search for the pieces that a mesh misses (missed_pieces.h) adds to that.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "supple/core/types.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit {

struct RouteEstimate {
  double leaves = 0.0;     ///< of 8^3 nodes that hold surface: what the faces of the supports' box would take
  double overlap = 0.0;    ///< primitives whose supports hold a node, on average
  double cubes_ms = 0.0;   ///< CPU time of marching cubes
  double openvdb_ms = 0.0; ///< of a grid, OpenVDB's volumeToMesh, and vertices projected onto the surface
  [[nodiscard]] bool prefers_cubes() const noexcept { return cubes_ms <= openvdb_ms; }
};

/// Times are those of `mesh_bench` on one core of an Intel Xeon at 2 to 3 GHz, by node and primitive and by leaf; only their
/// ratio decides, so the choice does not depend on the machine.
/// @param supports  of the placed primitives [m]   @param cell  [m], > 0
[[nodiscard]] RouteEstimate estimate_routes(const Skeleton& skeleton, std::span<const Box> supports, double cell);

/// What a search would do, by skeletons alone, before any cube is looked at.
struct SearchEstimate {
  bool decides = true;      ///< false: cells along all of a surface or along creases of it would stay undecided
  double search_ms = 0.0;   ///< CPU time, as in RouteEstimate
  double mesh_ms = 0.0;     ///< of the mesh that it completes
};

/// Cubes are halved where supports span few cells and where many overlap, down to about a thousand a primitive. Fitted to `mesh_bench`,
/// every shape and all bundled scenes, most often right within a factor of two. Not decided are blends by gradients of several nodes and,
/// beside other primitives, curves that bend within their own thickness.
/// @param supports  of the placed primitives [m]   @param cell  of the lattice [m], > 0
[[nodiscard]] SearchEstimate estimate_search(const Skeleton& skeleton, std::span<const Box> supports, double cell);

/// A body that divides space with others.
struct DividingBody {
  const Skeleton* skeleton = nullptr;
  std::span<const Box> supports;  ///< of its placed primitives [m]
};

/// The same for bodies that are searched together, beside their meshes of tetrahedra. @param pairs  that touch, by place in `bodies`
[[nodiscard]] SearchEstimate estimate_search(std::span<const DividingBody> bodies, std::span<const std::array<std::size_t, 2>> pairs,
                                             double cell);

}  // namespace supple::implicit
