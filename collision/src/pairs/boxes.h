/// @file boxes.h
/// Whether boxes overlap, where most candidates are near and no processor could guess which do.
#pragma once

#include "supple/core/types.h"

namespace supple::collision {

/// `a.overlaps(b)` with all six comparisons at once.
[[nodiscard]] inline bool overlap_at_once(const Box& a, const Box& b) {
  unsigned overlap = 1;
  for (const Eigen::Index k : {0, 1, 2}) {
    overlap &= static_cast<unsigned>(a.lower[k] <= b.upper[k]) & static_cast<unsigned>(b.lower[k] <= a.upper[k]);
  }
  return overlap != 0;
}

}  // namespace supple::collision
