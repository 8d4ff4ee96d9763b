/// @file supple/implicit/mesh_solid.h
/// A closed triangle mesh as a solid that stands still.
#pragma once

#include <cstdint>
#include <memory>

#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

class MeshDistance;

struct MeshSolidOptions {
  double slope = 1.0;  ///< |grad F| [1/m], > 0
  Pose pose{};         ///< where the mesh is put
};

/// F = -slope times the signed distance, smoothed over a 128th of the longest side (C^2: edges are rounded), and exact where the solid or a gap is thin.
/// Inside is where triangles go around a point at least once, either way: a shell in another one bounds a cavity if it runs the other way round, and shells
/// that overlap are one solid. Beyond a few cells outside F stays what it is there.
class MeshSolid {
 public:
  /// What was found of the mesh.
  struct Report {
    std::size_t turned = 0;    ///< triangles that ran around the other way than most of their shell
    std::size_t crossing = 0;  ///< triangles that pass through or touch others that are not their neighbours
    double deviation = 0.0;    ///< by which the surface is elsewhere than that of the mesh, at most [m]
    double size = 0.0;         ///< longest side of its box [m]
  };

  /// Vertices at one place count as one, and those without a triangle do not count. Triangles that run around the other way than most of those
  /// that they share edges with are turned.
  /// @throws Error{Scene}, key `mesh`, for one that is not closed, that has only one side or that encloses nothing, with the edge concerned
  MeshSolid(const Mesh& mesh, const MeshSolidOptions& options);

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const { return box_; }
  /// The thickness that all but a hundredth of its surface has at least, or a sixteenth of its longest side.
  [[nodiscard]] double feature_size() const { return feature_size_; }
  /// The triangles that bound it, with the normal of each face at its corners.
  [[nodiscard]] const Mesh& mesh() const { return *mesh_; }
  [[nodiscard]] const Report& report() const { return report_; }

 private:
  double evaluate(const Vec3& point, Vec3* gradient) const;

  std::shared_ptr<const MeshDistance> distance_;  // where the mesh is given
  std::shared_ptr<const Mesh> mesh_;
  Vec3 position_;
  Mat3 rotation_;
  double slope_;
  double feature_size_ = 0.0;
  double deepest_ = 0.0;  // bound of the distance inside
  Box box_;
  Report report_;
};

}  // namespace supple::implicit
