/// @file shape_curvature.h
/// Bounds of the second derivatives of potentials f = g(d) of one shape. With Q those of d^2 / 2,
/// H = (g'/d) (Q - grad d grad d^T) + g'' grad d grad d^T, and both g'/d and g'' lie in curvature_range of the kernel.
#pragma once

#include <array>
#include <cstddef>

#include "skeleton/shapes.h"
#include "supple/implicit/kernel.h"

namespace supple::implicit {

/// A ball in the frame of a shape.
struct ShapeBall {
  Vec3 centre = Vec3::Zero();
  double reach = 0.0;  ///< its radius [m]
  double far = 0.0;    ///< largest distance d in it that counts [m]: beyond the kernel's radius f is zero
};

/// Whose hull holds the nearest points of a curve to all of a ball, also where two of its parts are as near: control points of the part of it
/// between them; and the widths there.
struct NearestCurvePoints {
  std::array<Vec3, 4> hull;
  std::size_t count = 0;
  double least_width = 1.0, largest_width = 1.0;
};
/// @pre a curve
[[nodiscard]] NearestCurvePoints nearest_curve_points(const ShapeView& shape, const ShapeBall& ball) noexcept;

/// Of H in the ball [1/m^2]; infinite where there is none: where two parts of a curve are nearest at once, on the axes of rings, and where both ends of arcs are nearest.
/// @param kernel  of g'' and g'/d at the distances in the ball  @pre not convolved
[[nodiscard]] CurvatureRange shape_curvature(const ShapeView& shape, const ShapeBall& ball, const CurvatureRange& kernel) noexcept;

}  // namespace supple::implicit
