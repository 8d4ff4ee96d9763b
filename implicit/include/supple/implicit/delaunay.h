/// @file supple/implicit/delaunay.h
/// What is asked of a surface mesh with triangles of guaranteed quality. The mesher is an optional component
/// (`supple::cgal`); code that may do without it takes a `DelaunayMesher`, which is empty where the component is not there.
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
  double angle = 0.5235987755982988;  ///< least angle of a triangle [rad], in (0, pi/6]
  double size = 0.0;                  ///< largest radius of a surface ball [m], > 0
  double distance = 0.0;              ///< largest distance from a triangle's circumcentre to the centre of its ball [m], > 0
  /// Cell of the lattice on which the parts of the surface are looked for [m], > 0.
  double cell = 0.0;
  std::uint64_t most_vertices = 2'000'000;
  const std::atomic<int>* interrupt = nullptr;  ///< not 0: the mesher throws Interrupted soon (core/interrupt.h)
};

struct DelaunayReport {
  std::uint64_t seeds = 0;       ///< vertices at the start
  std::uint64_t inserted = 0;    ///< by refinement
  double least_angle = 0.0;      ///< [rad]
  std::uint64_t sharp = 0;       ///< triangles with a smaller angle than asked for
  std::uint64_t crossings = 0;   ///< pairs of triangles that pass through each other, of bodies that touch
  double largest_radius = 0.0;   ///< of a triangle's circumcircle [m]; a surface ball's is no smaller
  double largest_distance = 0.0; ///< from a triangle's circumcentre to the surface along its dual edge [m]
};

/// Vertices that a surface takes at the least. No triangle is larger than the equilateral one in its circumcircle; the radius of that is
/// the size at most and, where H is the mean curvature, about sqrt(2 distance / |H|): exactly on balls, on average of all directions
/// elsewhere.
struct DelaunayEstimate {
  double by_size = 0.0;      ///< for the size alone
  double by_distance = 0.0;  ///< for the distance alone
  double vertices = 0.0;     ///< for whichever is stricter, place by place
};

/// @param coarse  meshes with normals of all bodies; where "contact" is a column, contacts and their rims count by area and for half, as
///                two bodies share them
[[nodiscard]] DelaunayEstimate estimate_delaunay(std::span<const Mesh> coarse, const DelaunayOptions& options);

/// @throws Error{Limit} naming size or distance, and values that will do, where most_vertices are less than the estimate
void check_estimate(const DelaunayEstimate& estimate, const DelaunayOptions& options);

/// Of a mesher that has most_vertices and has not reached the bounds.
/// @throws Error{Limit} naming size, distance or, where these ask for much less, the angle
[[noreturn]] void refuse_more_vertices(const DelaunayEstimate& estimate, const DelaunayOptions& options);

/// The closed surface F = 0 within these bounds, outward oriented, vertices on the surface to rounding, with the field's
/// normals. Free of self-intersection: its triangles are faces of one Delaunay triangulation.
/// Every part that marching cubes of the cell find has triangles.
/// @throws Error{Limit} when most_vertices do not reach the bounds, before any is made where an estimate says so; an angle cannot be held
/// where the surface has an edge; or where cells do not resolve a part. Interrupted.
using DelaunayMesher =
    std::function<Mesh(const FieldView& field, const DelaunayOptions& options, DelaunayReport* report)>;

/// Bodies that touch, as polygonise_partition divides space, with triangles of guaranteed quality: every free surface and every contact of
/// two is refined by Delaunay's criterion on the surface (Chew 1993) between rims that their patches share and that are split where they
/// are encroached (Ruppert 1995). Where two bodies meet both meshes have bit-equal vertices and the same triangles reversed.
/// Dihedral angles do not matter; where rims meet at a sharper angle than asked for, that remains. Bodies whose boxes overlap are a group;
/// where the rims of one are too tangled, polygonise_partition_within divides it: size and distance hold, the angle does not, largest_radius
/// and largest_distance are not measured. Either shows as `sharp` > 0 and in `least_angle`. Normals and the column "contact" are those of
/// polygonise_partition; an unbounded body gets an empty mesh. Contacts narrower than the cell, or half the size where that is less, may be
/// missed. Where sheets are nearer to each other than the distance, their triangles may cross: there they are brought nearer to the surface,
/// in four steps, each of a quarter of the distance; what still crosses shows as `crossings` > 0.
/// @throws Error{Limit} when most_vertices do not reach the bounds, before any is made where an estimate says so. Interrupted.
[[nodiscard]] std::vector<Mesh> delaunay_partition(std::span<const FieldView> fields, const DelaunayOptions& options,
                                                   const Executor& executor, DelaunayReport* report = nullptr);

}  // namespace supple::implicit
