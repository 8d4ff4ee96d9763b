// The pair laws as their equations read; the step uses the packed kernels of pair_kernels.h, tested against these.
#include "supple/core/pair_laws.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

/// Loads of U = k psi(d) |w|^2 with w = kappa r + radius (n_A - n_B).
PairLoad form_load(double k, const Weight::Value& weight, double kappa, double radius, const PairPose& pose) {
  const double d = pose.r.norm();
  const Vec3 w = kappa * pose.r + radius * (pose.normal_a - pose.normal_b);
  const double w2 = w.squaredNorm();
  const double gain = 2.0 * k * weight.psi;
  return {.energy = k * weight.psi * w2,
          .force_b = -(gain * kappa * w + k * w2 * weight.slope / d * pose.r),
          .torque_a = -gain * radius * pose.normal_a.cross(w),
          .torque_b = gain * radius * pose.normal_b.cross(w)};
}

/// Loads of U = k psi(d) ((n_A . r)^2 + (n_B . r)^2).
PairLoad coplanarity_load(double k, const Weight::Value& weight, const PairPose& pose) {
  const double c_a = pose.normal_a.dot(pose.r);
  const double c_b = pose.normal_b.dot(pose.r);
  const double sum = c_a * c_a + c_b * c_b;
  const double gain = 2.0 * k * weight.psi;
  return {.energy = k * weight.psi * sum,
          .force_b = -gain * (c_a * pose.normal_a + c_b * pose.normal_b) -
                     k * sum * weight.slope / pose.r.norm() * pose.r,
          .torque_a = -gain * c_a * pose.normal_a.cross(pose.r),
          .torque_b = -gain * c_b * pose.normal_b.cross(pose.r)};
}

/// Loads of U = k psi(d) ((n_A + n_B) . r)^2.
PairLoad co_circularity_load(double k, const Weight::Value& weight, const PairPose& pose) {
  const Vec3 sum = pose.normal_a + pose.normal_b;
  const double c = sum.dot(pose.r);
  const double gain = 2.0 * k * weight.psi * c;
  return {.energy = k * weight.psi * c * c,
          .force_b = -gain * sum - k * c * c * weight.slope / pose.r.norm() * pose.r,
          .torque_a = -gain * pose.normal_a.cross(pose.r),
          .torque_b = -gain * pose.normal_b.cross(pose.r)};
}

}  // namespace

Weight::Value Weight::at(double distance) const {
  if (range == 0.0) return {.psi = 1.0, .slope = 0.0, .second = 0.0};
  const double q = distance * distance / (range * range);
  const double rest = 1.0 - q;
  if (rest <= 0.0) return {.psi = 0.0, .slope = 0.0, .second = 0.0};
  return {.psi = rest * rest * rest,
          .slope = -6.0 * distance / (range * range) * rest * rest,
          .second = -6.0 / (range * range) * rest * (1.0 - 5.0 * q)};
}

Weight::Value Weight::Value::over_distance_squared(double d) const {
  const double d2 = d * d;
  return {.psi = psi / d2,
          .slope = slope / d2 - 2.0 * psi / (d2 * d),
          .second = second / d2 - 4.0 * slope / (d2 * d) + 6.0 * psi / (d2 * d2)};
}

double Form::fit_curvature(const Vec3& r, const Vec3& normal_a, const Vec3& normal_b) {
  return r.dot(normal_b - normal_a) / r.squaredNorm();
}

BondFrame BondFrame::from_rest(double stretch, double rotation, const PairPose& rest) {
  return {.stretch = stretch,
          .rotation = rotation,
          .rest_a = rest.orientation_a.conjugate() * rest.r,
          .rest_b = rest.orientation_b.conjugate() * Vec3(-rest.r),
          .rest_orientation_a = rest.orientation_a,
          .rest_orientation_b = rest.orientation_b};
}

double Repulsion::cut_off() const { return distance - length * math::log(tolerance); }

PairLoad evaluate(const Cohesion& law, const PairPose& pose) {
  const double d = pose.r.norm();
  return {.energy = law.energy(d),
          .force_b = law.force(d) / d * pose.r,
          .torque_a = Vec3::Zero(),
          .torque_b = Vec3::Zero()};
}

PairLoad evaluate(const Form& law, const PairPose& pose) {
  const double d = pose.r.norm();
  return form_load(law.strength, law.weight.at(d).over_distance_squared(d), law.curvature, 1.0, pose);
}

PairLoad evaluate(const FormRadius& law, const PairPose& pose) {
  return form_load(law.strength, law.weight.at(pose.r.norm()), 1.0, law.radius, pose);
}

PairLoad evaluate(const BondFrame& law, const PairPose& pose) {
  const Mat3 q_a = pose.orientation_a.toRotationMatrix();
  const Mat3 q_b = pose.orientation_b.toRotationMatrix();
  const Vec3 arm_a = q_a * law.rest_a;
  const Vec3 arm_b = q_b * law.rest_b;
  const Vec3 u_a = pose.r - arm_a;
  const Vec3 u_b = pose.r + arm_b;
  const Mat3 a = q_a * law.rest_orientation_a.conjugate().toRotationMatrix();
  const Mat3 b = q_b * law.rest_orientation_b.conjugate().toRotationMatrix();
  Vec3 turn = Vec3::Zero();
  for (int k = 0; k < 3; ++k) turn += a.col(k).cross(b.col(k));
  const double half = 0.5 * law.stretch;
  return {.energy = 0.5 * half * (u_a.squaredNorm() + u_b.squaredNorm()) + 0.5 * law.rotation * (a - b).squaredNorm(),
          .force_b = -half * (u_a + u_b),
          .torque_a = half * arm_a.cross(u_a) + law.rotation * turn,
          .torque_b = -half * arm_b.cross(u_b) - law.rotation * turn};
}

PairLoad evaluate(const Coplanarity& law, const PairPose& pose) {
  return coplanarity_load(law.strength, law.weight.at(pose.r.norm()), pose);
}

PairLoad evaluate(const NormalisedCoplanarity& law, const PairPose& pose) {
  const double d = pose.r.norm();
  return coplanarity_load(law.strength, law.weight.at(d).over_distance_squared(d), pose);
}

PairLoad evaluate(const CoNormality& law, const PairPose& pose) {
  const double d = pose.r.norm();
  const Weight::Value weight = law.weight.at(d);
  const double squares = (pose.normal_a - pose.normal_b).squaredNorm();
  const Vec3 couple = 2.0 * law.strength * weight.psi * pose.normal_a.cross(pose.normal_b);
  return {.energy = law.strength * weight.psi * squares,
          .force_b = -law.strength * squares * weight.slope / d * pose.r,
          .torque_a = couple,
          .torque_b = -couple};
}

PairLoad evaluate(const CoCircularity& law, const PairPose& pose) {
  return co_circularity_load(law.strength, law.weight.at(pose.r.norm()), pose);
}

PairLoad evaluate(const NormalisedCoCircularity& law, const PairPose& pose) {
  const double d = pose.r.norm();
  return co_circularity_load(law.strength, law.weight.at(d).over_distance_squared(d), pose);
}

PairLoad evaluate(const Repulsion& law, const PairPose& pose) {
  const double d = pose.r.norm();
  const double cut_off = law.cut_off();
  if (d >= cut_off) return {};
  const double e = math::exp((law.distance - d) / law.length);
  return {.energy = law.force * (law.length * (e - law.tolerance) - law.tolerance * (cut_off - d)),
          .force_b = law.force * (e - law.tolerance) / d * pose.r,
          .torque_a = Vec3::Zero(),
          .torque_b = Vec3::Zero()};
}

Stiffness stiffness(const Cohesion& law) {
  constexpr int kSamples = 64;
  double largest = 0.0;
  for (int k = 0; k <= kSamples; ++k) {
    largest = std::max(largest, std::abs(law.slope(law.r0 * (0.75 + 0.5 * k / kSamples))));
  }
  return {.translation = largest, .rotation = 0.0};
}

Stiffness stiffness(const Form& law, double rest_distance) {
  const double gain = 2.0 * law.strength * law.weight.at(rest_distance).psi / (rest_distance * rest_distance);
  return {.translation = gain * law.curvature * law.curvature, .rotation = gain};
}

Stiffness stiffness(const FormRadius& law) {
  return {.translation = 2.0 * law.strength, .rotation = 2.0 * law.strength * law.radius * law.radius};
}

Stiffness stiffness(const BondFrame& law) {
  const double arm2 = std::max(law.rest_a.squaredNorm(), law.rest_b.squaredNorm());
  return {.translation = law.stretch, .rotation = 0.25 * law.stretch * arm2 + 2.0 * law.rotation};
}

Stiffness stiffness(const Coplanarity& law, double rest_distance) {
  const double gain = law.strength * law.weight.at(rest_distance).psi;
  return {.translation = 4.0 * gain, .rotation = gain * rest_distance * rest_distance};
}

Stiffness stiffness(const NormalisedCoplanarity& law, double rest_distance) {
  const double gain = law.strength * law.weight.at(rest_distance).psi;
  return {.translation = 4.0 * gain / (rest_distance * rest_distance), .rotation = gain};
}

Stiffness stiffness(const CoNormality& law, double rest_distance) {
  return {.translation = 0.0, .rotation = 2.0 * law.strength * law.weight.at(rest_distance).psi};
}

Stiffness stiffness(const CoCircularity& law, double rest_distance) {
  const double gain = 2.0 * law.strength * law.weight.at(rest_distance).psi;
  return {.translation = 4.0 * gain, .rotation = gain * rest_distance * rest_distance};
}

Stiffness stiffness(const NormalisedCoCircularity& law, double rest_distance) {
  const double gain = 2.0 * law.strength * law.weight.at(rest_distance).psi;
  return {.translation = 4.0 * gain / (rest_distance * rest_distance), .rotation = gain};
}

Stiffness stiffness(const Repulsion& law) { return {.translation = law.force / law.length, .rotation = 0.0}; }

}  // namespace supple::core
