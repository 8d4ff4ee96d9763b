#include "supple/implicit/project.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "field/bracketed_root.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// |F| below which p counts as on the surface: 1e-13, or what the rounding of p's coordinates alone does to F.
double round_off(const Vec3& p, const Vec3& gradient) {
  return std::max(1e-13, 4.0 * kEps * gradient.norm() * p.cwiseAbs().maxCoeff());
}

}  // namespace

double bracketed_root(const FieldView& field, const Vec3& a, const Vec3& along, const Bracket& bracket) {
  auto [low, f_low, high, f_high] = bracket;
  if (f_low == 0.0) return low;
  if (f_high == 0.0) return high;
  const double resolution = kEps * std::max(high, a.cwiseAbs().maxCoeff() / along.norm());
  double t = low + (high - low) * (f_low / (f_low - f_high));
  double last_step = high - low;
  while (high - low > resolution) {
    if (!(t > low && t < high)) t = 0.5 * (low + high);
    Vec3 gradient;
    const double f = field.value(a + t * along, gradient);
    if (f == 0.0) return t;
    ((f > 0.0) == (f_low > 0.0) ? low : high) = t;
    double next = t - f / gradient.dot(along);
    if (!(next > low && next < high) || std::abs(next - t) > 0.5 * last_step) next = 0.5 * (low + high);
    last_step = std::abs(next - t);
    if (last_step <= resolution) return next;
    t = next;
  }
  return t;
}

Projection project_to_surface(const FieldView& field, const Vec3& start, int max_iterations, Box* evaluated) {
  const double longest = 0.5 * field.feature_size();
  Projection result;
  result.point = start;
  Vec3 gradient;
  double f = field.value(start, gradient);
  if (evaluated != nullptr) evaluated->include(start);
  const auto finish = [&](bool converged) {
    const double norm = gradient.norm();
    result.converged = converged && norm > 0.0;
    result.normal = norm > 0.0 ? Vec3(-gradient / norm) : Vec3::Zero();
    return result;
  };
  for (result.iterations = 0; result.iterations < max_iterations;) {
    if (std::abs(f) <= round_off(result.point, gradient)) return finish(true);
    const double g2 = gradient.squaredNorm();
    if (!(g2 > 0.0) || !std::isfinite(f)) return finish(false);
    Vec3 step = -f / g2 * gradient;
    const double length = step.norm();
    if (length > longest) step *= longest / length;
    ++result.iterations;
    const Vec3 previous = result.point;
    const double f_previous = f;
    result.point = previous + step;
    f = field.value(result.point, gradient);
    if (evaluated != nullptr) evaluated->include(result.point);  // a root is sought between this one and the last
    const bool crossed = (f > 0.0) != (f_previous > 0.0);
    if (crossed && std::abs(f) > 0.5 * std::abs(f_previous)) {
      const double t = bracketed_root(field, previous, step, {0.0, f_previous, 1.0, f});
      result.point = previous + t * step;
      f = field.value(result.point, gradient);
      return finish(std::abs(f) <= round_off(result.point, gradient));
    }
  }
  return finish(std::abs(f) <= round_off(result.point, gradient));
}

Vec3 root_on_segment(const FieldView& field, const Vec3& a, const Vec3& b) {
  const double f_a = field.value(a);
  const double f_b = field.value(b);
  SUPPLE_EXPECTS(f_a * f_b <= 0.0);
  return a + bracketed_root(field, a, b - a, {0.0, f_a, 1.0, f_b}) * (b - a);
}

}  // namespace supple::implicit
