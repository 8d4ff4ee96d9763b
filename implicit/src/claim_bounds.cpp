#include "claim_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "shortest_in_hull.h"

namespace supple::implicit {

namespace {

Interval scaled(const Interval& value, double weight) { return {weight * value.lower, weight * value.upper}; }

}  // namespace

Claim::Claim(const SearchedBody& body, bool alone) : field_(body.field), weight_(body.weight) {
  if (alone) return;
  const double bound = gradient_bound(surface_box());
  if (bound > 0.0 && std::isfinite(bound)) steepness_ = bound;
}

void find_candidates(std::span<const Claim> claims, const Box& box, std::span<const std::uint32_t> bodies, Candidates& found) {
  found.body.assign(bodies.begin(), bodies.end());
  found.offset.assign(1, 0);
  found.primitive.clear();
  for (const std::uint32_t body : bodies) {
    if (is_sum(claims[body].field())) find_primitives(claims[body].field(), box, found.primitive);
    found.offset.push_back(static_cast<std::uint32_t>(found.primitive.size()));
  }
}

void CubeBounds::narrow(const Candidates& from, Candidates& narrowed) const {
  narrowed.body = from.body;
  narrowed.offset.assign(1, 0);
  narrowed.primitive.clear();
  for (const Entry& entry : entries().subspan(1)) {
    for (const GradientBounds::Term& term : entry.bounds.term) narrowed.primitive.push_back(term.id);
    narrowed.offset.push_back(static_cast<std::uint32_t>(narrowed.primitive.size()));
  }
}

void CubeBounds::start(const Box& box, const Candidates& candidates) {
  count_ = 1 + candidates.body.size();
  if (entry_.size() < count_) entry_.resize(count_);
  for (std::size_t k = 0; k + 1 < count_; ++k) {
    const Claim& claim = claims_[candidates.body[k]];
    Entry& entry = entry_[k + 1];
    entry.label = candidates.body[k] + 1;
    entry.steepness = claim.steepness();
    entry.weight = claim.weight();
    start_bounds(claim.field(), box, candidates.primitives_of(k), entry.bounds);
    entry.value = scaled(entry.bounds.value, entry.weight);
  }
}

void CubeBounds::add(Step step, const Box& box) {
  for (Entry& entry : entries().subspan(1)) {
    step(claims_[entry.label - 1].field(), box, entry.bounds);
    entry.value = scaled(entry.bounds.value, entry.weight);
  }
}

Verdict CubeBounds::operator()(const Box& box, const Candidates& candidates, bool flat_anyway) {
  start(box, candidates);
  Verdict verdict = judge();
  if (verdict.certain && !flat_anyway) return verdict;
  add(add_slopes, box);
  verdict.flat = is_flat();
  if (verdict.flat) return verdict;
  add(add_curvature, box);
  verdict = judge();
  verdict.flat = is_flat();
  return verdict;
}

bool CubeBounds::is_flat() {
  if (count_ == 2) return rises(entry_[1]);  // alone: space outside falls where it rises
  return std::all_of(entries().begin(), entries().end(),
      [&](const Entry& e) { return e.value.upper < most_ || rises(e) || (e.label == 0 && passes_round_bodies()); });
}

bool CubeBounds::knows_eighths() const {
  bool all_round = true;
  for (const Entry& e : entries().subspan(1)) {
    if (!e.bounds.term.empty() && !e.bounds.curved.known) return false;
    if (e.bounds.hull.size() != 1) return false;
    all_round = all_round && (e.bounds.term.empty() || e.bounds.round);
  }
  return !all_round;
}

std::array<Verdict, 8> CubeBounds::eighths(const Box& box) {
  std::array<Verdict, 8> verdict;
  if (!knows_eighths()) return verdict;
  const Vec3 half = 0.25 * box.extent();
  const double reach = (half + rounding_of(box)).norm(), largest = half.maxCoeff();
  std::array<Vec3, 8> middle;
  for (unsigned c = 0; c < 8; ++c) {
    for (unsigned k = 0; k < 3; ++k) middle[c][k] = box.lower[k] + ((c >> k & 1u) != 0 ? 3.0 : 1.0) * half[k];
  }
  value_.resize(count_);
  slope_.resize(count_);
  for (std::size_t i = 1; i < count_; ++i) {
    if (entry_[i].bounds.curved.known) claims_[entry_[i].label - 1].field().evaluate(middle, value_[i], slope_[i]);
  }
  for (unsigned c = 0; c < 8; ++c) {
    for (std::size_t i = 1; i < count_; ++i) {
      GradientBounds& bounds = entry_[i].bounds;
      if (!bounds.curved.known) continue;  // the same everywhere
      bounds.term.clear();  // of the whole box
      const auto& [lower, upper] = bounds.curved.curvature;
      const double first = slope_[i][c].cwiseAbs().dot(half + rounding_of(box)) + bounds.curved.round_off, second = 0.5 * reach * reach;
      bounds.value = {value_[i][c] - first + second * lower, value_[i][c] + first + second * upper};
      entry_[i].value = scaled(bounds.value, entry_[i].weight);
      bounds.hull[0] = {slope_[i][c], std::max(-lower, upper) * reach + bounds.curved.round_off / largest};
    }
    verdict[c] = judge();
    verdict[c].flat = is_flat();
  }
  return verdict;
}

Verdict CubeBounds::judge() {
  most_ = 0.0;
  for (const Entry& e : entries()) most_ = std::max(most_, e.value.lower);
  Verdict verdict;
  int possible = 0;
  for (const Entry& e : entries()) {
    if (e.value.upper < most_ || (e.label != 0 && !(e.value.upper > 0.0))) continue;
    ++possible;
    verdict.label = e.label;
    verdict.second_order = verdict.second_order && e.bounds.second_order;
  }
  verdict.certain = possible == 1;
  return verdict;
}

bool CubeBounds::passes_round_bodies() const {
  return lead_.size() <= 3 && std::all_of(lead_.begin(), lead_.end(), [](const Lead& l) {
    const GradientBounds& bounds = l.other->bounds;
    if (!bounds.round || bounds.hull.size() != 1) return false;
    const double length = bounds.hull[0].gradient.norm();
    return length > (1.0 + 1e-12) * bounds.hull[0].turn || (length > 0.0 && slope_along(bounds, bounds.hull[0].gradient / length).lower > 0.0);
  });
}

bool CubeBounds::rises(const Entry& own) {
  lead_.clear();
  double least = std::numeric_limits<double>::infinity();
  for (const Entry& e : entries()) {
    if (e.label == own.label) continue;
    const double scale = 1.0 / (own.steepness + e.steepness);
    const Interval &a = own.value, &b = e.value;
    lead_.push_back({&e, {scale * (a.lower - b.upper), scale * (a.upper - b.lower)}});
    least = std::min(least, lead_.back().value.upper);
  }
  std::erase_if(lead_, [&](const Lead& l) { return l.value.lower > least; });
  over_.clear();
  turn_.clear();
  for (const Lead& l : lead_) {
    if (own.bounds.hull.empty() || l.other->bounds.hull.empty()) return false;
    for (const GradientBounds::Ball& a : own.bounds.hull) {
      for (const GradientBounds::Ball& b : l.other->bounds.hull) {
        over_.push_back(own.weight * a.gradient - l.other->weight * b.gradient);
        turn_.push_back(own.weight * a.turn + l.other->weight * b.turn);
      }
    }
  }
  const Vec3 along = shortest_in_hull(over_);
  const double length = (1.0 + 1e-12) * along.norm();
  bool ahead = true;
  for (std::size_t k = 0; k < over_.size() && ahead; ++k) ahead = over_[k].dot(along) > turn_[k] * length;
  if (ahead) return true;
  if (!(length > 0.0)) return false;
  const Vec3 direction = along / along.norm();
  const double own_slope = own.weight * slope_along(own.bounds, direction).lower;
  return std::all_of(lead_.begin(), lead_.end(),
      [&](const Lead& l) { return own_slope > l.other->weight * slope_along(l.other->bounds, direction).upper; });
}

}  // namespace supple::implicit
