/// @file supple/implicit/polygonise.h
/// Surface meshes on a world lattice: node (i, j, k) lies at origin + cell (i, j, k), whatever the object, so that
/// objects that touch share their nodes. Each cube is cut into six tetrahedra around its main diagonal; vertices lie on
/// the tetrahedra's edges at the exact root of the field, so the mesh is closed and free of self-intersection by its
/// case table. Blocks of 8^3 cells that cannot hold surface are skipped by bounds.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

struct Lattice {
  Vec3 origin = Vec3::Zero();  ///< [m]
  double cell = 0.0;           ///< edge of a cell [m], > 0
};

struct PolygoniseCounts {
  std::uint64_t blocks_visited = 0;   ///< blocks evaluated
  std::uint64_t blocks_present = 0;   ///< blocks of the lattice inside the surface boxes
  std::uint64_t blocks = 0;           ///< where the bodies of a division may meet, evaluated or kept
  std::uint64_t nodes = 0;            ///< field values taken
  double cell = 0.0;                  ///< edge of the lattice's cells [m]
  double residual = 0.0;              ///< largest |F| at a vertex, |F_a - F_b| where two bodies touch
  std::uint64_t junctions = 0;        ///< points where three or more of bodies and outside meet
  std::uint64_t junctions_moved = 0;  ///< of these, not exact: the exact point lies beyond its simplex of the lattice
  std::uint64_t rim_points = 0;       ///< vertices where a rim leaves the faces between three different nodes
  std::uint64_t rim_points_moved = 0; ///< of these, not exact: near the rim
  std::uint64_t gaps = 0;             ///< edges across a gap between two bodies that is thinner than a cell
  std::uint64_t bytes = 0;            ///< that a PartitionMesher keeps
};

/// Blocks of a mesh: a block takes 25 kB while one is made, 50 kB where bodies touch, 12 GB in all.
inline constexpr std::uint64_t kMostBlocks = 250'000;

/// Coordinates (lowest node / 8) of the 8^3-cell blocks whose bounds admit a sign change of F, in z, y, x order.
/// @throws Error{Limit} when these are more than `limit`.
[[nodiscard]] std::vector<std::array<std::int32_t, 3>> find_surface_blocks(const FieldView& field,
                                                                           const Lattice& lattice,
                                                                           const Executor& executor,
                                                                           std::uint64_t limit = kMostBlocks,
                                                                           PolygoniseCounts* counts = nullptr);

/// Stage 9 for one body: the closed surface F = 0, outward oriented, with analytic normals. Where a node lies on the surface, the vertices of its edges lie in
/// one place with it, and triangles between them have no area.
[[nodiscard]] Mesh polygonise(const FieldView& field, const Lattice& lattice, const Executor& executor,
                              PolygoniseCounts* counts = nullptr);

/// Stage 9 for bodies that touch: space is divided by the largest positive field. Mesh m bounds
/// {F_m > 0, F_m >= F_j for all j}; where two bodies meet, both meshes have bit-equal vertices (on F_a = F_b) and the
/// same triangles reversed, joined along the rim (F_a = F_b = 0). Where a gap between two bodies is thinner than a cell
/// (F_a = F_b < 0 on an edge) each body keeps its own vertex, on its own F = 0. Ties go to the lower index.
/// A vertex on the outer surface has the normal of its own field; inside the contact -+ grad(F_a - F_b).
/// Every mesh gets a column "contact": index of the other body + 1 on the contact surface and its rim, 0 elsewhere
/// (where several others meet, the lowest).
/// Across a gap thinner than a cell each body keeps its own surface (counted). Rims are met to second order: wherever one passes a
/// face or a tetrahedron of the lattice a vertex lies on it, also where a third body or outside wins between two nodes and at none.
/// Where four of bodies and outside meet there is a vertex; the tetrahedron is divided around it. Where a rim winds through a
/// tetrahedron, or sheets of a thin body would cross in one, a vertex may stay inside, less than a cell from the rim (partly counted), and a
/// body that is thinner than a cell may end before the point where it meets three others.
/// An unbounded body (a ground) shapes the others and gets an empty mesh. @throws Error{Usage} when all are unbounded.
[[nodiscard]] std::vector<Mesh> polygonise_partition(std::span<const FieldView> fields, const Lattice& lattice,
                                                     const Executor& executor, PolygoniseCounts* counts = nullptr);

/// How far the meshes of bodies that touch may lie from their surfaces.
struct PartitionError {
  double largest = 0.0;             ///< of the centroids of all triangles [m], > 0
  std::string key = "mesh.error";   ///< named when it cannot be reached
  bool cell_is_stated = false;      ///< the coarsest cell is a wish, and refused as such where it is too small
};

/// polygonise_partition with cells of coarsest.cell, or smaller by powers of sqrt(2), so that every centroid lies within the error of its
/// body's surface: |D| / |grad D| with D = F_m - max(0, F_j) where that is smooth, along Newton's steps elsewhere. Bodies still share
/// their contact bit for bit. @throws Error{Limit} as soon as no mesh within kMostBlocks is to be expected to reach it.
/// @param counts  blocks and nodes are those of all meshes that were tried, the others those of the last
[[nodiscard]] std::vector<Mesh> polygonise_partition_within(std::span<const FieldView> fields, const Lattice& coarsest,
                                                            const PartitionError& error, const Executor& executor,
                                                            PolygoniseCounts* counts = nullptr);

}  // namespace supple::implicit
