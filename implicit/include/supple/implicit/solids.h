/// @file supple/implicit/solids.h
/// Rigid solids: walls, blocks and terrain. Each is a ScalarField of one part whose value is
/// `slope` times a depth, so that with a modulus P its pressure rises by P slope per metre. HalfSpace is in field.h, terrain in height_field.h.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Box with rounded edges: F = -slope times the signed distance. Smooth as deep as `rounding`; deeper, the gradient jumps
/// where two faces are equally near.
class SolidBox {
 public:
  /// @param half_sizes  of the whole box [m], > 0   @param rounding  radius of the edges [m], in [0, least half size]
  SolidBox(const Pose& pose, const Vec3& half_sizes, double rounding, double slope);

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;
  [[nodiscard]] std::optional<CorePoint> core_point(const Vec3& place) const;
  /// Its surface with sharp edges, one quadrangle per face.
  [[nodiscard]] Mesh mesh() const;
  /// The same box at another pose.
  [[nodiscard]] SolidBox placed(const Pose& pose) const { return {pose, half_, rounding_, slope_}; }

 private:
  double evaluate(const Vec3& point, Vec3* gradient) const;

  Vec3 centre_;
  Mat3 rotation_;
  Vec3 half_;
  double rounding_;
  double slope_;
};

/// Another field, which must outlive it, moved rigidly: F(x) = F_0(q^-1 (x - p)).
class MovedField {
 public:
  MovedField(const FieldView& field, const Pose& pose);

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const { return field_.bound(local(box)); }
  [[nodiscard]] double gradient_bound(const Box& box) const { return field_.gradient_bound(local(box)); }
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const { return field_.feature_size(); }
  [[nodiscard]] std::optional<CorePoint> core_point(const Vec3& place) const;

 private:
  [[nodiscard]] Box local(const Box& box) const;
  [[nodiscard]] std::vector<Vec3> local(std::span<const Vec3> points) const;

  FieldView field_;
  Vec3 position_;
  Mat3 rotation_;
};

}  // namespace supple::implicit
