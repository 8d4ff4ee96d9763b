#include <algorithm>
#include <cmath>

#include "supple/collision/deformed_field.h"

namespace supple::collision {
namespace {

constexpr double kLambda = 6.0;  // w = lambda a0 / k at most: a0 is the largest value iff lambda <= 6

}  // namespace

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
  return std::min(width, kLambda * height / stiffness);
}

double volume_keeping_height(double displaced, double area, double load, double steepness, double width) noexcept {
  if (!(displaced > 0.0) || !(area > 0.0) || !(load > 0.0) || !(steepness > 0.0)) return 0.0;
  const double held = 96.0 * displaced * load * steepness / (area * area);  // w (24 a0 + w)
  const double height = std::sqrt(held / (kLambda * (24.0 + kLambda)));
  if (kLambda * height <= width) return height;
  return std::max((held / width - width) / 24.0, 0.0);
}

}  // namespace supple::collision
