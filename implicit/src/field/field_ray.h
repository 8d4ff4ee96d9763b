/// @file field_ray.h
/// First hit of a ray with the surface of a Field, by intervals along the ray that are certain to contain F and its derivative.
#pragma once

#include <optional>

#include "supple/implicit/field.h"

namespace supple::implicit {

/// @pre the field sums its primitives (no other blend); direction is a unit vector, t_max finite
[[nodiscard]] std::optional<double> intersect_primitives(const Field& field, const Vec3& origin, const Vec3& direction, double t_max);

}  // namespace supple::implicit
