#include "surface/polar/patch_levels.h"

namespace supple::collision {

/// Pressures of the third bodies at points, and their slopes.
void PatchLevels::evaluate_thirds(std::span<const Vec3> points) {
  const std::size_t n = points.size();
  third_value.resize(third.size() * n);
  third_slope.resize(third.size() * n);
  for (std::size_t t = 0; t < third.size(); ++t) {
    const auto value = std::span(third_value).subspan(t * n, n);
    const auto slope = std::span(third_slope).subspan(t * n, n);
    third[t]->field.evaluate(points, value, slope);
    for (double& v : value) v *= third[t]->material.modulus;
    for (Vec3& g : slope) g *= third[t]->material.modulus;
  }
}

double PatchLevels::value(std::size_t level, const PeakFrame& frame, PairPressure& pressure, const Vec3& x) const {
  if (level < kink.size()) return kink[level].value(x);
  const ContactBody& body = *third[level - kink.size()];
  const double share = frame.depth[0] / frame.thickness;
  const double a = pressure.value(0, x), b = pressure.value(1, x);
  return body.material.modulus * body.field.value(x) - (share * a + (1.0 - share) * b);
}

double PatchLevels::value(std::size_t level, const PeakFrame& frame, const PressureBatch& at, std::size_t i, Vec3& slope) const {
  if (level < kink.size()) return kink[level].value(at.point[i], slope);
  const std::size_t k = (level - kink.size()) * at.size() + i;
  const double share = frame.depth[0] / frame.thickness;
  slope = third_slope[k] - (share * at.slope_a[i] + (1.0 - share) * at.slope_b[i]);
  return third_value[k] - (share * at.a[i] + (1.0 - share) * at.b[i]);
}

}  // namespace supple::collision
