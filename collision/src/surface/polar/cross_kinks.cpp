/// Where kinks of a field, and the borders of third bodies, cross a patch: which do, where on rays, and where rays begin to meet others.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

constexpr double kAtOrigin = 1e-9;       // radius of a crossing, over that of the rim: the kink goes through the origin

}  // namespace

/// Whether there are certainly none where the rim may be, which is kept in `smooth_`.
bool PolarRuleSolver::no_kinks_near(PairPressure& pressure) {
  constexpr double kReach = 1.5;  // of the rim, over what the curvature of the pressure says
  const double square = 2.0 * kReach * kReach * frame_.peak;
  const double height = std::abs(frame_.height_uu) + 2.0 * std::abs(frame_.height_uv) + std::abs(frame_.height_vv);
  const Vec3 across = (square * (frame_.u.cwiseAbs2() + frame_.v.cwiseAbs2())).cwiseSqrt();
  const Vec3 half = across + 0.5 * square * height * frame_.axis.cwiseAbs();
  smooth_ = {frame_.origin - half, frame_.origin + half};
  levels_.kink.clear();
  const bool known = pressure.kinks(smooth_, levels_.kink);
  const double reach = std::sqrt(square * (frame_.u.squaredNorm() + frame_.v.squaredNorm()) + 0.25 * square * square * height * height);
  const bool near = std::any_of(levels_.kink.begin(), levels_.kink.end(), [&](const implicit::Kink& kink) {
    return std::abs(kink.value(frame_.origin)) <= kink.change(frame_.origin, reach);
  });
  levels_.kink.clear();
  return known && !near;
}

void PolarRuleSolver::find_kinks(PairPressure& pressure) {
  levels_.kink.clear();
  Box box;
  for (const Vec3& x : rim_batch_.point) {
    box.include(x);
    if (rim_.size() > 1) continue;  // the ray stands for those all around
    const Vec3 reach = Vec3::Constant((x - frame_.origin).norm());
    box.include(frame_.origin - reach);
    box.include(frame_.origin + reach);
  }
  for (const Vec3& x : node_.point) box.include(x);
  levels_.all_kinks = pressure.kinks(box, levels_.kink);
  double square = 0.0;
  for (const Vec3& x : rim_batch_.point) square = std::max(square, (x - frame_.origin).squaredNorm());
  const double reach = kBeyondRim * std::sqrt(square);
  std::erase_if(levels_.kink, [&](const implicit::Kink& kink) { return std::abs(kink.value(frame_.origin)) > kink.change(frame_.origin, reach); });
}

/// Whether third bodies press harder than the pair all over the patch, as far as its nodes and the rim show.
bool PolarRuleSolver::taken_by_thirds() {
  const auto taken = [this](std::size_t n, std::size_t i, double p) {
    for (std::size_t t = 0; t < levels_.third.size(); ++t) {
      if (levels_.third_value[t * n + i] > p) return true;
    }
    return false;
  };
  levels_.evaluate_thirds(node_.point);
  for (std::size_t i = 0; i < node_.size(); ++i) {
    if (!taken(node_.size(), i, pressure_[i])) return false;
  }
  follow_rim();
  levels_.evaluate_thirds(fine_rim_);
  for (std::size_t i = 0; i < fine_rim_.size(); ++i) {
    if (!taken(fine_rim_.size(), i, -at_rim())) return false;
  }
  return true;
}

/// Whether some change their side on the patch, as far as its nodes show and the rim as they give it; keeps which.
bool PolarRuleSolver::kinks_cross(PairPressure& pressure) {
  levels_.crossing.clear();
  if (levels_.kink.empty() && levels_.third.empty()) return false;
  follow_rim();
  for (std::size_t k = 0; k < levels_.kink.size(); ++k) {
    if (!parts_at(levels_.kink[k])) continue;
    const bool side = levels_.kink[k].value(frame_.origin) > 0.0;
    const auto other = [&](const Vec3& x) { return (levels_.kink[k].value(x) > 0.0) != side; };
    if (std::any_of(fine_rim_.begin(), fine_rim_.end(), other) ||
        std::any_of(node_.point.begin(), node_.point.end(), other)) {
      levels_.crossing.push_back(k);
    }
  }
  if (levels_.third.empty()) return !levels_.crossing.empty();
  thirds_seen_.assign(levels_.third.size(), 0);
  std::vector<const Vec3*> inside(levels_.third.size(), nullptr);
  levels_.evaluate_thirds(node_.point);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) {
    for (std::size_t i = 0; i < node_.size(); ++i) {
      const bool harder = levels_.third_value[t * node_.size() + i] > pressure_[i];
      thirds_seen_[t] |= harder ? 1 : 2;
      if (harder && pressure_[i] > 0.0) inside[t] = &node_.point[i];
    }
  }
  levels_.evaluate_thirds(fine_rim_);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) {
    for (std::size_t i = 0; i < fine_rim_.size(); ++i) {
      const double p = levels_.third_value[t * fine_rim_.size() + i];
      if (std::abs(p) > at_rim()) thirds_seen_[t] |= p > 0.0 ? 1 : 2;
    }
  }
  levels_.imprint.clear();
  cover(cover_);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) {
    if (find_imprint(pressure, t, inside[t])) thirds_seen_[t] |= 1;
    if (thirds_seen_[t] == 3) levels_.crossing.push_back(levels_.kink.size() + t);
  }
  return !levels_.crossing.empty();
}

/// That of one third body on `cover_`. @param inside  a place in it, or null   @return whether there is one, whether its border is found or not
bool PolarRuleSolver::find_imprint(PairPressure& pressure, std::size_t third, const Vec3* inside) {
  cover_.thickness = frame_.thickness;
  const std::optional<Vec3> place = inside != nullptr ? std::optional<Vec3>(*inside) : finder_.find(pressure, cover_, *levels_.third[third], 0.0);
  if (!place) return false;
  Imprint imprint;
  imprint.third = third;
  if (finder_.trace(pressure, cover_, *levels_.third[third], *place, imprint)) levels_.imprint.push_back(std::move(imprint));
  return true;
}

/// Those on a patch with the rim `outline_`.
void PolarRuleSolver::find_imprints(PairPressure& pressure) {
  levels_.imprint.clear();
  if (levels_.third.empty()) return;
  polygon_ = outline_;
  cover(cover_);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) find_imprint(pressure, t, nullptr);
}

std::array<double, 2> PolarRuleSolver::Panel::bend(double x) const {
  const double width = end - begin, y = 0.5 * (1.0 + x), z = 1.0 - y;
  if (touch_begin && touch_end) return {begin + width * y * y * (3.0 - 2.0 * y), 3.0 * width * y * z};
  return touch_begin ? std::array{begin + width * y * y, width * y} : std::array{end - width * z * z, width * z};
}

/// Where neighbouring rays of the panels from `first` on meet other kinks, or in another order; only crossings that were found are kept.
void PolarRuleSolver::find_changes(PairPressure& pressure, const KronrodRule& rule, std::size_t first) {
  const std::size_t per_panel = rule.node.size();
  const auto ray_end = [this](std::size_t i) -> RayEnd {
    const Vec2 way(rays_.cosine[i], rays_.sine[i]);
    return {way, frame_.origin + rays_.radius[i] * direction(way.x(), way.y()) + rays_.height[i] * frame_.axis};
  };
  // Round-off says which rays meet a kink that goes through the origin.
  std::erase_if(crossings_, [](const Crossing& x) { return x.radius < kAtOrigin; });
  for (const Crossing& x : crossings_) {
    if (!x.good) panels_[first + x.ray / per_panel].lost = true;
  }
  std::erase_if(crossings_, [](const Crossing& x) { return !x.good || x.radius >= 1.0; });
  const auto same = [](const Crossing& x, const Crossing& y) { return x.level == y.level; };
  std::size_t next = 0;
  for (std::size_t p = first; p < panels_.size(); ++p) {
    Panel& panel = panels_[p];
    const double half = 0.5 * (panel.end - panel.begin);
    const auto place_at = [&](double x) { return panel.touches() ? panel.bend(x)[0] : panel.begin + half * (1.0 + x); };
    panel.change = changes_.size();
    std::span<const Crossing> before;
    for (std::size_t k = 0; k < per_panel; ++k) {
      const std::size_t begin = next;
      while (next < crossings_.size() && crossings_[next].ray == (p - first) * per_panel + k) ++next;
      const std::span<const Crossing> here = std::span(crossings_).subspan(begin, next - begin);
      const auto differ = std::mismatch(before.begin(), before.end(), here.begin(), here.end(), same);
      const bool changes = differ.first != before.end() || differ.second != here.end();
      if (k > 0 && changes) {
        double share = 0.5;
        const auto at = static_cast<std::size_t>(differ.first - before.begin());
        if (before.size() == here.size() && at + 1 < here.size() && same(before[at], here[at + 1]) && same(before[at + 1], here[at])) {
          // Two that change places do so where they meet.
          const double left = before[at + 1].radius - before[at].radius, right = here[at + 1].radius - here[at].radius;
          if (left + right > 0.0) share = left / (left + right);
        } else if (std::max(before.size(), here.size()) == at + 1 && std::min(before.size(), here.size()) == at) {
          // One that leaves through the rim does so at a corner.
          const std::size_t kink = before.size() > at ? before[at].level : here[at].level, ray = (p - first) * per_panel + k;
          if (const std::optional<double> corner = CornerFinder(pressure, frame_, levels_, extent_).between(kink, ray_end(ray - 1), ray_end(ray))) {
            share = *corner;
            panel.leaves = true;
          }
        }
        changes_.push_back(place_at(rule.node[k - 1] + share * (rule.node[k] - rule.node[k - 1])));
      }
      before = here;
    }
    panel.change_end = changes_.size();
  }
}

}  // namespace supple::collision
