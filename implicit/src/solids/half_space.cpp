#include <algorithm>
#include <cmath>
#include <limits>

#include "field/single_part.h"
#include "supple/core/error.h"
#include "supple/implicit/field.h"

namespace supple::implicit {

void HalfSpace::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = slope * (point - points[i]).dot(normal);
}

void HalfSpace::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == gradients.size());
  evaluate(points, values);
  std::fill(gradients.begin(), gradients.end(), Vec3(-slope * normal));
}

void HalfSpace::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const {
  evaluate_single_part(*this, points, parts);
}

Interval HalfSpace::bound(const Box& box) const {
  Interval sum;
  double scale = 0.0;  // of what is added, for its round-off
  for (int k = 0; k < 3; ++k) {
    if (normal[k] == 0.0) continue;  // also keeps 0 * infinity out
    const double a = slope * normal[k] * (point[k] - box.lower[k]);
    const double b = slope * normal[k] * (point[k] - box.upper[k]);
    sum.lower += std::min(a, b);
    sum.upper += std::max(a, b);
    for (const double x : {a, b}) {
      if (std::isfinite(x)) scale = std::max(scale, std::abs(x));
    }
  }
  const double round_off = 8.0 * std::numeric_limits<double>::epsilon() * scale;
  return {sum.lower - round_off, sum.upper + round_off};
}

double HalfSpace::gradient_bound(const Box&) const {
  return slope * normal.norm() * (1.0 + 4.0 * std::numeric_limits<double>::epsilon());
}

Box HalfSpace::surface_box() const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Box box{Vec3::Constant(-kInfinity), Vec3::Constant(kInfinity)};
  for (int k = 0; k < 3; ++k) {  // only a half-space along an axis ends on a side
    if (normal[(k + 1) % 3] != 0.0 || normal[(k + 2) % 3] != 0.0) continue;
    (normal[k] > 0.0 ? box.upper[k] : box.lower[k]) = point[k];
  }
  return box;
}

std::optional<CorePoint> HalfSpace::core_point(const Vec3& place) const {
  return CorePoint{place - std::max(0.0, (place - point).dot(normal)) * normal, 0.0, true};
}

double HalfSpace::feature_size() const { return std::numeric_limits<double>::infinity(); }

}  // namespace supple::implicit
