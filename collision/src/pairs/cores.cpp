#include "pairs/cores.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pairs/body_order.h"
#include "pairs/boxes.h"

namespace supple::collision {

std::optional<Between> between_cores(const ContactBody& one, const ContactBody& other, const Box& overlap, int steps) {
  constexpr double kEnough = 1e-3;  // of the distance: the overlap is sought from here, not measured
  constexpr double kRounding = 1e-12;
  constexpr double kMargin = 1e-9;  // covers the rounding, however long the cores are
  const bool leading = leads(one, other);
  const ContactBody &a = leading ? one : other, &b = leading ? other : one;
  const Vec3 start = first_place(a);
  std::optional<implicit::CorePoint> on_a = a.field.core_point(start);
  if (!on_a) return std::nullopt;
  std::optional<implicit::CorePoint> on_b = b.field.core_point(on_a->point);
  if (!on_b) return std::nullopt;
  double moved = 0.0;
  bool settled = false;  // the nearest points but for rounding
  for (int i = 0; i < steps; ++i) {
    const Vec3 before = on_a->point;
    on_a = a.field.core_point(on_b->point);
    moved = (on_a->point - before).norm();
    const double between = (on_a->point - on_b->point).norm();
    settled = moved <= kRounding * (between + before.lpNorm<Eigen::Infinity>());
    if (steps == kFewSteps ? moved <= kEnough * between : settled) break;
    on_b = b.field.core_point(on_a->point);
  }
  const Vec3 across = on_b->point - on_a->point;
  const double distance = across.norm(), radii = on_a->radius + on_b->radius;
  if (!(distance > kEnough * radii + kRounding * on_a->point.lpNorm<Eigen::Infinity>())) return std::nullopt;
  // Planes across the line part the cores, as far as they turn from step to step.
  const double extent = overlap.extent().norm(), turn = std::isfinite(extent) ? moved / distance * extent : 0.0;
  const double middle = 0.5 * (std::min(on_a->radius, distance) + std::max(distance - on_b->radius, 0.0));
  return Between{on_a->point + (middle / distance) * across, settled && distance > (1.0 + kMargin) * radii + turn, distance < (1.0 - kMargin) * radii};
}

std::optional<int> softer_of_nested_balls(const ContactBody& one, const ContactBody& other) {
  constexpr double kSameCentre = 1e-12, kInnermost = 1e-3;  // of the radius
  constexpr double kHardly = 1e-6;                          // of the largest pressure
  constexpr int kMostLooks = 4096;
  const std::optional<implicit::CorePoint> core = one.field.core_point(first_place(one));
  if (!core || !core->round) return std::nullopt;
  const std::optional<implicit::CorePoint> other_core = other.field.core_point(core->point);
  if (!other_core || !other_core->round) return std::nullopt;
  const double radius = std::min(core->radius, other_core->radius);
  const Box box = one.field.surface_box(), other_box = other.field.surface_box();
  // Half-spaces are round, too, and end nowhere.
  if (!(is_finite(box) && is_finite(other_box) && (other_core->point - core->point).norm() <= kSameCentre * radius)) return std::nullopt;
  const double end = box.intersection(other_box).upper.x() - core->point.x();
  if (!(end > 0.0)) return std::nullopt;

  const auto pressure = [&](const ContactBody& body, double from, double to) {
    const Interval value = body.field.bound({core->point + from * Vec3::UnitX(), core->point + to * Vec3::UnitX()});
    return Interval{body.material.modulus * value.lower, body.material.modulus * value.upper};
  };
  const double largest = std::min(pressure(one, 0.0, end).upper, pressure(other, 0.0, end).upper);
  int looks = 0;
  std::optional<int> softer;  // as far as it is known
  std::vector<Interval> open{{0.0, end}};
  while (!open.empty()) {
    const Interval range = open.back();
    open.pop_back();
    const Interval p = pressure(one, range.lower, range.upper), q = pressure(other, range.lower, range.upper);
    if (std::min(p.upper, q.upper) <= kHardly * largest || range.upper <= kInnermost * radius) continue;
    if (p.lower > q.upper || p.upper < q.lower) {
      const int here = p.lower > q.upper ? 1 : 0;
      if (softer.value_or(here) != here) return std::nullopt;
      softer = here;
      continue;
    }
    if (++looks > kMostLooks) return std::nullopt;
    const double middle = 0.5 * (range.lower + range.upper);
    open.push_back({range.lower, middle});
    open.push_back({middle, range.upper});
  }
  return softer;
}

}  // namespace supple::collision
