#include "supple/implicit/project.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "field_index.h"
#include "field_ray.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// Steps along rays below this share of the stretch whose slope is bounded make a look at its values worth while.
constexpr double kShort = 0.25;
/// Shortest stride, in features, where neither slopes nor values are bounded well enough.
constexpr double kUnbounded = 1e-3;

/// |F| below which p counts as on the surface: 1e-13, or what the rounding of p's coordinates alone does to F.
double round_off(const Vec3& p, const Vec3& gradient) {
  return std::max(1e-13, 4.0 * kEps * gradient.norm() * p.cwiseAbs().maxCoeff());
}

/// Root of F on a + t along between t = low and t = high, whose values have opposite signs; returns t. Newton kept in
/// its bracket, and bisection whenever a step is not half of the one before.
double bracketed_root(const FieldView& field, const Vec3& a, const Vec3& along, double low, double f_low, double high,
                      double f_high) {
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

}  // namespace

Projection project_to_surface(const FieldView& field, const Vec3& start, int max_iterations, Box* asked) {
  const double longest = 0.5 * field.feature_size();
  Projection result;
  result.point = start;
  Vec3 gradient;
  double f = field.value(start, gradient);
  if (asked != nullptr) asked->include(start);
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
    if (asked != nullptr) asked->include(result.point);  // a root is sought between this one and the last
    const bool crossed = (f > 0.0) != (f_previous > 0.0);
    if (crossed && std::abs(f) > 0.5 * std::abs(f_previous)) {
      const double t = bracketed_root(field, previous, step, 0.0, f_previous, 1.0, f);
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
  return a + bracketed_root(field, a, b - a, 0.0, f_a, 1.0, f_b) * (b - a);
}

std::optional<double> intersect(const FieldView& field, const Vec3& origin, const Vec3& direction, double t_max) {
  SUPPLE_EXPECTS(t_max >= 0.0 && std::isfinite(t_max));
  SUPPLE_EXPECTS(std::abs(direction.squaredNorm() - 1.0) < 1e-6);
  const Field* const primitives = field.as_field();
  if (primitives != nullptr) {
    const Field::Index& index = primitives->index();
    if (!index.blend.active() && !index.convolved) return intersect_primitives(*primitives, origin, direction, t_max);
  }
  const double feature = field.feature_size(), finest = std::min(feature, t_max);
  const auto at = [&](double t) -> Vec3 { return origin + t * direction; };
  const auto excludes_root = [&](const Box& box) {
    const Interval value = primitives != nullptr ? primitives->tight_bound(box) : field.bound(box);
    return value.lower > 0.0 || value.upper < 0.0;
  };
  double t = 0.0;
  double f = field.value(origin);
  const bool inside = f > 0.0;
  double stride = finest;
  while (t < t_max) {
    if (f == 0.0) return t;
    // Segment tracing: |grad F| <= slope on [t, t + stride], so no root lies within |F| / slope of t.
    stride = std::min(stride, t_max - t);
    Box box;
    box.include(at(t));
    box.include(at(t + stride));
    const double slope = field.gradient_bound(box);
    const double near = std::max(1e-6 * finest, 4.0 * kEps * (t + origin.cwiseAbs().maxCoeff()));
    double step = slope * stride <= std::abs(f) ? stride : std::abs(f) / slope;
    const bool bounded = std::isfinite(slope);
    if (step < kShort * stride && (stride > near || !bounded)) {
      // The slope says little. Values may still exclude a root; where they do not, shorter boxes have better bounds of both.
      if (excludes_root(box)) {
        step = stride;
      } else if (0.5 * stride > (bounded ? std::max(step, near) : kUnbounded * finest)) {
        stride *= 0.5;
        continue;
      } else if (!bounded) {
        step = stride;  // nothing is known: a change of sign is all that shows
      }
    }
    stride = 2.0 * step;
    if (step < near) {
      // So close that two roots in the gap would be nearer to each other than 1e-6 features: bracket and finish.
      const double ahead = std::min(t + 4.0 * near, t_max);
      const double f_ahead = field.value(at(ahead));
      if ((f_ahead > 0.0) != inside || f_ahead == 0.0) {
        return bracketed_root(field, origin, direction, t, f, ahead, f_ahead);
      }
      if (bounded && std::abs(f) <= 1e-10 * slope * finest) return t;  // touches
    }
    const double before = t, f_before = f;
    t += step;
    f = field.value(at(t));
    // Where the slope is bounded, only by the rounding of the last step.
    if ((f > 0.0) != inside) return bracketed_root(field, origin, direction, before, f_before, t, f);
  }
  return f == 0.0 ? std::optional<double>(t) : std::nullopt;
}

}  // namespace supple::implicit
