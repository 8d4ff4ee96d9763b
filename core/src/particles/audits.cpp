// Measures of a state: motion, divergence, deviation from a rest shape.
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "supple/core/error.h"
#include "supple/core/integrate.h"

namespace supple::core {

Motion measure_motion(const ParticleSet& set, const ParticleState& state) {
  SUPPLE_EXPECTS(set.size() == state.size());
  Motion motion;
  double mass = 0.0;
  Vec3 centre = Vec3::Zero();
  for (std::size_t i = 0; i < set.size(); ++i) {
    mass += set.mass[i];
    centre += set.mass[i] * state.position[i];
  }
  if (mass > 0.0) centre /= mass;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const Vec3 momentum = set.mass[i] * state.velocity[i];
    const Vec3& spin_momentum = state.angular_momentum[i];
    motion.kinetic_energy +=
        0.5 * momentum.dot(state.velocity[i]) + 0.5 * spin_momentum.dot(angular_velocity(set, state, i));
    motion.momentum += momentum;
    motion.angular_momentum += state.position[i].cross(momentum) + spin_momentum;
    motion.momentum_scale += momentum.norm();
    const double gyration = std::sqrt(0.5 * set.inertia[i].sum() / set.mass[i]);
    motion.angular_momentum_scale += ((state.position[i] - centre).norm() + gyration) * momentum.norm() + spin_momentum.norm();
  }
  return motion;
}

Divergence find_divergence(const ParticleSet& set, const ParticleState& state, double length, double speed) {
  const double length2 = length * length;
  const double speed2 = speed * speed;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const double x2 = state.position[i].squaredNorm();
    const double v2 = state.velocity[i].squaredNorm();
    const double q2 = state.orientation[i].squaredNorm();
    const double l2 = state.angular_momentum[i].squaredNorm();
    // One comparison on the way of a sound state: NaN and infinity fail it too.
    if (x2 <= length2 && v2 <= speed2 && q2 < 2.0 && std::isfinite(l2)) continue;
    const auto found = [i](const char* cause, double value, double limit) {
      return Divergence{
          .found = true, .particle = static_cast<std::uint32_t>(i), .cause = cause, .value = value, .limit = limit};
    };
    if (!std::isfinite(x2)) return found("position is not finite", x2, length);
    if (!std::isfinite(v2)) return found("velocity is not finite", v2, speed);
    if (!(q2 < 2.0)) return found("orientation is not a rotation", q2, 1.0);
    if (!std::isfinite(l2)) return found("angular momentum is not finite", l2, 0.0);
    if (v2 > speed2) return found("speed", std::sqrt(v2), speed);
    return found("distance from the origin", std::sqrt(x2), length);
  }
  return {};
}

ShapeError shape_error(std::span<const Vec3> rest, std::span<const Vec3> now) {
  SUPPLE_EXPECTS(rest.size() == now.size() && !rest.empty());
  const auto count = static_cast<double>(rest.size());
  Vec3 rest_centre = Vec3::Zero();
  Vec3 now_centre = Vec3::Zero();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    rest_centre += rest[i];
    now_centre += now[i];
  }
  rest_centre /= count;
  now_centre /= count;
  Mat3 covariance = Mat3::Zero();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    covariance += (now[i] - now_centre) * (rest[i] - rest_centre).transpose();
  }
  // Kabsch 1976: R = U diag(1, 1, det(U V^T)) V^T of the covariance U S V^T; the last sign refuses mirror images.
  const Eigen::JacobiSVD<Mat3> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) u.col(2) *= -1.0;
  const Mat3 rotation = u * svd.matrixV().transpose();
  ShapeError error;
  double sum = 0.0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const double d2 = (now[i] - now_centre - rotation * (rest[i] - rest_centre)).squaredNorm();
    sum += d2;
    error.largest = std::max(error.largest, d2);
  }
  error.rms = std::sqrt(sum / count);
  error.largest = std::sqrt(error.largest);
  return error;
}

double oscillation(std::span<const Vec3> before, std::span<const Vec3> after) {
  SUPPLE_EXPECTS(before.size() == after.size() && !before.empty());
  Vec3 mean = Vec3::Zero();
  for (std::size_t i = 0; i < before.size(); ++i) mean += after[i] - before[i];
  mean /= static_cast<double>(before.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) sum += (after[i] - before[i] - mean).squaredNorm();
  return std::sqrt(sum);
}

}  // namespace supple::core
