#include "surface/polar/rim_curve.h"

#include <algorithm>
#include <cmath>

#include "surface/accuracy.h"

namespace supple::collision {
namespace {

constexpr double kWalk = 0.25;          // first step to the rim, in radii of the peak
constexpr int kWalkSteps = 200;
constexpr std::size_t kMostPoints = 400;
constexpr double kLongest = 0.5, kLongestFine = 0.1, kShortest = 1e-3;  // steps along the rim, in radii
constexpr double kMostTurn = 0.35, kLittleTurn = 0.15;  // of the rim within a step [rad]
constexpr double kClose = 1e-3;         // of Newton's method at the rim, in steps
constexpr double kLeastClearance = 0.01;    // distance of the centre from all tangents of the rim, over the radius of the patch

}  // namespace

/// Newton's method for p_A = p_B = 0 from x, across the curve where both vanish. @param tangent  of it [unit], counterclockwise as u and v have it
/// @return whether it ended there
bool RimFollower::move_to_rim(Vec3& x, Vec3& tangent, double step) {
  for (int iteration = 0; iteration < kFreeSteps; ++iteration) {
    batch_.point[0] = x;
    pressure_.evaluate(batch_);
    const Vec3 &a = batch_.slope_a[0], &b = batch_.slope_b[0];
    tangent = a.cross(b);
    const double square = tangent.squaredNorm();
    if (!(square > 0.0)) return false;
    const Vec3 move = (batch_.b[0] * a - batch_.a[0] * b).cross(tangent) / square;
    const double length = move.norm();
    if (!(length <= 2.0 * step)) return false;
    x += move;
    if (length <= kClose * step) {
      tangent /= std::copysign(std::sqrt(square), frame_.u.cross(frame_.v).dot(frame_.axis));
      return true;
    }
  }
  return false;
}

/// A point of the rim, along a ray on Sigma from the origin of the frame.
bool RimFollower::walk_to_rim(const Vec3& along, double step, Vec3& x) {
  const Vec3 axis = frame_.axis;
  Vec3 inside = frame_.origin, way = along;
  for (int iteration = 0; iteration < kWalkSteps; ++iteration) {
    x = inside + step * way;
    double p = 0.0;
    for (const int newton : {0, 1, 2}) {
      batch_.point[0] = x;
      pressure_.evaluate(batch_);
      const Vec3 across = batch_.slope_b[0] - batch_.slope_a[0];
      const double rate = across.dot(axis);
      if (!(rate > kGraphCosine * across.norm())) return false;
      const double lift = (batch_.a[0] - batch_.b[0]) / rate;
      if (!(std::abs(lift) <= extent_)) return false;
      p = (batch_.a[0] * batch_.slope_b[0].dot(axis) - batch_.b[0] * batch_.slope_a[0].dot(axis)) / rate;
      if (newton < 2) x += lift * axis;
    }
    if (p <= 0.0) return true;
    way = (x - inside) / step;
    way = along + way.dot(axis) * axis;
    inside = x;
    if ((x - frame_.origin).norm() > extent_) return false;
  }
  return false;
}

bool RimFollower::follow(bool fine, std::vector<Vec3>& rim) {
  const double radius = std::sqrt(2.0 * frame_.peak) * std::min(frame_.u.norm(), frame_.v.norm());
  Vec3 x, tangent;
  if (!walk_to_rim(frame_.v.normalized(), kWalk * radius, x)) return false;
  if (!move_to_rim(x, tangent, radius)) return false;
  rim.clear();
  const Vec3 first = x;
  double step = (fine ? kLongestFine : kWalk) * radius;
  bool left = false;  // far enough from the first point to come back to it
  for (;;) {
    rim.push_back(x);
    if (rim.size() > kMostPoints) return false;
    const double home = (x - first).norm();
    left = left || home > 2.0 * step;
    if (left && home <= 1.2 * step && tangent.dot(first - x) > 0.0) break;
    for (;;) {
      Vec3 next = x + step * tangent, there;
      const bool found = move_to_rim(next, there, step);
      const double turn = found ? (there - tangent).norm() : 2.0;
      if (turn <= kMostTurn && (next - x).dot(tangent) > 0.5 * step) {
        x = next;
        tangent = there;
        if (turn < kLittleTurn) step = std::min(2.0 * step, (fine ? kLongestFine : kLongest) * radius);
        break;
      }
      step *= 0.5;
      if (step < kShortest * radius) return false;
    }
    if ((x - frame_.origin).norm() > extent_) return false;
  }
  if ((rim.back() - first).norm() < 0.3 * step) rim.pop_back();
  return true;
}

std::optional<Vec2> point_that_sees(std::span<const Vec2> polygon) {
  Vec2 low = polygon.front(), high = low;
  for (const Vec2& x : polygon) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  std::vector<Vec2> kernel{low, {high.x(), low.y()}, high, {low.x(), high.y()}}, kept;
  const std::size_t n = polygon.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2 &a = polygon[i], edge = polygon[(i + 1) % n] - a;
    kept.clear();
    const double at_first = cross(edge, kernel.front() - a);
    double at_p = at_first;
    for (std::size_t k = 0; k < kernel.size(); ++k) {
      const bool last = k + 1 == kernel.size();
      const Vec2 &p = kernel[k], &q = last ? kernel.front() : kernel[k + 1];
      const double at_q = last ? at_first : cross(edge, q - a);
      if (at_p >= 0.0) kept.push_back(p);
      if ((at_p >= 0.0) != (at_q >= 0.0)) kept.push_back(p + at_p / (at_p - at_q) * (q - p));
      at_p = at_q;
    }
    kernel.swap(kept);
    if (kernel.size() < 3) return std::nullopt;
  }
  double area = 0.0;
  Vec2 first = Vec2::Zero();
  for (std::size_t k = 1; k + 1 < kernel.size(); ++k) {
    const double half = 0.5 * cross(kernel[k] - kernel[0], kernel[k + 1] - kernel[0]);
    area += half;
    first += half / 3.0 * (kernel[0] + kernel[k] + kernel[k + 1]);
  }
  if (!(area > 0.0)) return std::nullopt;
  const Vec2 centre = first / area;
  const double least = kLeastClearance * (high - low).norm();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2 edge = polygon[(i + 1) % n] - polygon[i];
    if (!(cross(edge, centre - polygon[i]) > least * edge.norm())) return std::nullopt;
  }
  return centre;
}

}  // namespace supple::collision
