#include "supple/core/directed_form.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "supple/core/error.h"

namespace supple::core {

Mat3 fit_shape_operator(const Vec3& normal, std::span<const Vec3> offsets, std::span<const Vec3> normal_changes) {
  SUPPLE_EXPECTS(offsets.size() == normal_changes.size());
  Eigen::Index least = 0;
  normal.cwiseAbs().minCoeff(&least);
  const Vec3 t_1 = normal.cross(Vec3::Unit(least)).normalized();
  const Vec3 t_2 = normal.cross(t_1);
  // Normal equations for (S_11, sqrt(2) S_12, S_22), whose length is that of S.
  constexpr double kRoot = std::numbers::sqrt2 / 2.0;
  Mat3 left = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  for (std::size_t k = 0; k < offsets.size(); ++k) {
    const double x = t_1.dot(offsets[k]), y = t_2.dot(offsets[k]);
    const Vec3 first(x, kRoot * y, 0.0), second(0.0, kRoot * x, y);
    left += first * first.transpose() + second * second.transpose();
    right += t_1.dot(normal_changes[k]) * first + t_2.dot(normal_changes[k]) * second;
  }
  const Eigen::MatrixXd matrix = left;  // of fixed size it sets off false warnings of gcc 12
  const Eigen::VectorXd s = matrix.completeOrthogonalDecomposition().solve(Eigen::VectorXd(right));
  return s[0] * t_1 * t_1.transpose() + kRoot * s[1] * (t_1 * t_2.transpose() + t_2 * t_1.transpose()) +
         s[2] * t_2 * t_2.transpose();
}

PairLoad evaluate(const DirectedForm& law, const PairPose& pose) {
  const double d = pose.r.norm();
  const Weight::Value weight = law.weight.at(d).over_distance_squared(d);
  const Mat3 q_a = pose.orientation_a.toRotationMatrix();
  const Mat3 q_b = pose.orientation_b.toRotationMatrix();
  const Mat3 s_a = q_a * law.shape_a * q_a.transpose();
  const Mat3 s_b = q_b * law.shape_b * q_b.transpose();
  const Mat3 mean = 0.5 * (s_a + s_b);
  const Vec3 w = mean * pose.r + pose.normal_a - pose.normal_b;
  const double gain = 2.0 * law.strength * weight.psi;
  const auto turning = [&](const Mat3& s) -> Vec3 {
    return 0.5 * (Vec3(s * pose.r).cross(w) - pose.r.cross(Vec3(s * w)));
  };
  return {.energy = law.strength * weight.psi * w.squaredNorm(),
          .force_b = -gain * mean * w - law.strength * w.squaredNorm() * weight.slope / d * pose.r,
          .torque_a = -gain * (pose.normal_a.cross(w) + turning(s_a)),
          .torque_b = -gain * (turning(s_b) - pose.normal_b.cross(w))};
}

Stiffness stiffness(const DirectedForm& law, double rest_distance) {
  const double gain = 2.0 * law.strength * law.weight.at(rest_distance).psi / (rest_distance * rest_distance);
  const double shape = std::max(law.shape_a.norm(), law.shape_b.norm());
  const double lever = 1.0 + shape * rest_distance;  // |dw/dtheta| of one particle
  return {.translation = gain * shape * shape, .rotation = gain * lever * lever};
}

}  // namespace supple::core
