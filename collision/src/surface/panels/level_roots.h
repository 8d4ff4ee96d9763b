/// @file level_roots.h
/// Roots of a function along a line that is known by values and slopes at few places: Hermite's cubics between them.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace supple::collision {

/// A function at a place of a line, with its derivative along it.
struct LevelSample {
  double place, value, slope;
};

/// A change of sign between two places.
struct LevelRoot {
  double low, high;     ///< the signs at these differ
  double guess;         ///< where the cubic is 0
  bool rises;           ///< positive beyond it
  bool open_low, open_high;  ///< the sign at `low`, `high` is that of an extrapolation
};

/// Where the cubic between two samples of one sign turns, if it does on its way to zero.
[[nodiscard]] std::optional<LevelSample> turn_between(const LevelSample& from, const LevelSample& to);

/// @param samples  at least one, by rising places within [begin, end]   @param out  appended, by rising places
/// @return whether the function is positive where the line begins
bool predict_roots(std::span<const LevelSample> samples, double begin, double end, std::vector<LevelRoot>& out);

}  // namespace supple::collision
