#include "claim_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "shortest_in_hull.h"

namespace supple::implicit {

Claim::Claim(const SearchedBody& body, bool alone) : field_(body.field), weight_(body.weight) {
  if (alone) return;
  const double bound = gradient_bound(surface_box());
  if (bound > 0.0 && std::isfinite(bound)) steepness_ = bound;
}

GradientBounds Claim::bound_gradient(const Box& box) const {
  GradientBounds bounds = bounds_with_gradient(*field_, box);
  bounds.value = scaled(bounds.value);
  bounds.least_slope *= weight_;
  bounds.curved.curvature = {weight_ * bounds.curved.curvature.lower, weight_ * bounds.curved.curvature.upper};
  bounds.curved.round_off *= weight_;
  bounds.slack *= weight_;
  for (GradientBounds::Term& term : bounds.term) {
    term.factor = scaled(term.factor);
    term.gradient *= weight_;
    term.turn *= weight_;
  }
  for (GradientBounds::Ball& ball : bounds.hull) {
    ball.gradient *= weight_;
    ball.turn *= weight_;
  }
  return bounds;
}

bool CubeBounds::certain(const Box& box, std::span<const std::uint32_t> candidates) {
  entry_.assign(1, outside());
  for (const std::uint32_t body : candidates) entry_.push_back({.label = body + 1,
      .bounds = {{.value = claims_[body].bound(box)}, {}, {}}});
  return judge().certain;
}

Verdict CubeBounds::operator()(const Box& box, std::span<const std::uint32_t> candidates) {
  entry_.assign(1, outside());
  for (const std::uint32_t body : candidates) {
    entry_.push_back({.label = body + 1, .steepness = claims_[body].steepness(), .bounds = claims_[body].bound_gradient(box)});
  }
  Verdict verdict = judge();
  verdict.flat = is_flat();
  return verdict;
}

bool CubeBounds::is_flat() {
  return std::all_of(entry_.begin(), entry_.end(),
      [&](const Entry& e) { return e.bounds.value.upper < most_ || rises(e) || (e.label == 0 && passes_round_bodies()); });
}

std::array<Verdict, 8> CubeBounds::eighths(const Box& box) {
  std::array<Verdict, 8> verdict;
  for (const Entry& e : entry_) {
    if (e.label != 0 && !e.bounds.curved.known) return verdict;
  }
  const Vec3 half = 0.25 * box.extent();
  const double reach = half.norm(), largest = half.maxCoeff();
  std::array<Vec3, 8> middle;
  for (unsigned c = 0; c < 8; ++c) {
    for (unsigned k = 0; k < 3; ++k) middle[c][k] = box.lower[k] + ((c >> k & 1u) != 0 ? 3.0 : 1.0) * half[k];
  }
  value_.resize(entry_.size());
  slope_.resize(entry_.size());
  for (std::size_t i = 1; i < entry_.size(); ++i) claims_[entry_[i].label - 1].evaluate(middle, value_[i], slope_[i]);
  for (unsigned c = 0; c < 8; ++c) {
    for (std::size_t i = 1; i < entry_.size(); ++i) {
      GradientBounds& bounds = entry_[i].bounds;
      bounds.term.clear();  // of the whole box
      const auto& [lower, upper] = bounds.curved.curvature;
      const double first = slope_[i][c].cwiseAbs().dot(half) + bounds.curved.round_off, second = 0.5 * reach * reach;
      bounds.value = {value_[i][c] - first + second * lower, value_[i][c] + first + second * upper};
      bounds.hull[0] = {slope_[i][c], std::max(-lower, upper) * reach + bounds.curved.round_off / largest};
    }
    verdict[c] = judge();
    verdict[c].flat = is_flat();
  }
  return verdict;
}

Verdict CubeBounds::judge() {
  most_ = 0.0;
  for (const Entry& e : entry_) most_ = std::max(most_, e.bounds.value.lower);
  Verdict verdict;
  int possible = 0;
  for (const Entry& e : entry_) {
    if (e.bounds.value.upper < most_ || (e.label != 0 && !(e.bounds.value.upper > 0.0))) continue;
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
    return bounds.round && bounds.hull.size() == 1 && bounds.hull[0].gradient.norm() > (1.0 + 1e-12) * bounds.hull[0].turn;
  });
}

bool CubeBounds::rises(const Entry& own) {
  lead_.clear();
  double least = std::numeric_limits<double>::infinity();
  for (const Entry& e : entry_) {
    if (e.label == own.label) continue;
    const double scale = 1.0 / (own.steepness + e.steepness);
    const Interval &a = own.bounds.value, &b = e.bounds.value;
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
        over_.push_back(a.gradient - b.gradient);
        turn_.push_back(a.turn + b.turn);
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
  const double own_slope = slope_along(own.bounds, direction).lower;
  return std::all_of(lead_.begin(), lead_.end(),
      [&](const Lead& l) { return own_slope > slope_along(l.other->bounds, direction).upper; });
}

}  // namespace supple::implicit
