#include "bounds/shape_curvature.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "supple/core/math.h"

namespace supple::implicit {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr CurvatureRange kUnknown{-kInfinity, kInfinity};

/// How shapes change the range of the kernel, whose lower end is at most 0 and whose upper end is at least 0.
struct Bend {
  double lower = 1.0;  ///< H is at least this times the lower end,
  double upper = 1.0;  ///< at most this times the upper end,
  double rise = 0.0;   ///< and this times minus the lower end more
  [[nodiscard]] CurvatureRange of(const CurvatureRange& kernel) const noexcept {
    return {lower * kernel.lower, upper * kernel.upper - rise * kernel.lower};
  }
};

/// Circles: Q has 1, 1 and, around the axis, 1 - r / rho.
CurvatureRange circle_curvature(const ShapeView& shape, const ShapeBall& ball, const CurvatureRange& kernel) noexcept {
  const Vec3& y = ball.centre;
  const double rho = y.head<2>().norm() - ball.reach;
  if (!(rho > 0.0)) return kUnknown;
  // Opposite to its middle an arc's nearest point steps from one end to the other.
  if (shape.kind == ShapeKind::Arc && y.x() <= ball.reach && std::abs(y.y()) <= ball.reach) return kUnknown;
  const double around = std::min(1.0 - shape.size.x() / rho, 0.0);
  return around < 0.0 ? Bend{.rise = -around}.of(kernel) : kernel;
}

/// Curves g(t) and segments of width w(t), k = w', nearest point in between: w^2 Q = I - B m m^T with a unit vector m,
/// B = 1 / (1 - gap.g'' / |g'|^2 - s^2) and s = |k| d / |g'|, and m.n = s. So w^2 H is the kernel's plus
/// -(g'/d) B m m^T, and of -(g'/d) (B m m^T - 1 + n n^T) only the larger eigenvalue raises the upper end.
/// @param bend  largest gap.g'' / |g'|^2  @param slant  largest s  @param width  least w
CurvatureRange swept_curvature(double bend, double slant, double width, const CurvatureRange& kernel) noexcept {
  const double left = 1.0 - std::max(bend, 0.0) - slant * slant;
  if (!(left > 0.0)) return kUnknown;
  const double b = 1.0 / left, half = 0.5 * (b - 1.0);
  const double scale = 1.0 / (width * width);
  return Bend{.lower = scale, .upper = scale, .rise = scale * (half + std::sqrt(half * half + b * slant * slant))}.of(kernel);
}

/// In between d is the sine of the angle at the tip of a cone over kappa = |w'|, where the ends are spheres.
CurvatureRange tapered_curvature(const ShapeView& shape, const ShapeBall& ball, const CurvatureRange& kernel) noexcept {
  const double kappa = std::abs(shape.taper - 1.0) / (2.0 * shape.size.x()), least = std::min(1.0, shape.taper);
  const FootSample sample = foot(shape, ball.centre);
  double width = least;
  if (sample.q > 0.0) {
    // |grad d| = 1 / w, and the foot point moves at most 1 / (1 - s^2) times as far as y.
    const double here = std::sqrt(sample.q), slant = kappa * (here + ball.reach / least);
    if (slant < 1.0) width = std::max(here / sample.half_gradient.norm() - kappa * ball.reach / (1.0 - slant * slant), least);
  }
  return swept_curvature(0.0, kappa * ball.far, width * (1.0 - 1e-12), kernel);
}

/// The part [low, high] of a curve where the nearest points of a ball are.
class NearestPart {
 public:
  double low, high;

  NearestPart(const ShapeView& shape, const ShapeBall& ball) noexcept
      : low(nearest_on_curve(shape, ball.centre)), high(low), shape_(shape), ball_(ball), widening_(shape.taper - 1.0),
        second_(std::max(bezier(shape.control, 0.0).second.norm(), bezier(shape.control, 1.0).second.norm())),
        width_(width(low)), gap_(ball.centre - bezier(shape.control, low).point) {
    search(0.0, 1.0);
  }
  [[nodiscard]] double width(double t) const noexcept { return 1.0 + widening_ * t; }
  /// Largest |g''|.
  [[nodiscard]] double second() const noexcept { return second_; }

 private:
  void search(double from, double to) noexcept {
    if (from >= low && to <= high) return;
    const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
    const BezierPoint p = bezier(shape_.control, middle);
    const double length = half * (p.first.norm() + half * second_);
    if (!may_be_nearest(ball_.centre - p.point, length, std::max(width(from), width(to)))) return;
    constexpr double kLeast = 1.0 / 2048.0;
    if (half < kLeast || length < 0.05 * ball_.reach) {
      low = std::min(low, from);
      high = std::max(high, to);
      return;
    }
    search(from, middle);
    search(middle, to);
  }
  /// Whether some point of the ball may be nearer, by widths, to a point within `length` of centre - gap than to the nearest point of the centre.
  [[nodiscard]] bool may_be_nearest(const Vec3& gap, double length, double width) const noexcept {
    const double own2 = width_ * width_, other2 = width * width, reach = ball_.reach;
    const double apart = std::max(gap.norm() - length, 0.0);
    const double further = own2 * apart * apart - other2 * gap_.squaredNorm();
    const double gain = 2.0 * reach * ((own2 * gap - other2 * gap_).norm() + own2 * length) + std::max(other2 - own2, 0.0) * reach * reach;
    return further <= gain + 1e-12 * (own2 * gap.squaredNorm() + other2 * gap_.squaredNorm());
  }

  const ShapeView& shape_;
  const ShapeBall& ball_;
  double widening_, second_, width_;
  Vec3 gap_;
};

CurvatureRange curve_curvature(const ShapeView& shape, const ShapeBall& ball, const CurvatureRange& kernel) noexcept {
  const NearestPart part(shape, ball);
  const double width = std::min(part.width(part.low), part.width(part.high)), widening = std::abs(shape.taper - 1.0);
  const double third = (bezier(shape.control, 1.0).second - bezier(shape.control, 0.0).second).norm();
  constexpr int kPieces = 16;
  const double half = 0.5 * (part.high - part.low) / kPieces;
  double bend = 0.0, slant = 0.0;
  for (int i = 0; i < kPieces; ++i) {
    const BezierPoint p = bezier(shape.control, part.low + (2 * i + 1) * half);
    const Vec3 gap = ball.centre - p.point;
    const double least = p.first.norm() - half * part.second(), change = half * third;  // of |g'|, and of g''
    if (!(least > 0.0)) return kUnknown;
    const double moved = ball.reach + half * (p.first.norm() + half * part.second());  // of the gap
    const double along = gap.dot(p.second) + moved * (p.second.norm() + change) + gap.norm() * change;
    bend = std::max(bend, along / (least * least));
    slant = std::max(slant, widening * ball.far / least);
    // Where this holds on all of the part, each point of the ball has one nearest point there.
    if (!(1.0 - bend - widening * (gap.norm() + moved) / (width * least) > 0.0)) return kUnknown;
  }
  return swept_curvature(bend, slant, width * (1.0 - 1e-12), kernel);
}

/// d is a convex norm: Q >= grad d grad d^T. In the axes scaled by the sizes and where the largest coordinate is 1, W >= 1 and
/// R^-2 Q <= W^(2/n - 1) D, D the positive part of the second derivatives of W over n (superquadric() in shapes.cpp).
CurvatureRange superquadric_curvature(const ShapeView& shape, const CurvatureRange& kernel) noexcept {
  const double n = 2.0 / shape.pair[0], m = 2.0 / shape.pair[1];
  const double across = (std::max(n - m, 0.0) + m - 1.0) * math::pow(2.0, (n - 2.0) / m);
  const double steepest = shape.radius / shape.size.minCoeff(), scale = steepest * steepest * (1.0 + 1e-12);
  return Bend{.lower = scale * std::max({across, n - 1.0, 1.0}), .upper = scale}.of(kernel);
}

/// With p the part across y of 2 r n / rho, at most (b - 1)^2 / b long (squared; b the largest radius over the least), and E = diag(r) / rho:
/// (rho / R)^2 Q = 3 (I + p p^T) - 2 E, and grad d = (R / rho) (n - p).
CurvatureRange directed_curvature(const ShapeView& shape, const ShapeBall& ball, const CurvatureRange& kernel) noexcept {
  const double least = std::min(shape.size.minCoeff(), shape.control[0].minCoeff());
  const double most = std::max(shape.size.maxCoeff(), shape.control[0].maxCoeff());
  double shortest = least, longest = most;  // radius in the directions of the ball
  const double away = ball.centre.norm();
  if (ball.reach < 0.5 * away) {
    const double sine = ball.reach / away, angle = sine * (1.0 + 0.2 * sine * sine);  // asin t <= t (1 + t^2 / 5) up to 1/2
    const Vec3 n = ball.centre / away;
    double here = 0.0;
    for (int k = 0; k < 3; ++k) here += (n[k] >= 0.0 ? shape.size[k] : shape.control[0][k]) * n[k] * n[k];
    const double change = (most - least) * (angle + 1e-12);
    shortest = std::max(least, here - change);
    longest = std::min(most, here + change);
  }
  const double p2 = (most - least) * (most - least) / (most * least), scale = shape.radius * shape.radius / (shortest * shortest) * (1.0 + 1e-12);
  const double largest = 3.0 * (1.0 + p2) - 2.0 * least / longest;                    // of Q
  const double across = 3.0 - 2.0 * most / shortest - (1.0 + p2);                     // least of Q - grad d grad d^T
  return Bend{.lower = scale * std::max(largest, 1.0 + p2), .upper = scale * (1.0 + p2), .rise = scale * std::max(-across, 0.0)}.of(kernel);
}

}  // namespace

CurvatureRange shape_curvature(const ShapeView& shape, const ShapeBall& ball, const CurvatureRange& kernel) noexcept {
  switch (shape.kind) {
    case ShapeKind::Ring:
    case ShapeKind::Arc: return circle_curvature(shape, ball, kernel);
    case ShapeKind::Segment: return shape.taper == 1.0 ? kernel : tapered_curvature(shape, ball, kernel);
    case ShapeKind::Curve: return curve_curvature(shape, ball, kernel);
    case ShapeKind::Superquadric: return superquadric_curvature(shape, kernel);
    case ShapeKind::Directed: return directed_curvature(shape, ball, kernel);
    default: return kernel;  // distances to convex sets: Q lies between grad d grad d^T and 1
  }
}

NearestCurvePoints nearest_curve_points(const ShapeView& shape, const ShapeBall& ball) noexcept {
  const NearestPart part(shape, ball);
  const double first = part.width(part.low), last = part.width(part.high);
  NearestCurvePoints nearest{.hull = {}, .count = shape.control.size(), .least_width = std::min(first, last), .largest_width = std::max(first, last)};
  // The blossom of the curve at k times `high` and else `low` is control point k of the part.
  for (std::size_t k = 0; k < nearest.count; ++k) {
    std::array<Vec3, 4> p;
    std::copy(shape.control.begin(), shape.control.end(), p.begin());
    for (std::size_t step = 1; step < nearest.count; ++step) {
      const double t = step <= k ? part.high : part.low;
      for (std::size_t i = 0; i + step < nearest.count; ++i) p[i] += t * (p[i + 1] - p[i]);
    }
    nearest.hull[k] = p[0];
  }
  return nearest;
}

}  // namespace supple::implicit
