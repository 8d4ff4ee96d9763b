/// @file thin_cases.h
/// Stiff bodies under small loads: overlaps of a thousandth of a body's rounding and less.
#pragma once

#include <string_view>
#include <vector>

#include "contact_shapes.h"

namespace supple::benchmarks {

/// A convex flat core, along x and y, and what lies within a rounding of it.
struct FlatCore {
  std::string_view name;
  implicit::ShapeKind shape;
  Vec3 size;
  double area, perimeter;  ///< of the core [m^2], [m]; of a segment nothing and twice its length
};
inline const std::array kFlatCores{
    FlatCore{"point", implicit::ShapeKind::Point, Vec3::Zero(), 0.0, 0.0},
    FlatCore{"segment", implicit::ShapeKind::Segment, Vec3(0.15, 0, 0), 0.0, 0.6},
    FlatCore{"rectangle", implicit::ShapeKind::Rectangle, Vec3(0.15, 0.08, 0), 4.0 * 0.15 * 0.08, 4.0 * (0.15 + 0.08)},
    FlatCore{"disc", implicit::ShapeKind::Disc, Vec3(0.12, 0, 0), kPi * 0.12 * 0.12, 2.0 * kPi * 0.12}};

struct ForceAndArea {
  double force = 0.0, area = 0.0;
};

/// Of such a body that lies on a plane, both with linear pressures, to first order in d / r. The pressure on Sigma is k (d - y^2 / 2 r) at y from where the
/// core lies; over the core, its edges and its corners it adds up to a polynomial like Steiner's of parallel bodies.
/// @param r  rounding [m]   @param stiffness  1 / (1 / k_A + 1 / k_B) of the slopes k of both pressures [Pa/m]   @param d  overlap [m]
inline ForceAndArea on_plane(const FlatCore& core, double r, double stiffness, double d) {
  const double wide = std::sqrt(2.0 * r * d);
  return {stiffness * d * (core.area + 2.0 / 3.0 * core.perimeter * wide + kPi * r * d), core.area + core.perimeter * wide + 2.0 * kPi * r * d};
}

/// Shapes whose faces, edges and sides may lie on one another.
inline std::vector<implicit::Skeleton> flat_shapes() {
  using implicit::ShapeKind;
  return {linear_shape(ShapeKind::Box, Vec3(0.1, 0.08, 0.08), 0.02), linear_shape(ShapeKind::Segment, Vec3(0.1, 0, 0), 0.1),
          wyvill_shape(ShapeKind::Box, Vec3(0.2, 0.1, 0.1), 0.15), wyvill_shape(ShapeKind::Segment, Vec3(0.2, 0, 0), 0.2),
          wyvill_shape(ShapeKind::Disc, Vec3(0.15, 0, 0), 0.15)};
}

}  // namespace supple::benchmarks
