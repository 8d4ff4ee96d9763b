// Rayleigh's damping of deformation, pair by pair.
#include <Eigen/LU>
#include <cmath>

#include "laws/cross_matrix.h"
#include "laws/damping.h"
#include "laws/pair_hessians.h"

namespace supple::core {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vec12 = Eigen::Matrix<double, 12, 1>;

/// The damping time of a pair, 0 unless both are of one object that has one.
double damping_time(const ParticleSet& set, const std::vector<StiffnessDamping>& damping, std::uint32_t a,
                    std::uint32_t b) {
  if (set.object[a] != set.object[b]) return 0.0;
  double time = 0.0;
  for (const StiffnessDamping& law : damping) {
    if (law.object == set.object[a]) time += law.time;
  }
  return time;
}

/// The deformation of a pair: its motion without the rigid ones, which feel no damping (prestress would make a rotation feel forces). A motion is a sum of
/// rigid ones and of N q, where q = (u, v) moves the particles by (-u, u) and turns them by (c x u - v, c x u + v), c = -r / (2 d^2): the motions
/// that are orthogonal to the rigid ones where turns count by the distance d. A motion s has q = B^T s with
///   u = G (s_xB - s_xA) + 0.2 r x (s_thetaA + s_thetaB),  v = (s_thetaB - s_thetaA) / 2,  G = 0.4 (1 - r r^T / d^2) + 0.5 r r^T / d^2.
class Deformation {
 public:
  explicit Deformation(const Vec3& r)
      : r_(r), share_(0.4 * Mat3::Identity() + 0.1 / r.squaredNorm() * r * r.transpose()), turn_(-0.5 / r.squaredNorm() * cross_matrix(r)) {}

  /// N^T K N
  [[nodiscard]] Matrix6 stiffness(const PairHessian& k) const {
    Eigen::Matrix<double, 12, 6> columns;
    columns.leftCols<3>() = k.middleCols<3>(6) - k.middleCols<3>(0) + (k.middleCols<3>(3) + k.middleCols<3>(9)).lazyProduct(turn_);
    columns.rightCols<3>() = k.middleCols<3>(9) - k.middleCols<3>(3);
    Matrix6 out;
    out.topRows<3>() = columns.middleRows<3>(6) - columns.middleRows<3>(0) + turn_.transpose().lazyProduct(columns.middleRows<3>(3) + columns.middleRows<3>(9));
    out.bottomRows<3>() = columns.middleRows<3>(9) - columns.middleRows<3>(3);
    return out;
  }
  /// B^T s
  [[nodiscard]] Vector6 of(const Vec12& s) const {
    const Vec3 apart = s.segment<3>(6) - s.segment<3>(0), turns = s.segment<3>(3) + s.segment<3>(9);
    Vector6 q;
    q.head<3>() = share_ * apart + 0.2 * r_.cross(turns);
    q.tail<3>() = 0.5 * (s.segment<3>(9) - s.segment<3>(3));
    return q;
  }
  /// B k
  template <int columns>
  [[nodiscard]] Eigen::Matrix<double, 12, columns> loads(const Eigen::Matrix<double, 6, columns>& k) const {
    Eigen::Matrix<double, 12, columns> out;
    out.template middleRows<3>(6) = share_.lazyProduct(k.template topRows<3>());
    out.template middleRows<3>(0) = -out.template middleRows<3>(6);
    const Eigen::Matrix<double, 3, columns> moment = (-0.2 * cross_matrix(r_)).lazyProduct(k.template topRows<3>());
    out.template middleRows<3>(3) = moment - 0.5 * k.template bottomRows<3>();
    out.template middleRows<3>(9) = moment + 0.5 * k.template bottomRows<3>();
    return out;
  }

 private:
  Vec3 r_;
  Mat3 share_, turn_;
};

/// K without the rigid motions of the pair: B N^T K N B^T.
PairHessian deformation_stiffness(const Vec3& r, const PairHessian& k) {
  const Deformation deformation(r);
  const Eigen::Matrix<double, 12, 6> half = deformation.loads(deformation.stiffness(k));
  return deformation.loads<12>(half.transpose());
}

Vec12 velocities(const ParticleSet& set, const ParticleState& state, std::size_t a, std::size_t b) {
  Vec12 w;
  w << state.velocity[a], angular_velocity(set, state, a), state.velocity[b], angular_velocity(set, state, b);
  return w;
}

/// Forces or impulses of a pair that cancel exactly, from those that cancel to rounding errors.
struct Balanced {
  Vec3 force_b;
  Vec3 torque_a;
  Vec3 torque_b;
};
Balanced balance(const Vec3& r, const Vec12& load) {
  const Vec3 force_b = load.segment<3>(6);
  const Vec3 torque_a = load.segment<3>(3);
  return {force_b, torque_a, -torque_a - r.cross(force_b)};
}

/// Inverse inertia in world axes, zero in what is held.
Mat3 mobility(const ParticleSet& set, const ParticleState& state, std::size_t i) {
  const Mat3 q = state.orientation[i].toRotationMatrix();
  Mat3 inverse = q * set.inertia[i].cwiseInverse().asDiagonal() * q.transpose();
  if (set.pinned[i] == 0) return inverse;
  for (int axis = 0; axis < 3; ++axis) {
    if (free_rotation(set.pinned[i], Vec3::Unit(axis)) != Vec3::Zero()) continue;
    inverse.row(axis).setZero();
    inverse.col(axis).setZero();
  }
  return inverse;
}

/// M^-1 s of both particles, zero in what is held.
Eigen::Matrix<double, 12, 6> moved_by(const ParticleSet& set, const ParticleState& state, std::size_t a, std::size_t b, const Eigen::Matrix<double, 12, 6>& loads) {
  Eigen::Matrix<double, 12, 6> out;
  int at = 0;
  for (const std::size_t i : {a, b}) {
    const Vec3 free = free_translation(set.pinned[i], Vec3::Ones()) / set.mass[i];
    out.middleRows<3>(at) = free.asDiagonal() * loads.middleRows<3>(at);
    out.middleRows<3>(at + 3) = mobility(set, state, i).lazyProduct(loads.middleRows<3>(at + 3));
    at += 6;
  }
  return out;
}

/// Velocities that pins of a pair prescribe; zero of what is free.
Vec12 led_velocities(const ParticleSet& set, const Vec12& motion, std::size_t a, std::size_t b) {
  Vec12 led = Vec12::Zero();
  int at = 0;
  for (const std::size_t i : {a, b}) {
    if ((set.pinned[i] & kPinPosition) != 0) led.segment<3>(at) = motion.segment<3>(at);
    if ((set.pinned[i] & kPinOrientation) != 0) led.segment<3>(at + 3) = motion.segment<3>(at + 3);
    at += 6;
  }
  return led;
}

struct DampedPair {
  std::uint32_t a, b;
  PairHessian hessian;
};

/// q' = -A q / h for the deformation q of the velocities, A = h B^T M^-1 B N^T K N, to second order as in friction.
void damp(const ParticleSet& set, const DampedPair& pair, double h, ParticleState& state, Ledger& ledger) {
  const auto& [a, b, hessian] = pair;
  const Vec3 r = state.position[b] - state.position[a];
  const Deformation deformation(r);
  const Matrix6 k = h * deformation.stiffness(hessian);
  const Eigen::Matrix<double, 12, 6> loads = deformation.loads<6>(Matrix6::Identity());
  const Matrix6 mobility = loads.transpose().lazyProduct(moved_by(set, state, a, b, loads));
  const Vec12 motion = velocities(set, state, a, b), led = led_velocities(set, motion, a, b);
  const Vector6 before = deformation.of(motion - led), prescribed = deformation.of(led);
  const Matrix6 z = mobility.lazyProduct(k);
  // Of what is prescribed the mean has (exp(-A) - 1 + A) / A^2.
  const Vector6 drive = before + 0.5 * z * (before - prescribed - z * prescribed);
  const Vector6 mean = (Matrix6::Identity() + z + 0.5 * z.lazyProduct(z)).partialPivLu().solve(drive);
  const Vector6 impulse = -k * (mean + prescribed);
  const Balanced balanced = balance(r, deformation.loads<1>(impulse));
  apply_impulse(set, a, -balanced.force_b, balanced.torque_a, state, ledger);
  apply_impulse(set, b, balanced.force_b, balanced.torque_b, state, ledger);
  ledger.dissipated -= impulse.dot(before + prescribed) + 0.5 * impulse.dot(mobility * impulse);
}

}  // namespace

void apply_stiffness_damping(const ParticleSet& set, const Interactions& interactions, double dt, PairOrder order,
                             ParticleState& state, Ledger& ledger) {
  if (interactions.stiffness_damping.empty()) return;
  std::vector<DampedPair> blocks;
  for_each_hessian(set, state, interactions, HessianKind::PositiveSemiDefinite,
                   [&blocks](std::uint32_t a, std::uint32_t b, const PairHessian& h) { blocks.push_back({a, b, h}); });
  for (std::size_t step = 0; step < blocks.size(); ++step) {
    const DampedPair& block = blocks[order == PairOrder::Forward ? step : blocks.size() - 1 - step];
    const double time = damping_time(set, interactions.stiffness_damping, block.a, block.b);
    if (time > 0.0) damp(set, block, dt * time, state, ledger);
  }
}

void for_each_stiffness_damping(const ParticleSet& set, const ParticleState& state, const Interactions& interactions,
                                const PairHessianVisitor& visit) {
  if (interactions.stiffness_damping.empty()) return;
  for_each_hessian(set, state, interactions, HessianKind::PositiveSemiDefinite,
                   [&](std::uint32_t a, std::uint32_t b, const PairHessian& h) {
                     const double time = damping_time(set, interactions.stiffness_damping, a, b);
                     if (time > 0.0) visit(a, b, time * deformation_stiffness(state.position[b] - state.position[a], h));
                   });
}

void add_stiffness_damping_loads(const ParticleSet& set, const Interactions& interactions, const ParticleState& state,
                                 Loads& loads) {
  if (interactions.stiffness_damping.empty()) return;
  for_each_stiffness_damping(set, state, interactions, [&](std::uint32_t a, std::uint32_t b, const PairHessian& d) {
    const Vec3 r = state.position[b] - state.position[a];
    const Balanced balanced = balance(r, -d * velocities(set, state, a, b));
    loads.force[a] -= balanced.force_b;
    loads.force[b] += balanced.force_b;
    loads.torque[a] += balanced.torque_a;
    loads.torque[b] += balanced.torque_b;
  });
}

}  // namespace supple::core
