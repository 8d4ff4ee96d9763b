/// @file field_box_bounds.h
#pragma once

#include <vector>

#include "supple/implicit/field.h"
#include "supple/implicit/kernel.h"

namespace supple::implicit {

/// Field::box_bounds, and where the gradient points.
struct GradientBounds : Field::BoxBounds {
  struct Ball {
    Vec3 gradient = Vec3::Zero();  ///< [1/m]
    double turn = 0.0;             ///< radius [1/m]
  };
  /// Of a sum all of whose second derivatives are bounded: what bounds on parts of the box take besides value and
  /// gradient at their middles.
  struct Curved {
    bool known = false;
    CurvatureRange curvature{};  ///< on the box [1/m^2]
    double round_off = 0.0;      ///< of values [1]
  };
  Curved curved;
  std::vector<Ball> hull{};  ///< of these balls holds Clarke's gradients of F on all of the box; several where parts win in turn, empty: not known
  bool round = false;  ///< {F >= F(x)} is strictly convex for each point x of the box where the gradient is not 0
};

[[nodiscard]] GradientBounds bounds_with_gradient(const Field& field, const Box& box);

}  // namespace supple::implicit
