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
/// Where that point lies more than a cell beyond its cell, or a triangle would turn over, the cell stays as it was, and edges that cross
/// the crease are cut there. Where that would turn triangles over, as in valleys that are steep for the cells, those around are made anew.
/// Where triangles would cross then, as where cells bridge a valley with an opening below about 16 degrees several cells above its ground, or
/// where creases meet, that is taken back, step by step, in the limit to the triangles of march_cubes: closed, oriented, and nothing crosses
/// by more than rounding. The cells whose crease stays cut off for that are counted. A vertex on a crease has the mean of the normals of
/// its sides. With options.error, cells get smaller by sqrt(2) until it is met, from those on that march_cubes would begin with.
/// @pre the rule of the field's blend is Graph, options.refinements is 0   @throws Error{Limit} as CubeMesher::make
[[nodiscard]] Mesh march_creases(const Field& field, const MarchOptions& options, const Executor& executor,
                                 MarchCounts* counts = nullptr);

/// Meshes one body with creases again and again: what moved primitives do not reach is kept as by CubeMesher, and so are the nodes that
/// its vertices belong to and the points of its creases. With options.error all meshes that are tried are kept so, and errors of their
/// triangles. The result, and what is tried and refused, is that of march_creases, bit by bit.
class CreaseMesher {
 public:
  /// @param most_kept  of all meshes that were tried with options.error [byte]; where they need more, the coarsest are made anew
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
