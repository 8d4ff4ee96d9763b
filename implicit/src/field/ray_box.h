/// @file ray_box.h
#pragma once

#include <algorithm>

#include "supple/core/types.h"

namespace supple::implicit {

/// Whether the stretch [0, reach] of a ray meets the box.
[[nodiscard]] inline bool ray_meets(const Box& box, const Vec3& from, const Vec3& along, double reach) {
  const Vec3 to = from + reach * along;
  if ((from.cwiseMax(to).array() < box.lower.array()).any() || (from.cwiseMin(to).array() > box.upper.array()).any()) return false;
  double low = 0.0, high = reach;
  for (int k = 0; k < 3; ++k) {
    if (along[k] == 0.0) {
      if (from[k] < box.lower[k] || from[k] > box.upper[k]) return false;
      continue;
    }
    const double first = (box.lower[k] - from[k]) / along[k], second = (box.upper[k] - from[k]) / along[k];
    low = std::max(low, std::min(first, second));
    high = std::min(high, std::max(first, second));
  }
  return low <= high;
}

}  // namespace supple::implicit
