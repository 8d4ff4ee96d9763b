#include "surface/polar/rim_curve.h"

#include <algorithm>
#include <array>
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

namespace {

/// Second derivatives of Sigma's height at the origin, by differences along its tangents. @param rate  that p_B - p_A rises at, along the axis
void bend_at(PairPressure& pressure, double rate, Star& star) {
  PeakFrame& frame = star.frame;
  constexpr double kStep = 1e-3;  // of the radius
  const std::array<Vec3, 2> tangent{frame.u + star.rise.dot(frame.u) * frame.axis, frame.v + star.rise.dot(frame.v) * frame.axis};
  PressureBatch batch;
  batch.resize(4);
  for (std::size_t i = 0; i < 4; ++i) batch.point[i] = frame.origin + (i % 2 == 0 ? kStep : -kStep) * tangent[i / 2];
  pressure.evaluate(batch);
  const auto second = [&](std::size_t along, std::size_t across) {
    const std::size_t i = 2 * along;
    const Vec3 change = (batch.slope_a[i] - batch.slope_b[i]) - (batch.slope_a[i + 1] - batch.slope_b[i + 1]);
    return change.dot(tangent[across]) / (2.0 * kStep * rate);
  };
  frame.height_uu = second(0, 0);
  frame.height_uv = 0.5 * (second(0, 1) + second(1, 0));
  frame.height_vv = second(1, 1);
}

/// The frame of a star goes to a point that sees its rim, with axes in which the rim is as wide as it is long. @return whether there is one
bool move_to_centre(PairPressure& pressure, Star& star) {
  PeakFrame& frame = star.frame;
  const Vec3 along = frame.u.normalized(), across = frame.v.normalized();
  std::vector<Vec2> polygon;
  for (const Vec3& x : star.rim) polygon.emplace_back((x - frame.origin).dot(along), (x - frame.origin).dot(across));
  double area = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) area += 0.5 * cross(polygon[i], polygon[(i + 1) % polygon.size()]);
  if (area < 0.0) {
    std::reverse(polygon.begin(), polygon.end());
    std::reverse(star.rim.begin(), star.rim.end());
  }
  const std::optional<Vec2> centre = point_that_sees(polygon);
  if (!centre) return false;
  PolygonMoments moments;
  for (std::size_t i = 0; i < polygon.size(); ++i) moments.add_edge(polygon[i] - *centre, polygon[(i + 1) % polygon.size()] - *centre);
  const Eigen::Matrix2d second = moments.second / moments.area;
  const Principal axes = principal(second(0, 0), second(0, 1), second(1, 1));
  if (!(axes.second > 0.0)) return false;
  // From the peak to the centre in short steps on Sigma.
  Vec3 x = frame.origin;
  PressureBatch batch;
  batch.resize(1);
  const Vec3 way = centre->x() * along + centre->y() * across;
  const int steps = 1 + static_cast<int>(way.norm() / (kWalk * std::sqrt(axes.second)));
  if (steps > kWalkSteps) return false;
  double p = 0.0;
  for (int step = 0; step < steps + kFreeSteps; ++step) {
    if (step < steps) x += way / steps;
    batch.point[0] = x;
    pressure.evaluate(batch);
    const Vec3 slope = batch.slope_b[0] - batch.slope_a[0];
    const double rate = slope.dot(frame.axis);
    if (!(rate > kGraphCosine * slope.norm())) return false;
    x += (batch.a[0] - batch.b[0]) / rate * frame.axis;
    p = std::min(batch.a[0], batch.b[0]);
  }
  if (!(p > 0.0)) return false;
  frame.origin = x;
  // An ellipse has a quarter of the squares of its half axes as its second moments.
  frame.u = 2.0 * std::sqrt(axes.first) * (axes.cosine * along + axes.sine * across);
  frame.v = 2.0 * std::sqrt(axes.second) * (axes.cosine * across - axes.sine * along);
  const double rate = (batch.slope_b[0] - batch.slope_a[0]).dot(frame.axis);
  star.rise = (batch.slope_a[0] - batch.slope_b[0]) / rate;
  bend_at(pressure, rate, star);
  for (const Vec3& rim : star.rim) {
    const Vec3 d = rim - frame.origin;
    star.outline.push_back({frame.parts_of(d), d.dot(frame.axis), Vec2::Zero()});
  }
  return true;
}

}  // namespace

std::optional<Star> find_star(PairPressure& pressure, const PeakFrame& peak, double extent, bool fine) {
  Star star;
  star.frame = peak;
  if (!RimFollower(pressure, peak, extent).follow(fine, star.rim) || !move_to_centre(pressure, star)) return std::nullopt;
  return star;
}

/// Radius and height of the outline in a direction, linear between its points.
std::array<double, 2> Star::outline_at(double cosine, double sine) const {
  const Vec2 way(cosine, sine);
  const std::size_t n = outline.size();
  for (std::size_t i = 0; i < n; ++i) {
    const RimPoint &a = outline[i], &b = outline[(i + 1) % n];
    const double beyond = cross(a.at, way), before = cross(way, b.at);
    if (!(beyond >= 0.0) || !(before >= 0.0) || !(way.dot(a.at + b.at) > 0.0)) continue;
    const double share = beyond / (beyond + before);
    return {((1.0 - share) * a.at + share * b.at).norm(), (1.0 - share) * a.height + share * b.height};
  }
  return {0.0, 0.0};
}

}  // namespace supple::collision
