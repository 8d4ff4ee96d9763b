/// @file shapes.h
/// Squared distances q to the shapes, point by point: the clear form of what field_lanes.cpp does for the simple ones,
/// and the only form of the others.
#pragma once

#include <array>
#include <span>

#include "supple/implicit/skeleton.h"

namespace supple::implicit {

/// All that a kernel depends on, bit by bit.
void add_content(const Kernel& kernel, ContentWords& words);

/// A shape without its place; `y` below is in its frame, unstretched.
struct ShapeView {
  ShapeKind kind = ShapeKind::Point;
  Vec3 size = Vec3::Zero();
  double radius = 0.0;               ///< kernel radius R [m]
  double taper = 1.0;
  std::array<double, 2> pair{};      ///< Superquadric: exponents; Arc: cosine and sine of its half angle
  std::span<const Vec3> control;
  double gain = 0.0;                 ///< of a convolution; 0: the kernel of the nearest point
};

[[nodiscard]] ShapeView view_of(const Primitive& primitive) noexcept;

/// q, half its gradient, and its second derivatives where requested.
struct FootSample {
  double q = 0.0;
  Vec3 half_gradient = Vec3::Zero();
};
[[nodiscard]] FootSample foot(const ShapeView& shape, const Vec3& y, Mat3* second = nullptr) noexcept;

/// f and its gradient of a convolved shape. @pre shape.gain > 0
[[nodiscard]] Potential convolve(const ShapeView& shape, const Kernel& kernel, const Vec3& y) noexcept;
/// Bounds of a convolved shape's f and |grad f|, everywhere [1, 1/m].
struct ConvolutionLimits {
  double peak = 0.0, slope = 0.0;
};
[[nodiscard]] ConvolutionLimits convolution_limits(const ShapeView& shape, const Kernel& kernel) noexcept;

/// A point of a Bezier curve of two to four control points, with its first two derivatives by t in [0, 1].
struct BezierPoint {
  Vec3 point, first, second;
};
[[nodiscard]] BezierPoint bezier(std::span<const Vec3> control, double t) noexcept;
/// Where a curve is nearest by distance over width, in [0, 1].
[[nodiscard]] double nearest_on_curve(const ShapeView& shape, const Vec3& y) noexcept;

/// Where a placed primitive is not zero, relative to its position, world axes.
struct Support {
  Box core;            ///< the support lies within `reach` of this box
  double reach = 0.0;  ///< [m]
  Box whole;           ///< and in this one
  Vec3 rounding = Vec3::Zero();  ///< how far the kernel widens the shape along the axes [m], at most
};
[[nodiscard]] Support support_of(const Primitive& primitive, const Mat3& rotation) noexcept;

/// Whether sizes, control points, exponents, taper and stretch are such as the shape needs.
[[nodiscard]] bool well_formed(const Primitive& primitive) noexcept;

}  // namespace supple::implicit
