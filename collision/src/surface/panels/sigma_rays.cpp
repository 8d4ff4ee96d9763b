#include "surface/panels/sigma_rays.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "numbers.h"
#include "supple/core/interrupt.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

/// One ray, from the pressures and slopes at its height.
void read(const RayFrame& frame, const PressureBatch& batch, std::size_t i, SigmaRay& ray) {
  const Vec3 &axis = frame.axis[ray.along], apart = batch.slope_a[i] - batch.slope_b[i];
  const double a = batch.a[i], b = batch.b[i], sense = ray.sense();
  ray.fall = {-sense * batch.slope_a[i].dot(axis), sense * batch.slope_b[i].dot(axis)};
  const double steepness = ray.fall[0] + ray.fall[1], length = apart.norm();
  ray.outside = a <= 0.0 && b <= 0.0;
  ray.mismatch = std::abs(a - b);
  ray.cosine = length > 0.0 ? steepness / length : 0.0;
  if (!(steepness > 0.0)) {  // Sigma is no graph here: which way it lies is all that is known
    ray.step = a > b ? sense * kInfinity : -sense * kInfinity;
    ray.pressure = std::min(a, b);
    ray.rise = ray.slope = {};
    return;
  }
  ray.step = sense * (a - b) / steepness;
  ray.normal = -apart / length;
  // Weights of p_A and p_B whose sum does not change along the ray.
  const double of_b = ray.fall[0] / steepness, of_a = 1.0 - of_b;
  ray.pressure = of_a * a + of_b * b;
  for (const std::size_t k : {0u, 1u}) {
    const Vec3& across = frame.axis[static_cast<std::size_t>(k == 0 ? first_across(ray.along) : second_across(ray.along))];
    const double by_a = batch.slope_a[i].dot(across), by_b = batch.slope_b[i].dot(across);
    ray.slope[k] = of_a * by_a + of_b * by_b;
    ray.rise[k] = sense * (by_a - by_b) / steepness;
  }
}

/// Moves a ray's height towards its foot. @return whether there is more to do
bool advance(SigmaRay& ray, double enough, double reach) {
  constexpr double kSameHeight = 1e-14;
  if (std::abs(ray.step) <= enough) {
    ray.height += ray.step;
    ray.found = true;
    return false;
  }
  if (ray.outside && std::abs(ray.step) <= reach) {  // as good as needed: nothing is summed there
    ray.height += ray.step;
    ray.found = true;
    return false;
  }
  const bool up = ray.step > 0.0;
  (up ? ray.low : ray.high) = ray.height;
  (up ? ray.low_seen : ray.high_seen) = true;
  double next = ray.height + std::clamp(ray.step, -reach, reach);
  const bool beyond = up ? next >= ray.high : next <= ray.low;
  if (beyond) next = (up ? ray.high_seen : ray.low_seen) ? 0.5 * (ray.low + ray.high) : up ? ray.high : ray.low;
  if (std::abs(next - ray.height) <= kSameHeight * (std::abs(ray.low) + std::abs(ray.high))) return false;
  ray.height = next;
  return true;
}

}  // namespace

void probe(SigmaView& view, std::span<SigmaRay> rays, std::span<const std::uint32_t> which, RayScratch& scratch) {
  heed_scope();  // a pair may take seconds
  PressureBatch& batch = scratch.batch;
  batch.resize(which.size());
  for (std::size_t i = 0; i < which.size(); ++i) batch.point[i] = view.frame.world(rays[which[i]].local(rays[which[i]].height));
  view.pressure.evaluate(batch);
  for (std::size_t i = 0; i < which.size(); ++i) read(view.frame, batch, i, rays[which[i]]);
}

void lift(SigmaView& view, std::span<SigmaRay> rays, double enough, RayScratch& scratch) {
  std::vector<std::uint32_t>& open = scratch.open;
  open.resize(rays.size());
  std::iota(open.begin(), open.end(), 0u);
  for (int step = 0; step < kBracketSteps && !open.empty(); ++step) {
    probe(view, rays, open, scratch);
    std::erase_if(open, [&](std::uint32_t i) { return !advance(rays[i], enough, view.reach); });
  }
}

}  // namespace supple::collision
