// Rays against any field. A stretch of the ray is passed only where a bound excludes a root in it: |F| at its start against a bound of
// |grad F| (segment tracing, Galin et al. 2020), bounds of F, or those of F' along the ray, whose width falls like the stretch, so that
// those of F from them are of second order. Any other stretch is halved.
#include <algorithm>
#include <cmath>
#include <limits>

#include "bounds/field_box_bounds.h"
#include "field/bracketed_root.h"
#include "field/field_index.h"
#include "field/field_ray.h"
#include "supple/core/error.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// A stretch of which less than this share is clear is halved.
constexpr double kShort = 0.25;
/// Shortest interval, in features: where no bound decides there, the ray touches the surface.
constexpr double kFinest = 1e-8;
/// The same of views that bound neither slopes nor values well enough, where a change of sign is all that shows.
constexpr double kUnbounded = 1e-3;
/// Of bounds of F on the shortest stretch, in iso values: where they lie further apart F jumps, as blends by gradients do where the gradient of
/// a node vanishes; there too only a change of sign counts.
constexpr double kJump = 1e-4;
/// Stretches in a row that no bound decides, at most: the ray lies in the surface.
constexpr int kMostUndecided = 512;

class Tracer {
 public:
  Tracer(const FieldView& field, const Vec3& origin, const Vec3& direction, double t_max)
      : field_(field), primitives_(field.as_field()), origin_(origin), direction_(direction), t_max_(t_max), feature_(field.feature_size()) {}

  std::optional<double> first() {
    double t = 0.0, f = field_.value(origin_);
    if (f == 0.0) return t;
    double stride = std::min(feature_, t_max_);
    std::optional<Touch> touch;
    int undecided = 0;
    while (t < t_max_) {
      stride = std::min(std::max(stride, finest(t, kFinest)), t_max_ - t);
      const Look seen = look(t, f, stride);
      if (seen.root) return seen.root;
      double step = seen.clear;
      if (step >= kShort * stride) {
        if (touch) return touch->t;
      } else if (0.5 * stride >= finest(t, seen.finest)) {
        stride *= 0.5;
        continue;
      } else {
        step = stride;
        if (seen.continuous) {
          if (!touch || std::abs(f) < touch->size) touch = Touch{t, std::abs(f)};
          if (++undecided == kMostUndecided) return touch->t;
        }
      }
      const double before = t, f_before = f;
      t += step;
      f = field_.value(at(t));
      if (f == 0.0) return t;
      // Of what bounds have cleared only the rounding of the last step changes the sign.
      if ((f > 0.0) != (f_before > 0.0)) return bracketed_root(field_, origin_, direction_, {before, f_before, t, f});
      stride = 2.0 * step;
    }
    return touch ? std::optional<double>(touch->t) : std::nullopt;
  }

 private:
  struct Touch {
    double t, size;  ///< where |F| is the least
  };
  struct Look {
    double clear = 0.0;  ///< no root lies within this of the start
    double finest = kFinest;
    bool continuous = true;  ///< |F| is that small where nothing is decided
    std::optional<double> root{};  ///< the only one of the stretch
  };

  [[nodiscard]] Vec3 at(double t) const { return origin_ + t * direction_; }

  [[nodiscard]] double finest(double t, double features) const {
    return std::max(features * std::min(feature_, t_max_), 8.0 * kEps * (t + origin_.cwiseAbs().maxCoeff()));
  }

  /// @param f  F at t, not 0
  [[nodiscard]] Look look(double t, double f, double stride) const {
    Box box;
    box.include(at(t));
    box.include(at(t + stride));
    const Vec3 rounding = rounding_of(box);
    box = {box.lower - rounding, box.upper + rounding};
    const double slope = field_.gradient_bound(box), size = std::abs(f);
    if (slope * stride <= size) return {.clear = stride};
    const double clear = size / slope;
    const auto excludes = [](const Interval& value) { return value.lower > 0.0 || value.upper < 0.0; };
    if (primitives_ == nullptr) {
      if (excludes(field_.bound(box))) return {.clear = stride};
      return {.clear = clear, .finest = std::isfinite(slope) ? kFinest : kUnbounded, .continuous = std::isfinite(slope)};
    }
    const GradientBounds bounds = bounds_with_gradient(*primitives_, box);
    if (excludes(bounds.value)) return {.clear = stride};
    if (bounds.hull.empty()) {
      return {.clear = clear, .continuous = std::isfinite(slope) || bounds.value.upper - bounds.value.lower <= kJump * primitives_->index().iso};
    }
    // Inside and outside alike: of sign F, between the tangents of its steepest fall from the start and of its steepest rise to the end.
    const Interval along = slope_along(bounds, direction_);
    const double sign = f > 0.0 ? 1.0 : -1.0, end = field_.value(at(t + stride)), from = size, to = sign * end;
    const double fall = std::max(-std::min(sign * along.lower, sign * along.upper), 0.0);
    const double rise = std::max(std::max(sign * along.lower, sign * along.upper), 0.0);
    double least = std::min(from, to);
    if (fall > 0.0 && rise > 0.0) {
      const double lowest = std::clamp((rise * stride - (to - from)) / (fall + rise), 0.0, stride);
      least = std::min(least, from - fall * lowest);
    }
    if (least > bounds.round_off) return {.clear = stride};
    const bool monotone = along.lower > 0.0 || along.upper < 0.0;
    if (monotone && to < 0.0) return {.root = bracketed_root(field_, origin_, direction_, {t, f, t + stride, end})};
    return {.clear = clear};
  }

  FieldView field_;
  const Field* primitives_;
  Vec3 origin_, direction_;
  double t_max_, feature_;
};

}  // namespace

std::optional<double> intersect(const FieldView& field, const Vec3& origin, const Vec3& direction, double t_max) {
  SUPPLE_EXPECTS(t_max >= 0.0 && std::isfinite(t_max));
  SUPPLE_EXPECTS(std::abs(direction.squaredNorm() - 1.0) < 1e-6);
  const Field* const primitives = field.as_field();
  if (primitives != nullptr) {
    const Field::Index& index = primitives->index();
    if (!index.blend.active() && !index.convolved) return intersect_primitives(*primitives, origin, direction, t_max);
  }
  return Tracer(field, origin, direction, t_max).first();
}

}  // namespace supple::implicit
