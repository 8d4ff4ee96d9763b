/// @file rim_curve.h
/// The rim of a patch, where both pressures vanish, followed as a curve in space; and places that all of it is seen from.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "surface/find_peak.h"
#include "surface/pair_pressure.h"

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

}  // namespace supple::collision
