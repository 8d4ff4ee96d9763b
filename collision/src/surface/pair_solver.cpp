#include "surface/pair_solver.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "numbers.h"
#include "pairs/body_order.h"
#include "pairs/boxes.h"
#include "pairs/cores.h"
#include "surface/polar/symmetry.h"
#include "surface/region/sigma_columns.h"

namespace supple::collision {
namespace {

/// To which sizes of imprints are known.
constexpr double kOfSize = 0.1;

/// Error below which panels may miss slivers of that size between their nodes.
constexpr double kFinestPanels = 1e-4;

/// Pressures that differ by less are the same, over the largest.
constexpr double kTie = 1e-6;

/// Whether a body is convex and certainly does not reach a box: cheaper than bounds of its field.
bool clear_of(const ContactBody& body, const Box& box) {
  const std::optional<implicit::CorePoint> core = body.field.core_point(box.centre());
  return core && (core->point - box.centre()).norm() > core->radius + 0.5 * box.extent().norm();
}

/// Of balls and half-spaces.
std::optional<CommonAxis> axis_of(const ContactBody& a, const ContactBody& b, const Vec3& near) {
  std::optional<implicit::CorePoint> on_a = a.field.core_point(near);
  if (!on_a || !on_a->round) return std::nullopt;
  const std::optional<implicit::CorePoint> on_b = b.field.core_point(on_a->point);
  if (!on_b || !on_b->round) return std::nullopt;
  on_a = a.field.core_point(on_b->point);
  const Vec3 along = on_b->point - on_a->point;
  const double length = along.norm();
  if (!(length > 0.0)) return std::nullopt;
  return CommonAxis{on_a->point, along / length};
}

/// Whether a bound is as good as asked, or as round-off lets it be.
bool meets(const PairResult& result, double error) {
  constexpr double kRound = 1e-7, kSlack = 1.01, kOfRounding = 5.0;  // marching has two of these at least
  return result.rounding > kLostInRounding || result.summary.error_estimate <= std::max({kSlack * error, kRound, kOfRounding * result.rounding});
}

/// Of the forces and areas of two results, as in ContactSettings::error.
double difference_of(const PairResult& one, const PairResult& other) {
  if (!(one.load > 0.0)) return other.load > 0.0 ? 1.0 : 0.0;
  const double force = (one.summary.force - other.summary.force).norm() / force_scale(one.summary.force, one.load);
  const double area = std::abs(one.summary.area - other.summary.area) / one.summary.area;
  return std::max(force, area);
}

}  // namespace

void Partners::build(std::size_t bodies, std::span<const BodyPair> pairs) {
  offset.assign(bodies + 1, 0);
  for (const BodyPair& p : pairs) {
    ++offset[p.a + 1];
    ++offset[p.b + 1];
  }
  for (std::size_t i = 0; i < bodies; ++i) offset[i + 1] += offset[i];
  partner.resize(2 * pairs.size());
  // Filled from the back, so that offset[i] ends as the begin of i.
  for (std::size_t k = pairs.size(); k-- > 0;) {
    partner[--offset[pairs[k].a + 1]] = pairs[k].b;
    partner[--offset[pairs[k].b + 1]] = pairs[k].a;
  }
  for (std::size_t i = 0; i < bodies; ++i) offset[i] = offset[i + 1];
  offset[bodies] = static_cast<std::uint32_t>(partner.size());
}

/// Partners of either body whose surfaces may reach the overlap; of teams of obstacles the first ones, and not that of the pair.
void PairSolver::find_thirds(const Job& job, const Partners& partners) {
  const BodyPair& pair = job.pair;
  third_.clear();
  third_bodies_.clear();
  const auto add = [&](std::uint32_t c) {
    if (c == pair.a || c == pair.b || !overlap_at_once(job.boxes[c], job.overlap)) return;
    const Team* const team = teams_.of(c);
    if (team != nullptr && team == team_) return;
    const std::uint32_t first = team != nullptr ? team->member.front() : c;
    const auto place = std::lower_bound(third_.begin(), third_.end(), first);
    if (place == third_.end() || *place != first) third_.insert(place, first);
  };
  for (const std::uint32_t c : partners.of(pair.a)) add(c);
  for (const std::uint32_t c : partners.of(pair.b)) add(c);
  const auto meets = [&partners](std::uint32_t body, std::uint32_t c) {
    const std::span<const std::uint32_t> all = partners.of(body);
    return std::binary_search(all.begin(), all.end(), c);
  };
  thirds_.set(job.bodies, {job.a, job.b, pair}, third_, teams_, meets);
}

/// The team of the pair's obstacle, if it has one. @return whether the pair has its contact
bool PairSolver::join_team(std::span<const ContactBody> bodies, const ContactCandidates& candidates, const Partners& partners, const BodyPair& pair) {
  teams_.clear();
  team_ = nullptr;
  if (bodies[pair.a].fixed == bodies[pair.b].fixed) return true;
  const std::uint32_t obstacle = bodies[pair.a].fixed ? pair.a : pair.b, body = pair.a + pair.b - obstacle;
  teams_.find(bodies, body, partners.of(body));
  team_ = teams_.of(obstacle);
  if (team_ == nullptr) return true;
  if (team_->member.front() != obstacle) return false;
  team_seeds_.clear();
  for (const std::uint32_t c : team_->member) {
    const BodyPair other{std::min(body, c), std::max(body, c)};
    const auto k = static_cast<std::size_t>(std::lower_bound(candidates.pair.begin(), candidates.pair.end(), other) - candidates.pair.begin());
    const auto seeds = std::span(candidates.seed).subspan(candidates.offset[k], candidates.offset[k + 1] - candidates.offset[k]);
    team_seeds_.insert(team_seeds_.end(), seeds.begin(), seeds.end());
  }
  const Box own = bodies[body].field.surface_box(), all = team_->field.surface_box();
  team_overlap_ = {own.lower.cwiseMax(all.lower), own.upper.cwiseMin(all.upper)};
  return true;
}

/// How third bodies press on the patches, and whether nearly as much as the pair does. Those near are kept.
PairSolver::Pressing PairSolver::thirds_press(const Job& job, const PairResult& out) {
  Box patch;
  rim_.clear();
  for (const PolarCover& cover : patches_.covers()) {
    rim_.insert(rim_.end(), cover.rim.begin(), cover.rim.end());
    patch.include(cover.frame.origin);
  }
  for (const Vec3& x : rim_) patch.include(x);
  for (const Vec3& x : out.points.point) patch.include(x);
  const double largest = out.summary.largest_pressure, margin = 0.05 * largest, at_rim = kAtRim * job.settings().error * largest;
  const std::size_t points = out.points.point.size();
  taken_.assign(points + rim_.size(), 0);
  free_.clear();
  hardest_.assign(points, 0.0);
  value_.resize(taken_.size());
  bool press = false;
  for (std::size_t t = 0; t < third_.size(); ++t) {
    const ContactBody& third = thirds_.all()[t];
    if (!(teams_.of(third_[t]) != nullptr || job.boxes[third_[t]].overlaps(patch)) || clear_of(third, patch) || third.field.bound(patch).upper <= 0.0) continue;
    third_bodies_.push_back(&third);
    third.field.evaluate(out.points.point, std::span(value_).first(points));
    third.field.evaluate(rim_, std::span(value_).subspan(points));
    for (std::size_t i = 0; i < value_.size(); ++i) {
      // Beyond the outermost nodes the pressure of the pair falls to zero.
      const double p = third.material.modulus * value_[i], own = i < points ? out.points.pressure[i] : 0.0;
      press = press || p > (i < points ? own - margin : at_rim);
      if (p > (i < points ? own : -at_rim)) taken_[i] = 1;
      if (i < points) hardest_[i] = std::max(hardest_[i], p);
    }
    for (const PolarCover& cover : patches_.covers()) press = press || imprint_.find(job.polar.pressure, cover, third, margin).has_value();
  }
  if (!press) return Pressing::None;
  for (std::size_t i = 0; i < points; ++i) {
    if (hardest_[i] < out.points.pressure[i] - kTie * largest) free_.push_back({out.points.point[i], out.points.normal[i], out.points.pressure[i]});
  }
  return std::find(taken_.begin(), taken_.end(), 0) == taken_.end() ? Pressing::All : Pressing::Some;
}

/// Whether third bodies press harder than both of the pair somewhere beside Sigma, where one of the pair loses space to them and not to the other. Looked for
/// along the normals of the points of Sigma, as far as the overlap reaches there to first order.
bool PairSolver::thirds_press_beside(const Job& job, const PairResult& out) {
  constexpr int kPlaces = 4;  // on either side
  constexpr std::array<double, 2> kSides{1.0, -1.0};
  take_all_thirds(job);
  if (third_bodies_.empty()) return false;
  PressureBatch& batch = beside_;
  batch.resize(kSides.size() * kPlaces * out.points.point.size());
  std::size_t next = 0;
  for (std::size_t i = 0; i < out.points.point.size(); ++i) {
    const Vec3 way = (out.summary.largest_overlap * out.points.pressure[i] / out.summary.largest_pressure / kPlaces) * out.points.normal[i];
    for (const double side : kSides) {
      for (int k = 1; k <= kPlaces; ++k) batch.point[next++] = out.points.point[i] + side * k * way;
    }
  }
  job.polar.pressure.evaluate_values(batch);
  value_.resize(batch.size());
  for (const ContactBody* const third : third_bodies_) {
    third->field.evaluate(batch.point, value_);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const bool within = batch.a[i] > 0.0 && batch.b[i] > 0.0;
      if (within && third->material.modulus * value_[i] > std::max(batch.a[i], batch.b[i])) return true;
    }
  }
  return false;
}

/// Polar patches again, cut where `third_bodies_` press harder. A star tells more of where they do, but is slow where its rays touch a small imprint or a
/// face has corners: there patches are parted about the imprints themselves, which their size, or a star that is not as fine, has to confirm.
/// @return false where neither fits, or they contradict each other
bool PairSolver::polar_cut(const Job& job, PairResult& out) {
  if (job.a.pose.size() > 1 || job.b.pose.size() > 1) return false;  // their squeezed regions are not cut that exactly
  constexpr double kSafety = 3.0;
  constexpr double kSmall = 0.05;  // of the area of the patches: a star tells imprints that take less from each other by few of its rays
  const double whole = out.summary.area, of_whole = out.summary.error_estimate;
  const std::span<const PolarCover> covers = patches_.covers();
  const bool faces = std::any_of(covers.begin(), covers.end(), [](const PolarCover& cover) { return cover.frame.flat; });
  if (faces) return imprints_cut(job, out);
  const double error = job.settings().error;
  if (little_) {
    if (imprints_cut(job, out)) {
      const double off = std::abs(1.0 - little_->area - out.summary.area / whole);
      out.summary.error_estimate += std::max(off - of_whole, 0.0);
      if (meets(out, error)) return true;
    }
    out.clear();
    if (!rings(job, error, out)) return false;
  }
  const bool star = stars_cut(job, std::max(error, kFinestPanels), out), coarse = error >= kFinestPanels;
  const bool small = star && out.summary.area > (1.0 - kSmall) * whole;
  if (star && coarse && !small && (out.points.point.empty() || meets(out, error))) return true;
  const bool flows = star && coarse && (apex_[0] || apex_[1]);  // what flows out of these is held to the error by stars alone
  if (flows && !meets(out, error)) return false;
  std::swap(kept_, out);
  out.summary.bodies = job.pair;
  if (!imprints_cut(job, out)) return false;
  if (flows) {
    kept_.summary.error_estimate = std::max(kept_.summary.error_estimate, difference_of(kept_, out));
    std::swap(kept_, out);
    return meets(out, error);
  }
  if (!star || small) return true;
  const double off = difference_of(kept_, out);
  if (coarse) out.summary.error_estimate = std::max(out.summary.error_estimate, off);
  return coarse || off <= kSafety * (kept_.summary.error_estimate + out.summary.error_estimate);
}

/// What the imprints of `third_bodies_` take of the patches. @return nothing where that is not known to the error asked
std::optional<PairSolver::Taken> PairSolver::taken_by_imprints(const Job& job, const PairResult& out) {
  Taken taken;
  for (const ContactBody* const third : third_bodies_) {
    if (!third->field.convex()) return std::nullopt;  // it may have several imprints on a patch
    bool found = false;
    for (const PolarCover& cover : patches_.covers()) {
      const std::optional<Vec3> inside = imprint_.find(job.polar.pressure, cover, *third, 0.0);
      if (!inside) continue;
      found = true;
      const std::optional<ImprintSize> size = imprint_.measure(job.polar.pressure, cover, *third, *inside);
      if (!size) return std::nullopt;
      taken.area += size->share;
      taken.force += size->share * size->pressure * out.summary.area / out.load;
      if (!(kOfSize * taken.area <= job.settings().error)) return std::nullopt;
    }
    if (found) continue;
    // It may press beside where it is looked for, as next to a kink.
    value_.resize(out.points.point.size());
    third->field.evaluate(out.points.point, value_);
    for (std::size_t i = 0; i < value_.size(); ++i) {
      if (third->material.modulus * value_[i] > out.points.pressure[i]) return std::nullopt;
    }
  }
  return taken;
}

/// Whether imprints are so small that the patches stay within the given error as they are, or solved a little finer. The estimate grows by what imprints take.
bool PairSolver::may_leave_imprints(const Job& job, PairResult& out) {
  constexpr double kMost = 0.8;     // of the error: finer patches cost more than cut ones
  constexpr double kSafety = 1.25;
  const double error = job.settings().error;
  little_.reset();
  if (!(out.load > 0.0)) return false;
  little_ = taken_by_imprints(job, out);
  if (!little_) return false;
  const double taken = kSafety * std::max(little_->area, little_->force);
  if (!(taken <= kMost * error)) return false;
  if (out.summary.error_estimate + taken > error) {
    out.clear();
    if (!rings(job, error - taken, out) || out.summary.error_estimate + taken > error) {
      out.clear();
      rings(job, error, out);
      return false;
    }
    out.summary.rule = ContactRule::Polar;
  }
  out.summary.error_estimate += taken;
  return true;
}

/// The third bodies that reach the overlap.
void PairSolver::take_all_thirds(const Job& job) {
  third_bodies_.clear();
  for (const ContactBody& third : thirds_.all()) {
    if (third.field.bound(job.overlap).upper > 0.0) third_bodies_.push_back(&third);
  }
}

/// `third_bodies_` as what bounds panels.
void PairSolver::take_third_levels(const Job& job) {
  third_levels_.clear();
  for (std::size_t t = 0; t < third_.size(); ++t) {
    const ContactBody* const third = &thirds_.all()[t];
    if (std::find(third_bodies_.begin(), third_bodies_.end(), third) != third_bodies_.end()) third_levels_.push_back({third, third_[t] > job.pair.b});
  }
}

/// After a rule that did not fit.
void PairSolver::begin_anew(const Job& job, PairResult& out) {
  out.clear();
  take_all_thirds(job);
}

/// Polar patches from where `find_patches` begins. @return false where the rule does not fit
bool PairSolver::rings(const Job& job, double error, PairResult& out) {
  PolarJob polar = job.polar;
  polar.settings.error = error;
  PairPressure& pressure = polar.pressure;
  if (!patches_.solve(polar, out)) return false;
  // Faces that are nearly parallel are slow to tell where they are nearest: their overlap need not hold the seed. Obstacles without samples of their own
  // may be thin, and have a field only near them.
  const auto shown_by_seeds = [&](int side) { return pressure.body(side).skeleton != nullptr || pressure.field(side).convex(); };
  if (!patches_.empty() || (!job.convex && shown_by_seeds(0) && shown_by_seeds(1))) return true;
  std::optional<Between> between;
  if (job.convex) between = between_cores(pressure.body(0), pressure.body(1), job.overlap, kManySteps);
  if (between && between->apart) return true;
  patches_.start_from(job.overlap, pressure);
  if (!patches_.solve(polar, out)) return false;
  if (!patches_.empty() || !between || !between->overlap) return true;
  patches_.start_from(between->middle, pressure);
  return patches_.solve(polar, out);
}

/// The same, at another error where the one asked for is not met. @return false where the rule does not fit
bool PairSolver::polar(const Job& job, PairResult& out) {
  constexpr double kFiner = 0.1, kCoarse = 1e-3;
  const double error = job.settings().error;
  if (!rings(job, error, out)) {
    // Where rings are lost at a fine error, coarse ones are better than nothing: other rules may not find so thin an overlap.
    if (!job.convex || error >= kCoarse) return false;
    out.clear();
    return rings(job, kCoarse, out);
  }
  if (patches_.empty() || meets(out, error)) return true;
  // Rims and rounding may add a little to what panels are held to, and several patches are off by more than each of them: finer ones cost far
  // less than another rule.
  out.clear();
  if (rings(job, kFiner * error, out) && meets(out, error)) return true;
  out.clear();
  return rings(job, error, out);
}

/// Polar patches again, parted about their imprints, and cut where `third_bodies_` press harder. @return false where the rule does not fit
bool PairSolver::imprints_cut(const Job& job, PairResult& out) {
  out.clear();
  PolarJob cut = job.polar;
  cut.third = third_bodies_;
  if (!patches_.solve(cut, out)) return false;
  if (out.points.point.empty()) return free_.empty();  // all of it lies in a third body
  out.summary.rule = ContactRule::Polar;
  out.summary.largest_pressure = *std::max_element(out.points.pressure.begin(), out.points.pressure.end());
  return true;
}

/// The same by panels of a star. @return false where they do not fit
bool PairSolver::stars_cut(const Job& job, double asked, PairResult& out) {
  constexpr double kFiner = 0.5;  // several patches are off by more than each of them
  out.clear();
  PairPressure& pressure = job.polar.pressure;
  share_.clear();
  take_third_levels(job);
  const std::span<const PolarCover> covers = patches_.covers();
  const double error = covers.size() > 1 ? kFiner * asked : asked;
  for (const PolarCover& cover : covers) {
    imprints_.clear();
    for (std::size_t t = 0; t < third_levels_.size(); ++t) {
      if (const std::optional<Vec3> at = imprint_.find(pressure, cover, *third_levels_[t].body, 0.0)) imprints_.push_back({*at, t});
    }
    PanelOutcome outcome;
    const Vec3& origin = cover.frame.origin;
    if (!solve_by_panels({pressure, third_levels_, job.overlap, {}, error, origin, false, &cover, imprints_, free_, apex_}, panel_room_, out.points, outcome)) return false;
    const PatchSums& sums = outcome.sums;
    out.add(sums, origin);
    share_.push_back({sums.force, sums.first + sums.load * origin, sums.load, sums.area, outcome.estimate});
    if (outcome.largest <= out.summary.largest_pressure) continue;
    out.summary.largest_pressure = outcome.largest;
    out.summary.largest_overlap = outcome.thickness;
  }
  out.summary.patches = static_cast<std::uint32_t>(covers.size());
  if (out.points.point.empty()) return free_.empty();  // all of it lies in a third body
  out.summary.rule = ContactRule::Polar;
  out.summary.error_estimate = std::min(1.0, estimate_of_all(share_, out));
  return true;
}

/// A rule that sees all patches at once, with the bodies in the order that they tell themselves: lattices and rays are the same then, whichever of
/// them is named first.
template <class Rule, class Solve>
bool PairSolver::solve_in_order(const Job& job, Rule& rule, ContactRule name, const Solve& solve, PairResult& out) {
  begin_anew(job, out);
  const Vec3 reference = job.overlap.centre();
  const bool reversed = !leads(job.a, job.b);
  Regions regions = job.polar.regions;
  if (reversed) {
    job.polar.pressure.reverse();
    std::swap(regions[0], regions[1]);
  }
  const bool fits = solve(regions, reference);
  if (reversed) job.polar.pressure.reverse();
  if (!fits) return false;
  PatchSums sums = rule.sums();
  if (reversed) {
    sums.reverse();
    out.points.reverse();
  }
  out.add(sums, reference);
  out.summary.rule = name;
  out.summary.error_estimate = rule.estimate();
  out.summary.largest_pressure = *std::max_element(out.points.pressure.begin(), out.points.pressure.end());
  out.summary.largest_overlap = rule.thickness();
  out.summary.patches = std::max(1u, static_cast<std::uint32_t>(patches_.covers().size()));
  return true;
}

/// @param alone  as if there were no third bodies
bool PairSolver::march(const Job& job, PairResult& out, bool alone) {
  const ContactSettings& settings = job.settings();
  PairPressure& pressure = job.polar.pressure;
  return solve_in_order(job, march_, ContactRule::March, [&](const Regions& regions, const Vec3& reference) {
    if (alone) third_bodies_.clear();
    const bool symmetric = settings.symmetry && third_bodies_.empty();
    const std::optional<CommonAxis> axis = symmetric ? axis_of_symmetry(pressure.body(0), pressure.body(1), job.overlap) : std::nullopt;
    return march_.solve({pressure, third_bodies_, job.overlap, regions, reference, axis, {settings.error, settings.max_refinement}}, out.points);
  }, out);
}

/// What the solution by panels gives to `solve_in_order`.
struct PanelRule {
  PanelOutcome outcome;
  [[nodiscard]] const PatchSums& sums() const { return outcome.sums; }
  [[nodiscard]] double estimate() const { return outcome.estimate; }
  [[nodiscard]] double thickness() const { return outcome.thickness; }
};

bool PairSolver::panels(const Job& job, PairResult& out) {
  if (!is_finite(job.overlap)) return false;
  PairPressure& pressure = job.polar.pressure;
  std::vector<Vec3> starts(job.seeds.begin(), job.seeds.end());
  if (starts.empty()) {
    finder_.start_from_scan(pressure, job.overlap, starts_);
    for (const StartPoint& inside : starts_.inside) starts.push_back(inside.at);
  }
  PanelRule rule;
  return solve_in_order(job, rule, ContactRule::Panels, [&](const Regions& regions, const Vec3& reference) {
    take_third_levels(job);
    const bool fits = solve_by_panels({pressure, third_levels_, job.overlap, starts, job.settings().error, reference, job.settings().only == ContactRule::None}, panel_room_, out.points, rule.outcome);
    for (const std::size_t side : {0u, 1u}) out.points.unsure[side] = regions[side] != Region::None;
    return fits;
  }, out);
}

/// Marches where polar patches do not meet the error, and keeps the better of both. @return whether that is the marched one
bool PairSolver::march_instead(const Job& job, PairResult& out) {
  std::swap(kept_, out);
  out.summary.bodies = kept_.summary.bodies;
  if (march(job, out) && out.summary.error_estimate < kept_.summary.error_estimate) return true;
  std::swap(kept_, out);
  return false;
}

/// Whether polar patches would be many, or crossed by many kinks, so that panels cost less.
bool PairSolver::suits_panels(const Job& job) const {
  constexpr std::size_t kFewHills = 3, kManyPrimitives = 16;
  constexpr double kWide = 2.0;  // overlaps, in features of the bodies
  if (job.settings().error < kFinestPanels) return false;
  const auto many = [](const ContactBody& body) { return body.skeleton != nullptr && body.skeleton->primitive.size() >= kManyPrimitives; };
  if (!many(job.a) && !many(job.b)) return false;
  return patches_.hills() > kFewHills || job.polar.extent > kWide * job.polar.pressure.feature_size();
}

void PairSolver::choose(const Job& job, PairResult& out) {
  const ContactRule only = job.settings().only;
  const bool any = only == ContactRule::None;
  cut_by_thirds_ = !third_.empty();
  if (only == ContactRule::Panels) {
    if (!panels(job, out)) {
      begin_anew(job, out);
      if (patches_.any_touches(job.polar.pressure, job.polar.extent, job.convex)) out.summary.error_estimate = 1.0;
    }
    out.summary.reason = RuleReason::Asked;
    return;
  }
  if (any && suits_panels(job)) {
    if (panels(job, out) && meets(out, job.settings().error)) {
      out.summary.reason = RuleReason::ManyHills;
      return;
    }
    begin_anew(job, out);
    third_bodies_.clear();
  }
  bool fits = (any || only == ContactRule::Polar) && polar(job, out);
  // Bodies that overlap where rings find no Sigma lie in each other, or one is so thin that Sigma is far from where rings begin.
  const bool may_be_missed = any && patches_.empty() && out.rounding <= kLostInRounding && is_finite(job.overlap) &&
                             (patches_.knows_overlap(job.polar.pressure) || may_lie_within(job, 0) || may_lie_within(job, 1)) &&
                             march_.may_meet(job.polar.pressure, job.overlap);
  fits = fits && !may_be_missed;
  RuleReason reason = !any ? RuleReason::Asked : fits ? RuleReason::Fits : RuleReason::NoGraph;
  if (fits && !patches_.empty()) {
    out.summary.rule = ContactRule::Polar;
    const Pressing pressing = third_.empty() ? Pressing::None : thirds_press(job, out);
    cut_by_thirds_ = pressing == Pressing::None && !third_.empty() && fills_regions(job) && thirds_press_beside(job, out);
    if (pressing == Pressing::All) {
      fill_beyond_thirds(job, out);
      return;
    }
    if (pressing == Pressing::Some && !may_leave_imprints(job, out)) {
      cut_by_thirds_ = true;
      fits = polar_cut(job, out);
      if (!fits && any) reason = RuleReason::ThirdBody;
    }
  }
  if (!fits) {
    fits = only != ContactRule::Polar && march(job, out);
    if (!fits && any && !third_.empty() && march(job, out, true) && thirds_press(job, out) == Pressing::All) return fill_beyond_thirds(job, out);
    if (!fits) {
      begin_anew(job, out);
      if (only == ContactRule::Polar || may_be_missed) out.summary.error_estimate = 1.0;
    }
  } else if (any && !patches_.empty() && !meets(out, job.settings().error) && march_instead(job, out)) {
    reason = RuleReason::Unmet;
  }
  out.summary.reason = reason;
}

/// Of squeezed regions that are filled as they are. Forces and moments are the sums on Sigma: how regions share them out among the parts of a body need
/// not be better.
double PairSolver::region_error(const ContactSettings& settings) {
  constexpr double kFinest = 1e-4, kFinestOfOther = 1e-5, kToShare = 1e-2;
  return std::max(settings.error, !settings.energy ? kToShare : settings.other_columns ? kFinestOfOther : kFinest);
}

/// Squeezed regions that columns from Sigma may not hold, or whose Sigma is worse than asked, are filled as they are.
void PairSolver::fill_unsure_regions(const Job& job, PairResult& out) {
  constexpr double kPoor = 1e-3;
  constexpr double kOfCells = 4.0, kCoarsest = 1e-2;  // what is left of a body is known to far less than two orders of cells differ by
  const double asked = region_error(job.settings()), error = std::max(asked, std::min(kOfCells * job.settings().error, kCoarsest));
  PatchPoints& points = out.points;
  const bool poor = out.summary.rule == ContactRule::March && out.summary.error_estimate > std::max(kPoor, asked);
  const bool cut = job.settings().energy && cut_by_thirds_;
  for (const std::size_t side : {0u, 1u}) points.unsure[side] = job.polar.regions[side] != Region::None && (poor || cut || points.unsure[side]);
  if (points.point.empty() || !(points.unsure[0] || points.unsure[1])) return;
  take_all_thirds(job);
  const auto peak = static_cast<std::size_t>(std::max_element(points.pressure.begin(), points.pressure.end()) - points.pressure.begin());
  for (const int side : {0, 1}) {
    if (!points.unsure[side]) continue;
    points.drop_region(side);
    if (!poor && add_columns({job.polar.pressure, side, third_bodies_, job.polar.regions[static_cast<std::size_t>(side)], asked}, points)) continue;
    region_.fill({job.polar.pressure, side, third_bodies_, error}, job.overlap, points.normal[peak], points);
  }
}

/// Where third bodies press harder on all of Sigma: what the bodies lose to each other beside them.
void PairSolver::fill_beyond_thirds(const Job& job, PairResult& out) {
  const auto peak = static_cast<std::size_t>(std::max_element(out.points.pressure.begin(), out.points.pressure.end()) - out.points.pressure.begin());
  const Vec3 across = out.points.normal[peak];
  out.clear();
  out.summary.reason = RuleReason::ThirdBody;
  if (!job.settings().energy) return;
  take_all_thirds(job);
  for (const int side : {0, 1}) {
    if (job.polar.regions[static_cast<std::size_t>(side)] == Region::None) continue;
    region_.fill({job.polar.pressure, side, third_bodies_, region_error(job.settings())}, job.overlap, across, out.points);
  }
}

/// Whether a body may lie in another with all of it. It would press less there everywhere: where its first primitive that has pressure sits, or on its
/// first sample.
bool PairSolver::may_lie_within(const Job& job, int side) {
  const ContactBody& inner = side == 0 ? job.a : job.b;
  const auto presses_less = [&](const Vec3& place) -> std::optional<bool> {  // none: it has no pressure there
    const double own = job.polar.pressure.value(side, place);
    if (!(own > 0.0)) return std::nullopt;
    return own < job.polar.pressure.value(1 - side, place);
  };
  if (inner.skeleton == nullptr) return presses_less(inner.field.surface_box().centre()).value_or(false);
  for (const implicit::Primitive& p : inner.skeleton->primitive) {
    if (const std::optional<bool> less = presses_less(inner.pose[p.part].to_world(p.offset.position))) return *less;
  }
  if (inner.samples == nullptr) return false;
  const auto valid = std::find(inner.samples->valid.begin(), inner.samples->valid.end(), 1);
  if (valid == inner.samples->valid.end()) return false;
  const Vec3& on_surface = inner.samples->point[static_cast<std::size_t>(valid - inner.samples->valid.begin())];
  return (side == 0 ? job.b : job.a).field.value(on_surface) > 0.0;
}

/// One body in the other without Sigma, if it is so: the energy that it took to get there. What presses no more than rounding is no Sigma.
/// @param equal  both press alike everywhere   @param softer  the side that is known to press less everywhere
void PairSolver::fill_within(const Job& job, bool equal, std::optional<int> softer, PairResult& out) {
  PairPressure& pressure = job.polar.pressure;
  if (out.summary.largest_pressure > kEpsilon * pressure.largest_modulus()) return;
  if (!is_finite(job.overlap)) return;
  const int leading = leads(job.a, job.b) ? 0 : 1;
  for (const int side : {leading, 1 - leading}) {
    if (job.polar.regions[static_cast<std::size_t>(side)] == Region::None || !(equal || (softer ? *softer == side : may_lie_within(job, side)))) continue;
    const double unsure = job.settings().only == ContactRule::None ? out.summary.error_estimate : 0.0;
    begin_anew(job, out);
    out.summary.error_estimate = unsure;
    region_.fill({pressure, side, third_bodies_, region_error(job.settings()), equal}, job.overlap, Vec3::UnitZ(), out.points);
    out.summary.reason = RuleReason::Within;
    return;
  }
}

SharedApex PairSolver::search_apex(PairPressure& pressure, std::size_t side, const ContactQuery& query, std::uint32_t body) {
  others_.clear();
  for (const std::uint32_t c : query.partners.of(body)) others_.push_back(&query.bodies[c]);
  SharedApex shared;
  shared.searched = true;
  shared.apex = find_shared_apex(pressure, static_cast<int>(side), others_, query.settings.other_columns ? ApexRank::Next : ApexRank::Best, shared.taker);
  return shared;
}

SharedApex PairSolver::find_apex(const ContactQuery& query, std::uint32_t body) {
  const ContactBody& own = query.bodies[body];
  const std::span<const std::uint32_t> partners = query.partners.of(body);
  if (partners.size() < 2 || own.pose.size() > 1 || !own.field.convex()) return {};
  const std::vector<BodyPair>& pairs = query.candidates.pair;
  for (const std::uint32_t c : partners) {
    const BodyPair pair{std::min(body, c), std::max(body, c)};
    const auto k = static_cast<std::size_t>(std::lower_bound(pairs.begin(), pairs.end(), pair) - pairs.begin());
    const auto presses = [&](std::uint32_t d) { return d != body && d != c && overlap_at_once(query.boxes[d], query.candidates.overlap[k]); };
    const std::span<const std::uint32_t> others = query.partners.of(c);
    if (std::none_of(partners.begin(), partners.end(), presses) && std::none_of(others.begin(), others.end(), presses)) continue;
    PairPressure pressure(own, query.bodies[c]);
    SharedApex shared = search_apex(pressure, 0, query, body);
    shared.pair = k;
    shared.evaluations = pressure.evaluations();
    return shared;
  }
  return {};
}

/// What a convex body loses to several others flows out of one place of it through Sigma of all its pairs: such sides need no region. Obstacles lose to
/// each other what they do not press hardest on, which no Sigma bounds.
void PairSolver::find_apexes(Job& job, const ContactQuery& query) {
  if (third_.empty()) return;
  for (const std::size_t side : {0u, 1u}) {
    if (job.polar.regions[side] != Region::Sums) continue;
    const std::uint32_t body = side == 0 ? job.pair.a : job.pair.b, other = job.pair.a + job.pair.b - body;
    const auto fixed = [&job](std::uint32_t c) { return job.bodies[c].fixed; };
    if (fixed(body) && std::any_of(third_.begin(), third_.end(), fixed)) continue;
    const bool alone = &(side == 0 ? job.a : job.b) == &job.bodies[body];  // not met with others as one
    const SharedApex shared = alone && query.shared_apex[body].searched ? query.shared_apex[body] : search_apex(job.polar.pressure, side, query, body);
    apex_[side] = shared.apex;
    if (!apex_[side]) continue;
    const std::uint32_t by = query.partners.of(body)[shared.taker];
    apex_[side]->lost = apex_[side]->lost && (by == other || (team_ != nullptr && fixed(other) && std::binary_search(team_->member.begin(), team_->member.end(), by)));
    job.polar.regions[side] = Region::None;
  }
}

void PairSolver::add_flows(const Job& job, PairResult& out) {
  for (const std::size_t side : {0u, 1u}) {
    if (!apex_[side] || (out.points.point.empty() && !apex_[side]->lost)) continue;
    add_flow(job.polar.pressure, static_cast<int>(side), *apex_[side], job.settings().error, out.points);
    if (out.points.point.empty()) out.summary.reason = RuleReason::Within;
  }
}

/// Where patches are looked for first.
void PairSolver::find_patches(const Job& job) {
  if (job.convex) {
    patches_.start_from(job.seeds.front(), job.polar.pressure);
  } else if (job.seeds.empty()) {
    patches_.start_from(job.overlap, job.polar.pressure);
  } else {
    patches_.start_from(job.seeds, job.polar.spacing, job.polar.pressure);
  }
}

void PairSolver::solve(const ContactQuery& query, std::size_t k, PairResult& out) {
  const auto& [bodies, candidates, partners, boxes, shared_apex, settings] = query;
  const BodyPair pair = candidates.pair[k];
  out.summary.bodies = pair;
  out.clear();
  patches_.forget();
  if (!join_team(bodies, candidates, partners, pair)) return;
  const bool several = team_ != nullptr;
  const ContactBody& a = several && bodies[pair.a].fixed ? team_->body : bodies[pair.a];
  const ContactBody& b = several && bodies[pair.b].fixed ? team_->body : bodies[pair.b];
  PairPressure pressure(a, b);

  const Box& overlap = several ? team_overlap_ : candidates.overlap[k];
  const std::span<const Vec3> seeds =
      several ? std::span<const Vec3>(team_seeds_) : std::span(candidates.seed).subspan(candidates.offset[k], candidates.offset[k + 1] - candidates.offset[k]);
  const double spacing = candidates.spacing.size() == candidates.pair.size() ? candidates.spacing[k] : 0.0;
  const bool convex = !several && candidates.convex.size() == candidates.pair.size() && candidates.convex[k] != 0;
  const double diagonal = overlap.extent().norm();
  double extent = std::isfinite(diagonal) && diagonal > 0.0 ? diagonal : kInfinity;
  // Boxes that just touch have no extent across, but a patch that is as wide as the samples are apart may be there.
  extent = std::max(extent, convex ? pressure.feature_size() : 2.0 * spacing);
  if (!std::isfinite(extent)) extent = 4.0 * pressure.feature_size();
  if (!std::isfinite(extent)) return;  // two half-spaces

  const Region least = settings.energy ? Region::Sums : Region::None;
  Job job{bodies, boxes, overlap, seeds, pair, a, b, {pressure, settings, {}, extent, spacing, {}, false, {}}, convex};
  find_thirds(job, partners);
  job.polar.regions = {a.pose.size() > 1 ? Region::Points : least, b.pose.size() > 1 ? Region::Points : least};
  if (settings.symmetry && convex) job.polar.axis = axis_of(a, b, seeds.front());
  job.polar.faces = convex && !job.polar.axis && is_finite(overlap);
  const bool equal = coincide(a, b);
  const std::optional<int> softer = equal ? std::nullopt : softer_of_nested_balls(a, b);
  apex_ = {};
  if (!equal) find_apexes(job, query);
  if (!equal && !softer) {
    find_patches(job);
    choose(job, out);
    fill_unsure_regions(job, out);
  }
  fill_within(job, equal, softer, out);
  add_flows(job, out);

  ContactSurface::Summary& summary = out.summary;
  summary.load = out.load;
  if (out.load > 0.0) summary.centre_of_pressure = out.first / out.load;
  summary.energy_a = out.points.energy[0];
  summary.energy_b = out.points.energy[1];
  summary.energy = summary.energy_a + summary.energy_b;
  summary.displaced_a = out.points.displaced[0];
  summary.displaced_b = out.points.displaced[1];
  summary.residual = out.points.residual / pressure.largest_modulus();
  summary.points = out.points.point.size();
  summary.evaluations = pressure.evaluations();
  for (const std::uint32_t body : {pair.a, pair.b}) {
    if (!shared_apex.empty() && shared_apex[body].pair == k) summary.evaluations += shared_apex[body].evaluations;
  }
}

}  // namespace supple::collision
