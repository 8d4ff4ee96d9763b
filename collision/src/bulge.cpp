#include <algorithm>

#include "supple/collision/deformed_field.h"

namespace supple::collision {

double BulgeProfile::value(double x) const noexcept {
  if (!(x > 0.0) || x >= width) return 0.0;
  const double w = width, w2 = w * w;
  if (x <= 0.5 * w) {
    const double c = 4.0 * (w * stiffness - 4.0 * height) / (w2 * w);
    const double d = 4.0 * (3.0 * height - w * stiffness) / w2;
    return x * (stiffness + x * (d + x * c));
  }
  return 4.0 * height / (w2 * w) * (x - w) * (x - w) * (4.0 * x - w);
}

double BulgeProfile::slope(double x) const noexcept {
  if (x < 0.0 || x >= width) return 0.0;
  const double w = width, w2 = w * w;
  if (x <= 0.5 * w) {
    const double c = 4.0 * (w * stiffness - 4.0 * height) / (w2 * w);
    const double d = 4.0 * (3.0 * height - w * stiffness) / w2;
    return stiffness + x * (2.0 * d + 3.0 * x * c);
  }
  return 4.0 * height / (w2 * w) * (x - w) * (12.0 * x - 6.0 * w);
}

double effective_width(double width, double height, double stiffness) noexcept {
  constexpr double kLambda = 6.0;
  return std::min(width, kLambda * height / stiffness);
}

}  // namespace supple::collision
