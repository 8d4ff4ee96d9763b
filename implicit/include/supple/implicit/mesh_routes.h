/// @file supple/implicit/mesh_routes.h
/// Which way from a body to its mesh costs less, by counts: on the nodes around its surface (march_cubes.h), or through an
/// OpenVDB grid (surface_grid.h).
#pragma once

#include <span>

#include "supple/core/types.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit {

struct RouteEstimate {
  double leaves = 0.0;     ///< of 8^3 nodes that hold surface: what the faces of the supports' box would take
  double overlap = 0.0;    ///< primitives whose supports hold a node, on average
  double cubes_ms = 0.0;   ///< CPU time of marching cubes
  double openvdb_ms = 0.0; ///< of a grid and OpenVDB's volumeToMesh
  [[nodiscard]] bool prefers_cubes() const noexcept { return cubes_ms <= openvdb_ms; }
};

/// Times are those of `mesh_bench` on one core of an Intel Xeon at 2 to 3 GHz, by node and primitive and by leaf; only their
/// ratio decides, so the choice does not depend on the machine.
/// @param supports  of the placed primitives [m]   @param cell  [m], > 0
[[nodiscard]] RouteEstimate estimate_routes(const Skeleton& skeleton, std::span<const Box> supports, double cell);

}  // namespace supple::implicit
