#include "surface/polar/polar_cover.h"

#include <cmath>

#include "numbers.h"
#include "supple/core/math.h"

namespace supple::collision {

PolarCover::Reach PolarCover::reach(const Vec2& at) const {
  const double c = at.x(), s = at.y();
  double far = 0.0, height_there = 0.0;  // rho over that of the rim; height of the rim
  if (corner.empty()) {
    const auto n = static_cast<double>(radius.size());
    double turn = math::atan2(s, c) / (kTurn);
    if (turn < 0.0) turn += 1.0;
    const double place = turn * n;
    const double below = std::floor(place), share = place - below;
    const std::size_t k = static_cast<std::size_t>(below) % radius.size(), next = (k + 1) % radius.size();
    far = std::sqrt(c * c + s * s) / ((1.0 - share) * radius[k] + share * radius[next]);
    height_there = (1.0 - share) * height[k] + share * height[next];
  } else {
    for (std::size_t k = 0; k < corner.size(); ++k) {
      const std::size_t next = k + 1 < corner.size() ? k + 1 : 0;
      const Vec2 &a = corner[k], &b = corner[next];
      const double beyond_a = a.x() * s - a.y() * c, beyond_b = c * b.y() - s * b.x(), whole = beyond_a + beyond_b;
      if (!(beyond_a >= 0.0) || !(beyond_b >= 0.0) || !(whole > 0.0)) continue;
      far = whole / (a.x() * b.y() - a.y() * b.x());
      height_there = (beyond_b * height[k] + beyond_a * height[next]) / whole;
      break;
    }
  }
  return {far, height_there};
}

bool PolarCover::contains(const StartPoint& place, double slack) const {
  if (place.across.dot(frame.axis) < 0.0) return false;
  const Vec3 d = place.at - frame.origin;
  const auto [far, height_there] = reach(frame.parts_of(d));
  if (far > 1.0 + slack) return false;
  const double up = d.dot(frame.axis), linear = rise.dot(d - up * frame.axis), curved = height_there * far * far - linear * far;
  return std::abs(up - linear - curved) <= 2.0 * thickness + 0.5 * std::abs(height_there);
}

}  // namespace supple::collision
