#include "pair_pressure.h"

#include <array>
#include <cmath>

namespace supple::collision {

double PairPressure::overlap_out_of(int side, const Vec3& from, const Vec3& way, double longest) {
  constexpr int kMostSteps = 200, kHalvings = 40;
  constexpr double kEnough = 1e-6;  // of the longest step
  std::array<double, 1> value;
  std::array<Vec3, 1> slope;
  double t = 0.0;
  for (int i = 0; i < kMostSteps; ++i) {
    const Vec3 x = from + t * way;
    evaluate(side, {&x, 1}, value, slope);
    const double fall = -slope[0].dot(way);
    const double step = fall > 0.0 ? std::clamp(value[0] / fall, -longest, longest) : std::copysign(longest, value[0]);
    t += step;
    if (std::abs(step) < kEnough * longest) break;
  }
  const auto other_presses = [&](double at) {
    const Vec3 x = from + at * way;
    evaluate(1 - side, {&x, 1}, value);
    return value[0] > 0.0;
  };
  if (!(t > 0.0) || other_presses(t)) return t;
  double low = 0.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + t);
    (other_presses(middle) ? low : t) = middle;
  }
  return t;
}

}  // namespace supple::collision
