// Hessians of the pair laws. A law is differentiated in y = (dr, dtheta_A, dtheta_B) first, dr = dx_B - dx_A; a vector b
// that a particle carries moves by dtheta x b + dtheta x (dtheta x b) / 2.
#include "supple/core/pair_hessian.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "laws/cross_matrix.h"
#include "laws/relative_hessian.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

/// Places in q.
enum : int { kXA = 0, kThetaA = 3, kXB = 6, kThetaB = 9 };

/// A vector in y.
Vec9 stacked(const Vec3& r, const Vec3& turn_a, const Vec3& turn_b) {
  Vec9 v;
  v.segment<3>(kR) = r;
  v.segment<3>(kTurnA) = turn_a;
  v.segment<3>(kTurnB) = turn_b;
  return v;
}

/// Contribution of the second-order motion of a body vector b to its particle's rotation block, `gradient` being dU/db.
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

}  // namespace

PairHessian from_relative(const Mat9& second) {
  PairHessian h = PairHessian::Zero();
  add_relative(h, second.block<3, 3>(kR, kR));
  for (const auto& [turn, theta] : {std::pair{kTurnA, kThetaA}, std::pair{kTurnB, kThetaB}}) {
    add_block(h, kXA, theta, -second.block<3, 3>(kR, turn));
    add_block(h, kXB, theta, second.block<3, 3>(kR, turn));
    h.block<3, 3>(theta, theta) += second.block<3, 3>(turn, turn);
  }
  add_block(h, kThetaA, kThetaB, second.block<3, 3>(kTurnA, kTurnB));
  mirror(h);
  return h;
}

namespace {

/// Terms e_1 ... of an energy k psi(d) sum e^2, with their derivatives in y.
template <int count>
struct Residuals {
  Eigen::Matrix<double, count, 1> value;
  Eigen::Matrix<double, 9, count> gradient;  ///< a column each
  Mat9 turning = Mat9::Zero();  ///< sum of e times its second derivative
};

/// Hessian of U = k psi(d) sum e^2. Positive semi-definite: 2 k sum J^T J with J = d(sqrt(psi) e)/dy.
template <int count>
PairHessian weighted_squares(double k, const Weight::Value& weight, const Residuals<count>& e, const PairPose& pose,
                             HessianKind kind) {
  if (weight.psi == 0.0) return PairHessian::Zero();
  const Vec9 along = stacked(pose.r / pose.r.norm(), Vec3::Zero(), Vec3::Zero());
  if (kind == HessianKind::PositiveSemiDefinite) {
    const Eigen::Matrix<double, 9, count> j =
        e.gradient + 0.5 * weight.slope / weight.psi * along * e.value.transpose();
    return from_relative(2.0 * k * weight.psi * j * j.transpose());
  }
  const Mat9 mixed = 2.0 * weight.slope * (e.gradient * e.value) * along.transpose();
  Mat9 second = 2.0 * weight.psi * (e.gradient * e.gradient.transpose() + e.turning) + mixed + mixed.transpose();
  second.block<3, 3>(kR, kR) += e.value.squaredNorm() * radial_hessian(weight.slope, weight.second, pose.r);
  return from_relative(k * second);
}

/// U = k psi |kappa r + radius (n_A - n_B)|^2.
PairHessian form_hessian(double k, const Weight::Value& weight, double kappa, double radius, const PairPose& pose,
                         HessianKind kind) {
  Residuals<3> e;
  e.value = kappa * pose.r + radius * (pose.normal_a - pose.normal_b);
  e.gradient << kappa * Mat3::Identity(), radius * cross_matrix(pose.normal_a), -radius * cross_matrix(pose.normal_b);
  e.turning.block<3, 3>(kTurnA, kTurnA) = turning_term(pose.normal_a, radius * e.value);
  e.turning.block<3, 3>(kTurnB, kTurnB) = turning_term(pose.normal_b, -radius * e.value);
  return weighted_squares(k, weight, e, pose, kind);
}

/// Adds value times the second derivatives of n . r to `turning`, the normal being that of the particle at `turn`.
void add_dot_product(Mat9& turning, double value, const Vec3& normal, const Vec3& r, int turn) {
  const Mat3 mixed = -value * cross_matrix(normal);
  turning.block<3, 3>(kR, turn) += mixed;
  turning.block<3, 3>(turn, kR) += mixed.transpose();
  turning.block<3, 3>(turn, turn) += turning_term(normal, value * r);
}

/// U = k psi ((n_A . r)^2 + (n_B . r)^2).
PairHessian coplanarity_hessian(double k, const Weight::Value& weight, const PairPose& pose, HessianKind kind) {
  Residuals<2> e;
  e.value << pose.normal_a.dot(pose.r), pose.normal_b.dot(pose.r);
  e.gradient.col(0) = stacked(pose.normal_a, pose.normal_a.cross(pose.r), Vec3::Zero());
  e.gradient.col(1) = stacked(pose.normal_b, Vec3::Zero(), pose.normal_b.cross(pose.r));
  add_dot_product(e.turning, e.value[0], pose.normal_a, pose.r, kTurnA);
  add_dot_product(e.turning, e.value[1], pose.normal_b, pose.r, kTurnB);
  return weighted_squares(k, weight, e, pose, kind);
}

/// U = k psi ((n_A + n_B) . r)^2.
PairHessian co_circularity_hessian(double k, const Weight::Value& weight, const PairPose& pose, HessianKind kind) {
  Residuals<1> e;
  const Vec3 sum = pose.normal_a + pose.normal_b;
  e.value << sum.dot(pose.r);
  e.gradient = stacked(sum, pose.normal_a.cross(pose.r), pose.normal_b.cross(pose.r));
  add_dot_product(e.turning, e.value[0], pose.normal_a, pose.r, kTurnA);
  add_dot_product(e.turning, e.value[0], pose.normal_b, pose.r, kTurnB);
  return weighted_squares(k, weight, e, pose, kind);
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
  return coplanarity_hessian(law.strength, law.weight.at(pose.r.norm()), pose, kind);
}

PairHessian hessian(const NormalisedCoplanarity& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  return coplanarity_hessian(law.strength, law.weight.at(d).over_distance_squared(d), pose, kind);
}

PairHessian hessian(const CoNormality& law, const PairPose& pose, HessianKind kind) {
  return form_hessian(law.strength, law.weight.at(pose.r.norm()), 0.0, 1.0, pose, kind);
}

PairHessian hessian(const CoCircularity& law, const PairPose& pose, HessianKind kind) {
  return co_circularity_hessian(law.strength, law.weight.at(pose.r.norm()), pose, kind);
}

PairHessian hessian(const NormalisedCoCircularity& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  return co_circularity_hessian(law.strength, law.weight.at(d).over_distance_squared(d), pose, kind);
}

PairHessian hessian(const LennardJones& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  return central_hessian(-law.force(d), -law.slope(d), pose, kind);
}

PairHessian hessian(const LinearCohesion& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  return central_hessian(-law.force(d), -law.slope(d), pose, kind);
}

PairHessian hessian(const TabulatedCohesion& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  return central_hessian(-law.force(d), -law.slope(d), pose, kind);
}

PairHessian hessian(const DirectedCohesion& law, const PairPose& pose, HessianKind kind) {
  // s = d^2 / h with h = h_A + h_B, h_X = sqrt(r . M r) and M = Q D^2 Q^T: turning X by dtheta is turning r by -dtheta.
  const Vec3& r = pose.r;
  double h = 0.0;
  Vec9 gradient = Vec9::Zero();  // of h
  Mat9 second = Mat9::Zero();    // of h
  const auto add = [&](const Vec3& semi_axes, const Quat& orientation, int turn) {
    const Mat3 q = orientation.toRotationMatrix();
    const Mat3 m = q * semi_axes.cwiseAbs2().asDiagonal() * q.transpose();
    const double value = std::sqrt(r.dot(m * r));
    const Vec3 g = m * r / value;
    const Mat3 hessian_r = (m - g * g.transpose()) / value;
    const Mat3 lever = cross_matrix(r);
    h += value;
    gradient.segment<3>(kR) += g;
    gradient.segment<3>(turn) -= r.cross(g);
    second.block<3, 3>(kR, kR) += hessian_r;
    second.block<3, 3>(turn, turn) += lever.transpose() * hessian_r * lever + turning_term(r, g);
    const Mat3 mixed = hessian_r * lever - cross_matrix(g);
    second.block<3, 3>(kR, turn) += mixed;
    second.block<3, 3>(turn, kR) += mixed.transpose();
  };
  add(law.semi_axes_a, pose.orientation_a, kTurnA);
  add(law.semi_axes_b, pose.orientation_b, kTurnB);

  const double s = r.squaredNorm() / h;
  const Cohesion unit{.r0 = 1.0, .f0 = law.scale, .a = law.a};
  const double bend = -unit.slope(s);  // W''
  const Vec9 d2_gradient = stacked(2.0 * r, Vec3::Zero(), Vec3::Zero());
  const Vec9 slope = (d2_gradient - s * gradient) / h;
  if (kind == HessianKind::PositiveSemiDefinite) {
    return from_relative(std::max(bend, 0.0) * slope * slope.transpose());
  }
  Mat9 second_s = -(slope * gradient.transpose() + gradient * slope.transpose()) - s * second;
  second_s.block<3, 3>(kR, kR) += 2.0 * Mat3::Identity();
  return from_relative(bend * slope * slope.transpose() - unit.force(s) / h * second_s);
}

PairHessian hessian(const DirectedForm& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  const Mat3 q_a = pose.orientation_a.toRotationMatrix();
  const Mat3 q_b = pose.orientation_b.toRotationMatrix();
  const Mat3 s_a = q_a * law.shape_a * q_a.transpose();
  const Mat3 s_b = q_b * law.shape_b * q_b.transpose();
  const Mat3 mean = 0.5 * (s_a + s_b);
  const Mat3 lever = cross_matrix(pose.r);
  Residuals<3> e;
  e.value = mean * pose.r + pose.normal_a - pose.normal_b;
  const Vec3& w = e.value;
  e.gradient.block<3, 3>(kR, 0) = mean;
  const auto add = [&](const Mat3& s, const Vec3& normal, double sign, int turn) {
    const Mat3 by_turn = 0.5 * (s * lever - cross_matrix(s * pose.r)) - sign * cross_matrix(normal);
    e.gradient.block<3, 3>(turn, 0) = by_turn.transpose();
    // Second derivatives of w . S r / 2 with fixed w, S turning by dtheta.
    const Mat3 mixed = 0.5 * (s * cross_matrix(w) - cross_matrix(s * w));
    const Mat3 both = 0.5 * cross_matrix(w).transpose() * s * lever;
    e.turning.block<3, 3>(kR, turn) += mixed;
    e.turning.block<3, 3>(turn, kR) += mixed.transpose();
    e.turning.block<3, 3>(turn, turn) += both + both.transpose() + turning_term(pose.r, 0.5 * s * w) +
                                         turning_term(w, 0.5 * s * pose.r) + turning_term(normal, sign * w);
  };
  add(s_a, pose.normal_a, 1.0, kTurnA);
  add(s_b, pose.normal_b, -1.0, kTurnB);
  return weighted_squares(law.strength, law.weight.at(d).over_distance_squared(d), e, pose, kind);
}

PairHessian hessian(const Repulsion& law, const PairPose& pose, HessianKind kind) {
  const double d = pose.r.norm();
  if (d >= law.cut_off()) return PairHessian::Zero();
  const double e = math::exp((law.distance - d) / law.length);
  return central_hessian(-law.force * (e - law.tolerance), law.force * e / law.length, pose, kind);
}

}  // namespace supple::core
