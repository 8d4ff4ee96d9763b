/// @file shortest_in_hull.h
#pragma once

#include <algorithm>
#include <span>

#include "supple/core/types.h"

namespace supple::implicit {

/// The shortest vector of the convex hull of some, nearly (Frank & Wolfe's method).
inline Vec3 shortest_in_hull(std::span<const Vec3> vectors) {
  Vec3 at = vectors[0];
  for (int i = 0; i < 16; ++i) {
    const Vec3* best = &vectors[0];
    for (const Vec3& v : vectors) best = v.dot(at) < best->dot(at) ? &v : best;
    const Vec3 step = *best - at;
    const double length2 = step.squaredNorm();
    if (length2 == 0.0) break;
    at += std::clamp(-at.dot(step) / length2, 0.0, 1.0) * step;
  }
  return at;
}

}  // namespace supple::implicit
