/// @file field_box_bounds.h
#pragma once

#include <vector>

#include "supple/implicit/field.h"

namespace supple::implicit {

/// Field::box_bounds, and where the gradient points.
struct GradientBounds : Field::BoxBounds {
  struct Ball {
    Vec3 gradient = Vec3::Zero();  ///< [1/m]
    double turn = 0.0;             ///< radius [1/m]
  };
  std::vector<Ball> hull;  ///< of these balls holds Clarke's gradients of F on all of the box; several where parts win in turn, empty: not known
};

[[nodiscard]] GradientBounds bounds_with_gradient(const Field& field, const Box& box);

}  // namespace supple::implicit
