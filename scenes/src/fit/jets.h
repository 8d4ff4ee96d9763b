/// @file jets.h
/// Principal curvatures of a surface through points.
#pragma once

#include <span>

#include "supple/core/types.h"

namespace supple::fit {

/// Where a surface bulges along its normal, curvatures are > 0.
struct SurfaceFrame {
  Vec3 normal = Vec3::UnitZ();
  Vec3 direction = Vec3::UnitX();     ///< of the first curvature, across the normal
  double first = 0.0, second = 0.0;   ///< principal curvatures [1 / unit of length]
};

/// The frame at the first point, by a polynomial of second order through all (Cazals & Pouget 2005, by CGAL).
/// @param normal  side of the surface   @pre points.size() >= 6
[[nodiscard]] SurfaceFrame measure_frame(std::span<const Vec3> points, const Vec3& normal);

}  // namespace supple::fit
