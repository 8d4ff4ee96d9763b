/// @file supple/implicit/skeleton.h
/// Skeleton primitives: the shapes whose distance field a kernel turns into a potential, each placed in the frame of
/// one part (particle) of its body.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/content_versions.h"
#include "supple/core/types.h"
#include "supple/implicit/blend.h"
#include "supple/implicit/kernel.h"

namespace supple::implicit {

/// Each shape in its own frame, with the meaning of `size` and `control`. q is the squared distance for the kernel:
/// that to the nearest point of the shape, unless stated otherwise. R is the kernel's radius.
enum class ShapeKind : std::uint8_t {
  Point,         ///< q = |y|^2
  Segment,       ///< from -size.x to +size.x along x; `taper`
  Rectangle,     ///< |x| <= size.x, |y| <= size.y, z = 0: q = max(|x|-h_x,0)^2 + max(|y|-h_y,0)^2 + z^2
  Disc,          ///< radius size.x in z = 0
  Box,           ///< half sizes size; solid (q = 0 inside)
  Ellipsoid,     ///< support semi-axes size: q = R^2 |D^-1 y|^2, so f = 0 on the ellipsoid with these semi-axes
  Triangle,      ///< control: three corners
  Polygon,       ///< control: the corners of a plane convex polygon, in order
  Ring,          ///< circle of radius size.x in z = 0
  Arc,           ///< the part of that circle within the angle size.y [rad] of the x axis, 0 < size.y <= pi
  Curve,         ///< Bezier curve of 2, 3 (quadratic) or 4 (cubic) control points; `taper`
  Superquadric,  ///< support semi-axes size: q = R^2 u^2, u = ((|x/a|^(2/e2) + |y/b|^(2/e2))^(e2/e1) + |z/c|^(2/e1))^(e1/2),
                 ///< `exponent` = {e1, e2} in [0.2, 1]: 1 is an ellipsoid, 0.2 nearly a box (Barr 1981)
  Directed,      ///< radius by direction: q = R^2 d^2 / r(n)^2, n = y/d, r(n) = sum_k r_k n_k^2 with r_k = size_k where
                 ///< n_k >= 0 and control[0]_k elsewhere: the support ends at these radii on the axes, smoothly between
};

struct Primitive {
  std::uint32_t part = 0;  ///< the part of the body that carries it
  ShapeKind shape = ShapeKind::Point;
  Vec3 size = Vec3::Zero();  ///< [m], by shape
  Pose offset;               ///< primitive frame -> part frame
  Kernel kernel;
  std::vector<Vec3> control;  ///< [m], own frame, by shape
  /// Segment, Curve: support radius at the end over that at the beginning, > 0, linear in the parameter t between them:
  /// q = min over t of |y - g(t)|^2 / (1 + (taper - 1) t)^2.
  double taper = 1.0;
  std::array<double, 2> exponent{1.0, 1.0};
  /// The field is stretched by these factors along the own axes, shape and support alike: f(y / stretch). An anisotropic
  /// metric for any shape.
  Vec3 stretch = Vec3::Ones();
  /// Segment, Triangle, Polygon, Ring, Arc with a kernel that convolves() and without taper: the kernel is integrated over the
  /// shape instead of taken at its nearest point, scaled so that a long straight line (a wide plane) is 1/2 at the distance
  /// where the kernel itself is. Shapes that share ends or edges join without a bulge.
  bool convolved = false;
};

/// Distance of a primitive's shape in the frame of the primitive.
struct ShapeSample {
  double q = 0.0;                ///< squared distance [m^2]
  Vec3 gradient = Vec3::Zero();  ///< grad q [m]
};
[[nodiscard]] ShapeSample evaluate(const Primitive& primitive, const Vec3& y) noexcept;
/// Second derivatives of q [1] where they exist; they jump where the foot point changes to another piece of the shape.
[[nodiscard]] Mat3 second_derivative(const Primitive& primitive, const Vec3& y) noexcept;

/// f of a single primitive in its own frame.
struct Potential {
  double value = 0.0;            ///< [1]
  Vec3 gradient = Vec3::Zero();  ///< [1/m]
};
[[nodiscard]] Potential potential(const Primitive& primitive, const Vec3& y) noexcept;

/// Largest |grad sqrt(q)|: 1 for plain shapes; more where stretch, taper or radii less than R bring level sets together.
[[nodiscard]] double distance_scale(const Primitive& primitive) noexcept;

/// Whether level sets are scaled copies of each other (q = R^2 u^2, u homogeneous) instead of offsets of a shape.
[[nodiscard]] inline bool scales(const Primitive& p) noexcept {
  return p.shape == ShapeKind::Ellipsoid || p.shape == ShapeKind::Superquadric || p.shape == ShapeKind::Directed;
}

/// Box of {f > 0}, own frame [m].
[[nodiscard]] Box support_box(const Primitive& primitive) noexcept;

/// All primitives of one body, sorted by part; const in a Scene.
struct Skeleton {
  std::vector<Primitive> primitive;
  std::uint32_t part_count = 0;
  double iso = 0.5;  ///< c: the body is {sum f >= c}
  Blend blend;       ///< combination of the parts, if not a sum
};

/// Whether the body is convex by construction: one primitive, offsets of a convex shape.
[[nodiscard]] bool has_convex_core(const Skeleton& skeleton) noexcept;
/// Whether all its level sets are convex by construction: those bodies, stretched ones and ellipsoids, too.
[[nodiscard]] bool has_convex_levels(const Skeleton& skeleton) noexcept;

/// Primitives in world axes; Frame data.
struct PlacedSkeleton {
  std::vector<Vec3> position;  ///< origin of the primitive [m], shape [primitives]
  std::vector<Mat3> rotation;  ///< primitive frame -> world, shape [primitives]; empty where `radius` is not
  std::vector<Box> support;    ///< box of {f_k > 0} [m], shape [primitives]
  // Of more than 64 unstretched points with Wyvill's kernel and nothing else, which need no rotation; else empty.
  std::vector<double> radius;       ///< R [m]
  std::vector<std::uint32_t> part;  ///< the part that carries it
};

/// Box of {f > 0} of a primitive placed in the world, enlarged by the round-off of f: outside it f is exactly zero.
[[nodiscard]] Box placed_support(const Primitive& primitive, const Vec3& position, const Mat3& rotation) noexcept;

/// Stage 2. @param parts  world poses of the body's parts, shape [part_count]
void place_skeleton(const Skeleton& skeleton, std::span<const Pose> parts, PlacedSkeleton& out);

/// Everything that a field of them depends on, to the bit.
void add_content(const Skeleton& skeleton, const PlacedSkeleton& placed, ContentWords& words);

}  // namespace supple::implicit
