/// @file supple/cgal/surface_meshes.h
/// What CGAL does for meshes; an optional component. CGAL's packages behind it are under the GPL, and so is a program that
/// links it.
#pragma once

#include "supple/core/mesh.h"
#include "supple/implicit/delaunay.h"

namespace supple::cgal {

/// A DelaunayMesher: Delaunay refinement (Boissonnat & Oudot 2005) by CGAL's surface mesher from points of marching cubes,
/// `size` apart or a sixth of a small part's extent. Where triangles reach not all of them, or the topology is not that of marching cubes, as with
/// a body thinner than `size`, it begins anew from twice as many of the part, down to a quarter of the cell.
[[nodiscard]] Mesh delaunay_mesh(const implicit::FieldView& field, const implicit::DelaunayOptions& options,
                                 implicit::DelaunayReport* report = nullptr);

/// Largest distance from a point of `from` to `to` [m], within `error` of the exact one (CGAL's branch and bound).
/// Triangles without area count as the segments or points that they are. Infinite when `to` alone is empty, 0 when `from` is. @pre error > 0,
/// corners are finite
[[nodiscard]] double one_sided_hausdorff_distance(const Mesh& from, const Mesh& to, double error);

}  // namespace supple::cgal
