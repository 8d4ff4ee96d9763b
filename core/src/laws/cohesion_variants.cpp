#include "supple/core/cohesion_variants.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

PairLoad central_load(double energy, double force, const PairPose& pose) {
  return {.energy = energy,
          .force_b = force / pose.r.norm() * pose.r,
          .torque_a = Vec3::Zero(),
          .torque_b = Vec3::Zero()};
}

/// Support distance rho and its gradient on the unit sphere, in world axes.
struct Support {
  double value;
  Vec3 gradient;
};

Support support_of(const Vec3& semi_axes, const Quat& orientation, const Vec3& u) {
  const Vec3 scaled = semi_axes.cwiseProduct(orientation.conjugate() * u);
  const double rho = scaled.norm();
  const Vec3 m_u = orientation * Vec3(semi_axes.cwiseProduct(scaled));
  return {.value = rho, .gradient = (m_u - u.dot(m_u) * u) / rho};
}

template <class Law>
double steepest_near_rest(const Law& law, double r0) {
  constexpr int kSamples = 64;
  double largest = 0.0;
  for (int k = 0; k <= kSamples; ++k) {
    largest = std::max(largest, std::abs(law.slope(r0 * (0.75 + 0.5 * k / kSamples))));
  }
  return largest;
}

}  // namespace

double LinearCohesion::force(double distance) const {
  const double v = distance / r0 - 1.0;
  return -f0 * v * (eta + v * v) * math::exp(-a * v * v);
}

double LinearCohesion::slope(double distance) const {
  const double v = distance / r0 - 1.0;
  const double v2 = v * v;
  return -f0 / r0 * (eta + 3.0 * v2 - 2.0 * a * v2 * (eta + v2)) * math::exp(-a * v2);
}

double LinearCohesion::energy(double distance) const {
  const double v = distance / r0 - 1.0;
  const double x = a * v * v;
  if (x < 1e-2) {
    // The closed form loses digits to cancellation near rest; the series of its two terms errs below x^7 / 7!.
    const double linear = x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0)))));
    const double cubic =
        x * x * (1.0 / 2.0 - x * (1.0 / 3.0 - x * (1.0 / 8.0 - x * (1.0 / 30.0 - x * (1.0 / 144.0 - x / 840.0)))));
    return f0 * r0 * (eta * linear / (2.0 * a) + cubic / (2.0 * a * a));
  }
  const double gauss = math::exp(-x);
  return f0 * r0 * (eta * (1.0 - gauss) / (2.0 * a) + (1.0 - (1.0 + x) * gauss) / (2.0 * a * a));
}

double LinearCohesion::binding_energy() const { return f0 * r0 * (eta / (2.0 * a) + 1.0 / (2.0 * a * a)); }

double LinearCohesion::maximum_distance() const {
  // f' = 0: 2 a u^2 + (2 a eta - 3) u - eta = 0 for u = v^2.
  const double b = 2.0 * a * eta - 3.0;
  return r0 * (1.0 + std::sqrt((std::sqrt(b * b + 8.0 * a * eta) - b) / (4.0 * a)));
}

double LinearCohesion::influence_radius(double epsilon) const {
  SUPPLE_EXPECTS(epsilon > 0.0 && epsilon < 1.0);
  double lower = maximum_distance();
  const double target = epsilon * std::abs(force(lower));
  double upper = 2.0 * lower;
  while (std::abs(force(upper)) > target) upper *= 2.0;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (lower + upper);
    (std::abs(force(middle)) > target ? lower : upper) = middle;
  }
  return upper;
}

double DirectedCohesion::rest_distance(const PairPose& pose) const {
  const Vec3 u = pose.r / pose.r.norm();
  return support_of(semi_axes_a, pose.orientation_a, u).value +
         support_of(semi_axes_b, pose.orientation_b, Vec3(-u)).value;
}

PairLoad evaluate(const LinearCohesion& law, const PairPose& pose) {
  const double d = pose.r.norm();
  return central_load(law.energy(d), law.force(d), pose);
}

PairLoad evaluate(const TabulatedCohesion& law, const PairPose& pose) {
  const double d = pose.r.norm();
  return central_load(law.energy(d), law.force(d), pose);
}

PairLoad evaluate(const DirectedCohesion& law, const PairPose& pose) {
  const double d = pose.r.norm();
  const Vec3 u = pose.r / d;
  const Support a = support_of(law.semi_axes_a, pose.orientation_a, u);
  const Support b = support_of(law.semi_axes_b, pose.orientation_b, Vec3(-u));
  const double r0 = a.value + b.value;
  const Cohesion unit{.r0 = 1.0, .f0 = law.scale, .a = law.a};
  const double slope = -unit.force(d / r0);  // W'
  return {.energy = unit.energy(d / r0),
          .force_b = -slope / r0 * u + slope / (r0 * r0) * (a.gradient - b.gradient),
          .torque_a = -slope * d / (r0 * r0) * u.cross(a.gradient),
          .torque_b = slope * d / (r0 * r0) * u.cross(b.gradient)};
}

Stiffness stiffness(const LinearCohesion& law) {
  return {.translation = steepest_near_rest(law, law.r0), .rotation = 0.0};
}

Stiffness stiffness(const TabulatedCohesion& law) {
  return {.translation = steepest_near_rest(law, law.r0), .rotation = 0.0};
}

Stiffness stiffness(const DirectedCohesion& law) {
  // W'' (ds)^2 with |grad s|^2 <= (1 + (Delta_A + Delta_B)^2 / r0^2) / r0^2 and |ds/dtheta_X| <= Delta_X / r0, because
  // the slope of rho on the sphere is at most Delta = largest - smallest semi-axis.
  const double steepest = steepest_near_rest(Cohesion{.r0 = 1.0, .f0 = law.scale, .a = law.a}, 1.0);
  const double delta_a = law.semi_axes_a.maxCoeff() - law.semi_axes_a.minCoeff();
  const double delta_b = law.semi_axes_b.maxCoeff() - law.semi_axes_b.minCoeff();
  const double r0 = law.semi_axes_a.minCoeff() + law.semi_axes_b.minCoeff();
  const double tilt = (delta_a + delta_b) / r0;
  return {.translation = steepest * (1.0 + tilt * tilt) / (r0 * r0),
          .rotation = 0.5 * steepest * (delta_a * delta_a + delta_b * delta_b) / (r0 * r0)};
}

}  // namespace supple::core
