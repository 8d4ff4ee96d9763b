/// @file pair_result.h
/// What one pair gives, before pairs are joined in their order.
#pragma once

#include "supple/collision/contact_surface.h"
#include "surface/patch_points.h"

namespace supple::collision {

struct PairResult {
  ContactSurface::Summary summary;
  PatchPoints points;
  Vec3 first = Vec3::Zero();  ///< integral of x p dA [N m]
  double load = 0.0;          ///< integral of p dA [N]
  double rounding = 0.0;      ///< what of the estimate no polar or marched rule can help, as the overlap is so thin

  /// Forgets all but the bodies.
  void clear() {
    const BodyPair pair = summary.bodies;
    summary = {};
    summary.bodies = pair;
    points.clear();
    first = Vec3::Zero();
    load = rounding = 0.0;
  }
  /// @param reference  that the sums are about
  void add(const PatchSums& sums, const Vec3& reference) {
    summary.force -= sums.force;
    summary.moment -= sums.moment + reference.cross(sums.force);
    summary.area += sums.area;
    first += sums.first + sums.load * reference;
    load += sums.load;
  }
};

}  // namespace supple::collision
