/// @file supple/implicit/polygonise.h
/// Surface meshes on a world lattice: node (i, j, k) lies at origin + cell (i, j, k) for all objects, so that
/// objects that touch share their nodes. Each cube is divided into six tetrahedra around its main diagonal; vertices lie on
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
  std::uint64_t blocks = 0;           ///< blocks where the bodies of a partition may meet, evaluated or kept
  std::uint64_t nodes = 0;            ///< field evaluations
  double cell = 0.0;                  ///< edge of the lattice's cells [m]
  double residual = 0.0;              ///< largest |F| at a vertex, |F_a - F_b| where two bodies touch
  std::uint64_t junctions = 0;        ///< points where three or more regions (bodies, outside) meet
  std::uint64_t junctions_moved = 0;  ///< of these, approximate: the exact point lies outside its simplex of the lattice
  std::uint64_t boundary_points = 0;       ///< vertices on boundary curves away from the faces between three different nodes
  std::uint64_t boundary_points_moved = 0; ///< of these, approximate: near the curve
  std::uint64_t gaps = 0;             ///< edges across a gap between two bodies that is thinner than a cell
  std::uint64_t bytes = 0;            ///< kept data of a PartitionMesher
};

/// Largest number of blocks of a mesh: a block needs 25 kB during meshing, 50 kB where bodies touch, 12 GB in total.
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
/// same triangles reversed, joined along the boundary curve (F_a = F_b = 0). Where a gap between two bodies is thinner than a cell
/// (F_a = F_b < 0 on an edge) each body keeps its own vertex, on its own F = 0. Ties go to the lower index.
/// A vertex on the outer surface has the normal of its own field; inside the contact -+ grad(F_a - F_b).
/// Every mesh gets a column "contact": index of the other body + 1 on the contact surface and its boundary, 0 elsewhere
/// (where several others meet, the lowest).
/// Across a gap thinner than a cell each body keeps its own surface (counted). Boundary curves are met to second order: where one passes a
/// face or a tetrahedron of the lattice a vertex lies on it, also where a third region is largest between two nodes and at none.
/// Where four regions meet there is a vertex; the tetrahedron is divided around it. Where a boundary curve winds through a
/// tetrahedron, or sheets of a thin body would intersect in one, a vertex may stay inside, less than a cell from the curve (partly counted), and a
/// body that is thinner than a cell may end before the point where it meets three others.
/// An unbounded body (a ground) shapes the others and gets an empty mesh. @throws Error{Usage} when all are unbounded.
[[nodiscard]] std::vector<Mesh> polygonise_partition(std::span<const FieldView> fields, const Lattice& lattice,
                                                     const Executor& executor, PolygoniseCounts* counts = nullptr);

/// Error bound of the meshes of bodies that touch.
struct PartitionError {
  double largest = 0.0;             ///< largest distance of triangle centroids to the surface [m], > 0
  std::string key = "mesh.error";   ///< named in the error when it cannot be met
  bool cell_is_stated = false;      ///< the coarsest cell is given by the caller, and named in the error where it is too small
};

/// polygonise_partition with cells of coarsest.cell, or smaller by powers of sqrt(2), so that every centroid lies within the error of its
/// body's surface: |D| / |grad D| with D = F_m - max(0, F_j) where that is smooth, along Newton's steps elsewhere. Bodies still share
/// their contact bit for bit. @throws Error{Limit} as soon as no mesh within kMostBlocks can be expected to meet it.
/// @param counts  blocks and nodes are those of all trial meshes, the others those of the last
[[nodiscard]] std::vector<Mesh> polygonise_partition_within(std::span<const FieldView> fields, const Lattice& coarsest,
                                                            const PartitionError& error, const Executor& executor,
                                                            PolygoniseCounts* counts = nullptr);

}  // namespace supple::implicit
