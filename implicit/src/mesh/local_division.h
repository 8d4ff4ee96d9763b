/// @file local_division.h
/// Divides the triangles of a mesh that are farther from the surface than an error, and only these and what keeps the mesh closed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "field/bytes_of.h"
#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Kept for its memory. Results depend on the arguments alone.
class LocalDivision {
 public:
  /// Bisects triangles at their edges, the longest first (Rivara 1984, "Algorithms for refining triangular grids based on bisection"), which keeps
  /// angles above half of the smallest one where the surface is smooth. New vertices are moved onto the surface; those of edges that cross a crease, or that run along it,
  /// onto the crease, where the normals of its sides differ by more than 10 degrees: such edges count as twice as long. A vertex stays on its edge, to be tried again in the next
  /// round, where Newton's method leads farther than the longest edge, or where triangles would be inverted or intersect.
  /// @param from  closed, without intersections beyond rounding
  /// @param goal  largest centroid_error [m]
  /// @param most  triangles
  /// @param on_creases  so many of its vertices, the last ones, are on creases
  /// @return null where that takes more triangles, or where vertices do not reach the surface; else valid until the next call
  [[nodiscard]] const Mesh* divide(const FieldView& field, const Mesh& from, double goal, std::size_t most, const Executor& executor, std::size_t on_creases = 0);
  /// Of the mesh that was returned last [m].
  [[nodiscard]] double error() const { return error_; }
  [[nodiscard]] Mesh take() { return std::move(mesh_); }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_of(mesh_); }

 private:
  Mesh mesh_;
  double error_ = 0.0;
};

}  // namespace supple::implicit
