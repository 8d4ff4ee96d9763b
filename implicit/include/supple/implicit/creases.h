/// @file supple/implicit/creases.h
/// Meshes of bodies whose blend leaves creases: where nodes of a blending graph unite without blending, their surfaces
/// meet at an angle along a curve. Other meshers cut it off within a cell.
#pragma once

#include <memory>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit {

/// Whether two nodes of a graph whose supports overlap have a weight below 1.
[[nodiscard]] bool has_creases(const Field& field);

/// The surface of march_cubes with vertices on its creases. F is the largest of the fields
/// F_k = f_k + sum over j of w_kj min(f_j, f_k) - c of its nodes; a cell whose vertices belong to two or three of them gets a
/// vertex where their fields vanish together, and edges that cross the crease are turned onto it (Kobbelt et al. 2001).
/// Where that point lies more than a cell beyond its cell, or a triangle would be inverted, the cell is unchanged, and edges that cross
/// the crease are split there. Where that would invert triangles, as in valleys that are steep for the cells, the triangles around are rebuilt.
/// Where triangles would intersect then, as where cells bridge a valley with an opening below about 16 degrees several cells above its ground, or
/// where creases meet, these changes are undone step by step, in the limit down to the triangles of march_cubes: closed, oriented, and without
/// intersections beyond rounding. The cells whose crease stays cut off for this reason are counted. A vertex on a crease has the mean of the
/// normals of its sides. With options.error, cells get smaller by sqrt(2) until it is met, starting from the first cells of march_cubes, or until dividing those triangles that
/// are too far from the surface takes fewer, new vertices of creases on these.
/// @pre the rule of the field's blend is Graph, options.refinements is 0   @throws Error{Limit} as CubeMesher::make
[[nodiscard]] Mesh march_creases(const Field& field, const MarchOptions& options, const Executor& executor,
                                 MarchCounts* counts = nullptr);

/// Meshes one body with creases repeatedly: data out of reach of moved primitives are kept as by CubeMesher, also the nodes of
/// its vertices and the points of its creases. With options.error the data of all trial meshes are kept, with the errors of their
/// triangles. Results, trial meshes and refusals are those of march_creases, bit by bit.
class CreaseMesher {
 public:
  /// @param most_kept  limit of kept data of all trial meshes with options.error [byte]; beyond it the coarsest are rebuilt
  explicit CreaseMesher(std::uint64_t most_kept = kMostKeptToError);
  ~CreaseMesher();
  CreaseMesher(CreaseMesher&&) noexcept;
  CreaseMesher& operator=(CreaseMesher&&) noexcept;

  /// @return as march_creases, valid until the next call   @pre, @throws as march_creases
  const Mesh& make(const Field& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts = nullptr);
  /// As those of CubeMesher.
  void keep_at_most(std::uint64_t most_kept);
  [[nodiscard]] std::uint64_t kept_to_error() const;
  /// As CubeMesher::expect_error.
  void expect_error(const Field& field, const MarchOptions& options, const Executor& executor, std::uint64_t most_triangles);

 private:
  struct Impl;
  std::uint64_t most_kept_;
  std::unique_ptr<Impl> impl_;  ///< made with the first mesh
};

}  // namespace supple::implicit
