#include "supple/collision/contact_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "boxes.h"
#include "find_peak.h"
#include "march_rule.h"
#include "polar_rule.h"
#include "sample_rule.h"
#include "symmetry.h"
#include "supple/core/error.h"

namespace supple::collision {
namespace {

/// What one pair gives; each has a slot of its own and is joined in pair order.
struct PairResult {
  ContactSurface::Summary summary;
  PatchPoints points;
};

/// A patch reaches so much farther than its rim, over its radius, where places are told from those of others.
constexpr double kBesideRim = 0.05;

/// Bodies by pair, to find third ones: the partners of body i are partner[offset[i] .. offset[i + 1]), rising.
struct Partners {
  std::vector<std::uint32_t> offset, partner;

  void build(std::size_t bodies, std::span<const BodyPair> pairs) {
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
  [[nodiscard]] std::span<const std::uint32_t> of(std::uint32_t i) const {
    return std::span(partner).subspan(offset[i], offset[i + 1] - offset[i]);
  }
};

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
bool meets(const ContactSurface::Summary& summary, double error) {
  constexpr double kRound = 1e-7, kSlack = 1.01;
  return summary.error_estimate <= std::max(kSlack * error, kRound);
}

/// The solver of one thread; its buffers are reused.
class PairSolver {
 public:
  void solve(std::span<const ContactBody> bodies, const ContactCandidates& candidates, const Partners& partners,
             std::span<const Box> boxes, std::size_t k, const ContactSettings& settings, PairResult& out);

 private:
  bool polar(PairPressure& pressure, const ContactSettings& settings, double extent, double spacing,
             std::span<const ContactBody* const> third, const Box* faces, PairResult& out);
  struct PatchJob {
    PairPressure& pressure;
    const ContactSettings& settings;
    double extent, spacing;
    std::span<const ContactBody* const> third;
    const Box* faces;
  };
  enum class Patch : std::uint8_t { Added, Known, Unfit };
  static constexpr std::size_t kMostPatches = 16;
  bool polar(const PatchJob& job, bool follow, bool& unseen, PairResult& out);
  Patch add_patch(const PatchJob& job, const Vec3& hill, bool follow, PairResult& out);
  [[nodiscard]] bool patches_overlap() const;
  std::optional<Vec3> outside_patches(PairPressure& pressure, double extent);
  void find_crossings(PairPressure& pressure, double spacing);
  [[nodiscard]] bool covered(const Vec3& x, double slack) const;
  void find_thirds(const BodyPair& pair, const Partners& partners, std::span<const Box> boxes, const Box& overlap);
  bool thirds_press(PairPressure& pressure, std::span<const ContactBody> bodies, std::span<const Box> boxes, const PairResult& out);
  bool samples(PairPressure& pressure, std::span<const ContactBody> bodies, const Box& overlap, double spacing,
               const ContactSettings& settings, PairResult& out);
  bool march(PairPressure& pressure, std::span<const ContactBody> bodies, const Box& overlap,
             const ContactSettings& settings, PairResult& out);
  bool stand_in(PairPressure& pressure, std::span<const ContactBody> bodies, const Box& overlap, double spacing,
                const ContactSettings& settings, bool have, PairResult& out);
  bool polar_cut(PairPressure& pressure, const ContactSettings& settings, double extent, double spacing, const Box* faces, PairResult& out);
  void clear(PairResult& out);
  void begin_anew(std::span<const ContactBody> bodies, const Box& overlap, PairResult& out);
  template <class Rule>
  void keep(const Rule& rule, ContactRule name, const Vec3& reference, PairResult& out);
  void add_sums(const PatchSums& sums, const Vec3& reference, ContactSurface::Summary& summary);

  PeakFinder finder_;
  ImprintFinder imprint_;
  PolarRuleSolver polar_;
  SampleRuleSolver samples_;
  MarchRuleSolver march_;
  StartPoints starts_;
  std::vector<Vec3> crossing_, from_, point_, before_;
  std::vector<PolarCover> covers_;
  std::size_t cover_count_ = 0;
  std::vector<std::uint32_t> third_;
  std::vector<const ContactBody*> third_bodies_;
  std::vector<double> value_;
  PressureBatch batch_;
  std::optional<CommonAxis> axis_;
  Regions regions_{};
  Vec3 first_ = Vec3::Zero();  // integral of x p dA
  double load_ = 0.0;
  /// What another rule has left.
  struct Kept {
    PairResult result;
    Vec3 first = Vec3::Zero();
    double load = 0.0;
  } kept_;
};

void PairSolver::add_sums(const PatchSums& sums, const Vec3& reference, ContactSurface::Summary& summary) {
  summary.force -= sums.force;
  summary.moment -= sums.moment + reference.cross(sums.force);
  summary.area += sums.area;
  first_ += sums.first + sums.load * reference;
  load_ += sums.load;
}

/// One polar patch for each hill. @param third  that patches are cut at   @param faces  of convex bodies: a box of their overlap
/// @return false where the rule does not fit
bool PairSolver::polar(PairPressure& pressure, const ContactSettings& settings, double extent, double spacing,
                       std::span<const ContactBody* const> third, const Box* faces, PairResult& out) {
  const PatchJob job{pressure, settings, extent, spacing, third, faces};
  bool unseen = false;
  if (polar(job, false, unseen, out)) return true;
  if (!unseen) return false;
  // A rim that is followed all around leaves nothing out.
  clear(out);
  return polar(job, true, unseen, out);
}

/// @param follow  all rims   @param unseen  whether there is a place of a patch that its rim leaves out
bool PairSolver::polar(const PatchJob& job, bool follow, bool& unseen, PairResult& out) {
  cover_count_ = 0;
  for (const Vec3& hill : starts_.hill) {
    if (add_patch(job, hill, follow, out) == Patch::Unfit) return false;
  }
  // Two patches may lie so near to each other that their seeds have one hill.
  for (std::size_t more = 0; const std::optional<Vec3> x = outside_patches(job.pressure, job.extent); ++more) {
    const Patch found = more < kMostPatches ? add_patch(job, *x, follow, out) : Patch::Unfit;
    unseen = found == Patch::Known && cover_count_ > 0;
    if (found != Patch::Added) return false;
  }
  crossing_.clear();
  if (!job.pressure.convex()) find_crossings(job.pressure, job.spacing);
  for (const Vec3& x : crossing_) {
    if (!covered(x, kBesideRim) && add_patch(job, x, follow, out) == Patch::Unfit) return false;
  }
  out.summary.patches = static_cast<std::uint32_t>(cover_count_);
  return !patches_overlap();
}

bool PairSolver::covered(const Vec3& x, double slack) const {
  return std::any_of(covers_.begin(), covers_.begin() + static_cast<std::ptrdiff_t>(cover_count_),
                     [&](const PolarCover& cover) { return cover.contains(x, slack); });
}

PairSolver::Patch PairSolver::add_patch(const PatchJob& job, const Vec3& hill, bool follow, PairResult& out) {
  if (covered(hill, 0.0)) return Patch::Known;
  std::optional<PeakFrame> frame;
  if (axis_ && job.third.empty()) frame = finder_.find_on_axis(job.pressure, *axis_, hill, job.extent);
  const bool on_axis = frame.has_value();
  if (!on_axis) frame = finder_.climb(job.pressure, hill, job.extent, job.faces != nullptr, job.faces != nullptr);
  if (!frame || covered(frame->origin, 0.0)) return Patch::Known;
  const auto solve = [&] {
    return polar_.solve(job.pressure, *frame, job.settings, regions_, 2.0 * job.extent, job.third, on_axis, follow, job.faces, out.points);
  };
  if (!solve()) {
    if (!frame->flat) return Patch::Unfit;
    frame = finder_.climb(job.pressure, hill, job.extent, job.faces != nullptr, false);
    if (!frame || covered(frame->origin, 0.0)) return Patch::Known;
    if (!solve()) return Patch::Unfit;
  }
  add_sums(polar_.sums(), polar_.origin(), out.summary);
  out.summary.error_estimate = std::max(out.summary.error_estimate, polar_.estimate());
  out.summary.kinks += polar_.kinks();
  if (polar_.largest() > out.summary.largest_pressure) {
    out.summary.largest_pressure = polar_.largest();
    out.summary.largest_overlap = polar_.thickness();
  }
  if (covers_.size() == cover_count_) covers_.emplace_back();
  polar_.cover(covers_[cover_count_++]);
  return Patch::Added;
}

bool PairSolver::patches_overlap() const {
  for (std::size_t i = 0; i < cover_count_; ++i) {
    for (std::size_t j = 0; j < cover_count_; ++j) {
      if (i == j) continue;
      for (const Vec3& x : covers_[i].rim) {
        if (covers_[j].contains(x, 0.0)) return true;
      }
    }
  }
  return false;
}

/// A place of Sigma where both bodies press that belongs to no patch, from the points inside both.
std::optional<Vec3> PairSolver::outside_patches(PairPressure& pressure, double extent) {
  batch_.point.clear();
  for (const Vec3& x : starts_.inside) {
    if (!covered(x, kBesideRim)) batch_.point.push_back(x);
  }
  if (batch_.point.empty()) return std::nullopt;
  // The rest may only seem to lie outside, by a slanted axis: what counts is their foot on Sigma.
  batch_.resize(batch_.point.size());
  double peak = 0.0;
  for (std::size_t i = 0; i < cover_count_; ++i) peak = std::max(peak, covers_[i].frame.peak);
  constexpr int kSteps = 6;
  for (int step = 0; step < kSteps; ++step) {
    pressure.evaluate(batch_);
    if (step + 1 == kSteps) break;
    for (std::size_t i = 0; i < batch_.size(); ++i) {
      const Vec3 slope = batch_.slope_a[i] - batch_.slope_b[i];
      const double square = slope.squaredNorm();
      if (!(square > 0.0)) continue;
      Vec3 move = ((batch_.b[i] - batch_.a[i]) / square) * slope;
      const double length = move.norm();
      if (length > extent) move *= extent / length;
      batch_.point[i] += move;
    }
  }
  for (std::size_t i = 0; i < batch_.size(); ++i) {
    if (std::min(batch_.a[i], batch_.b[i]) <= 1e-3 * peak) continue;
    if (std::abs(batch_.a[i] - batch_.b[i]) > 1e-6 * pressure.largest_modulus()) return batch_.point[i];  // it found no place on Sigma
    if (!covered(batch_.point[i], kBesideRim)) return batch_.point[i];
  }
  return std::nullopt;
}

/// Fills `crossing_`: places near seeds where the surfaces cross, or all but touch, and that belong to no patch. A patch may lie between samples, and
/// beside a larger one, whose hill then is the only one.
void PairSolver::find_crossings(PairPressure& pressure, double spacing) {
  constexpr int kSteps = 6;
  constexpr double kFarthest = 2.0, kLongest = 0.5, kNear = 0.05;  // of the spacing
  crossing_.clear();
  batch_.point.clear();
  from_.clear();
  const auto keep = [&](const Vec3& x, const Vec3& from) {
    if (covered(x, kBesideRim)) return;
    batch_.point.push_back(x);
    from_.push_back(from);
  };
  for (const Vec3& x : starts_.beside) keep(x, x);
  for (int step = 0; step < kSteps && !batch_.point.empty(); ++step) {
    batch_.resize(batch_.point.size());
    pressure.evaluate(batch_);
    point_.swap(batch_.point);
    before_.swap(from_);
    batch_.point.clear();
    from_.clear();
    for (std::size_t i = 0; i < point_.size(); ++i) {
      const double steep_a = batch_.slope_a[i].norm(), steep_b = batch_.slope_b[i].norm();
      if (!(steep_a > 0.0) || !(steep_b > 0.0)) continue;
      // Newton's method to p_A = p_B = 0, the shortest step: normals and distances of both surfaces, to first order.
      const Vec3 normal_a = batch_.slope_a[i] / steep_a, normal_b = batch_.slope_b[i] / steep_b;
      const double off_a = batch_.a[i] / steep_a, off_b = batch_.b[i] / steep_b, c = normal_a.dot(normal_b), square = 1.0 - c * c;
      if (step + 1 == kSteps) {
        if (std::max(std::abs(off_a), std::abs(off_b)) <= kNear * spacing) crossing_.push_back(point_[i]);
        continue;
      }
      if (!(square > 0.0)) continue;
      Vec3 move = ((c * off_b - off_a) / square) * normal_a + ((c * off_a - off_b) / square) * normal_b;
      const double length = move.norm(), longest = kLongest * spacing;
      if (length > longest) move *= longest / length;
      const Vec3 next = point_[i] + move;
      if ((next - before_[i]).norm() <= kFarthest * spacing) keep(next, before_[i]);
    }
  }
}

/// Partners of either body whose surfaces may reach the overlap.
void PairSolver::find_thirds(const BodyPair& pair, const Partners& partners, std::span<const Box> boxes, const Box& overlap) {
  const auto reaches = [&](std::uint32_t c) { return overlap_at_once(boxes[c], overlap); };
  third_.clear();
  third_bodies_.clear();
  for (const std::uint32_t c : partners.of(pair.a)) {
    if (reaches(c) && c != pair.b) third_.push_back(c);
  }
  for (const std::uint32_t c : partners.of(pair.b)) {
    if (!reaches(c) || c == pair.a) continue;
    const auto place = std::lower_bound(third_.begin(), third_.end(), c);
    if (place == third_.end() || *place != c) third_.insert(place, c);
  }
}

/// Whether a third body presses on the patches nearly as much as the pair does.
/// @param boxes  of the bodies' surfaces
bool PairSolver::thirds_press(PairPressure& pressure, std::span<const ContactBody> bodies, std::span<const Box> boxes,
                              const PairResult& out) {
  Box patch;
  for (std::size_t i = 0; i < cover_count_; ++i) {
    for (const Vec3& x : covers_[i].rim) patch.include(x);
    patch.include(covers_[i].frame.origin);
  }
  for (const Vec3& x : out.points.point) patch.include(x);
  constexpr double kMargin = 0.05;
  value_.resize(out.points.point.size());
  bool press = false;
  for (const std::uint32_t c : third_) {
    if (!boxes[c].overlaps(patch) || clear_of(bodies[c], patch) || bodies[c].field.bound(patch).upper <= 0.0) continue;
    third_bodies_.push_back(&bodies[c]);
    bodies[c].field.evaluate(out.points.point, value_);
    for (std::size_t i = 0; i < value_.size(); ++i) {
      const double p = bodies[c].material.modulus * value_[i];
      press = press || p > out.points.pressure[i] - kMargin * out.summary.largest_pressure;
    }
    for (std::size_t i = 0; i < cover_count_ && !press; ++i) {
      press = imprint_.find(pressure, covers_[i], bodies[c], kMargin * out.summary.largest_pressure).has_value();
    }
    // Beyond the outermost nodes the pressure of the pair falls to zero.
    for (std::size_t i = 0; i < cover_count_ && !press; ++i) {
      for (std::size_t k = 0; k < covers_[i].rim.size() && !press; ++k) press = bodies[c].field.value(covers_[i].rim[k]) > 0.0;
    }
  }
  return press;
}

/// Forgets what a rule has left.
void PairSolver::clear(PairResult& out) {
  const BodyPair pair = out.summary.bodies;
  out.summary = {};
  out.summary.bodies = pair;
  out.points.clear();
  first_ = Vec3::Zero();
  load_ = 0.0;
}

/// After a rule that did not fit; finds the third bodies that reach the overlap.
void PairSolver::begin_anew(std::span<const ContactBody> bodies, const Box& overlap, PairResult& out) {
  clear(out);
  third_bodies_.clear();
  for (const std::uint32_t c : third_) {
    if (bodies[c].field.bound(overlap).upper > 0.0) third_bodies_.push_back(&bodies[c]);
  }
}

/// Polar patches again, cut where `third_bodies_` press harder. @return false where the rule does not fit
bool PairSolver::polar_cut(PairPressure& pressure, const ContactSettings& settings, double extent, double spacing, const Box* faces,
                           PairResult& out) {
  clear(out);
  if (!polar(pressure, settings, extent, spacing, third_bodies_, faces, out)) return false;
  if (out.points.point.empty()) return true;  // all of it lies in a third body
  out.summary.rule = ContactRule::Polar;
  out.summary.largest_pressure = *std::max_element(out.points.pressure.begin(), out.points.pressure.end());
  return true;
}

/// The summary of a rule that sees all patches at once.
template <class Rule>
void PairSolver::keep(const Rule& rule, ContactRule name, const Vec3& reference, PairResult& out) {
  add_sums(rule.sums(), reference, out.summary);
  out.summary.rule = name;
  out.summary.error_estimate = rule.estimate();
  out.summary.largest_pressure = *std::max_element(out.points.pressure.begin(), out.points.pressure.end());
  out.summary.largest_overlap = rule.thickness();
  out.summary.patches = std::max(1u, static_cast<std::uint32_t>(cover_count_));
}

bool PairSolver::samples(PairPressure& pressure, std::span<const ContactBody> bodies, const Box& overlap, double spacing,
                         const ContactSettings& settings, PairResult& out) {
  begin_anew(bodies, overlap, out);
  const BodyPair pair = out.summary.bodies;
  const Vec3 reference = overlap.centre();
  // The spacing of the kept samples, or what they would have.
  constexpr double kAcrossFeature = 3.0;
  const double first = spacing > 0.0 ? spacing : pressure.feature_size() / kAcrossFeature;
  if (!samples_.solve(pressure, bodies[pair.a], bodies[pair.b], third_bodies_, overlap, first, settings, regions_, reference,
                      out.points)) {
    return false;
  }
  keep(samples_, ContactRule::Samples, reference, out);
  return true;
}

bool PairSolver::march(PairPressure& pressure, std::span<const ContactBody> bodies, const Box& overlap,
                       const ContactSettings& settings, PairResult& out) {
  begin_anew(bodies, overlap, out);
  const Vec3 reference = overlap.centre();
  const bool alone = settings.symmetry && third_bodies_.empty();
  const std::optional<CommonAxis> axis = alone ? axis_of_symmetry(bodies[out.summary.bodies.a], bodies[out.summary.bodies.b], overlap) : std::nullopt;
  if (!march_.solve(pressure, third_bodies_, overlap, {settings.error, settings.max_refinement}, regions_, axis, reference, out.points)) return false;
  keep(march_, ContactRule::March, reference, out);
  return true;
}

/// The rules that fit where polar rings do not, or are not as good as asked: the first whose bound is, else the least bound.
/// @param have  `out` holds a result already   @return whether it holds one
bool PairSolver::stand_in(PairPressure& pressure, std::span<const ContactBody> bodies, const Box& overlap, double spacing,
                          const ContactSettings& settings, bool have, PairResult& out) {
  // Few samples meet a coarse error with fewer points than marching begins with; finer ones they meet late or never.
  constexpr double kCoarse = 1e-2, kFinestSampled = 1e-3;
  const auto set_aside = [&] {
    std::swap(kept_.result, out);
    std::swap(kept_.first, first_);
    std::swap(kept_.load, load_);
    out.summary.bodies = kept_.result.summary.bodies;
  };
  const std::array<ContactRule, 2> marched_first{ContactRule::March, ContactRule::Samples}, sampled_first{ContactRule::Samples, ContactRule::March};
  for (const ContactRule rule : settings.error >= kCoarse ? sampled_first : marched_first) {
    if (settings.only != ContactRule::None && settings.only != rule) continue;
    if (have && (meets(out.summary, settings.error) || (rule == ContactRule::Samples && out.summary.error_estimate <= kFinestSampled))) continue;
    if (have) set_aside();
    const bool fits = rule == ContactRule::March ? march(pressure, bodies, overlap, settings, out)
                                                 : samples(pressure, bodies, overlap, spacing, settings, out);
    if (have && (!fits || kept_.result.summary.error_estimate <= out.summary.error_estimate)) set_aside();
    have = have || fits;
  }
  return have;
}

void PairSolver::solve(std::span<const ContactBody> bodies, const ContactCandidates& candidates,
                       const Partners& partners, std::span<const Box> boxes, std::size_t k, const ContactSettings& settings,
                       PairResult& out) {
  const BodyPair pair = candidates.pair[k];
  const ContactBody &a = bodies[pair.a], &b = bodies[pair.b];
  PairPressure pressure(a, b);
  const Region least = settings.energy ? Region::Sums : Region::None;
  regions_ = {a.pose.size() > 1 ? Region::Points : least, b.pose.size() > 1 ? Region::Points : least};
  out.summary.bodies = pair;
  clear(out);
  cover_count_ = 0;

  const Box& overlap = candidates.overlap[k];
  const std::span<const Vec3> seeds =
      std::span(candidates.seed).subspan(candidates.offset[k], candidates.offset[k + 1] - candidates.offset[k]);
  const double spacing = candidates.spacing.size() == candidates.pair.size() ? candidates.spacing[k] : 0.0;
  const bool convex = candidates.convex.size() == candidates.pair.size() && candidates.convex[k] != 0;
  const double diagonal = overlap.extent().norm();
  double extent = std::isfinite(diagonal) && diagonal > 0.0 ? diagonal : std::numeric_limits<double>::infinity();
  // Boxes that just touch have no extent across, but a patch that is as wide as the samples are apart may be there.
  extent = std::max(extent, convex ? pressure.feature_size() : 2.0 * spacing);
  if (!std::isfinite(extent)) extent = 4.0 * pressure.feature_size();
  if (!std::isfinite(extent)) return;  // two half-spaces

  find_thirds(pair, partners, boxes, overlap);
  axis_ = settings.symmetry && convex ? axis_of(a, b, seeds.front()) : std::nullopt;

  if (convex) {
    starts_.hill.assign(seeds.begin(), seeds.end());
    starts_.inside.clear();
    starts_.beside.clear();
    batch_.resize(1);
    batch_.point[0] = seeds.front();
    pressure.evaluate_values(batch_);
    if (std::min(batch_.a[0], batch_.b[0]) > 0.0) starts_.inside.push_back(seeds.front());
  } else if (seeds.empty()) {
    finder_.start_from_scan(pressure, overlap, starts_);
  } else {
    finder_.start_from_seeds(pressure, seeds, spacing, starts_);
  }
  const bool any = settings.only == ContactRule::None;
  const Box* faces = convex && !axis_ && overlap.lower.allFinite() && overlap.upper.allFinite() ? &overlap : nullptr;
  const bool polar_first = any || settings.only == ContactRule::Polar;
  bool fits = polar_first && polar(pressure, settings, extent, spacing, {}, faces, out);
  if (convex && polar_first && fits && cover_count_ == 0) {
    // Faces that are nearly parallel are slow to tell where they are nearest: their overlap need not hold the seed.
    finder_.start_from_scan(pressure, overlap, starts_);
    fits = polar(pressure, settings, extent, spacing, {}, faces, out);
  }
  RuleReason reason = any ? RuleReason::Fits : RuleReason::Asked;
  if (any && !fits) reason = RuleReason::NoGraph;
  if (fits && cover_count_ > 0) {
    out.summary.rule = ContactRule::Polar;
    if (any && !third_.empty() && thirds_press(pressure, bodies, boxes, out)) {
      // The squeezed regions of bodies with several parts are not cut that exactly.
      fits = a.pose.size() == 1 && b.pose.size() == 1 && polar_cut(pressure, settings, extent, spacing, faces, out);
      if (!fits) reason = RuleReason::ThirdBody;
    }
  }
  if (!fits && settings.only == ContactRule::Polar) {
    begin_anew(bodies, overlap, out);
    out.summary.error_estimate = 1.0;
  } else if (!fits || (any && cover_count_ > 0 && !meets(out.summary, settings.error))) {
    const bool polar = fits;
    fits = stand_in(pressure, bodies, overlap, spacing, settings, polar, out);
    if (polar && out.summary.rule != ContactRule::Polar) reason = RuleReason::Unmet;
    if (any && !polar && out.summary.rule == ContactRule::March && a.skeleton == nullptr && b.skeleton == nullptr) reason = RuleReason::NoSkeleton;
    if (!fits) {
      begin_anew(bodies, overlap, out);
      const auto touches = [&](const Vec3& hill) { return finder_.climb(pressure, hill, extent, convex, false).has_value(); };
      if (settings.only == ContactRule::Samples && std::any_of(starts_.hill.begin(), starts_.hill.end(), touches)) out.summary.error_estimate = 1.0;
    }
  }
  out.summary.reason = reason;
  ContactSurface::Summary& summary = out.summary;
  summary.load = load_;
  if (load_ > 0.0) summary.centre_of_pressure = first_ / load_;
  summary.energy = out.points.energy;
  summary.displaced_a = out.points.displaced[0];
  summary.displaced_b = out.points.displaced[1];
  summary.residual = out.points.residual / pressure.largest_modulus();
  summary.points = out.points.point.size();
  summary.evaluations = pressure.evaluations();
}

/// Numbers of pairs, points and points of squeezed regions.
struct Extent {
  std::size_t pairs = 0, points = 0, volumes = 0;
  void operator+=(const Extent& other) {
    pairs += other.pairs;
    points += other.points;
    volumes += other.volumes;
  }
};

/// What a surface needs of one pair. @param parted  whether A, B have several parts, whose forces need the regions
Extent extent_of(const PairResult& result, const std::array<bool, 2>& parted) {
  if (result.summary.rule == ContactRule::None && result.summary.error_estimate == 0.0) return {};
  Extent extent{1, result.points.point.size(), 0};
  for (std::size_t i = 0; i < result.points.volume_side.size() && (parted[0] || parted[1]); ++i) {
    extent.volumes += parted[result.points.volume_side[i]] ? 1 : 0;
  }
  return extent;
}

/// @param keep  never fewer entries than there are: what lies beyond is not written again when they are wanted
void resize(ContactSurface& out, const Extent& size, bool keep) {
  const auto to = [keep](std::size_t n, auto&... arrays) { (arrays.resize(keep ? std::max(n, arrays.size()) : n), ...); };
  to(size.pairs, out.summary);
  to(size.points, out.pair, out.point, out.normal, out.area, out.pressure);
  to(size.volumes, out.volume_pair, out.volume_side, out.volume_point, out.volume_weight);
}

/// Copies one pair that touches to its place.
void put(const PairResult& result, const std::array<bool, 2>& parted, const Extent& begin, ContactSurface& out) {
  const auto at = [](auto& to, std::size_t place) { return to.begin() + static_cast<std::ptrdiff_t>(place); };
  const auto index = static_cast<std::uint32_t>(begin.pairs);
  const PatchPoints& points = result.points;
  out.summary[index] = result.summary;
  std::fill_n(at(out.pair, begin.points), points.point.size(), index);
  std::copy(points.point.begin(), points.point.end(), at(out.point, begin.points));
  std::copy(points.normal.begin(), points.normal.end(), at(out.normal, begin.points));
  std::copy(points.area.begin(), points.area.end(), at(out.area, begin.points));
  std::copy(points.pressure.begin(), points.pressure.end(), at(out.pressure, begin.points));
  std::size_t place = begin.volumes;
  for (std::size_t i = 0; i < points.volume_side.size() && (parted[0] || parted[1]); ++i) {
    if (!parted[points.volume_side[i]]) continue;
    out.volume_pair[place] = index;
    out.volume_side[place] = points.volume_side[i];
    out.volume_point[place] = points.volume_point[i];
    out.volume_weight[place++] = points.volume_weight[i];
  }
}

}  // namespace

void ContactSurface::clear() {
  pair.clear();
  point.clear();
  normal.clear();
  area.clear();
  pressure.clear();
  volume_pair.clear();
  volume_side.clear();
  volume_point.clear();
  volume_weight.clear();
  summary.clear();
}

void solve_contact_surface(std::span<const ContactBody> bodies, const ContactCandidates& candidates,
                           const ContactSettings& settings, const Executor& executor, ContactSurface& out) {
  SUPPLE_EXPECTS(settings.error >= 1e-10 && settings.error <= 0.1);
  SUPPLE_EXPECTS(candidates.offset.size() == candidates.pair.size() + 1);
  if (candidates.pair.empty()) return out.clear();
  thread_local std::vector<PairResult> results;
  thread_local std::vector<Extent> begins;  // of blocks
  thread_local Partners partners;
  thread_local std::vector<Box> boxes;
  boxes.resize(bodies.size());
  partners.build(bodies.size(), candidates.pair);
  // In portions, so that what pairs leave behind is joined while it is still near, and buffers stay small.
  constexpr std::size_t kPortion = 512, kBlock = 4;
  const std::size_t pairs = candidates.pair.size();
  if (results.size() < std::min(pairs, kPortion)) results.resize(std::min(pairs, kPortion));
  begins.resize(kPortion / kBlock);
  struct Job {
    std::span<const ContactBody> bodies;
    const ContactCandidates& candidates;
    const ContactSettings& settings;
    const Partners& partners;
    std::span<Box> boxes;
    std::vector<PairResult>& results;
    std::vector<Extent>& begins;
    ContactSurface& out;
    std::size_t first;
    [[nodiscard]] std::array<bool, 2> parted(std::size_t k) const {
      const BodyPair& pair = candidates.pair[first + k];
      return {bodies[pair.a].pose.size() > 1, bodies[pair.b].pose.size() > 1};
    }
  } job{bodies, candidates, settings, partners, boxes, results, begins, out, 0};
  constexpr std::size_t kBodies = 64;
  executor.for_blocks(bodies.size(), kBodies, [&job](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) job.boxes[i] = job.bodies[i].field ? job.bodies[i].field.surface_box() : Box{};
  });
  Extent size;
  for (; job.first < pairs; job.first += kPortion) {
    const std::size_t count = std::min(kPortion, pairs - job.first);
    executor.for_blocks(count, kBlock, [&job](std::size_t begin, std::size_t end) {
      thread_local PairSolver solver;
      Extent block;
      for (std::size_t k = begin; k < end; ++k) {
        solver.solve(job.bodies, job.candidates, job.partners, job.boxes, job.first + k, job.settings, job.results[k]);
        block += extent_of(job.results[k], job.parted(k));
      }
      job.begins[begin / kBlock] = block;
    });
    for (std::size_t block = 0; block * kBlock < count; ++block) {
      const Extent extent = begins[block];
      begins[block] = size;
      size += extent;
    }
    resize(out, size, true);
    executor.for_blocks(count, kBlock, [&job](std::size_t begin, std::size_t end) {
      Extent at = job.begins[begin / kBlock];
      for (std::size_t k = begin; k < end; ++k) {
        const std::array<bool, 2> parted = job.parted(k);
        const Extent extent = extent_of(job.results[k], parted);
        if (extent.pairs > 0) put(job.results[k], parted, at, job.out);
        at += extent;
      }
    });
  }
  resize(out, size, false);
}

}  // namespace supple::collision
