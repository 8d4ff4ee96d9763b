// Hessians of the pair laws. A law of r and the normals is differentiated in z = (r, n_A, n_B) first; z moves with q by
// dr = dx_B - dx_A and dn = dtheta x n + dtheta x (dtheta x n) / 2.
#include "supple/core/pair_hessian.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "supple/core/math.h"

namespace supple::core {
namespace {

using Vec9 = Eigen::Matrix<double, 9, 1>;
using Mat9 = Eigen::Matrix<double, 9, 9>;

/// Places in q and in z.
enum : int { kXA = 0, kThetaA = 3, kXB = 6, kThetaB = 9 };
enum : int { kR = 0, kNA = 3, kNB = 6 };

/// [v]: the matrix of v x.
Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

/// What the second-order motion of a body vector b adds to its particle's rotation block, `gradient` being dU/db.
Mat3 turning_term(const Vec3& b, const Vec3& gradient) {
  const Mat3 outer = b * gradient.transpose();
  return 0.5 * (outer + outer.transpose()) - b.dot(gradient) * Mat3::Identity();
}

void add_block(PairHessian& h, int row, int column, const Mat3& block) {
  h.block<3, 3>(row, column) += block;
  h.block<3, 3>(column, row) += block.transpose();
}

/// The upper half copied to the lower, which roundings have made differ.
void mirror(PairHessian& h) {
  for (int row = 1; row < 12; ++row) {
    for (int column = 0; column < row; ++column) h(row, column) = h(column, row);
  }
}

/// Adds K for the relative displacement dx_B - dx_A.
void add_relative(PairHessian& h, const Mat3& k) {
  h.block<3, 3>(kXA, kXA) += k;
  h.block<3, 3>(kXB, kXB) += k;
  add_block(h, kXA, kXB, -k);
}

/// second r r^T / d^2 + first / d (1 - r r^T / d^2): the Hessian of a function of d with these derivatives.
Mat3 radial_hessian(double first, double second, const Vec3& r) {
  const double d = r.norm();
  const Mat3 along = r * r.transpose() / (d * d);
  return second * along + first / d * (Mat3::Identity() - along);
}

PairHessian central_hessian(double first, double second, const PairPose& pose, HessianKind kind) {
  if (kind == HessianKind::PositiveSemiDefinite) {
    first = std::max(first, 0.0);
    second = std::max(second, 0.0);
  }
  PairHessian h = PairHessian::Zero();
  add_relative(h, radial_hessian(first, second, pose.r));
  mirror(h);
  return h;
}

/// From derivatives in z; a matrix without the second-order motion of the normals for a zero gradient.
PairHessian from_normal_derivatives(const Vec9& gradient, const Mat9& second, const PairPose& pose) {
  const Mat3 turn_a = -cross_matrix(pose.normal_a);  // dn_A = turn_a dtheta_A
  const Mat3 turn_b = -cross_matrix(pose.normal_b);
  PairHessian h = PairHessian::Zero();
  add_relative(h, second.block<3, 3>(kR, kR));
  const Mat3 r_a = second.block<3, 3>(kR, kNA) * turn_a;
  const Mat3 r_b = second.block<3, 3>(kR, kNB) * turn_b;
  add_block(h, kXA, kThetaA, -r_a);
  add_block(h, kXB, kThetaA, r_a);
  add_block(h, kXA, kThetaB, -r_b);
  add_block(h, kXB, kThetaB, r_b);
  add_block(h, kThetaA, kThetaB, turn_a.transpose() * second.block<3, 3>(kNA, kNB) * turn_b);
  h.block<3, 3>(kThetaA, kThetaA) += turn_a.transpose() * second.block<3, 3>(kNA, kNA) * turn_a +
                                     turning_term(pose.normal_a, gradient.segment<3>(kNA));
  h.block<3, 3>(kThetaB, kThetaB) += turn_b.transpose() * second.block<3, 3>(kNB, kNB) * turn_b +
                                     turning_term(pose.normal_b, gradient.segment<3>(kNB));
  mirror(h);
  return h;
}

/// One term e of an energy k psi(d) sum e^2, with its derivatives in z. `second` is null where e is linear in z.
struct Residual {
  double value = 0.0;
  Vec9 gradient = Vec9::Zero();
  const Mat9* second = nullptr;
};

/// Hessian of U = k psi(d) sum e^2. Positive semi-definite: 2 k sum J^T J with J = d(sqrt(psi) e)/dz.
PairHessian weighted_squares(double k, const Weight::Value& weight, std::span<const Residual> residuals,
                             const PairPose& pose, HessianKind kind) {
  if (weight.psi == 0.0) return PairHessian::Zero();
  Vec9 along = Vec9::Zero();
  along.segment<3>(kR) = pose.r / pose.r.norm();
  Mat9 second = Mat9::Zero();
  if (kind == HessianKind::PositiveSemiDefinite) {
    for (const Residual& e : residuals) {
      const Vec9 j = e.gradient + 0.5 * weight.slope / weight.psi * e.value * along;
      second += 2.0 * k * weight.psi * j * j.transpose();
    }
    return from_normal_derivatives(Vec9::Zero(), second, pose);
  }
  double squares = 0.0;
  Vec9 gradient = Vec9::Zero();  // of the sum of squares
  for (const Residual& e : residuals) {
    squares += e.value * e.value;
    gradient += 2.0 * e.value * e.gradient;
    second += 2.0 * weight.psi * e.gradient * e.gradient.transpose();
    if (e.second != nullptr) second += 2.0 * weight.psi * e.value * *e.second;
  }
  const Mat9 mixed = weight.slope * gradient * along.transpose();
  second += mixed + mixed.transpose();
  second.block<3, 3>(kR, kR) += squares * radial_hessian(weight.slope, weight.second, pose.r);
  return from_normal_derivatives(k * weight.psi * gradient, k * second, pose);
}

/// U = k psi |kappa r + radius (n_A - n_B)|^2.
PairHessian form_hessian(double k, const Weight::Value& weight, double kappa, double radius, const PairPose& pose,
                         HessianKind kind) {
  const Vec3 w = kappa * pose.r + radius * (pose.normal_a - pose.normal_b);
  std::array<Residual, 3> residuals;
  for (int i = 0; i < 3; ++i) {
    Residual& e = residuals[static_cast<std::size_t>(i)];
    e.value = w[i];
    e.gradient[kR + i] = kappa;
    e.gradient[kNA + i] = radius;
    e.gradient[kNB + i] = -radius;
  }
  return weighted_squares(k, weight, residuals, pose, kind);
}

}  // namespace

PairHessian hessian(const Cohesion& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  return central_hessian(-law.force(d), -law.slope(d), pose, kind);
}

PairHessian hessian(const Form& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  return form_hessian(law.strength, law.weight.at(d).over_distance_squared(d), law.curvature, 1.0, pose, kind);
}

PairHessian hessian(const FormRadius& law, const PairPose& pose, HessianKind kind) {
  return form_hessian(law.strength, law.weight.at(pose.r.norm()), 1.0, law.radius, pose, kind);
}

PairHessian hessian(const BondFrame& law, const PairPose& pose, HessianKind kind) {
  const Mat3 q_a = pose.orientation_a.toRotationMatrix();
  const Mat3 q_b = pose.orientation_b.toRotationMatrix();
  const Vec3 arm_a = q_a * law.rest_a;
  const Vec3 arm_b = q_b * law.rest_b;
  const Vec3 u_a = pose.r - arm_a;
  const Vec3 u_b = pose.r + arm_b;
  const double half = 0.5 * law.stretch;
  const Mat3 lever_a = cross_matrix(arm_a);   // du_A = dr + lever_a dtheta_A
  const Mat3 lever_b = -cross_matrix(arm_b);  // du_B = dr + lever_b dtheta_B

  PairHessian h = PairHessian::Zero();
  add_relative(h, law.stretch * Mat3::Identity());
  add_block(h, kXA, kThetaA, -half * lever_a);
  add_block(h, kXB, kThetaA, half * lever_a);
  add_block(h, kXA, kThetaB, -half * lever_b);
  add_block(h, kXB, kThetaB, half * lever_b);
  h.block<3, 3>(kThetaA, kThetaA) += half * lever_a.transpose() * lever_a;
  h.block<3, 3>(kThetaB, kThetaB) += half * lever_b.transpose() * lever_b;

  // Rotation: k_theta (3 - sum_k a_k . b_k). With M = sum_k a_k b_k^T the mixed block is -k_theta (tr M - M^T), exactly
  // and for the squares |a_k - b_k|^2 alike; theirs on the diagonal is 2 k_theta.
  const Mat3 m = q_a * (law.rest_orientation_a.conjugate() * law.rest_orientation_b).toRotationMatrix() *
                 q_b.transpose();
  add_block(h, kThetaA, kThetaB, -law.rotation * (m.trace() * Mat3::Identity() - m.transpose()));
  if (kind == HessianKind::PositiveSemiDefinite) {
    h.block<3, 3>(kThetaA, kThetaA) += 2.0 * law.rotation * Mat3::Identity();
    h.block<3, 3>(kThetaB, kThetaB) += 2.0 * law.rotation * Mat3::Identity();
  } else {
    const Mat3 own = law.rotation * (m.trace() * Mat3::Identity() - 0.5 * (m + m.transpose()));
    h.block<3, 3>(kThetaA, kThetaA) += own + turning_term(arm_a, -half * u_a);
    h.block<3, 3>(kThetaB, kThetaB) += own + turning_term(arm_b, half * u_b);
  }
  mirror(h);
  return h;
}

PairHessian hessian(const Coplanarity& law, const PairPose& pose, HessianKind kind) {
  std::array<Residual, 2> residuals;  // n_A . r and n_B . r
  std::array<Mat9, 2> second{Mat9::Zero(), Mat9::Zero()};
  const std::array<int, 2> place{kNA, kNB};
  const std::array<const Vec3*, 2> normal{&pose.normal_a, &pose.normal_b};
  for (std::size_t k = 0; k < 2; ++k) {
    residuals[k].value = normal[k]->dot(pose.r);
    residuals[k].gradient.segment<3>(kR) = *normal[k];
    residuals[k].gradient.segment<3>(place[k]) = pose.r;
    second[k].block<3, 3>(kR, place[k]).setIdentity();
    second[k].block<3, 3>(place[k], kR).setIdentity();
    residuals[k].second = &second[k];
  }
  return weighted_squares(law.strength, law.weight.at(pose.r.norm()), residuals, pose, kind);
}

PairHessian hessian(const Repulsion& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  if (d >= law.cut_off()) return PairHessian::Zero();
  const double e = math::exp((law.distance - d) / law.length);
  return central_hessian(-law.force * (e - law.tolerance), law.force * e / law.length, pose, kind);
}

}  // namespace supple::core
