#include "surface/panels/panel_levels.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace supple::collision {
namespace {

LevelValue rim_of(const SigmaRay& ray) {
  if (!ray.found) return {-std::max(std::abs(ray.pressure), std::numeric_limits<double>::min()), {}};
  return {ray.pressure, ray.slope};
}

LevelValue kink_of(const implicit::Kink& kink, const RayFrame& frame, const SigmaRay& ray) {
  Vec3 gradient;
  LevelValue out;
  out.value = kink.value(frame.world(ray.local(ray.height)), gradient);
  for (const std::size_t k : {0u, 1u}) out.slope[k] = gradient.dot(ray.tangent(frame, k));
  return out;
}

}  // namespace

void evaluate_levels(const Levels& levels, const SigmaView& view, std::span<const SigmaRay> rays, std::span<const LevelQuery> queries, LevelScratch& scratch,
                     std::span<LevelValue> out) {
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const LevelQuery& query = queries[i];
    const SigmaRay& ray = rays[query.ray];
    if (query.level == Levels::kRim) out[i] = rim_of(ray);
    if (query.level == Levels::kLowWall) out[i] = {ray.height - query.wall[0], ray.rise};
    if (query.level == Levels::kHighWall) out[i] = {query.wall[1] - ray.height, {-ray.rise[0], -ray.rise[1]}};
    if (levels.is_kink(query.level)) out[i] = kink_of(levels.kink[query.level - levels.first_kink()], view.frame, ray);
  }
  // Where two pressures are the same but for rounding, the margin says whose it is.
  constexpr double kTie = 1e-9;  // of the modulus
  for (std::size_t t = 0; t < levels.third.size(); ++t) {
    scratch.which.clear();
    scratch.point.clear();
    for (std::size_t i = 0; i < queries.size(); ++i) {
      if (queries[i].level != Levels::kFirstThird + t) continue;
      scratch.which.push_back(static_cast<std::uint32_t>(i));
      const SigmaRay& ray = rays[queries[i].ray];
      scratch.point.push_back(view.frame.world(ray.local(ray.height)));
    }
    if (scratch.which.empty()) continue;
    const ContactBody& third = *levels.third[t].body;
    const double modulus = third.material.modulus, margin = (levels.third[t].yields ? kTie : -kTie) * modulus;
    scratch.value.resize(scratch.which.size());
    scratch.gradient.resize(scratch.which.size());
    third.field.evaluate(scratch.point, scratch.value, scratch.gradient);
    for (std::size_t n = 0; n < scratch.which.size(); ++n) {
      const std::uint32_t i = scratch.which[n];
      const SigmaRay& ray = rays[queries[i].ray];
      out[i].value = ray.pressure - modulus * scratch.value[n] + margin;
      for (const std::size_t k : {0u, 1u}) out[i].slope[k] = ray.slope[k] - modulus * scratch.gradient[n].dot(ray.tangent(view.frame, k));
    }
  }
}

}  // namespace supple::collision
