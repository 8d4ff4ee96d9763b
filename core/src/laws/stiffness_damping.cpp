// Rayleigh's damping of deformation, pair by pair.
#include <Eigen/Cholesky>
#include <cmath>

#include "laws/cross_matrix.h"
#include "laws/damping.h"
#include "laws/pair_hessians.h"

namespace supple::core {
namespace {

using Mat12 = Eigen::Matrix<double, 12, 12>;
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

/// K without the rigid motions of the pair: P^T K P with P R = 0. Prestress would make a rotation feel forces.
Mat12 deformation_stiffness(const Vec3& r, const PairHessian& k) {
  const double d = r.norm();
  // Rigid motions of the pair about A; rotations are scaled by the distance d.
  Eigen::Matrix<double, 12, 6> rigid = Eigen::Matrix<double, 12, 6>::Zero();
  rigid.block<3, 3>(0, 0).setIdentity();
  rigid.block<3, 3>(6, 0).setIdentity();
  rigid.block<3, 3>(3, 3).setIdentity();
  rigid.block<3, 3>(9, 3).setIdentity();
  rigid.block<3, 3>(6, 3) = -cross_matrix(r);
  Vec12 weight = Vec12::Ones();
  weight.segment<3>(3).setConstant(d * d);
  weight.segment<3>(9).setConstant(d * d);
  const Eigen::Matrix<double, 6, 12> weighted = rigid.transpose() * weight.asDiagonal();
  const Mat12 keep = Mat12::Identity() - rigid * (weighted * rigid).llt().solve(weighted);
  return keep.transpose() * k * keep;
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

/// M^(1/2) or its inverse for one particle; pinned directions have no inverse mass.
Mat12 mass_root(const ParticleSet& set, const ParticleState& state, std::size_t a, std::size_t b, bool inverse) {
  Mat12 root = Mat12::Zero();
  int at = 0;
  for (const std::size_t i : {a, b}) {
    Vec3 inertia = set.inertia[i].cwiseSqrt();
    double mass = std::sqrt(set.mass[i]);
    if (inverse) {
      inertia = inertia.cwiseInverse();
      mass = 1.0 / mass;
    }
    const Mat3 q = state.orientation[i].toRotationMatrix();
    root.block<3, 3>(at, at) = mass * Mat3::Identity();
    root.block<3, 3>(at + 3, at + 3) = q * inertia.asDiagonal() * q.transpose();
    for (int axis = 0; axis < 3; ++axis) {
      if (free_translation(set.pinned[i], Vec3::Unit(axis)) == Vec3::Zero()) {
        root.row(at + axis).setZero();
        root.col(at + axis).setZero();
      }
      if (free_rotation(set.pinned[i], Vec3::Unit(axis)) == Vec3::Zero()) {
        root.row(at + 3 + axis).setZero();
        root.col(at + 3 + axis).setZero();
      }
    }
    at += 6;
  }
  return root;
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

void damp(const ParticleSet& set, const DampedPair& pair, double h, ParticleState& state, Ledger& ledger) {
  const auto& [a, b, hessian] = pair;
  const Vec3 r = state.position[b] - state.position[a];
  const Mat12 k = deformation_stiffness(r, hessian);
  const Mat12 light = mass_root(set, state, a, b, true);
  const Vec12 motion = velocities(set, state, a, b);
  const Vec12 before = mass_root(set, state, a, b, false) * motion;
  const Vec12 led = led_velocities(set, motion, a, b);
  // y' = -Z y / h in y = M^(1/2) velocity, to second order as in friction.
  const Mat12 z = h * light * k * light;
  const Mat12 one = Mat12::Identity();
  Vec12 drive = before + 0.5 * z * before;
  if (!led.isZero(0.0)) {
    const Vec12 push = -h * light * (k * led);  // with y' = -(Z y - push) / h: the mean has (exp(-Z) - 1 + Z) / Z^2 of it
    drive += 0.5 * (push + z * push);
  }
  const Vec12 mean = (one + z + 0.5 * z * z).llt().solve(drive);
  const Vec12 impulse = led.isZero(0.0) ? Vec12(-h * k * (light * mean)) : Vec12(-h * k * (light * mean + led));
  const Balanced balanced = balance(r, impulse);
  apply_impulse(set, a, -balanced.force_b, balanced.torque_a, state, ledger);
  apply_impulse(set, b, balanced.force_b, balanced.torque_b, state, ledger);
  const Vec12 gain = light * impulse;
  ledger.dissipated -= gain.dot(before) + 0.5 * gain.squaredNorm() + impulse.dot(led);
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
