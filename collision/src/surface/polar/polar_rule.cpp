#include "surface/polar/polar_rule.h"

#include <cmath>
#include <numeric>

#include "numbers.h"
#include "supple/core/interrupt.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

constexpr double kSafety = 5.0;          // a smooth patch needs none; at kinks two rules may agree by chance
constexpr double kOfLast = 0.3;          // of the estimate of the rule before: the next may agree with it by chance
constexpr double kOfLastWhereSmooth = 1e-3;
// What a kink near the rim can do between the nodes of the two coarsest rules of a pair of them.
constexpr double kUnseenAtFirst = 3e-3, kUnseen = 5e-5;
constexpr double kSplitBelow = 5e-3;  // errors for which kinks matter
constexpr std::size_t kMostCoarse = 3;   // the finest rule for others
constexpr double kSafetyAtFirst = 3.0;   // of two rules so coarse, the finer one is a hundred times better on a smooth patch
constexpr double kSafetyAcross = 2.0;    // where kinks are not parted rules converge by powers: what both differ by is not much above what the finer one is off by
constexpr double kNearRim = 10.0;        // pressure over the peak, by the step over the radius, where Newton's last step to the rim begins: on smooth patches it is 2
constexpr double kNearRimOfFace = 1.0;   // beside whose edges the slope grows from little to much
constexpr double kBelowRim = 0.05;       // over the peak
constexpr int kFreeRimSteps = 10;
constexpr int kHeightSteps = 14;

/// What tells whether a rule is enough where no kink is near: the forces of two may agree by chance, as their errors change sign with depth; then the spread of
/// the pressure, which converges later, does not.
double error_where_smooth(const PatchSums& fine, const PatchSums& coarse) {
  constexpr double kLater = 0.04;  // of what spreads differ by: about so much less forces do
  return error_of_finer(std::max(relative_difference(fine, coarse), kLater * std::abs(fine.spread - coarse.spread) / fine.spread));
}

/// The same where kinks may cross the patch, unseen by either rule.
double error_at_kinks(std::size_t r, const PatchSums& fine, const PatchSums& coarse) {
  const double difference = relative_difference(fine, coarse);
  return r == 1 ? kSafetyAtFirst * difference + kUnseenAtFirst : kSafety * difference + (r == 2 ? kUnseen : 0.0);
}

/// The coarsest rule that is asked: fine errors do not ask the coarsest ones of all.
std::size_t first_rule(double error, bool smooth) {
  if (smooth) return error < 1e-7 ? 2 : error < 1e-3 ? 1 : 0;
  return error < 1e-6 ? 3 : error < 1e-5 ? 2 : error < kSplitBelow ? 1 : 0;
}

}  // namespace

void PolarRuleSolver::start_rim(const PolarRule& rule, bool first) {
  const auto n = static_cast<std::size_t>(rule.angular);
  if (!first) {
    coarse_radius_.swap(rim_.radius);
    coarse_height_.swap(rim_.height);
  }
  rim_.cosine = rule.cosine;
  rim_.sine = rule.sine;
  rim_.radius.resize(n);
  rim_.height.resize(n);
  const std::size_t coarse = coarse_radius_.size();
  for (std::size_t k = 0; k < n; ++k) {
    if (first) {
      const double c = rule.cosine[k], s = rule.sine[k];
      rim_.radius[k] = std::sqrt(2.0 * frame_.peak);
      rim_.height[k] = frame_.peak * (frame_.height_uu * c * c + 2.0 * frame_.height_uv * c * s + frame_.height_vv * s * s);
      continue;
    }
    double radius = 0.0, height = 0.0;
    const double* row = rule.from_coarser.data() + k * coarse;
    for (std::size_t j = 0; j < coarse; ++j) {
      radius += row[j] * coarse_radius_[j];
      height += row[j] * coarse_height_[j];
    }
    rim_.radius[k] = radius;
    rim_.height[k] = height;
  }
}

void PolarRuleSolver::start_rim_search(Rays& rays) {
  const std::size_t n = rays.size();
  rim_batch_.resize(n);
  rays.outward.resize(n);
  low_.assign(n, 0.0);
  high_.assign(n, kInfinity);
  open_.resize(n);
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  rim_error_ = 0.0;
}

bool PolarRuleSolver::solve_rim(PairPressure& pressure, Rays& rays, double error) {
  start_rim_search(rays);
  // A step that small leaves an error of its square; p vanishes at the rim, so the force feels the fourth power.
  const double enough = std::min(1e-3, 0.1 * std::sqrt(error));
  // Beside the edge of a face, where the pressure falls over a small part of the radius, the last step has to be small against that part.
  const double low_enough = (about_middle_ ? kNearRimOfFace : kNearRim) * enough * frame_.peak;
  const Vec3 origin = frame_.origin, axis = frame_.axis, u = frame_.u, v = frame_.v;  // copies, which stay in registers
  const double thickness = frame_.thickness;
  const auto place = [&](std::size_t k) {
    const Vec3 e = rays.cosine[k] * u + rays.sine[k] * v;
    rim_batch_.point[k] = origin + rays.radius[k] * e + rays.height[k] * axis;
  };
  for (int iteration = 0; iteration < kBracketSteps && !open_.empty(); ++iteration) {
    heed_scope();
    for (const std::size_t k : open_) place(k);
    pressure.evaluate(rim_batch_, open_, some_);
    std::size_t left = 0;
    for (const std::size_t k : open_) {
      const Vec3 e = rays.cosine[k] * u + rays.sine[k] * v;
      const AlongAxis sigma(rim_batch_.slope_a[k], rim_batch_.slope_b[k], axis);
      if (!sigma.upright(kGraphCosine)) return false;
      const double a = rim_batch_.a[k], b = rim_batch_.b[k], on_sigma = sigma.pressure(a, b), along = sigma.slope(e);
      double& radius = rays.radius[k];
      // Newton's first steps may stray from Sigma, where the sign of on_sigma says little: they set no bracket.
      if (iteration >= kFreeRimSteps) (on_sigma > 0.0 ? low_[k] : high_[k]) = radius;
      double next = along < 0.0 ? radius - on_sigma / along : 2.0 * radius;
      next = std::clamp(next, 0.4 * radius, 2.0 * radius);
      const bool near = (next - radius) * (next - radius) <= enough * enough * radius * radius && std::abs(on_sigma) <= low_enough;
      if (!near && (!(next > low_[k]) || !(next < high_[k]))) {
        next = std::isfinite(high_[k]) ? 0.5 * (low_[k] + high_[k]) : 1.5 * radius;
      }
      const double step = next - radius;
      const double lift = ((a - b) + (sigma.slope_a.dot(e) - sigma.slope_b.dot(e)) * step) / sigma.rate;
      const bool settled = std::abs(lift) <= enough * std::max(thickness, std::abs(rays.height[k]));
      const bool smooth = !near || !settled || !about_middle_ || std::abs(step) <= enough * enough * radius ||
                          same_side(rim_batch_.point[k], rim_batch_.point[k] + step * e + lift * axis);
      if (near && settled && smooth) {
        if (!columns_.reach_rim(frame_, sigma, radius * e)) return false;
        rays.outward[k] = -Vec2(sigma.slope(u), sigma.slope(v));
        // Newton's method leaves about half the square of its last step, which the area feels twice.
        rim_error_ = std::max(rim_error_, step * step / (radius * radius));
      } else {
        open_[left++] = k;
      }
      radius = next;
      rays.height[k] += lift;
      if (radius * e.norm() > extent_ || !std::isfinite(radius + rays.height[k])) return false;
    }
    open_.resize(left);
  }
  return open_.empty();
}

/// Whether no kink that crosses the patch lies between two places, or at either.
bool PolarRuleSolver::same_side(const Vec3& from, const Vec3& to) const {
  constexpr double kAt = 0.01;  // of the way
  const Vec3 a = from - kAt * (to - from), b = to + kAt * (to - from);
  return std::none_of(levels_.crossing.begin(), levels_.crossing.end(), [&](std::size_t k) { return k < levels_.kink.size() && (levels_.kink[k].value(a) > 0.0) != (levels_.kink[k].value(b) > 0.0); });
}

void PolarRuleSolver::place_nodes(const PolarRule& rule) {
  const auto angles = static_cast<std::size_t>(rule.angular), radii = static_cast<std::size_t>(rule.radial);
  const GaussRule& gauss = gauss_rule(rule.radial);
  const std::size_t n = angles * radii;
  node_.resize(n);
  foot_.resize(n);
  height_.resize(n);
  weight_.resize(n);
  const double sector = kTurn / rule.angular;
  for (std::size_t k = 0; k < angles; ++k) {
    const double c = rule.cosine[k], s = rule.sine[k], rim = rim_.radius[k];
    const Vec3 e = c * frame_.u + s * frame_.v;
    // Through slope and curvature at the origin, where the peak has no slope, and the rim.
    const double linear = rim * rise_.dot(e);
    const double square =
        0.5 * rim * rim * (frame_.height_uu * c * c + 2.0 * frame_.height_uv * c * s + frame_.height_vv * s * s);
    const double rest = rim_.height[k] - linear - square;
    for (std::size_t j = 0; j < radii; ++j) {
      const std::size_t i = k * radii + j;
      const double r = gauss.node[j], r2 = r * r;
      foot_[i] = frame_.origin + (r * rim) * e;
      height_[i] = r * linear + r2 * (square + (about_star_ ? r : r2) * rest);
      weight_[i] = sector * gauss.weight[j] * rim * rim * r * jacobian_;
    }
  }
}

bool PolarRuleSolver::solve_heights(PairPressure& pressure, double error) {
  const std::size_t n = node_.size();
  const double round_off = 4.0 * kEpsilon * pressure.largest_modulus();
  const double enough = std::max(round_off, std::min(1e-11 * pressure.largest_modulus(), 1e-3 * error * frame_.peak));
  const Vec3 axis = frame_.axis;
  open_.resize(n);
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  residual_ = 0.0;
  for (int iteration = 0; iteration < kHeightSteps; ++iteration) {
    for (const std::size_t i : open_) node_.point[i] = foot_[i] + height_[i] * axis;
    pressure.evaluate(node_, open_, some_);
    double off = 0.0;
    std::size_t left = 0;
    for (const std::size_t i : open_) {
      const double gap = node_.a[i] - node_.b[i];
      const double rate = (node_.slope_b[i] - node_.slope_a[i]).dot(axis), step = gap / rate;
      // A step below the round-off of the coordinates cannot help.
      if (std::abs(gap) <= enough || std::abs(step) <= 2.0 * kEpsilon * node_.point[i].lpNorm<Eigen::Infinity>()) {
        residual_ = std::max(residual_, std::abs(gap));
        continue;
      }
      if (!(rate > 0.0)) return false;
      off = std::max(off, std::abs(gap));
      height_[i] += step;
      if (!(std::abs(height_[i]) <= extent_)) return false;
      open_[left++] = i;
    }
    open_.resize(left);
    if (left == 0) return true;
    if (iteration + 1 == kHeightSteps) residual_ = std::max(residual_, off);
  }
  return residual_ <= 1e-6 * frame_.peak;
}

bool PolarRuleSolver::integrate() {
  const std::size_t n = node_.size();
  area_.resize(n);
  normal_.resize(n);
  pressure_.resize(n);
  // Copies of what is read and added to, which stay in registers.
  const Vec3 origin = frame_.origin, axis = frame_.axis;
  // A kink so near to the rim that Newton's last step to the rim crossed it leaves a little more than round-off.
  const double lowest = -residual_ - (about_middle_ ? kBelowRim * frame_.peak : 0.0);
  PatchSums sums;
  double lift = 0.0, below = 0.0;
  const std::size_t thirds = cut_ ? levels_.third.size() : 0;
  if (cut_) levels_.evaluate_thirds(node_.point);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 &slope_a = node_.slope_a[i], &slope_b = node_.slope_b[i];
    const double a = node_.a[i], b = node_.b[i];
    const Vec3 across = slope_b - slope_a;
    const Vec3 normal = across / across.norm();
    const double cosine = normal.dot(axis);
    // On Sigma to first order: the round-off of a steep body counts little.
    const double fall = -slope_a.dot(axis), rise = slope_b.dot(axis);
    const double p = (a * rise + b * fall) / (rise + fall);
    lift = std::max(lift, std::abs(a - b) / (rise + fall));
    if (!(cosine > kGraphCosine) || !(p > lowest)) return false;
    for (std::size_t t = 0; t < thirds; ++t) {
      if (levels_.third_value[t * n + i] > p) weight_[i] = 0.0;
    }
    const double area = weight_[i] / cosine, pressure = std::max(p, 0.0);
    below += std::max(-p, 0.0) * std::abs(area);
    normal_[i] = normal;
    area_[i] = area;
    pressure_[i] = pressure;
    sums.add(node_.point[i] - origin, normal, area, pressure);
  }
  fine_ = sums;
  lift_ = lift;
  below_ = below;
  return cut_ || sums.load > 0.0;
}

/// Of what one ray stands for all around the axis.
void PolarRuleSolver::keep_along_axis(PatchSums& sums) const {
  sums.force = sums.force.dot(frame_.axis) * frame_.axis;
  sums.first = sums.first.dot(frame_.axis) * frame_.axis;
  sums.moment.setZero();
}

/// Rim and nodes of the single ray, to all rays of the rule. @param slopes  of the pressures, too
void PolarRuleSolver::turn(const PolarRule& rule, bool slopes) {
  const auto angles = static_cast<std::size_t>(rule.angular), radii = node_.size();
  const Vec3 origin = frame_.origin, axis = frame_.axis;
  const Vec3 u = frame_.u.normalized(), v = axis.cross(u);
  node_.resize(angles * radii);
  for (auto* array : {&weight_, &area_, &pressure_}) array->resize(angles * radii);
  normal_.resize(angles * radii);
  const double share = 1.0 / static_cast<double>(angles);
  for (std::size_t j = 0; j < radii; ++j) {
    const auto turns = [&](const Vec3& x, const Vec3& shift, std::vector<Vec3>& to) {
      const Vec3 along = shift + x.dot(axis) * axis, across_u = x.dot(u) * u, across_v = x.dot(u) * v;
      for (std::size_t k = 0; k < angles; ++k) to[k * radii + j] = along + rule.cosine[k] * across_u + rule.sine[k] * across_v;
    };
    turns(Vec3(node_.point[j] - origin), origin, node_.point);
    turns(Vec3(normal_[j]), Vec3::Zero(), normal_);
    if (slopes) turns(Vec3(node_.slope_a[j]), Vec3::Zero(), node_.slope_a);
    if (slopes) turns(Vec3(node_.slope_b[j]), Vec3::Zero(), node_.slope_b);
    const double weight = share * weight_[j], area = share * area_[j], p = pressure_[j];
    for (std::size_t k = 0; k < angles; ++k) {
      weight_[k * radii + j] = weight;
      area_[k * radii + j] = area;
      pressure_[k * radii + j] = p;
    }
  }
  rim_.cosine = rule.cosine;
  rim_.sine = rule.sine;
  rim_.radius.assign(angles, rim_.radius.front());
  rim_.height.assign(angles, rim_.height.front());
}

double PolarRuleSolver::rounding() const { return rounding_error(frame_.origin.lpNorm<Eigen::Infinity>() + size_, frame_.thickness); }

/// What the heights are off by, and what rounding of the coordinates does.
double PolarRuleSolver::placing_error() const { return lift_ / std::sqrt(fine_.area) + rounding(); }

/// The same, and what the rim is off by.
double PolarRuleSolver::algebraic_error() const { return 2.0 * rim_error_ + placing_error(); }

bool PolarRuleSolver::solve(const PolarJob& job, const PeakFrame& frame, const Known& known, PatchPoints& points) {
  PairPressure& pressure = job.pressure;
  const Thirds third = job.third;
  size_ = std::isfinite(pressure.feature_size()) ? pressure.feature_size() : 0.0;
  extent_ = 2.0 * job.extent;
  error_ = job.settings.error;
  levels_.third = third;
  levels_.imprint.clear();
  peak_ = frame.origin;
  may_go_through_ = false;
  for (const int side : {0, 1}) {
    const std::optional<implicit::CorePoint> core = pressure.field(side).core_point(frame.origin);
    may_go_through_ = may_go_through_ || ((!core || !core->round) && third.empty());
  }
  const PatchPoints::Mark before = points.mark();
  const auto anew = [&] {
    points.back_to(before);
    return true;
  };
  const bool peaked = !frame.flat;
  const auto [round, follow] = known;
  if (peaked && !follow && solve_about_peak(job, frame, {.round = round}, points)) return true;
  if (job.faces && anew() && solve_about_middle(job, frame, points)) return true;
  if (peaked && anew() && solve_about_star(job, frame, follow, points)) return true;
  if (peaked && !follow && anew() && solve_about_peak(job, frame, {.round = round, .any = true}, points)) return true;
  points.back_to(before);
  return false;
}

/// A state without anything known of the patch but its peak.
void PolarRuleSolver::start_about_peak(const PeakFrame& frame) {
  frame_ = frame;
  jacobian_ = frame.u.norm() * frame.v.norm();
  rise_.setZero();
  columns_.forget();
  cut_ = about_middle_ = false;
  estimate_ = 1.0;
  parted_ = 0;
  polygon_.clear();
  levels_.kink.clear();
  levels_.all_kinks = true;  // where none are looked for
}

bool PolarRuleSolver::solve_about_peak(const PolarJob& job, const PeakFrame& frame, const AboutPeak& how, PatchPoints& points) {
  PairPressure& pressure = job.pressure;
  const bool any = how.any;
  bool round = how.round;
  const double error = job.settings.error;
  start_about_peak(frame);
  const std::span<const PolarRule> rules = polar_rules();
  const bool parts = error < kSplitBelow || !levels_.third.empty();
  // Patches that need more at coarse errors are uneven: there two rules agree by chance.
  const std::size_t most = parts || any ? rules.size() - 1 : kMostCoarse;
  const std::size_t last = std::min<std::size_t>(most, static_cast<std::size_t>(std::max(job.settings.max_refinement, 1)));
  bool smooth = error < kSplitBelow && levels_.third.empty() && no_kinks_near(pressure);
  std::size_t first = std::min(first_rule(error, smooth), last - 1);
  double difference = 0.0;
  for (std::size_t r = first; r <= last; ++r) {
    const PolarRule& rule = round ? polar_rays()[r] : rules[r];
    start_rim(rule, r == first);
    if (!solve_rim(pressure, rim_, error)) return false;
    if (smooth && std::any_of(rim_batch_.point.begin(), rim_batch_.point.end(), [this](const Vec3& x) { return !smooth_.contains(x); })) {
      smooth = false;
      first = std::min(first_rule(error, false), last - 1);
      r = first - 1;
      continue;
    }
    place_nodes(rule);
    if (!solve_heights(pressure, error)) return false;
    coarse_ = fine_;
    if (!integrate()) return false;
    if (round) keep_along_axis(fine_);
    if (!smooth && r == first && error < kSplitBelow) find_kinks(pressure);
    if (round && !levels_.kink.empty()) {
      round = false;
      r = first - 1;
      continue;
    }
    if (!levels_.third.empty() && taken_by_thirds()) return leave_all();
    if (parts && !(any && levels_.third.empty()) && kinks_cross(pressure)) return solve_split(pressure, job.settings) && finish_parted(job, points);
    if (r == first) continue;
    const double last_difference = difference;
    difference = smooth ? std::max(error_where_smooth(fine_, coarse_), kOfLastWhereSmooth * last_difference) : error_at_kinks(r, fine_, coarse_);
    if (!parts && r > first + 1) difference = std::max(difference, std::min(kOfLast * last_difference, kOfParts * error));
    if (difference > kOfParts * error && r < last) continue;
    estimate_ = (any ? kSafetyAcross : 1.0) * difference + algebraic_error();
    if (estimate_ > error && !any) return false;
    // Pressures do not depend on the angle, so that those of the coarser rule are enough for what slides.
    return finish(pressure, rules[r].column, job.regions, error, round ? &rules[r - 1] : nullptr, points);
  }
  return false;
}

/// A patch that third bodies have all of.
bool PolarRuleSolver::leave_all() {
  fine_ = {};
  estimate_ = 0.0;
  thickness_ = frame_.thickness;
  return true;
}

/// The same as `finish`, of a patch that was parted.
bool PolarRuleSolver::finish_parted(const PolarJob& job, PatchPoints& points) {
  parted_ = static_cast<std::uint32_t>(levels_.crossing.size());
  return finish(job.pressure, column_of(job.settings.error), job.regions, job.settings.error, nullptr, points);
}

/// Columns, and what was found, to `points`. @param turns  rule whose rays the single one stands for, or null
bool PolarRuleSolver::finish(PairPressure& pressure, int column, const Regions& regions, double error, const PolarRule* turns,
                             PatchPoints& points) {
  const bool all = regions[0] == Region::Points || regions[1] == Region::Points;
  if (turns != nullptr && all) turn(*turns, true);
  largest_ = frame_.peak;
  summit_ = node_.size();
  for (std::size_t i = 0; i < node_.size() && about_middle_; ++i) {
    if ((cut_ && area_[i] == 0.0) || pressure_[i] <= largest_) continue;
    largest_ = pressure_[i];
    summit_ = i;
  }
  const std::optional<double> thickness =
      columns_.add(pressure, {frame_, peak_, node_, weight_, pressure_, normal_, summit_, extent_}, {column, regions, error, may_go_through_}, points);
  if (!thickness) return false;
  thickness_ = *thickness;
  if (turns != nullptr && !all) turn(*turns, false);
  for (std::size_t i = 0; i < node_.size(); ++i) {
    if (cut_ && area_[i] == 0.0) continue;
    points.point.push_back(node_.point[i]);
    points.normal.push_back(normal_[i]);
    points.area.push_back(area_[i]);
    points.pressure.push_back(pressure_[i]);
  }
  points.residual = std::max(points.residual, residual_);
  return true;
}

void PolarRuleSolver::cover(PolarCover& out) const {
  out.frame = frame_;
  out.corner.clear();
  out.thickness = thickness_;
  out.rise = rise_;
  if (!polygon_.empty()) {
    out.height.clear();
    out.rim.clear();
    for (const RimPoint& p : polygon_) {
      out.corner.push_back(p.at);
      out.height.push_back(p.height);
      out.rim.push_back(frame_.place(p.at, p.height));
    }
    return;
  }
  out.radius = rim_.radius;
  out.height = rim_.height;
  out.rim.resize(rim_.size());
  for (std::size_t k = 0; k < rim_.size(); ++k) {
    out.rim[k] = frame_.origin + rim_.radius[k] * direction(rim_.cosine[k], rim_.sine[k]) + rim_.height[k] * frame_.axis;
  }
}

}  // namespace supple::collision
