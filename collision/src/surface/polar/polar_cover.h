/// @file polar_cover.h
/// The ground that a polar patch covers.
#pragma once

#include <vector>

#include "surface/find_peak.h"

namespace supple::collision {

struct PolarCover {
  PeakFrame frame;
  std::vector<double> radius, height;  ///< of the rim, by equally spaced angles; of `corner` where there are some
  std::vector<Vec2> corner;            ///< of an outline about the origin, by angle, in units of u and v
  std::vector<Vec3> rim;               ///< its points
  double thickness = 0.0;
  Vec3 rise = Vec3::Zero();            ///< of Sigma at the origin, over a step across the axis; about the peak there is none
  /// Along the ray from the origin through a point, in units of u and v: the distance of the point over that of the rim, 0 where no
  /// corner is near the ray, and the height of the rim there.
  struct Reach {
    double far = 0.0, rise = 0.0;
  };
  [[nodiscard]] Reach reach(const Vec2& at) const;
  /// Whether a place lies over the patch, near Sigma, and on the same side of A: on the other side of a body that is pinched there is
  /// another patch. @param slack  share of the radius that a point may lie outside
  [[nodiscard]] bool contains(const StartPoint& place, double slack) const;
};

}  // namespace supple::collision
