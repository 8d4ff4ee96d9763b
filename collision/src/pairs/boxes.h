/// @file boxes.h
/// Whether boxes overlap and where they end.
#pragma once

#include "supple/core/types.h"

namespace supple::collision {

/// Whether a box ends on all sides.
[[nodiscard]] inline bool is_finite(const Box& box) { return box.lower.allFinite() && box.upper.allFinite(); }

/// `a.overlaps(b)` with all six comparisons at once: most candidates are near, and no processor could guess which do.
[[nodiscard]] inline bool overlap_at_once(const Box& a, const Box& b) {
  unsigned overlap = 1;
  for (const Eigen::Index k : {0, 1, 2}) {
    overlap &= static_cast<unsigned>(a.lower[k] <= b.upper[k]) & static_cast<unsigned>(b.lower[k] <= a.upper[k]);
  }
  return overlap != 0;
}

}  // namespace supple::collision
