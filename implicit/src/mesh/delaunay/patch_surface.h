/// @file patch_surface.h
/// Where the patches of a PatchComplex lie: fields of labels agree there and no other is larger.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "mesh/delaunay/patch_complex.h"

namespace supple::implicit {

using Corners = std::array<Vec3, 3>;

[[nodiscard]] inline Vec3 normal_of(const Corners& c) { return (c[1] - c[0]).cross(c[2] - c[0]); }

struct Shape {
  double shortest, angle;  ///< least edge [m], least angle [rad]
  std::size_t sharpest;    ///< where that is
  double radius;           ///< of the circumcircle [m]
  Vec3 centre;
};
[[nodiscard]] Shape shape_of(const Corners& c);

class PatchSurface {
 public:
  explicit PatchSurface(std::span<const FieldView> fields);

  /// The place nearest to `start`, by Newton's method, where the fields of the labels agree and no other is larger.
  [[nodiscard]] std::optional<Vec3> settle(const lattice::LabelSet& labels, const Vec3& start, double within) const;
  /// Distance of a point to the surface between a triangle's labels along a direction, at most `most` [m], to second order.
  [[nodiscard]] double distance_along(const PatchComplex::Triangle& t, const Vec3& from, const Vec3& direction, double most) const;
  /// Cosine of the angle between a triangle and the surface at its centroid; -1 where that lies farther off than `most`.
  [[nodiscard]] double uprightness(const PatchComplex::Triangle& t, const Corners& corner, double most) const;
  /// Is that cosine less than this for a triangle?
  [[nodiscard]] bool is_folded(const PatchComplex& complex, double least) const;

 private:
  /// No other label is above the level of these.
  [[nodiscard]] bool wins(const lattice::LabelSet& labels, const Vec3& x, double level) const;

  std::span<const FieldView> fields_;
  std::vector<Box> box_;
};

}  // namespace supple::implicit
