/// @file supple/implicit/skeleton.h
/// Skeleton primitives: the shapes whose distance field a kernel turns into a potential, each placed in the frame of
/// one part (particle) of its body.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/types.h"
#include "supple/implicit/kernel.h"

namespace supple::implicit {

/// Each shape in its own frame, with the meaning of `size`. q is the squared distance that the kernel sees.
enum class ShapeKind : std::uint8_t {
  Point,      ///< q = |y|^2
  Segment,    ///< from -size.x to +size.x along x
  Rectangle,  ///< |x| <= size.x, |y| <= size.y, z = 0: q = max(|x|-h_x,0)^2 + max(|y|-h_y,0)^2 + z^2
  Disc,       ///< radius size.x in z = 0
  Box,        ///< half sizes size; solid (q = 0 inside)
  Ellipsoid,  ///< support semi-axes size: q = R^2 |D^-1 y|^2, so f = 0 on the ellipsoid with these semi-axes
};

/// Foot-point distance of a shape in its own frame.
struct ShapeSample {
  double q = 0.0;            ///< squared distance [m^2]
  Vec3 gradient = Vec3::Zero();  ///< grad q [m], own frame
};
/// @param radius  kernel radius R [m]; only Ellipsoid uses it
[[nodiscard]] ShapeSample evaluate(ShapeKind shape, const Vec3& size, double radius, const Vec3& y) noexcept;

struct Primitive {
  std::uint32_t part = 0;  ///< which part of the body carries it
  ShapeKind shape = ShapeKind::Point;
  Vec3 size = Vec3::Zero();  ///< [m], by shape
  Pose offset;               ///< primitive frame -> part frame
  Kernel kernel;
};

/// All primitives of one body, sorted by part; const in a Scene.
struct Skeleton {
  std::vector<Primitive> primitive;
  std::uint32_t part_count = 0;
  double iso = 0.5;  ///< c: the body is {sum f >= c}
};

/// Primitives in world axes; Frame data.
struct PlacedSkeleton {
  std::vector<Vec3> position;  ///< origin of the primitive [m], shape [primitives]
  std::vector<Mat3> rotation;  ///< primitive frame -> world, shape [primitives]
  std::vector<Box> support;    ///< box of {f_k > 0} [m], shape [primitives]
};

/// Stage 2. @param parts  world poses of the body's parts, shape [part_count]
void place_skeleton(const Skeleton& skeleton, std::span<const Pose> parts, PlacedSkeleton& out);

}  // namespace supple::implicit
