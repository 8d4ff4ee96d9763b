/// @file supple/implicit/delaunay.h
/// Options of surface meshes with triangles of guaranteed quality. The mesher is an optional component
/// (`supple::cgal`); code that can work without it takes a `DelaunayMesher`, which is empty where the component is absent.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Bounds of the restricted Delaunay triangulation of a surface (Boissonnat & Oudot 2005). A triangle's surface ball is the
/// empty ball through its corners whose centre lies on the surface.
struct DelaunayOptions {
  double angle = 0.5235987755982988;  ///< smallest angle of a triangle [rad], in (0, pi/6]
  double size = 0.0;                  ///< largest radius of a surface ball [m], > 0
  double distance = 0.0;              ///< largest distance from a triangle's circumcentre to the centre of its ball [m], > 0
  /// Cell of the lattice on which the parts of the surface are found [m], > 0.
  double cell = 0.0;
  std::uint64_t most_vertices = 2'000'000;
  const std::atomic<int>* interrupt = nullptr;  ///< not 0: the mesher throws Interrupted soon (core/interrupt.h)
};

struct DelaunayReport {
  std::uint64_t seeds = 0;       ///< vertices at the start
  std::uint64_t inserted = 0;    ///< by refinement
  double least_angle = 0.0;      ///< [rad]
  std::uint64_t sharp = 0;       ///< triangles with a smaller angle than the bound
  std::uint64_t crossings = 0;   ///< pairs of intersecting triangles, of bodies that touch
  double largest_radius = 0.0;   ///< of a triangle's circumcircle [m]; a surface ball's is no smaller
  double largest_distance = 0.0; ///< from a triangle's circumcentre to the surface along its dual edge [m]
};

/// Least number of vertices of a surface. No triangle is larger than the equilateral one in its circumcircle; the radius of that is
/// the size at most and, where H is the mean curvature, about sqrt(2 distance / |H|): exactly on balls, on average of all directions
/// elsewhere.
struct DelaunayEstimate {
  double by_size = 0.0;      ///< for the size alone
  double by_distance = 0.0;  ///< for the distance alone
  double vertices = 0.0;     ///< for the stricter of the two, locally
};

/// @param coarse  meshes with normals of all bodies; where "contact" is a column, contacts and their boundaries count by area and for half, as
///                two bodies share them
[[nodiscard]] DelaunayEstimate estimate_delaunay(std::span<const Mesh> coarse, const DelaunayOptions& options);

/// @throws Error{Limit} naming size or distance, and sufficient values, where most_vertices are less than the estimate
void check_estimate(const DelaunayEstimate& estimate, const DelaunayOptions& options);

/// Called by a mesher that has inserted most_vertices without meeting the bounds.
/// @throws Error{Limit} naming size, distance or, where these need far fewer, the angle
[[noreturn]] void refuse_more_vertices(const DelaunayEstimate& estimate, const DelaunayOptions& options);

/// The closed surface F = 0 within these bounds, outward oriented, vertices on the surface to rounding, with the field's
/// normals. Free of self-intersection: its triangles are faces of one Delaunay triangulation.
/// Every part that marching cubes of the cell find gets triangles.
/// @throws Error{Limit} when most_vertices do not suffice, before any is made where an estimate shows it; an angle cannot be met
/// where the surface has an edge; or where cells do not resolve a part. Interrupted.
using DelaunayMesher =
    std::function<Mesh(const FieldView& field, const DelaunayOptions& options, DelaunayReport* report)>;

/// Bodies that touch, as polygonise_partition divides space, with triangles of guaranteed quality: every free surface and every contact of
/// two is refined by Delaunay's criterion on the surface (Chew 1993) between boundary curves that patches share and that are split where they
/// are encroached (Ruppert 1995). Where two bodies meet both meshes have bit-equal vertices and the same triangles reversed.
/// Dihedral angles do not matter; a sharper angle between boundary curves remains. Bodies whose bounding boxes overlap are a group;
/// where the boundary curves of a group are too complex, polygonise_partition_within meshes it: size and distance hold, the angle does not, largest_radius
/// and largest_distance are not measured. Both cases show as `sharp` > 0 and in `least_angle`. Normals and the column "contact" are those of
/// polygonise_partition; an unbounded body gets an empty mesh. Contacts narrower than the cell, or half the size where that is less, may be
/// missed. Where sheets are closer to each other than the distance, their triangles may intersect: there the distance is reduced
/// in four steps, each to a quarter; remaining intersections show as `crossings` > 0.
/// @throws Error{Limit} when most_vertices do not suffice, before any is made where an estimate shows it. Interrupted.
[[nodiscard]] std::vector<Mesh> delaunay_partition(std::span<const FieldView> fields, const DelaunayOptions& options,
                                                   const Executor& executor, DelaunayReport* report = nullptr);

}  // namespace supple::implicit
