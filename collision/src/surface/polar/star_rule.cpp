/// Polar quadrature of a patch that its peak does not see whole, or whose rim Newton's method misses from there: the rim, where
/// both pressures vanish, is followed all around, and rays begin at a point that all of it is seen from. Such points are the
/// kernel of the polygon that the rim is in the plane across the axis; the patch is star-shaped where there are some (Preparata &
/// Shamos 1985, sec. 7.2.6). The rest is that of patches that kinks cross.
#include <algorithm>
#include <array>
#include <cmath>

#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

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
bool PolarRuleSolver::move_to_rim(PairPressure& pressure, Vec3& x, Vec3& tangent, double step) {
  PressureBatch& batch = rim_batch_;
  batch.resize(1);
  for (int iteration = 0; iteration < kFreeSteps; ++iteration) {
    batch.point[0] = x;
    pressure.evaluate(batch);
    const Vec3 &a = batch.slope_a[0], &b = batch.slope_b[0];
    tangent = a.cross(b);
    const double square = tangent.squaredNorm();
    if (!(square > 0.0)) return false;
    const Vec3 move = (batch.b[0] * a - batch.a[0] * b).cross(tangent) / square;
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
bool PolarRuleSolver::walk_to_rim(PairPressure& pressure, const Vec3& along, double step, Vec3& x) {
  PressureBatch& batch = rim_batch_;
  batch.resize(1);
  const Vec3 axis = frame_.axis;
  Vec3 inside = frame_.origin, way = along;
  for (int iteration = 0; iteration < kWalkSteps; ++iteration) {
    x = inside + step * way;
    double p = 0.0;
    for (const int newton : {0, 1, 2}) {
      batch.point[0] = x;
      pressure.evaluate(batch);
      const Vec3 across = batch.slope_b[0] - batch.slope_a[0];
      const double rate = across.dot(axis);
      if (!(rate > kGraphCosine * across.norm())) return false;
      const double lift = (batch.a[0] - batch.b[0]) / rate;
      if (!(std::abs(lift) <= extent_)) return false;
      p = (batch.a[0] * batch.slope_b[0].dot(axis) - batch.b[0] * batch.slope_a[0].dot(axis)) / rate;
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

/// The rim as a polygon in `fine_rim_`, counterclockwise as u and v have it. @param fine  in steps that do not leap over the neck of a lobe
bool PolarRuleSolver::follow_rim_curve(PairPressure& pressure, bool fine) {
  const double radius = std::sqrt(2.0 * frame_.peak) * std::min(frame_.u.norm(), frame_.v.norm());
  Vec3 x, tangent;
  if (!walk_to_rim(pressure, frame_.v.normalized(), kWalk * radius, x)) return false;
  if (!move_to_rim(pressure, x, tangent, radius)) return false;
  fine_rim_.clear();
  const Vec3 first = x;
  double step = (fine ? kLongestFine : kWalk) * radius;
  bool left = false;  // far enough from the first point to come back to it
  for (;;) {
    fine_rim_.push_back(x);
    if (fine_rim_.size() > kMostPoints) return false;
    const double home = (x - first).norm();
    left = left || home > 2.0 * step;
    if (left && home <= 1.2 * step && tangent.dot(first - x) > 0.0) break;
    for (;;) {
      Vec3 next = x + step * tangent, there;
      const bool found = move_to_rim(pressure, next, there, step);
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
  if ((fine_rim_.back() - first).norm() < 0.3 * step) fine_rim_.pop_back();
  return true;
}

/// The centroid of the kernel of the polygon that the rim is across the axis. @return nothing where the kernel is empty
std::optional<Vec2> PolarRuleSolver::point_that_sees(std::span<const Vec2> polygon) {
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

/// Second derivatives of Sigma's height at the origin, by differences along its tangents. @param rate  that p_B - p_A rises at, along the axis
void PolarRuleSolver::bend_at_star(PairPressure& pressure, double rate) {
  constexpr double kStep = 1e-3;  // of the radius
  const std::array<Vec3, 2> tangent{frame_.u + rise_.dot(frame_.u) * frame_.axis, frame_.v + rise_.dot(frame_.v) * frame_.axis};
  PressureBatch& batch = rim_batch_;
  batch.resize(4);
  for (std::size_t i = 0; i < 4; ++i) batch.point[i] = frame_.origin + (i % 2 == 0 ? kStep : -kStep) * tangent[i / 2];
  pressure.evaluate(batch);
  const auto second = [&](std::size_t along, std::size_t across) {
    const std::size_t i = 2 * along;
    const Vec3 change = (batch.slope_a[i] - batch.slope_b[i]) - (batch.slope_a[i + 1] - batch.slope_b[i + 1]);
    return change.dot(tangent[across]) / (2.0 * kStep * rate);
  };
  frame_.height_uu = second(0, 0);
  frame_.height_uv = 0.5 * (second(0, 1) + second(1, 0));
  frame_.height_vv = second(1, 1);
}

/// The frame goes to a point that sees the rim, with axes in which the rim is as wide as it is long.
bool PolarRuleSolver::move_to_star(PairPressure& pressure) {
  const Vec3 along = frame_.u.normalized(), across = frame_.v.normalized();
  std::vector<Vec2> polygon;
  for (const Vec3& x : fine_rim_) polygon.emplace_back((x - frame_.origin).dot(along), (x - frame_.origin).dot(across));
  double area = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) area += 0.5 * cross(polygon[i], polygon[(i + 1) % polygon.size()]);
  if (area < 0.0) {
    std::reverse(polygon.begin(), polygon.end());
    std::reverse(fine_rim_.begin(), fine_rim_.end());
  }
  const std::optional<Vec2> centre = point_that_sees(polygon);
  if (!centre) return false;
  PolygonMoments moments;
  for (std::size_t i = 0; i < polygon.size(); ++i) moments.add_edge(polygon[i] - *centre, polygon[(i + 1) % polygon.size()] - *centre);
  const Eigen::Matrix2d second = moments.second / moments.area;
  const Principal axes = principal(second(0, 0), second(0, 1), second(1, 1));
  if (!(axes.second > 0.0)) return false;
  // From the peak to the centre in short steps on Sigma.
  Vec3 x = frame_.origin;
  PressureBatch& batch = rim_batch_;
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
    const double rate = slope.dot(frame_.axis);
    if (!(rate > kGraphCosine * slope.norm())) return false;
    x += (batch.a[0] - batch.b[0]) / rate * frame_.axis;
    p = std::min(batch.a[0], batch.b[0]);
  }
  if (!(p > 0.0)) return false;
  frame_.origin = x;
  // An ellipse has a quarter of the squares of its half axes as its second moments.
  frame_.u = 2.0 * std::sqrt(axes.first) * (axes.cosine * along + axes.sine * across);
  frame_.v = 2.0 * std::sqrt(axes.second) * (axes.cosine * across - axes.sine * along);
  jacobian_ = frame_.u.norm() * frame_.v.norm();
  const double rate = (batch.slope_b[0] - batch.slope_a[0]).dot(frame_.axis);
  rise_ = (batch.slope_a[0] - batch.slope_b[0]) / rate;
  bend_at_star(pressure, rate);
  outline_.clear();
  for (const Vec3& rim : fine_rim_) {
    const Vec3 d = rim - frame_.origin;
    outline_.push_back({frame_.parts_of(d), d.dot(frame_.axis), Vec2::Zero()});
  }
  return true;
}

/// The kinks that come as near to the frame's origin as the rim goes.
void PolarRuleSolver::find_star_kinks(PairPressure& pressure) {
  double square = 0.0;
  for (const Vec3& x : fine_rim_) square = std::max(square, (x - frame_.origin).squaredNorm());
  const double reach = kBeyondRim * std::sqrt(square);
  kinks_.clear();
  all_kinks_ = pressure.kinks({frame_.origin - Vec3::Constant(reach), frame_.origin + Vec3::Constant(reach)}, kinks_);
  std::erase_if(kinks_, [&](const implicit::Kink& kink) { return std::abs(kink.value(frame_.origin)) > kink.change(frame_.origin, reach); });
}

/// Those of them that have points of rays to the rim on the other side than the centre; third bodies may all cross.
void PolarRuleSolver::cross_star(PairPressure& pressure) {
  crossing_.clear();
  for (std::size_t k = 0; k < kinks_.size(); ++k) {
    if (!parts_at(kinks_[k])) continue;
    const bool side = kinks_[k].value(frame_.origin) > 0.0;
    const auto other = [&](const RimPoint& p) {
      const Vec3 reach = frame_.across(p.at);
      const double linear = rise_.dot(reach);
      for (const double share : {0.25, 0.5, 0.75, 1.0}) {
        const double height = share * linear + share * share * (p.height - linear);
        if ((kinks_[k].value(frame_.origin + share * reach + height * frame_.axis) > 0.0) != side) return true;
      }
      return false;
    };
    if (std::any_of(outline_.begin(), outline_.end(), other)) crossing_.push_back(k);
  }
  for (std::size_t t = 0; t < third_.size(); ++t) crossing_.push_back(kinks_.size() + t);
  find_imprints(pressure);
}

/// Radius and height of the outline in a direction, linear between its points.
std::array<double, 2> PolarRuleSolver::outline_at(double cosine, double sine) const {
  const Vec2 way(cosine, sine);
  const std::size_t n = outline_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const RimPoint &a = outline_[i], &b = outline_[(i + 1) % n];
    const double beyond = cross(a.at, way), before = cross(way, b.at);
    if (!(beyond >= 0.0) || !(before >= 0.0) || !(way.dot(a.at + b.at) > 0.0)) continue;
    const double share = beyond / (beyond + before);
    return {((1.0 - share) * a.at + share * b.at).norm(), (1.0 - share) * a.height + share * b.height};
  }
  return {0.0, 0.0};
}

/// @param frame  of the peak   @param fine  the steps along the rim   @return false where no point sees the whole rim
bool PolarRuleSolver::solve_about_star(const PolarJob& job, const PeakFrame& frame, bool fine, PatchPoints& points) {
  PairPressure& pressure = job.pressure;
  frame_ = frame;
  about_middle_ = false;
  about_star_ = follow_rim_curve(pressure, fine) && move_to_star(pressure);
  if (!about_star_) return false;
  find_star_kinks(pressure);
  cross_star(pressure);
  const bool fits = solve_split(pressure, job.settings);
  about_star_ = false;
  if (!fits) return false;
  polygon_ = outline_;
  return finish_parted(job, points);
}

}  // namespace supple::collision
