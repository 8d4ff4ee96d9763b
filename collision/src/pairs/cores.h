/// @file cores.h
/// Two convex bodies as their cores tell how they lie.
#pragma once

#include <optional>

#include "supple/collision/bodies.h"

namespace supple::collision {

struct Between {
  Vec3 middle = Vec3::Zero();  ///< of the overlap, or of the gap [m]
  bool apart = false;          ///< certainly no overlap
  bool overlap = false;        ///< certainly one
};

/// Steps that tell most pairs apart, and all that are tried where nothing else helps: faces that are nearly parallel need many.
inline constexpr int kFewSteps = 32, kManySteps = 512;

/// On the line between the nearest points of two cores, which are found by going from one to the other.
/// @param overlap  of their boxes   @param steps  at most; kFewSteps also end where a thousandth of the distance is all that is left
/// @return none where the cores meet, or a body has none
[[nodiscard]] std::optional<Between> between_cores(const ContactBody& one, const ContactBody& other, const Box& overlap, int steps = kFewSteps);

/// Of two balls about one centre that press differently wherever both press, so that no Sigma lies between them and neither pushes the other: the side (0: `one`)
/// that presses less. Proved by bounds of their fields along a ray, but for what hardly presses or lies within a thousandth of the radius; none where it is not so.
[[nodiscard]] std::optional<int> softer_of_nested_balls(const ContactBody& one, const ContactBody& other);

}  // namespace supple::collision
