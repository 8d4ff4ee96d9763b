/// @file supple/implicit/convolution.h
/// Kernels integrated over segments, triangles and arcs, in closed form (Bloomenthal & Shoemake 1991; for Cauchy's kernel
/// after McCormack & Sherstyuk 1998, but over edges, by Green's theorem, and with the integrand clipped to the support).
/// Integrals are additive: a shape that is divided into pieces has the same field, without bulges at the joints.
#pragma once

#include <span>

#include "supple/core/types.h"
#include "supple/implicit/skeleton.h"

namespace supple::implicit {

/// An integral and its gradient by the point y.
struct Convolution {
  double value = 0.0;
  Vec3 gradient = Vec3::Zero();
};

/// Kernels that can be integrated: Wyvill, Murakami, Cauchy.
[[nodiscard]] bool convolves(KernelKind kind) noexcept;

/// Of k(|x - y|) over the segment |x_x| <= half_length on the x axis [m]. @pre convolves(kernel.kind), here and below
[[nodiscard]] Convolution convolve_segment(const Kernel& kernel, double half_length, const Vec3& y) noexcept;
/// Over a plane convex polygon, its corners in order [m^2].
[[nodiscard]] Convolution convolve_polygon(const Kernel& kernel, std::span<const Vec3> corner, const Vec3& y) noexcept;
/// Over the arc of a circle in z = 0 within the angle half_angle <= pi of the x axis [m].
[[nodiscard]] Convolution convolve_arc(const Kernel& kernel, double radius, double half_angle, const Vec3& y) noexcept;

/// Over a whole line or plane at a distance [m, m^2].
[[nodiscard]] double convolve_line(const Kernel& kernel, double distance) noexcept;
[[nodiscard]] double convolve_plane(const Kernel& kernel, double distance) noexcept;

/// Largest value of f of a single primitive; an upper bound if the primitive is convolved.
[[nodiscard]] double peak(const Primitive& primitive) noexcept;

}  // namespace supple::implicit
