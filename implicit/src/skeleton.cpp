#include "supple/implicit/skeleton.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"

namespace supple::implicit {
namespace {

/// max(|x| - h, 0) with the sign of x.
double outside(double x, double h) noexcept { return std::copysign(std::max(std::abs(x) - h, 0.0), x); }

/// Half extents [m] along the axes of the primitive's frame of its shape without the kernel's rounding.
Vec3 half_extent(const Primitive& primitive) noexcept {
  const Vec3& s = primitive.size;
  switch (primitive.shape) {
    case ShapeKind::Point: return Vec3::Zero();
    case ShapeKind::Segment: return {s.x(), 0.0, 0.0};
    case ShapeKind::Rectangle: return {s.x(), s.y(), 0.0};
    case ShapeKind::Disc: return {s.x(), s.x(), 0.0};
    case ShapeKind::Box:
    case ShapeKind::Ellipsoid: return s;
  }
  return s;
}

}  // namespace

ShapeSample evaluate(ShapeKind shape, const Vec3& size, double radius, const Vec3& y) noexcept {
  Vec3 v = y;  // from the foot point to y
  switch (shape) {
    case ShapeKind::Point: break;
    case ShapeKind::Segment: v.x() = outside(y.x(), size.x()); break;
    case ShapeKind::Rectangle:
      v.x() = outside(y.x(), size.x());
      v.y() = outside(y.y(), size.y());
      break;
    case ShapeKind::Box:
      for (int k = 0; k < 3; ++k) v[k] = outside(y[k], size[k]);
      break;
    case ShapeKind::Disc: {
      const double rho = std::sqrt(y.x() * y.x() + y.y() * y.y());
      const double share = rho > size.x() ? (rho - size.x()) / rho : 0.0;
      v.x() *= share;
      v.y() *= share;
      break;
    }
    case ShapeKind::Ellipsoid: {
      const Vec3 u = y.cwiseQuotient(size);
      return {.q = radius * radius * u.squaredNorm(), .gradient = 2.0 * radius * radius * u.cwiseQuotient(size)};
    }
  }
  return {.q = v.squaredNorm(), .gradient = 2.0 * v};
}

void place_skeleton(const Skeleton& skeleton, std::span<const Pose> parts, PlacedSkeleton& out) {
  SUPPLE_EXPECTS(parts.size() == skeleton.part_count);
  const std::size_t n = skeleton.primitive.size();
  out.position.resize(n);
  out.rotation.resize(n);
  out.support.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Primitive& primitive = skeleton.primitive[i];
    SUPPLE_EXPECTS(primitive.part < parts.size());
    SUPPLE_EXPECTS(primitive.kernel.radius > 0.0);
    SUPPLE_EXPECTS(primitive.shape != ShapeKind::Ellipsoid || (primitive.size.array() > 0.0).all());
    const Pose& part = parts[primitive.part];
    const Vec3 position = part.to_world(primitive.offset.position);
    const Mat3 rotation = part.orientation.toRotationMatrix() * primitive.offset.orientation.toRotationMatrix();
    out.position[i] = position;
    out.rotation[i] = rotation;
    const Vec3 half = half_extent(primitive);
    const double R = primitive.kernel.radius;
    Vec3 reach;
    if (primitive.shape == ShapeKind::Ellipsoid) {
      reach = (rotation * half.asDiagonal()).rowwise().norm();
    } else if (primitive.shape == ShapeKind::Disc) {
      // A disc reaches r sqrt(1 - n_k^2) = r |(t1_k, t2_k)| along world axis k.
      reach = rotation.leftCols<2>().rowwise().norm() * half.x() + Vec3::Constant(R);
    } else {
      reach = rotation.cwiseAbs() * half + Vec3::Constant(R);
    }
    // Wider than f's round-off, so that what lies outside is exactly zero.
    reach += Vec3::Constant(1e-12 * reach.maxCoeff()) + 1e-15 * position.cwiseAbs();
    out.support[i] = {position - reach, position + reach};
  }
}

}  // namespace supple::implicit
