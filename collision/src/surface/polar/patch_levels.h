/// @file patch_levels.h
/// What parts a patch besides its rim: kinks of the two fields, where a derivative of the pressure jumps, and borders of third bodies, beyond which these
/// press harder than the pair. To the rule both are levels: functions s that vanish there.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "supple/implicit/kinks.h"
#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/polar/imprint.h"

namespace supple::collision {

/// Levels are numbered: kinks first, then third bodies.
struct PatchLevels {
  std::vector<implicit::Kink> kink;
  bool all_kinks = false;             ///< these are all of both fields
  Thirds third;
  std::vector<std::size_t> crossing;  ///< levels that cross the patch, rising
  std::vector<Imprint> imprint;       ///< of third bodies on the patch
  std::vector<double> third_value;    ///< pressures of third bodies at the points evaluated last, one body after the other [Pa]
  std::vector<Vec3> third_slope;

  [[nodiscard]] bool is_kink(std::size_t level) const { return level < kink.size(); }
  /// To `third_value` and `third_slope`.
  void evaluate_thirds(std::span<const Vec3> points);
  /// s of a kink; of a third body, how much harder than the pair it presses where the axis through x meets Sigma, to first order [Pa].
  [[nodiscard]] double value(std::size_t level, const PeakFrame& frame, PairPressure& pressure, const Vec3& x) const;
  /// The same with its slope at point i of a batch, for which the third bodies have been evaluated.
  [[nodiscard]] double value(std::size_t level, const PeakFrame& frame, const PressureBatch& at, std::size_t i, Vec3& slope) const;
};

}  // namespace supple::collision
