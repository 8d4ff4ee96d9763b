/// @file field_box_bounds.h
#pragma once

#include <limits>

#include "supple/implicit/field.h"

namespace supple::implicit {

/// Field::box_bounds, and where the gradient points.
struct GradientBounds : Field::BoxBounds {
  Vec3 gradient = Vec3::Zero();                           ///< at the centre of the box [1/m]
  double turn = std::numeric_limits<double>::infinity();  ///< grad F differs from it by at most this [1/m]; not known in blends
};

[[nodiscard]] GradientBounds bounds_with_gradient(const Field& field, const Box& box);

}  // namespace supple::implicit
