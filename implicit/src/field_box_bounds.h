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
  /// What is known of the gradient of one term of a sum on the box: it is `factor` times a vector within `spread` of `gap`, and lies
  /// within `turn` of `gradient`. A support that ends in the box leaves the first of some use.
  struct Term {
    Vec3 gap = Vec3::Zero();       ///< from the nearest point of the shape to the middle of the box, in the metric of the shape
    double spread = 0.0;
    Interval factor{};             ///< at most 0
    Vec3 gradient = Vec3::Zero();  ///< [1/m]
    double turn = 0.0;             ///< [1/m]
  };
  std::vector<Ball> hull{};  ///< of these balls holds Clarke's gradients of F on all of the box; several where parts win in turn, empty: not known
  bool round = false;  ///< {F >= F(x)} is strictly convex for each point x of the box where the gradient is not 0
  std::vector<Term> term{};  ///< of a sum; empty: not known, or none
  double slack = 0.0;        ///< round-off of sums of these [1/m]
};

[[nodiscard]] GradientBounds bounds_with_gradient(const Field& field, const Box& box);

/// Of grad F along a unit vector, on the box of these bounds [1/m]. @pre the hull is not empty
[[nodiscard]] Interval slope_along(const GradientBounds& bounds, const Vec3& direction);

}  // namespace supple::implicit
