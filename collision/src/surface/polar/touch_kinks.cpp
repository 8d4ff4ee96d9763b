/// Where rays touch kinks. There the integral along a ray begins to have a chord beyond the kink, whose length grows as the root of
/// the angle: two rules of angles say little of it, unless panels end there and have their angles grow as a square.
#include <algorithm>
#include <array>
#include <cmath>

#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

constexpr double kSide = 1e-3;          // of the radius, for the second derivative along the ray
constexpr double kClose = 1e-9;         // [rad]
constexpr double kCloseRadius = 1e-4;   // of the radius: the angle is off by its square
constexpr double kFarthest = 0.3;       // step of the radius
constexpr double kHidden = 0.02;        // [rad]: rays lie wider apart at a corner of the rim
constexpr double kLeastRadius = 0.5;    // of a corner's, at which the kink turns back from it

}  // namespace

/// @param i  place in a batch of pressures, near Sigma at that angle and radius
PolarRuleSolver::Along PolarRuleSolver::along_ray(const PressureBatch& at, std::size_t i, std::size_t kink, double angle, double radius) const {
  const auto [sin, cos] = math::sin_cos(angle);
  const Vec3 along = direction(cos, sin), across = radius * direction(-sin, cos);
  const Vec3 gap = at.slope_a[i] - at.slope_b[i];
  const double up = gap.dot(frame_.axis);
  Vec3 slope;
  const double s = kinks_[kink].value(at.point[i], slope);
  Along out;
  out.height = -(at.a[i] - at.b[i]) / up;
  out.rise = -gap.dot(along) / up;
  out.rise_across = -gap.dot(across) / up;
  const double s_up = slope.dot(frame_.axis);
  out.s = s + s_up * out.height;
  out.by_radius = slope.dot(along) + s_up * out.rise;
  out.by_angle = slope.dot(across) + s_up * out.rise_across;
  return out;
}

/// Newton's method for the angle at which s of a kink is 0 where it has an extremum along the ray.
/// @return nothing where it ends elsewhere than between the rays that it is to lie between
std::optional<double> PolarRuleSolver::touching_angle(PairPressure& pressure, const Touch& near) {
  double angle = near.angle, radius = near.radius, height = near.height;
  PressureBatch& batch = crossing_batch_;
  for (int step = 0; step < kFreeSteps; ++step) {
    const math::SinCos at = math::sin_cos(angle);
    const auto place = [&](double r, double h) -> Vec3 { return frame_.origin + r * direction(at.cos, at.sin) + h * frame_.axis; };
    batch.resize(1);
    batch.point[0] = place(radius, height);
    pressure.evaluate(batch);
    const Along middle = along_ray(batch, 0, near.kink, angle, radius);
    const double side = kSide * radius;
    batch.resize(2);
    for (const int i : {0, 1}) {
      const double off = i == 0 ? -side : side;
      batch.point[static_cast<std::size_t>(i)] = place(radius + off, height + middle.height + off * middle.rise);
    }
    pressure.evaluate(batch);
    const double bend = (along_ray(batch, 1, near.kink, angle, radius).by_radius - along_ray(batch, 0, near.kink, angle, radius).by_radius) / (2.0 * side);
    const double move = std::clamp(-middle.by_radius / bend, -kFarthest * radius, kFarthest * radius);
    const double turn = -(middle.s + middle.by_radius * move + 0.5 * bend * move * move) / middle.by_angle;
    angle += turn;
    if (!(angle > near.from) || !(angle < near.to)) return std::nullopt;
    radius += move;
    height += middle.height + middle.rise * move + middle.rise_across * turn;
    if (std::abs(turn) <= kClose && std::abs(move) <= kCloseRadius * radius) return angle;
  }
  return std::nullopt;
}

/// Angles at which rays touch kinks so near to a corner of the rim that a chord may lie between it and the first ray.
void PolarRuleSolver::find_hidden_touches(PairPressure& pressure, std::span<const Corner> corners, std::vector<double>& angles) {
  PressureBatch& batch = crossing_batch_;
  for (const Corner& corner : corners) {
    if (corner.kink >= kinks_.size()) continue;
    const Vec3 d = corner.at - frame_.origin;
    const Vec2 at = frame_.parts_of(d);
    const double angle = math::atan2(at.y(), at.x()), radius = at.norm(), height = d.dot(frame_.axis);
    const Vec3 along = direction(at.x() / radius, at.y() / radius);
    const double side = kSide * radius;
    batch.resize(1);
    batch.point[0] = corner.at;
    pressure.evaluate(batch);
    const Along here = along_ray(batch, 0, corner.kink, angle, radius);
    batch.point[0] = corner.at - side * (along + here.rise * frame_.axis);
    pressure.evaluate(batch);
    const double bend = (here.by_radius - along_ray(batch, 0, corner.kink, angle, radius).by_radius) / side;
    const double move = -here.by_radius / bend, turn = 0.5 * here.by_radius * here.by_radius / bend / here.by_angle;
    if (!(move < 0.0) || !(move > -kLeastRadius * radius) || !(std::abs(turn) < kHidden)) continue;
    const Touch near{corner.kink, angle + turn, radius + move, height + here.rise * move + here.rise_across * turn, angle - 2.0 * kHidden, angle + 2.0 * kHidden};
    if (const std::optional<double> touch = touching_angle(pressure, near)) angles.push_back(*touch);
  }
}

}  // namespace supple::collision
