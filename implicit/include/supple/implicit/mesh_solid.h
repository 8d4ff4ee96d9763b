/// @file supple/implicit/mesh_solid.h
/// A closed triangle mesh as a solid that stands still: its signed distances on a lattice, made by OpenVDB, as a smooth field.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

struct MeshSolidOptions {
  double voxel = 0.0;                     ///< edge of a cell [m]; 0: a 64th of the mesh's longest side, or finer where the mesh is thinner
  double slope = 1.0;                     ///< |grad F| beside faces [1/m], > 0
  std::uint64_t max_voxels = 64'000'000;  ///< of the lattice around the mesh; refused beyond
};

/// F = -slope times the signed distance. The distances are the coefficients of a cubic B-spline on the lattice, so F is C^2
/// and edges are rounded over about a cell; beside a smooth surface F errs by voxel^2 / 6 times its Laplacian, on a sphere of
/// radius R by voxel^2 / 3 R in distance. Beyond a few cells outside the mesh F stays what it is there.
class MeshSolid {
 public:
  /// Vertices at one place count as one. @throws Error{Scene}, keys `mesh` for one that is not closed, `voxel` for too many cells or none in thin parts
  MeshSolid(const Mesh& mesh, const MeshSolidOptions& options);

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const { return box_; }
  [[nodiscard]] double feature_size() const { return 4.0 * voxel_; }
  [[nodiscard]] double voxel() const { return voxel_; }
  /// The triangles it was made from, with a normal of each face at its corners.
  [[nodiscard]] const Mesh& mesh() const { return mesh_; }

 private:
  double evaluate(const Vec3& point, Vec3* gradient) const;
  [[nodiscard]] std::size_t index(std::size_t i, std::size_t j, std::size_t k) const { return (k * size_[1] + j) * size_[0] + i; }

  Mesh mesh_;
  Vec3 corner_ = Vec3::Zero();  // node (0, 0, 0)
  double voxel_, slope_;
  std::array<std::size_t, 3> size_{};
  std::vector<float> distance_;  // at the nodes, x fastest
  double deepest_ = 0.0;         // largest distance inside
  Box box_;
};

}  // namespace supple::implicit
