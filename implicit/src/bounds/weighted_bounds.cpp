#include "bounds/weighted_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bounds/shortest_in_hull.h"
#include "field/field_index.h"

namespace supple::implicit {

namespace {

Interval scaled(const Interval& value, double weight) { return {weight * value.lower, weight * value.upper}; }

/// rho of a lead of a weighted field in [a] over one in [b], 0 <= a, where b <= a.
Interval rho_of(const Interval& a, const Interval& b, double depth) {
  const double least = b.upper > 0.0 ? std::max(1.0 - b.upper / a.lower, 0.0) : 1.0 - b.upper / a.upper;  // of 1 - b / a
  const double most = b.lower > 0.0 ? 1.0 - b.lower / a.upper : 1.0 - b.lower / a.lower;
  const double low = 1.0 / (1.0 + depth * most / (a.lower + depth)), high = 1.0 / (1.0 + depth * least / (a.upper + depth));
  // Not a number where weighted fields are 0.
  return {low >= 0.0 ? std::min(low, 1.0) * (1.0 - 1e-12) : 0.0, high <= 1.0 ? high * (1.0 + 1e-12) : 1.0};
}

}  // namespace

WeightedField::WeightedField(const SearchedBody& body) : field_(body.field), weight_(body.weight), depth_(-bound(Box{}).lower) {}

Box WeightedField::support_box() const {
  Box all;
  for (const Box& support : field_->packed().support) all = all.united(support);
  return all;
}

void find_candidates(std::span<const WeightedField> weighted, const Box& box, std::span<const std::uint32_t> bodies, Candidates& found) {
  found.body.clear();
  found.offset.assign(1, 0);
  found.primitive.clear();
  for (const std::uint32_t body : bodies) {
    const std::size_t first = found.primitive.size();
    find_primitives(weighted[body].field(), box, found.primitive);
    if (found.primitive.size() == first) continue;
    if (!is_sum(weighted[body].field())) found.primitive.resize(first);
    found.body.push_back(body);
    found.offset.push_back(static_cast<std::uint32_t>(found.primitive.size()));
  }
}

void CubeBounds::narrow(Candidates& narrowed) const {
  narrowed.body.clear();
  narrowed.offset.assign(1, 0);
  narrowed.primitive.clear();
  for (const Entry& entry : entries().subspan(1)) {
    narrowed.body.push_back(entry.label - 1);
    for (const GradientBounds::Term& term : entry.bounds.term) narrowed.primitive.push_back(term.id);
    narrowed.offset.push_back(static_cast<std::uint32_t>(narrowed.primitive.size()));
  }
}

void CubeBounds::start(const Box& box, const Candidates& candidates) {
  count_ = 1 + candidates.body.size();
  if (entry_.size() < count_) entry_.resize(count_);
  for (std::size_t k = 0; k + 1 < count_; ++k) {
    const WeightedField& weighted_field = weighted_[candidates.body[k]];
    Entry& entry = entry_[k + 1];
    entry.label = candidates.body[k] + 1;
    entry.weight = weighted_field.weight();
    entry.depth = weighted_field.depth();
    start_bounds(weighted_field.field(), box, candidates.primitives_of(k), entry.bounds);
    entry.value = scaled(entry.bounds.value, entry.weight);
  }
}

void CubeBounds::add(Step step, const Box& box) {
  for (Entry& entry : entries().subspan(1)) {
    step(weighted_[entry.label - 1].field(), box, entry.bounds);
    entry.value = scaled(entry.bounds.value, entry.weight);
  }
}

Verdict CubeBounds::operator()(const Box& box, const Candidates& candidates, bool flat_anyway) {
  start(box, candidates);
  Verdict verdict = judge();
  if (verdict.certain && !flat_anyway) return verdict;
  drop_others();
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
      [&](const Entry& e) { return !may_have_part(e) || rises(e) || (e.label == 0 && passes_convex_primitives()); });
}

bool CubeBounds::knows_eighths() const {
  bool all_lone = true;
  for (const Entry& e : entries().subspan(1)) {
    if (!e.bounds.term.empty() && !e.bounds.curved.known) return false;
    if (e.bounds.hull.size() != 1) return false;
    all_lone = all_lone && (e.bounds.term.empty() || e.bounds.convex == 1);
  }
  return !all_lone;
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
    if (entry_[i].bounds.curved.known) weighted_[entry_[i].label - 1].field().evaluate(middle, value_[i], slope_[i]);
  }
  for (unsigned c = 0; c < 8; ++c) {
    for (std::size_t i = 1; i < count_; ++i) {
      GradientBounds& bounds = entry_[i].bounds;
      if (!bounds.curved.known) continue;  // the same everywhere
      bounds.term.clear();  // for the whole box
      const auto& [lower, upper] = bounds.curved.curvature;
      const double first = slope_[i][c].cwiseAbs().dot(half + rounding_of(box)) + bounds.round_off, second = 0.5 * reach * reach;
      bounds.value = {value_[i][c] - first + second * lower, value_[i][c] + first + second * upper};
      entry_[i].value = scaled(bounds.value, entry_[i].weight);
      bounds.hull[0] = {slope_[i][c], std::max(-lower, upper) * reach + bounds.round_off / largest};
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
    verdict.second_order = verdict.second_order && e.bounds.second_order;
    if (!may_have_part(e)) continue;
    ++possible;
    verdict.label = e.label;
  }
  verdict.certain = possible == 1;
  return verdict;
}

bool CubeBounds::passes_convex_primitives() const {
  std::size_t primitives = 0;
  for (const Lead& l : lead_) {
    const GradientBounds& bounds = l.other->bounds;
    primitives += bounds.convex;
    if (bounds.convex == 0 || primitives > 3 || bounds.hull.size() != 1) return false;
    const double length = bounds.hull[0].gradient.norm();
    if (length > (1.0 + 1e-12) * bounds.hull[0].turn) continue;
    if (!(length > 0.0 && slope_along(bounds, bounds.hull[0].gradient / length).lower > 0.0)) return false;
  }
  return true;
}

void CubeBounds::find_leads(const Entry& own) {
  // Where `own` is the owner, its weighted field is the largest.
  const Interval a{std::max(own.value.lower, most_), std::max(own.value.upper, most_)};
  const auto above_least = [&](const Entry& e) { return Interval{e.value.lower + e.depth, std::min(e.value.upper, a.upper) + e.depth}; };
  lead_.clear();
  Entry* nearest = nullptr;
  double most = -1.0;
  for (Entry& e : entries()) {
    if (e.label == own.label) continue;
    const double share = e.label == 0 ? 0.0 : above_least(e).lower / (a.upper + e.depth);
    if (share > most || nearest == nullptr) {
      most = share;
      nearest = &e;
    }
  }
  if (nearest == nullptr) return;
  const double near = above_least(*nearest).lower;
  for (Entry& e : entries()) {
    if (e.label == own.label) continue;
    // Shares are p / (c_a + phi).
    const double upper = above_least(e).upper;
    const auto is_less = [&](double weighted_field) { return upper * (weighted_field + nearest->depth) < near * (weighted_field + e.depth); };
    if (&e != nearest && is_less(a.lower) && is_less(a.upper)) continue;
    lead_.push_back({&e, own.label == 0 || e.label == 0 ? Interval{1.0, 1.0} : rho_of(a, e.value, e.depth)});
  }
}

void CubeBounds::drop_others() {
  if (count_ == 2) return;
  for (Entry& e : entries()) e.matters = may_have_part(e);
  for (const Entry& e : entries()) {
    if (!may_have_part(e)) continue;
    find_leads(e);
    for (const Lead& l : lead_) l.other->matters = true;
  }
  std::size_t kept = 1;
  for (std::size_t k = 1; k < count_; ++k) {
    if (!entry_[k].matters) continue;
    if (k != kept) std::swap(entry_[k], entry_[kept]);
    ++kept;
  }
  count_ = kept;
}

bool CubeBounds::rises(const Entry& own) {
  find_leads(own);
  over_.clear();
  turn_.clear();
  for (const Lead& l : lead_) {
    if (own.bounds.hull.empty() || l.other->bounds.hull.empty()) return false;
    for (const GradientBounds::Ball& a : own.bounds.hull) {
      for (const GradientBounds::Ball& b : l.other->bounds.hull) {
        for (const double rho : {l.rho.lower, l.rho.upper}) {
          over_.push_back(own.weight * a.gradient - rho * l.other->weight * b.gradient);
          turn_.push_back(own.weight * a.turn + rho * l.other->weight * b.turn);
          if (l.rho.lower == l.rho.upper) break;
        }
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
      [&](const Lead& l) {
    const double slope = l.other->weight * slope_along(l.other->bounds, direction).upper;
    return own_slope > slope * (slope > 0.0 ? l.rho.upper : l.rho.lower);
  });
}

}  // namespace supple::implicit
