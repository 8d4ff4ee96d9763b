/// @file supple/implicit/project.h
/// Points moved onto the surface F = 0, along the gradient or along a ray.
#pragma once

#include <optional>

#include "supple/implicit/field_view.h"

namespace supple::implicit {

struct Projection {
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  ///< outward unit normal at `point`
  bool converged = false;      ///< |F| <= 1e-13 (or round-off of F) was reached
  int iterations = 0;
};

/// Newton along the gradient, x <- x - F grad F / |grad F|^2, each step at most half the feature size; a bracketed root
/// between the last two points when a step changed the sign of F without halving it. Fails (converged = false) where
/// the gradient vanishes. The result depends on the feature size and on values in `evaluated` alone.
/// @param evaluated  extended by the box of the points at which the field was evaluated
[[nodiscard]] Projection project_to_surface(const FieldView& field, const Vec3& start, int max_iterations = 50, Box* evaluated = nullptr);

/// Root of F on the segment a + t (b - a), t in [0, 1], F(a) and F(b) of opposite sign: bracketed Newton.
/// @pre F(a) F(b) <= 0
[[nodiscard]] Vec3 root_on_segment(const FieldView& field, const Vec3& a, const Vec3& b);

/// First point of F = 0 on the ray origin + t direction, t in [0, t_max]. Intervals of the ray are skipped only where bounds of F, of |grad F|
/// (segment tracing, Galin et al. 2020) or of F' along the ray exclude a root, so neither thin nor grazed surfaces are missed. A ray that
/// passes too close for any bound counts as a hit: sums of kernels of distances within the rounding of F, other Fields and views within
/// 1e-8 features, or their rounding. Where F jumps (blends by gradients, where the gradient of a node vanishes), and along views that do
/// not bound their slope (there 1e-3 features), only a change of sign counts.
/// @pre direction is a unit vector
[[nodiscard]] std::optional<double> intersect(const FieldView& field, const Vec3& origin, const Vec3& direction,
                                              double t_max);

}  // namespace supple::implicit
