/// @file rim_curve.h
/// The rim of a patch, where both pressures vanish, followed as a curve in space; and places that all of it is seen from.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/polar/outline.h"

namespace supple::collision {

class RimFollower {
 public:
  /// @param frame  of the peak   @param extent  farther from the peak nothing is followed [m]
  RimFollower(PairPressure& pressure, const PeakFrame& frame, double extent) : pressure_(pressure), frame_(frame), extent_(extent) { batch_.resize(1); }
  /// The rim as a polygon, counterclockwise as u and v have it. @param fine  in steps that do not leap over the neck of a lobe   @return whether it closes
  bool follow(bool fine, std::vector<Vec3>& rim);

 private:
  bool move_to_rim(Vec3& x, Vec3& tangent, double step);
  bool walk_to_rim(const Vec3& along, double step, Vec3& x);

  PairPressure& pressure_;
  const PeakFrame& frame_;
  double extent_;
  PressureBatch batch_;
};

/// The centroid of the kernel of a polygon: of the places that see all of it (Preparata & Shamos 1985, sec. 7.2.6). @return nothing where the kernel is empty
[[nodiscard]] std::optional<Vec2> point_that_sees(std::span<const Vec2> polygon);

/// A patch as a place sees it that all of its rim is seen from.
struct Star {
  PeakFrame frame;         ///< about that place; in units of u and v the rim is as wide as it is long
  Vec3 rise = Vec3::Zero();  ///< of Sigma there, over a step across the axis
  std::vector<Vec3> rim;
  std::vector<RimPoint> outline;  ///< the same, without slopes
  /// Radius and height of the outline in a direction, linear between its points.
  [[nodiscard]] std::array<double, 2> outline_at(double cosine, double sine) const;
};

/// @param fine  the steps along the rim   @return nothing where no place sees the whole rim
[[nodiscard]] std::optional<Star> find_star(PairPressure& pressure, const PeakFrame& peak, double extent, bool fine);

}  // namespace supple::collision
