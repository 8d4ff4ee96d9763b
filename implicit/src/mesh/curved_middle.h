/// @file curved_middle.h
/// Where the middle of an edge is expected on the surface.
#pragma once

#include "supple/core/types.h"

namespace supple::implicit {

/// Middle of the cubic from a to b [m] that is perpendicular to the normals at both ends (Vlachos et al. 2001, "Curved PN triangles").
[[nodiscard]] inline Vec3 curved_middle(const Vec3& a, const Vec3& normal_a, const Vec3& b, const Vec3& normal_b) {
  const Vec3 along = b - a;
  return 0.5 * (a + b) - 0.125 * (along.dot(normal_a) * normal_a - along.dot(normal_b) * normal_b);
}

}  // namespace supple::implicit
