/// @file pair_result.h
/// What one pair gives, before pairs are joined in their order.
#pragma once

#include <span>

#include "supple/collision/contact_surface.h"
#include "surface/patch_points.h"

namespace supple::collision {

/// What one patch adds to a pair.
struct PatchShare {
  Vec3 force = Vec3::Zero(), first = Vec3::Zero();  ///< first moment of its load about the world's origin
  double load = 0.0, area = 0.0;
  double estimate = 0.0;  ///< as ContactSurface::Summary::error_estimate has it, of the patch alone
};

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

/// Forces of patches may cancel, and each is a lever to the centre of pressure: both are then off by more than any of the patches is.
[[nodiscard]] double estimate_of_all(std::span<const PatchShare> patches, const PairResult& all);

}  // namespace supple::collision
