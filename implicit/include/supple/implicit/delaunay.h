/// @file supple/implicit/delaunay.h
/// What is asked of a surface mesh with triangles of guaranteed quality. The mesher is an optional component
/// (`supple::cgal`); code that may do without it takes a `DelaunayMesher`, which is empty where the component is not there.
#pragma once

#include <cstdint>
#include <functional>

#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Bounds of the restricted Delaunay triangulation of a surface (Boissonnat & Oudot 2005). A triangle's surface ball is the
/// empty ball through its corners whose centre lies on the surface.
struct DelaunayOptions {
  double angle = 0.5235987755982988;  ///< least angle of a triangle [rad], in (0, pi/6]
  double size = 0.0;                  ///< largest radius of a surface ball [m], > 0
  double distance = 0.0;              ///< largest distance from a triangle's circumcentre to the centre of its ball [m], > 0
  /// Cell of the lattice on which the parts of the surface are looked for [m], > 0.
  double cell = 0.0;
  std::uint64_t most_vertices = 2'000'000;
};

struct DelaunayReport {
  std::uint64_t seeds = 0;       ///< vertices at the start
  std::uint64_t inserted = 0;    ///< by refinement
  double least_angle = 0.0;      ///< [rad]
  double largest_radius = 0.0;   ///< of a triangle's circumcircle [m]; a surface ball's is no smaller
  double largest_distance = 0.0; ///< from a triangle's circumcentre to the surface along its dual edge [m]
};

/// The closed surface F = 0 within these bounds, outward oriented, vertices on the surface to rounding, with the field's
/// normals. Free of self-intersection: its triangles are faces of one Delaunay triangulation.
/// @throws Error{Limit} when most_vertices do not reach the bounds: an angle cannot be held where the surface has an edge.
using DelaunayMesher =
    std::function<Mesh(const FieldView& field, const DelaunayOptions& options, DelaunayReport* report)>;

}  // namespace supple::implicit
