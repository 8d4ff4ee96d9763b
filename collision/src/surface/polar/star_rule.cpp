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
#include "surface/polar/rim_curve.h"

namespace supple::collision {
namespace {

constexpr double kWalk = 0.25;    // longest step from the peak to the centre, over the radius of the patch
constexpr int kWalkSteps = 200;

}  // namespace

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
  levels_.kink.clear();
  levels_.all_kinks = pressure.kinks({frame_.origin - Vec3::Constant(reach), frame_.origin + Vec3::Constant(reach)}, levels_.kink);
  std::erase_if(levels_.kink, [&](const implicit::Kink& kink) { return std::abs(kink.value(frame_.origin)) > kink.change(frame_.origin, reach); });
}

/// Those of them that have points of rays to the rim on the other side than the centre; third bodies may all cross.
void PolarRuleSolver::cross_star(PairPressure& pressure) {
  levels_.crossing.clear();
  for (std::size_t k = 0; k < levels_.kink.size(); ++k) {
    if (!parts_at(levels_.kink[k])) continue;
    const bool side = levels_.kink[k].value(frame_.origin) > 0.0;
    const auto other = [&](const RimPoint& p) {
      const Vec3 reach = frame_.across(p.at);
      const double linear = rise_.dot(reach);
      for (const double share : {0.25, 0.5, 0.75, 1.0}) {
        const double height = share * linear + share * share * (p.height - linear);
        if ((levels_.kink[k].value(frame_.origin + share * reach + height * frame_.axis) > 0.0) != side) return true;
      }
      return false;
    };
    if (std::any_of(outline_.begin(), outline_.end(), other)) levels_.crossing.push_back(k);
  }
  for (std::size_t t = 0; t < levels_.third.size(); ++t) levels_.crossing.push_back(levels_.kink.size() + t);
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
  about_star_ = RimFollower(pressure, frame_, extent_).follow(fine, fine_rim_) && move_to_star(pressure);
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
