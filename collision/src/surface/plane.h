/// @file plane.h
/// Directions, lines and polygons in a plane.
#pragma once

#include "supple/core/types.h"

namespace supple::collision {

using Vec2 = Eigen::Vector2d;

/// Positive where b lies to the left of a.
inline double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// By angle in [0, 2 pi) without a trigonometric function.
inline bool before(const Vec2& a, const Vec2& b) {
  const auto lower = [](const Vec2& x) { return x.y() < 0.0 || (x.y() == 0.0 && x.x() < 0.0); };
  if (lower(a) != lower(b)) return lower(b);
  return cross(a, b) > 0.0;
}

/// The place x where a . x = p and b . x = q; not finite where a and b are parallel.
inline Vec2 meeting_of(const Vec2& a, double p, const Vec2& b, double q) { return Vec2(p * b.y() - q * a.y(), a.x() * q - b.x() * p) / cross(a, b); }

/// Area of a polygon about the origin and its moments, from its edges counterclockwise.
struct PolygonMoments {
  double area = 0.0;
  Vec2 first = Vec2::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();

  void add_edge(const Vec2& p, const Vec2& q) {
    const double half = 0.5 * cross(p, q);
    const Vec2 sum = p + q;
    area += half;
    first += half / 3.0 * sum;
    second += half / 12.0 * (p * p.transpose() + q * q.transpose() + sum * sum.transpose());
  }
};

}  // namespace supple::collision
