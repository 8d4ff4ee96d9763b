#include "surface/march/sample_rule.h"

#include <cmath>
#include <limits>
#include <utility>

#include "surface/quadrature.h"
#include "surface/region/squeezed_region.h"

namespace supple::collision {
namespace {

constexpr double kLeastCosine = 1.0 / 16.0;  // as for surface samples: beyond, the ray is no measure of the surface
constexpr int kLeastStretches = 3, kMostStretches = 16;
constexpr int kRootSteps = 40;
constexpr int kMostLevels = 32;
constexpr double kFewPoints = 24.0;  // fewer say nothing about their error
constexpr double kRim = 0.75;       // half width of the rim in cells: wider blurs it, narrower leaves the cells' places visible
constexpr double kSafety = 2.7;
constexpr double kOfLast = 0.35;     // of the bound of the spacing before: the next may agree with it by chance
constexpr double kEnough = 0.9;      // of the error asked: what that asks no finer spacing for
constexpr double kEdgeOn = 0.01;     // of a cell of the surface: so near to where they begin rays see Sigma from beside it, if at all
constexpr double kCellError = 4.0;   // what the places of the cells may do, in the largest share of a cell over the area
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double fourth_power(double x) { return x * x * x * x; }

}  // namespace

void SampleRuleSolver::Rays::clear() {
  foot.clear();
  direction.clear();
  spread.clear();
  begin.clear();
  reach.clear();
  end.clear();
  primitive.clear();
  first.assign(1, 0);
  station.clear();
}

/// The box around the parts of the overlap's box where both bodies may be, by their bounds.
Box SampleRuleSolver::shrink(const Box& overlap) const {
  constexpr int kParts = 4, kRounds = 3;
  Box box = overlap;
  for (int round = 0; round < kRounds; ++round) {
    Box held;
    const Vec3 step = box.extent() / kParts;
    for (int n = 0; n < kParts * kParts * kParts; ++n) {
      Box part;
      part.lower = box.lower + step.cwiseProduct(Vec3(n % kParts, n / kParts % kParts, n / (kParts * kParts)));
      part.upper = part.lower + step;
      if (body_[0]->field.bound(part).upper >= 0.0 && body_[1]->field.bound(part).upper >= 0.0) held = held.united(part);
    }
    box = held;
    if (box.empty()) break;
  }
  return box;
}

/// The rays of one body that meet the box, with the pressures at stations along them. @return seeds looked at
std::size_t SampleRuleSolver::send(PairPressure& pressure, int side, const Box& box, double spacing) {
  Rays& rays = rays_[static_cast<std::size_t>(side)];
  rays.clear();
  const ContactBody& body = *body_[static_cast<std::size_t>(side)];
  if (body.skeleton == nullptr) return 0;
  const std::size_t seen = implicit::make_sample_layout(*body.skeleton, spacing, body.pose, box, layout_);
  const double feature = pressure.feature_size();
  for (std::size_t s = 0; s < layout_.size(); ++s) {
    const Pose& pose = body.pose[layout_.part[s]];
    const Vec3 foot = pose.to_world(layout_.foot[s]), direction = pose.orientation * layout_.direction[s];
    double begin = 0.0, end = layout_.reach[s];
    for (int k = 0; k < 3; ++k) {
      if (direction[k] == 0.0) continue;
      const double one = (box.lower[k] - foot[k]) / direction[k], other = (box.upper[k] - foot[k]) / direction[k];
      begin = std::max(begin, std::min(one, other));
      end = std::min(end, std::max(one, other));
    }
    if (!(end > begin)) continue;
    rays.foot.push_back(foot);
    rays.direction.push_back(direction);
    rays.spread.push_back(layout_.spread[s]);
    rays.begin.push_back(begin);
    rays.reach.push_back(layout_.reach[s]);
    rays.end.push_back(end);
    rays.primitive.push_back(layout_.primitive[s]);
    const double wanted = std::ceil(4.0 * (end - begin) / feature);
    const int stretches = static_cast<int>(std::clamp(wanted, double{kLeastStretches}, double{kMostStretches}));
    for (int i = 0; i <= stretches; ++i) rays.station.push_back(begin + (end - begin) * i / stretches);
    rays.first.push_back(static_cast<std::uint32_t>(rays.station.size()));
  }
  at_.resize(rays.station.size());
  for (std::size_t r = 0; r < rays.size(); ++r) {
    for (std::uint32_t i = rays.first[r]; i < rays.first[r + 1]; ++i) at_.point[i] = rays.at(r, rays.station[i]);
  }
  pressure.evaluate_values(at_);
  rays.gap.resize(at_.size());
  for (std::size_t i = 0; i < at_.size(); ++i) rays.gap[i] = at_.a[i] - at_.b[i];
  rays.own.assign(side == 0 ? at_.a.begin() : at_.b.begin(), side == 0 ? at_.a.end() : at_.b.end());
  return seen;
}

/// All roots of p_A - p_B between stations, by bracketed Newton in batches.
/// @param scale  pressure below which a difference counts as none [Pa]
void SampleRuleSolver::find_crossings(PairPressure& pressure, double scale) {
  crossings_.clear();
  for (std::uint32_t side = 0; side < 2; ++side) {
    const Rays& rays = rays_[side];
    for (std::uint32_t r = 0; r < rays.size(); ++r) {
      for (std::uint32_t i = rays.first[r]; i + 1 < rays.first[r + 1]; ++i) {
        const double f = rays.gap[i], g = rays.gap[i + 1];
        if ((f > 0.0) == (g > 0.0)) continue;
        const double low = rays.station[i], high = rays.station[i + 1];
        crossings_.push_back({side, r, low, high, low + (high - low) * (f / (f - g)), f > 0.0});
      }
    }
  }
  open_.resize(crossings_.size());
  for (std::uint32_t c = 0; c < open_.size(); ++c) open_[c] = c;
  for (int step = 0; step < kRootSteps && !open_.empty(); ++step) {
    at_.resize(open_.size());
    for (std::size_t i = 0; i < open_.size(); ++i) {
      const Crossing& c = crossings_[open_[i]];
      at_.point[i] = rays_[c.side].at(c.ray, c.t);
    }
    pressure.evaluate(at_);
    std::size_t left = 0;
    for (std::size_t i = 0; i < open_.size(); ++i) {
      Crossing& c = crossings_[open_[i]];
      const double gap = at_.a[i] - at_.b[i];
      if (std::abs(gap) <= scale) continue;
      ((gap > 0.0) == c.falls ? c.low : c.high) = c.t;
      double next = c.t - gap / (at_.slope_a[i] - at_.slope_b[i]).dot(rays_[c.side].direction[c.ray]);
      if (!(next > c.low && next < c.high)) next = 0.5 * (c.low + c.high);
      const bool moves = std::abs(next - c.t) > 4.0 * std::numeric_limits<double>::epsilon() * at_.point[i].lpNorm<Eigen::Infinity>();
      c.t = next;
      if (moves) open_[left++] = open_[i];
    }
    open_.resize(left);
  }
}

/// The largest pressure of third bodies at the points of `at_`, with its slope.
void SampleRuleSolver::third_pressures(std::span<const ContactBody* const> third) {
  const std::size_t n = at_.size();
  third_.assign(n, -kInfinity);
  if (third.empty()) return;
  third_slope_.assign(n, Vec3::Zero());
  value_.resize(n);
  slope_.resize(n);
  for (const ContactBody* body : third) {
    body->field.evaluate(at_.point, value_, slope_);
    for (std::size_t i = 0; i < n; ++i) {
      const double p = body->material.modulus * value_[i];
      if (p <= third_[i]) continue;
      third_[i] = p;
      third_slope_[i] = body->material.modulus * slope_[i];
    }
  }
}

template <class Use>
void SampleRuleSolver::for_contributions(int side, std::size_t point, const Vec3& x, const Use& use) const {
  const ContactBody& body = *body_[static_cast<std::size_t>(side)];
  const implicit::FieldParts& parts = parts_[static_cast<std::size_t>(side)];
  const std::vector<implicit::Primitive>& all = body.skeleton->primitive;
  for (std::uint32_t row = parts.offset[point]; row < parts.offset[point + 1]; ++row) {
    const std::uint32_t part = parts.part[row];
    auto p = std::partition_point(all.begin(), all.end(), [&](const implicit::Primitive& q) { return q.part < part; });
    if (p == all.end() || p->part != part) continue;
    const auto next = p + 1;
    if (next == all.end() || next->part != part) {
      use(static_cast<std::uint32_t>(p - all.begin()), parts.value[row], parts.gradient[row]);
      continue;
    }
    for (; p != all.end() && p->part == part; ++p) {
      const Vec3 y = p->offset.to_body(body.pose[part].to_body(x));
      const implicit::Potential f = implicit::potential(*p, y);
      const Vec3 gradient = body.pose[part].orientation * (p->offset.orientation * f.gradient);
      use(static_cast<std::uint32_t>(p - all.begin()), f.value, gradient);
    }
  }
}

/// Share of each crossing's bundle in the partition of unity at its point: the fourth power of the contribution to the
/// body's sum, times the squared cosine between the contribution's slope and Sigma's normal.
void SampleRuleSolver::shares(const PressureBatch& at) {
  for (const std::size_t side : {0u, 1u}) {
    if (body_[side]->skeleton != nullptr) body_[side]->field.evaluate_parts(at.point, parts_[side]);
  }
  share_.assign(at.size(), 0.0);
  for (std::size_t i = 0; i < at.size(); ++i) {
    const Crossing& c = crossings_[i];
    const Vec3 across = at.slope_b[i] - at.slope_a[i];
    double own = 0.0, all = 0.0;
    for (const int side : {0, 1}) {
      if (body_[static_cast<std::size_t>(side)]->skeleton == nullptr) continue;
      double sum = 0.0;
      for_contributions(side, i, at.point[i], [&](std::uint32_t, double value, const Vec3&) { sum += std::max(value, 0.0); });
      if (!(sum > 0.0)) continue;
      for_contributions(side, i, at.point[i], [&](std::uint32_t primitive, double value, const Vec3& gradient) {
        const double square = gradient.squaredNorm();
        if (!(value > 0.0) || !(square > 0.0)) return;
        const double along = gradient.dot(across);
        const double weight = fourth_power(value / sum) * (along * along / square);
        all += weight;
        if (static_cast<std::uint32_t>(side) == c.side && primitive == rays_[c.side].primitive[c.ray]) own = weight;
      });
    }
    if (all > 0.0) share_[i] = own / all;
  }
}

void SampleRuleSolver::place_points(PairPressure& pressure, std::span<const ContactBody* const> third, const Vec3& reference,
                                    PatchPoints& points) {
  points.clear();
  sums_ = {};
  at_.resize(crossings_.size());
  for (std::size_t i = 0; i < crossings_.size(); ++i) at_.point[i] = rays_[crossings_[i].side].at(crossings_[i].ray, crossings_[i].t);
  pressure.evaluate(at_);
  shares(at_);
  third_pressures(third);
  weight_.clear();
  moved_.resize(0);
  largest_cell_ = 0.0;
  edge_on_ = false;
  for (std::size_t i = 0; i < at_.size(); ++i) {
    if (!(share_[i] > 0.0)) continue;
    const Crossing& c = crossings_[i];
    const Vec3 across = at_.slope_b[i] - at_.slope_a[i];
    const Vec3 normal = across.normalized();
    const double cosine = std::max(std::abs(normal.dot(rays_[c.side].direction[c.ray])), kLeastCosine);
    const double swept = rays_[c.side].swept(c.ray, c.t), cell = swept / cosine;
    const double p = 0.5 * (at_.a[i] + at_.b[i]);
    Vec3 slope = at_.slope_a[i];
    double room = p;
    if (p - third_[i] < p) {
      room = p - third_[i];
      slope -= third_slope_[i];
    }
    slope -= slope.dot(normal) * normal;
    // A cell that the rim cuts counts with the share inside. Its point moves in by so much that the load that a linear
    // pressure has over all cuts is right: the middle of the part inside would have more.
    const double half = kRim * std::sqrt(cell), steepness = slope.norm();
    double inside = 1.0;
    Vec3 x = at_.point[i];
    if (room < half * steepness) {
      if (room <= -half * steepness) continue;
      const double distance = room / steepness;
      inside = 0.5 * (1.0 + distance / half);
      x += ((inside * inside * half - distance) / steepness) * slope;
    } else if (!(room > 0.0)) {
      continue;
    }
    largest_cell_ = std::max(largest_cell_, share_[i] * cell);
    edge_on_ = edge_on_ || swept < kEdgeOn * spacing_ * spacing_;
    moved_.point.push_back(x);
    weight_.push_back(share_[i] * cell * inside);
  }
  const std::size_t n = moved_.point.size();
  moved_.resize(n);
  const double enough = 1e-12 * pressure.largest_modulus();
  constexpr int kSteps = 8;
  for (int step = 0; step < kSteps; ++step) {
    pressure.evaluate(moved_);
    bool moves = false;
    for (std::size_t i = 0; i < n && step + 1 < kSteps; ++i) {
      const Vec3 across = moved_.slope_b[i] - moved_.slope_a[i];
      const double gap = moved_.a[i] - moved_.b[i], square = across.squaredNorm();
      if (std::abs(gap) <= enough || !(square > 0.0)) continue;
      moved_.point[i] += (gap / square) * across;
      moves = true;
    }
    if (!moves) break;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double p = 0.5 * (moved_.a[i] + moved_.b[i]), gap = std::abs(moved_.a[i] - moved_.b[i]);
    const Vec3 across = moved_.slope_b[i] - moved_.slope_a[i];
    const double steepness = across.norm();
    if (!(p > 0.0) || !(steepness > 0.0) || gap > 1e-10 * pressure.largest_modulus()) continue;
    const Vec3 normal = across / steepness;
    sums_.add(moved_.point[i] - reference, normal, weight_[i], p);
    points.point.push_back(moved_.point[i]);
    points.normal.push_back(normal);
    points.area.push_back(weight_[i]);
    points.pressure.push_back(p);
    points.residual = std::max(points.residual, gap);
  }
}

/// Gauss points on the stretches of the rays of one body beyond Sigma, where its pressure is the smaller one. Where a third body presses harder the
/// stretch begins on another Sigma, with whose pair it counts.
void SampleRuleSolver::add_columns(PairPressure& pressure, int side, std::span<const ContactBody* const> third,
                                   PatchPoints& points) {
  const Rays& rays = rays_[static_cast<std::size_t>(side)];
  const double sign = side == 0 ? 1.0 : -1.0;  // of own - other
  column_.clear();
  std::size_t c = 0;
  while (c < crossings_.size() && crossings_[c].side != static_cast<std::uint32_t>(side)) ++c;
  for (std::uint32_t r = 0; r < rays.size(); ++r) {
    const double last = rays.reach[r];
    const bool own_smaller = sign * rays.gap[rays.first[r]] < 0.0;
    if (rays.begin[r] == 0.0 && own_smaller && rays.own[rays.first[r]] > 0.0) {
      const double other = rays.own[rays.first[r]] + std::abs(rays.gap[rays.first[r]]);
      const auto harder = [&](const ContactBody* body) { return body->material.modulus * body->field.value(rays.foot[r]) > other; };
      if (std::none_of(third.begin(), third.end(), harder)) column_.push_back({r, rays.begin[r], last});
    }
    for (; c < crossings_.size() && crossings_[c].side == static_cast<std::uint32_t>(side) && crossings_[c].ray == r; ++c) {
      const bool enters = crossings_[c].falls == (side == 0);
      if (third_[c] > at_.a[c]) continue;
      if (enters) {
        column_.push_back({r, crossings_[c].t, last});
      } else if (!column_.empty() && column_.back().ray == r) {
        column_.back().end = crossings_[c].t;
      }
    }
  }
  // Each ends where the own pressure vanishes, if it does before.
  struct Bracket {
    double low, high, t;
  };
  thread_local std::vector<Bracket> bracket;
  bracket.clear();
  for (const Column& k : column_) bracket.push_back({k.begin, k.end, k.begin});
  open_.resize(column_.size());
  for (std::uint32_t k = 0; k < open_.size(); ++k) open_[k] = k;
  const double enough = 1e-9 * pressure.modulus(side);
  for (int step = 0; step < kRootSteps && !open_.empty(); ++step) {
    moved_.point.resize(open_.size());
    value_.resize(open_.size());
    slope_.resize(open_.size());
    for (std::size_t i = 0; i < open_.size(); ++i) moved_.point[i] = rays.at(column_[open_[i]].ray, bracket[open_[i]].t);
    pressure.evaluate(side, moved_.point, value_, slope_);
    std::size_t left = 0;
    for (std::size_t i = 0; i < open_.size(); ++i) {
      Bracket& b = bracket[open_[i]];
      if (step == 0 && !(value_[i] > 0.0)) {  // outside already
        b.high = b.low;
        continue;
      }
      if (std::abs(value_[i]) <= enough) continue;
      (value_[i] > 0.0 ? b.low : b.high) = b.t;
      double next = b.t - value_[i] / slope_[i].dot(rays.direction[column_[open_[i]].ray]);
      if (!(next > b.low && next < b.high)) next = 0.5 * (b.low + b.high);
      const bool moves = std::abs(next - b.t) > 1e-9 * spacing_;
      b.t = next;
      if (moves) open_[left++] = open_[i];
    }
    open_.resize(left);
  }

  open_.clear();
  constexpr int kNodes = 3;
  const GaussRule& gauss = gauss_rule(kNodes);
  const std::size_t begin = points.volume_point.size();
  const std::vector<implicit::Primitive>& all = body_[static_cast<std::size_t>(side)]->skeleton->primitive;
  for (std::size_t k = 0; k < column_.size(); ++k) {
    const std::uint32_t r = column_[k].ray;
    const double length = bracket[k].t - column_[k].begin;
    if (!(length > 0.0)) continue;
    for (std::size_t j = 0; j < gauss.node.size(); ++j) {
      const double t = column_[k].begin + length * gauss.node[j];
      points.volume_point.push_back(rays.at(r, t));
      points.volume_weight.push_back(rays.swept(r, t) * length * gauss.weight[j]);
      if (all.size() > 1) open_.push_back(rays.primitive[r]);
    }
  }
  const auto added = std::span(points.volume_point).subspan(begin);
  if (all.size() > 1) {
    // The bundles of several primitives overlap: each gets its share.
    body_[static_cast<std::size_t>(side)]->field.evaluate_parts(added, parts_[static_cast<std::size_t>(side)]);
    for (std::size_t i = 0; i < added.size(); ++i) {
      double own = 0.0, sum = 0.0;
      for_contributions(side, i, added[i], [&](std::uint32_t primitive, double value, const Vec3&) {
        const double weight = fourth_power(std::max(value, 0.0));
        sum += weight;
        if (primitive == open_[i]) own = weight;
      });
      points.volume_weight[begin + i] *= sum > 0.0 ? own / sum : 0.0;
    }
  }
  add_to_region(pressure, side, begin, value_, points);
}

/// The same for a body without rays, along its slope from the points on Sigma: exact where level sets are planes.
void SampleRuleSolver::add_columns_across(PairPressure& pressure, int side, PatchPoints& points) {
  constexpr int kNodes = 3;
  const GaussRule& gauss = gauss_rule(kNodes);
  const std::size_t n = points.point.size(), begin = points.volume_point.size();
  value_.resize(n);
  slope_.resize(n);
  pressure.evaluate(side, points.point, value_, slope_);
  for (std::size_t i = 0; i < n; ++i) {
    const double steepness = slope_[i].norm();
    if (!(steepness > 0.0)) continue;
    const Vec3 along = -slope_[i] / steepness;
    const double length = points.pressure[i] / steepness;
    for (std::size_t j = 0; j < gauss.node.size(); ++j) {
      points.volume_point.push_back(points.point[i] + (length * gauss.node[j]) * along);
      points.volume_weight.push_back(points.area[i] * std::abs(points.normal[i].dot(along)) * length * gauss.weight[j]);
    }
  }
  add_to_region(pressure, side, begin, value_, points);
}

bool SampleRuleSolver::solve(const Job& job, PatchPoints& points) {
  PairPressure& pressure = job.pressure;
  const Box& overlap = job.overlap;
  const Limits& limits = job.limits;
  body_ = {&pressure.body(0), &pressure.body(1)};
  estimate_ = 1.0;
  thickness_ = 0.0;
  points.clear();
  if (body_[0]->skeleton == nullptr && body_[1]->skeleton == nullptr) return false;
  if (overlap.empty() || !overlap.lower.allFinite() || !overlap.upper.allFinite()) return false;
  const double scale = 1e-13 * pressure.largest_modulus();
  const std::size_t evaluated_before = pressure.evaluations();
  std::size_t evaluated = 0;
  PatchSums coarse;
  int refined = -1;
  Box patch = shrink(overlap);
  if (patch.empty()) return false;
  spacing_ = job.spacing;
  for (int level = 0; level < kMostLevels; ++level, spacing_ *= 0.5) {
    const Box box = patch.inflated(spacing_);
    std::size_t seen = 0;
    for (const int side : {0, 1}) seen += send(pressure, side, box, spacing_);
    find_crossings(pressure, scale);
    place_points(pressure, job.third, job.reference, points);
    const bool last = 4 * seen > limits.rays || level + 1 == kMostLevels;
    const std::size_t before = std::exchange(evaluated, pressure.evaluations() - evaluated_before);
    // What the error falls to, and evaluations grow to, when the spacing is halved.
    constexpr double kFall = 0.25, kGrow = 4.0;
    const auto within = [&] {
      double more = kGrow * static_cast<double>(evaluated - before), sum = static_cast<double>(evaluated) + more;
      for (double error = kFall * estimate_; refined > 0 && error > limits.error; error *= kFall) sum += more *= kGrow;
      return sum <= static_cast<double>(limits.evaluations);
    };
    if (static_cast<double>(points.point.size()) < kFewPoints) {
      if (last) break;
      if (!within()) return false;
      continue;
    }
    if (refined >= 0) {
      const double least = refined > 0 ? std::min(kOfLast * estimate_, kEnough * limits.error) : 0.0;
      estimate_ = edge_on_ ? 1.0 : std::max(kSafety * relative_difference(sums_, coarse) + kCellError * largest_cell_ / sums_.area, least);
    }
    ++refined;
    if (last || estimate_ <= limits.error || refined >= limits.refinements) break;
    if (!within()) return false;
    coarse = sums_;
    Box held;
    for (const Vec3& x : points.point) held.include(x);
    patch = held.inflated(spacing_).intersection(patch);
  }
  if (!(sums_.load > 0.0)) return false;
  for (const int side : {0, 1}) {
    if (job.regions[static_cast<std::size_t>(side)] == Region::None) continue;
    if (body_[static_cast<std::size_t>(side)]->skeleton != nullptr) {
      add_columns(pressure, side, job.third, points);
    } else {
      add_columns_across(pressure, side, points);
    }
  }
  const auto peak = static_cast<std::size_t>(std::max_element(points.pressure.begin(), points.pressure.end()) - points.pressure.begin());
  for (const int side : {0, 1}) thickness_ += pressure.overlap_out_of(side, points.point[peak], (side == 0 ? 1.0 : -1.0) * points.normal[peak], spacing_);
  return true;
}

}  // namespace supple::collision
