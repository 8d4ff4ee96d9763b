/// @file turns.h
/// Directions in a plane.
#pragma once

#include "supple/core/types.h"

namespace supple::collision {

/// Positive where b lies to the left of a.
inline double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// By angle in [0, 2 pi) without a trigonometric function.
inline bool before(const Vec2& a, const Vec2& b) {
  const auto lower = [](const Vec2& x) { return x.y() < 0.0 || (x.y() == 0.0 && x.x() < 0.0); };
  if (lower(a) != lower(b)) return lower(b);
  return cross(a, b) > 0.0;
}

}  // namespace supple::collision
