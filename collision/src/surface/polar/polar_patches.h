/// @file polar_patches.h
/// All contact patches of a pair by the polar rule: one for each hill of the pressure on Sigma, and those that no hill tells.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/pair_result.h"
#include "surface/polar/polar_job.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {

class PolarPatches {
 public:
  /// Where to look: from the nearest place of convex bodies, from surface samples, or from a grid.
  void start_from(const Vec3& seed, PairPressure& pressure);
  void start_from(std::span<const Vec3> seeds, double spacing, PairPressure& pressure) { finder_.start_from_seeds(pressure, seeds, spacing, starts_); }
  void start_from(const Box& overlap, PairPressure& pressure) { finder_.start_from_scan(pressure, overlap, starts_); }

  /// Adds all patches to an empty result. @return false where the rule does not fit
  bool solve(const PolarJob& job, PairResult& out);

  [[nodiscard]] std::span<const PolarCover> covers() const { return std::span(covers_).first(cover_count_); }
  /// How many hills of the pressure there seem to be.
  [[nodiscard]] std::size_t hills() const { return starts_.hill.size(); }
  [[nodiscard]] bool empty() const { return cover_count_ == 0; }
  /// No patches, whatever was found.
  void forget() { cover_count_ = 0; }
  /// Whether Newton's method finds a place where the bodies press from any of the hills.
  [[nodiscard]] bool any_touches(PairPressure& pressure, double extent, bool convex);
  /// Whether one of the places to start from lies farther inside both bodies than rounding tells.
  [[nodiscard]] bool knows_overlap(PairPressure& pressure);

 private:
  enum class Patch : std::uint8_t { Added, Known, Lost, Unfit };

  bool solve(const PolarJob& job, bool follow, bool& unseen, PairResult& out);
  Patch add_patch(const PolarJob& job, const StartPoint& hill, bool follow, PairResult& out);
  [[nodiscard]] bool overlap(PairPressure& pressure);
  std::optional<StartPoint> outside(PairPressure& pressure, double extent);
  void find_crossings(PairPressure& pressure, double spacing);
  [[nodiscard]] bool covered(const StartPoint& place, double slack) const;

  PeakFinder finder_;
  PolarRuleSolver polar_;
  StartPoints starts_;
  std::vector<StartPoint> crossing_;
  std::vector<Vec3> from_, point_, before_;
  std::vector<PolarCover> covers_;
  std::size_t cover_count_ = 0;
  std::vector<PatchShare> share_;
  PressureBatch batch_;
};

}  // namespace supple::collision
