#include "pairs/cores.h"

#include <algorithm>
#include <cmath>

#include "pairs/body_order.h"

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

}  // namespace supple::collision
