/// @file supple/implicit/mesh_solid.h
/// A closed triangle mesh as a fixed solid.
#pragma once

#include <cstdint>
#include <memory>

#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

class MeshDistance;

struct MeshSolidOptions {
  double slope = 1.0;  ///< |grad F| [1/m], > 0
  Pose pose{};         ///< pose of the mesh
};

/// F = -slope times the signed distance, smoothed over a 128th of the longest side (C^2: edges are rounded), and exact where the solid or a gap is thin.
/// Points with a nonzero winding number are inside: a shell inside another one bounds a cavity if it is oriented the other way round, and shells
/// that overlap are one solid. Farther outside than a few cells F is constant.
class MeshSolid {
 public:
  /// Properties of the given mesh.
  struct Report {
    std::size_t turned = 0;    ///< triangles that were reversed to agree with their shell
    std::size_t crossing = 0;  ///< triangles that intersect or touch others that are not their neighbours
    double deviation = 0.0;    ///< largest distance of the surface from the mesh [m]
    double size = 0.0;         ///< longest side of its box [m]
  };

  /// Vertices at the same position are merged, and vertices without a triangle are ignored. Triangles that are oriented against most of those
  /// that they share edges with are reversed.
  /// @throws Error{Scene}, key `mesh`, for a mesh that is not closed, is one-sided or encloses nothing, with the edge concerned
  MeshSolid(const Mesh& mesh, const MeshSolidOptions& options);

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const { return box_; }
  /// The thickness that 99 % of its surface exceeds, or a sixteenth of its longest side.
  [[nodiscard]] double feature_size() const { return feature_size_; }
  /// Its boundary triangles, with the normal of each face at its corners.
  [[nodiscard]] const Mesh& mesh() const { return *mesh_; }
  [[nodiscard]] const Report& report() const { return report_; }
  /// Whether they are of one mesh, in whatever pose, and keep its distances together. Solids of equal meshes without crossings do while both live.
  [[nodiscard]] friend bool share_distance(const MeshSolid& a, const MeshSolid& b) { return a.distance_ == b.distance_; }

 private:
  double evaluate(const Vec3& point, Vec3* gradient) const;

  std::shared_ptr<const MeshDistance> distance_;  // in the pose of the mesh
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
