/// @file accuracy.h
/// Numbers by which all rules decide alike.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "supple/implicit/kinks.h"

namespace supple::collision {

/// Steps of Newton's method that is held between places on both sides of a zero, at most: halving alone gains twelve digits by then.
inline constexpr int kBracketSteps = 40;
/// The same of a method that is not: it has arrived by then, or is lost.
inline constexpr int kFreeSteps = 8;

/// Least cosine between Sigma's normal and an axis along which Sigma is a graph.
inline constexpr double kGraphCosine = 0.2;
/// Least cosine between a ray and the normal of what it is to meet: nearer to grazing, it is not followed.
inline constexpr double kLeastSight = 0.1;
/// Pressure over the modulus within which a place lies on a body's surface: a body's own samples do, but for rounding.
inline constexpr double kOnSurface = 1e-9;
/// Rays by which the outline of a patch or of an imprint is seen roughly, and well.
inline constexpr std::size_t kFewRays = 8, kManyRays = 16;

/// Estimate over the difference of two orders: both may miss something.
inline constexpr double kTwoOrders = 2.0;
/// Share of the error asked for that estimates of parts may come to: the rest is left to rims and heights, which Newton's method leaves a little off.
inline constexpr double kOfParts = 0.9;
/// Share of the error asked for that parts which are not refined may come to.
inline constexpr double kOfKept = 0.5;
/// What a straight line between two values may be off by where what it stands for bends once: of the rectangle that the values span.
inline constexpr double kOfRectangle = 0.125;

/// An estimate of what the finer of two orders is off by where both converge, from what they differ by, relative: the power 3/2 of that, as in QUADPACK
/// (Piessens et al. 1983, sec. 2.2.4.1). `supple bench collision/calibration` tells how often it is exceeded.
[[nodiscard]] inline double error_of_finer(double difference) {
  constexpr double kRegular = 100.0;  // differences above the inverse of its square, 1e-4, count whole: orders may not converge yet
  constexpr double kLeast = 0.1;      // of the difference: orders may agree by chance
  return difference * std::clamp(kRegular * std::sqrt(difference), kLeast, 1.0);
}

/// Whether a rule leaves a kink uncut: across a jump of a third derivative sums converge with the fourth power of their points, which is enough at these errors.
[[nodiscard]] inline bool is_mild(const implicit::Kink& kink, double error) {
  constexpr double kMild = 1e-4;
  return kink.order > 2 && error >= kMild;
}

}  // namespace supple::collision
