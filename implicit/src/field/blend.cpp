#include "field/blend.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::implicit {

ArcBlend arc_blend(double a, double b, double t) noexcept {
  const bool a_larger = a >= b;
  const double most = a_larger ? a : b;
  const double least = a_larger ? b : a;
  if (least <= t * most) return {.value = most, .by_a = a_larger ? 1.0 : 0.0, .by_b = a_larger ? 0.0 : 1.0};
  const double s = a + b;
  const double n = a * a + b * b;
  const double k = t * t + 2.0 * t - 1.0;
  const double root = std::sqrt(t * t * s * s - k * n);
  const double bottom = t * s + root;
  const double value = n / bottom;
  const auto slope = [&](double x) { return (2.0 * x - value * (t + (t * t * s - k * x) / root)) / bottom; };
  return {.value = value,
          .by_a = slope(a),
          .by_b = slope(b),
          .by_t = -value / bottom * (s + (t * s * s - (t + 1.0) * n) / root)};
}

Opening opening_of(double opening, double cosine) noexcept {
  const double x2 = cosine * cosine;
  return {.t = opening + (1.0 - opening) * x2 * (2.0 - x2), .slope = (1.0 - opening) * 4.0 * cosine * (1.0 - x2)};
}

double fading(double age, double time) noexcept {
  if (!(age > 0.0)) return 1.0;
  if (age >= time) return 0.0;
  const double s = age / time;
  return 1.0 - s * s * (3.0 - 2.0 * s);
}

void BlendIndex::assign(const Blend& blend, std::size_t part_count) {
  rule_ = blend.rule;
  if (!active()) return;
  SUPPLE_EXPECTS(blend.node.empty() || blend.node.size() == part_count);
  SUPPLE_EXPECTS(blend.exponent >= 1.0 && blend.opening > 0.0 && blend.opening < 1.0);
  exponent_ = blend.exponent;
  opening_ = blend.opening;
  node_.assign(blend.node.begin(), blend.node.end());
  std::size_t nodes = part_count;
  if (!node_.empty()) nodes = std::size_t{*std::max_element(node_.begin(), node_.end())} + 1;
  offset_.assign(nodes + 1, 0);
  for (const BlendEdge& e : blend.edge) {
    SUPPLE_EXPECTS(e.a < e.b && e.b < nodes && e.weight >= 0.0 && e.weight <= 1.0);
    ++offset_[e.a + 1];
    ++offset_[e.b + 1];
  }
  for (std::size_t k = 0; k < nodes; ++k) offset_[k + 1] += offset_[k];
  neighbour_.resize(2 * blend.edge.size());
  weight_.resize(2 * blend.edge.size());
  // Smaller neighbours first: edges are sorted by (a, b), so both passes meet them in rising order.
  next_.assign(offset_.begin(), offset_.end());
  for (const BlendEdge& e : blend.edge) {
    neighbour_[next_[e.b]] = e.a;
    weight_[next_[e.b]++] = e.weight;
  }
  for (const BlendEdge& e : blend.edge) {
    neighbour_[next_[e.a]] = e.b;
    weight_[next_[e.a]++] = e.weight;
  }
}

template <class Nodes, class Use>
void BlendIndex::for_neighbours(const Nodes& nodes, std::size_t k, const Use& use) const {
  std::size_t j = 0;
  for (std::uint32_t n = offset_[nodes[k].node]; n < offset_[nodes[k].node + 1]; ++n) {
    while (j < nodes.size() && nodes[j].node < neighbour_[n]) ++j;
    if (j == nodes.size()) return;
    if (nodes[j].node == neighbour_[n]) use(j, weight_[n]);
  }
}

double BlendIndex::weight(std::uint32_t a, std::uint32_t b) const noexcept {
  const auto first = neighbour_.begin() + offset_[a], last = neighbour_.begin() + offset_[a + 1];
  const auto at = std::lower_bound(first, last, b);
  return at != last && *at == b ? weight_[static_cast<std::size_t>(at - neighbour_.begin())] : 0.0;
}

Combined BlendIndex::combine(std::span<const NodeSample> nodes, std::span<double> share) const noexcept {
  Combined out;
  std::fill(share.begin(), share.end(), 0.0);
  if (nodes.empty()) return out;
  const std::size_t n = nodes.size();
  switch (rule_) {
    case BlendRule::Sum:
      for (const NodeSample& k : nodes) out.value += k.value;
      std::fill(share.begin(), share.end(), 1.0);
      return out;
    case BlendRule::Graph: {
      std::size_t best = 0;
      for (std::size_t k = 0; k < n; ++k) {
        double sum = nodes[k].value;
        for_neighbours(nodes, k, [&](std::size_t j, double w) { sum += w * std::min(nodes[j].value, nodes[k].value); });
        if (sum > out.value) {
          out.value = sum;
          best = k;
        }
      }
      share[best] = 1.0;
      // Where its field is the largest the node's own value is, but for rounding: alike, the other's slope counts.
      const double own = nodes[best].value + 64.0 * std::numeric_limits<double>::epsilon() * out.value;
      for_neighbours(nodes, best, [&](std::size_t j, double w) { share[nodes[j].value < own ? j : best] += w; });
      return out;
    }
    case BlendRule::Ricci: {
      double most = 0.0;
      for (const NodeSample& k : nodes) most = std::max(most, k.value);
      double sum = 0.0;
      for (std::size_t k = 0; k < n; ++k) {
        share[k] = math::pow(nodes[k].value / most, exponent_);
        sum += share[k];
      }
      out.value = most * math::pow(sum, 1.0 / exponent_);
      for (std::size_t k = 0; k < n; ++k) share[k] *= out.value / (sum * nodes[k].value);
      return out;
    }
    case BlendRule::Gradient: break;
  }
  std::size_t largest = 0;
  for (std::size_t k = 1; k < n; ++k) {
    if (nodes[k].value > nodes[largest].value) largest = k;
  }
  out.value = nodes[largest].value;
  share[largest] = 1.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      const NodeSample& a = nodes[i];
      const NodeSample& b = nodes[j];
      if (std::min(a.value, b.value) <= opening_ * std::max(a.value, b.value)) continue;  // t >= opening: the union
      const double scale = a.gradient.norm() * b.gradient.norm();
      if (!(scale > 0.0)) continue;
      const double cosine = std::clamp(a.gradient.dot(b.gradient) / scale, -1.0, 1.0);
      const Opening opening = opening_of(opening_, cosine);
      const ArcBlend arc = arc_blend(a.value, b.value, opening.t);
      if (!(arc.value > out.value)) continue;
      std::fill(share.begin(), share.end(), 0.0);
      share[i] = arc.by_a;
      share[j] = arc.by_b;
      out = {.value = arc.value, .first = i, .second = j, .cosine = cosine, .by_cosine = arc.by_t * opening.slope};
    }
  }
  return out;
}

Interval BlendIndex::opening_range(const NodeBound& a, const NodeBound& b) const {
  const double length_a = a.gradient.norm(), length_b = b.gradient.norm();
  if ((length_a == 0.0 && a.turn == 0.0) || (length_b == 0.0 && b.turn == 0.0)) return {1.0, 1.0};  // no angle: they unite
  if (!(a.turn < length_a && b.turn < length_b)) return {opening_, 1.0};
  // A vector within r of g lies within asin(r / |g|) of its direction; both may turn towards or away from each other.
  const double sin_a = a.turn / length_a, sin_b = b.turn / length_b, cos_a = std::sqrt(1.0 - sin_a * sin_a), cos_b = std::sqrt(1.0 - sin_b * sin_b);
  const double cosine = a.gradient.dot(b.gradient) / (length_a * length_b), sine = a.gradient.cross(b.gradient).norm() / (length_a * length_b);
  const double turned_cosine = cos_a * cos_b - sin_a * sin_b, turned_sine = sin_a * cos_b + cos_a * sin_b;
  constexpr double kRounding = 1e-14;
  const double most = cosine >= turned_cosine ? 1.0 : cosine * turned_cosine + sine * turned_sine + kRounding;
  const double least = cosine <= -turned_cosine ? -1.0 : cosine * turned_cosine - sine * turned_sine - kRounding;
  const double smallest = least <= 0.0 && most >= 0.0 ? 0.0 : std::min(std::abs(least), std::abs(most));
  const double largest = std::min(std::max(std::abs(least), std::abs(most)), 1.0);
  return {opening_of(opening_, smallest).t, opening_of(opening_, largest).t};
}

Interval BlendIndex::bound(std::span<const NodeBound> nodes) const {
  Interval out;
  const std::size_t n = nodes.size();
  for (const NodeBound& k : nodes) {
    out.lower = std::max(out.lower, k.value.lower);
    out.upper = std::max(out.upper, k.value.upper);
  }
  if (rule_ == BlendRule::Graph) {
    for (std::size_t k = 0; k < n; ++k) {
      const Interval& own = nodes[k].value;
      Interval sum = own;
      for_neighbours(nodes, k, [&](std::size_t j, double w) {
        sum.lower += w * std::min(nodes[j].value.lower, own.lower);
        sum.upper += w * std::min(nodes[j].value.upper, own.upper);
      });
      out.lower = std::max(out.lower, sum.lower);
      out.upper = std::max(out.upper, sum.upper);
    }
  } else if (rule_ == BlendRule::Ricci) {
    const auto mean = [&](double most, auto value) {
      if (!(most > 0.0)) return 0.0;
      double sum = 0.0;
      for (const NodeBound& k : nodes) {
        if (value(k) > 0.0) sum += math::pow(value(k) / most, exponent_);
      }
      return most * math::pow(sum, 1.0 / exponent_);
    };
    out.lower = mean(out.lower, [](const NodeBound& k) { return k.value.lower; });
    out.upper = mean(out.upper, [](const NodeBound& k) { return k.value.upper; });
  } else if (rule_ == BlendRule::Gradient) {
    // The arc rises with both values and falls with t, which is at least the opening.
    const bool turns_known = std::any_of(nodes.begin(), nodes.end(), [](const NodeBound& k) { return std::isfinite(k.turn); });
    if (turns_known) {
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = i + 1; j < n; ++j) {
          const Interval t = opening_range(nodes[i], nodes[j]);
          out.lower = std::max(out.lower, arc_blend(nodes[i].value.lower, nodes[j].value.lower, t.upper).value);
          out.upper = std::max(out.upper, arc_blend(nodes[i].value.upper, nodes[j].value.upper, t.lower).value);
        }
      }
      return out;
    }
    double first = 0.0, second = 0.0;
    for (const NodeBound& k : nodes) {
      const double u = k.value.upper;
      if (u > first) {
        second = first;
        first = u;
      } else {
        second = std::max(second, u);
      }
    }
    out.upper = std::max(out.upper, arc_blend(first, second, opening_).value);
  }
  return out;
}

double BlendIndex::slope_bound(std::span<const NodeBound> nodes) const {
  double largest = 0.0;
  for (const NodeBound& k : nodes) largest = std::max(largest, k.slope);
  const std::size_t n = nodes.size();
  if (rule_ == BlendRule::Gradient) return n > 1 ? std::numeric_limits<double>::infinity() : largest;
  if (rule_ == BlendRule::Graph) {
    for (std::size_t k = 0; k < n; ++k) {
      double sum = nodes[k].slope;
      for_neighbours(nodes, k, [&](std::size_t j, double w) { sum += w * std::max(nodes[j].slope, nodes[k].slope); });
      largest = std::max(largest, sum);
    }
    return largest;
  }
  // Shares s_k of Ricci's have sum s_k^(n/(n-1)) = 1, so Hoelder's inequality gives the n-norm of the slopes.
  if (!(largest > 0.0)) return 0.0;
  double sum = 0.0;
  for (const NodeBound& k : nodes) {
    if (k.slope > 0.0) sum += math::pow(k.slope / largest, exponent_);
  }
  return largest * math::pow(sum, 1.0 / exponent_);
}

bool BlendIndex::find_terms(std::span<const NodeBound> nodes, std::vector<Term>& terms) const {
  terms.clear();
  const double least = bound(nodes).lower;
  // The sum of what blends with node k, other than node j.
  const auto beside = [&](std::size_t k, std::size_t j) {
    Interval sum;
    for_neighbours(nodes, k, [&](std::size_t i, double w) {
      if (i == j) return;
      sum.lower += w * std::min(nodes[i].value.lower, nodes[k].value.lower);
      sum.upper += w * std::min(nodes[i].value.upper, nodes[k].value.upper);
    });
    return sum;
  };
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const Interval& own = nodes[k].value;
    if (rule_ == BlendRule::Gradient) {
      for (const NodeBound& other : nodes.first(k)) {
        if (own.upper > opening_ * other.value.lower && other.value.upper > opening_ * own.lower) return false;
      }
      if (own.upper >= least) terms.push_back({.winner = k, .node = k});
      continue;
    }
    double largest = own.upper;
    for_neighbours(nodes, k, [&](std::size_t j, double w) { largest += w * std::min(nodes[j].value.upper, own.upper); });
    if (largest < least) continue;
    terms.push_back({.winner = k, .node = k});
    for_neighbours(nodes, k, [&](std::size_t j, double w) {
      const Interval& other = nodes[j].value;
      if (other.lower > own.upper) {
        terms.push_back({.winner = k, .node = k, .weight = w});
        return;
      }
      // With f_j > f_k node k only wins by what blends with it beside j.
      const bool is_less = other.upper < own.lower || beside(k, j).upper <= beside(j, k).lower;
      terms.push_back({.winner = k, .node = j, .weight = w, .or_winner = !is_less});
    });
  }
  return true;
}

Interval BlendIndex::share(const NodeBound& node, const Interval& all) const {
  // (f_k / F)^(n - 1)
  const auto power = [&](double f, double F) { return f > 0.0 ? math::pow(f / F, exponent_ - 1.0) : 0.0; };
  return {power(node.value.lower, all.upper), node.value.upper < all.lower ? power(node.value.upper, all.lower) : 1.0};
}

}  // namespace supple::implicit
