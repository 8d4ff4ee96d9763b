#include "laws/damping.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "laws/cross_matrix.h"
#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::core {
namespace {

/// One particle of a pair: its compliance to an impulse.
struct Side {
  std::size_t index;
  double inverse_mass;
  double inverse_inertia;  ///< of an isotropic body
  bool isotropic;
  bool held;               ///< turns as its pin does
};

Side side_of(const ParticleSet& set, std::size_t i) {
  const Vec3& inertia = set.inertia[i];
  const bool held = (set.pinned[i] & kPinOrientation) != 0;
  return {.index = i,
          .inverse_mass = (set.pinned[i] & kPinPosition) != 0 ? 0.0 : 1.0 / set.mass[i],
          .inverse_inertia = held ? 0.0 : 1.0 / inertia.x(),
          .isotropic = held || (inertia.x() == inertia.y() && inertia.y() == inertia.z()),
          .held = held};
}

Vec3 spin(const ParticleSet& set, const ParticleState& state, const Side& side) {
  if (side.isotropic && !side.held) return side.inverse_inertia * state.angular_momentum[side.index];
  return angular_velocity(set, state, side.index);
}

Mat3 inverse_inertia(const ParticleSet& set, const ParticleState& state, const Side& side) {
  if (side.isotropic) return side.inverse_inertia * Mat3::Identity();
  const Mat3 q = state.orientation[side.index].toRotationMatrix();
  return q * set.inertia[side.index].cwiseInverse().asDiagonal() * q.transpose();
}

/// Maps relative velocity u to the impulse over h: -(1 - exp(-h k)) / k u to second order in z = h k, by
/// exp(-z) ~ 1 / (1 + z + z^2 / 2), which tends to 0 with growing z as the exponential does.
double gain(double h, double k) {
  const double z = h * k;
  return -h * (1.0 + 0.5 * z) / (1.0 + z + 0.5 * z * z);
}

/// The same for a symmetric positive semi-definite matrix z = h K.
Vec3 implicit_impulse(const Mat3& z, const Vec3& u) {
  const Mat3 one = Mat3::Identity();
  return -(one + z + 0.5 * z * z).llt().solve(u + 0.5 * z * u);
}

void rub(const ParticleSet& set, const Side& a, const Side& b, double h, ParticleState& state, Ledger& ledger) {
  const Vec3 r = state.position[b.index] - state.position[a.index];
  const Vec3 u = (state.velocity[b.index] - state.velocity[a.index]) -
                 0.5 * (spin(set, state, a) + spin(set, state, b)).cross(r);
  const double mass_term = a.inverse_mass + b.inverse_mass;
  Vec3 impulse;
  double lost = 0.0;
  if (a.isotropic && b.isotropic) {
    // K = mass_term + lever_term (1 - r r / d^2): two eigenvalues, along and across the bond.
    const double d2 = r.squaredNorm();
    const double across_term = mass_term + 0.25 * (a.inverse_inertia + b.inverse_inertia) * d2;
    const Vec3 u_along = d2 > 0.0 ? Vec3(u.dot(r) / d2 * r) : Vec3(Vec3::Zero());
    const Vec3 along = gain(h, mass_term) * u_along;
    const Vec3 across = gain(h, across_term) * (u - u_along);
    impulse = along + across;
    lost = -impulse.dot(u) - 0.5 * (mass_term * along.squaredNorm() + across_term * across.squaredNorm());
  } else {
    const Mat3 lever = cross_matrix(0.5 * r);
    const Mat3 k = mass_term * Mat3::Identity() -
                   lever * (inverse_inertia(set, state, a) + inverse_inertia(set, state, b)) * lever;
    impulse = implicit_impulse(h * k, h * u);
    lost = -impulse.dot(u) - 0.5 * impulse.dot(k * impulse);
  }
  const Vec3 angular = -0.5 * r.cross(impulse);
  apply_impulse(set, a.index, -impulse, angular, state, ledger);
  apply_impulse(set, b.index, impulse, angular, state, ledger);
  ledger.dissipated += lost;
}

void rub_spins(const ParticleSet& set, const Side& a, const Side& b, double h, ParticleState& state, Ledger& ledger) {
  const Vec3 u = spin(set, state, b) - spin(set, state, a);
  Vec3 impulse;
  double lost = 0.0;
  if (a.isotropic && b.isotropic) {
    const double k = a.inverse_inertia + b.inverse_inertia;
    impulse = gain(h, k) * u;
    lost = -impulse.dot(u) - 0.5 * k * impulse.squaredNorm();
  } else {
    const Mat3 k = inverse_inertia(set, state, a) + inverse_inertia(set, state, b);
    impulse = implicit_impulse(h * k, h * u);
    lost = -impulse.dot(u) - 0.5 * impulse.dot(k * impulse);
  }
  apply_impulse(set, a.index, Vec3::Zero(), -impulse, state, ledger);
  apply_impulse(set, b.index, Vec3::Zero(), impulse, state, ledger);
  ledger.dissipated += lost;
}

/// Step times friction of a pair.
struct RubSteps {
  double slide = 0.0;  ///< [kg]
  double spin = 0.0;   ///< [kg m^2]
};

/// Both frictions of two free isotropic bodies at once: `rub` and `rub_spins` without their questions.
void rub_free_isotropic(const ParticleSet& set, const IndexPair& pair, const RubSteps& steps, ParticleState& state, Ledger& ledger) {
  const auto [a, b] = pair;
  const double mass_a = 1.0 / set.mass[a];
  const double mass_b = 1.0 / set.mass[b];
  const double inertia_a = 1.0 / set.inertia[a].x();
  const double inertia_b = 1.0 / set.inertia[b].x();
  const double spin_term = inertia_a + inertia_b;
  const double mass_term = mass_a + mass_b;
  const Vec3 r = state.position[b] - state.position[a];
  const double d2 = r.squaredNorm();
  const double across_term = std::fma(0.25 * spin_term, d2, mass_term);
  const double along_share = d2 > 0.0 ? 1.0 / d2 : 0.0;
  const double gain_along = gain(steps.slide, mass_term);
  const double gain_across = gain(steps.slide, across_term);
  const double gain_spin = gain(steps.spin, spin_term);

  Vec3 momentum_a = state.angular_momentum[a];
  Vec3 momentum_b = state.angular_momentum[b];
  const Vec3 u = (state.velocity[b] - state.velocity[a]) -
                 0.5 * (inertia_a * momentum_a + inertia_b * momentum_b).cross(r);
  const Vec3 u_along = u.dot(r) * along_share * r;
  const Vec3 along = gain_along * u_along;
  const Vec3 across = gain_across * (u - u_along);
  const Vec3 impulse = along + across;
  const Vec3 angular = -0.5 * r.cross(impulse);
  state.velocity[a] -= mass_a * impulse;
  state.velocity[b] += mass_b * impulse;
  momentum_a += angular;
  momentum_b += angular;

  const Vec3 u_spin = inertia_b * momentum_b - inertia_a * momentum_a;
  const Vec3 spin_impulse = gain_spin * u_spin;
  state.angular_momentum[a] = momentum_a - spin_impulse;
  state.angular_momentum[b] = momentum_b + spin_impulse;
  ledger.dissipated -= impulse.dot(u) + 0.5 * (mass_term * along.squaredNorm() + across_term * across.squaredNorm()) +
                       spin_impulse.dot(u_spin) + 0.5 * spin_term * spin_impulse.squaredNorm();
}

bool is_free_isotropic(const ParticleSet& set, std::size_t i) {
  const Vec3& inertia = set.inertia[i];
  return set.pinned[i] == 0 && inertia.x() == inertia.y() && inertia.y() == inertia.z();
}

/// Drag of a particle with a pin over dt: what a moving pin holds keeps its velocity, and the pin does the work.
void drag_pinned(const ParticleSet& set, const MediumDamping& law, std::size_t i, double dt, ParticleState& state, Ledger& ledger) {
  const bool held = (set.pinned[i] & kPinPosition) != 0, held_turn = (set.pinned[i] & kPinOrientation) != 0;
  const double keep = math::exp(-law.linear * dt), keep_spin = math::exp(-law.angular * dt);
  const Vec3 velocity = held ? state.velocity[i] : Vec3(keep * state.velocity[i]);
  const Vec3 impulse = held ? Vec3(-law.linear * dt * set.mass[i] * velocity) : Vec3(set.mass[i] * (velocity - state.velocity[i]));
  const Vec3 omega = angular_velocity(set, state, i);
  const Vec3 momentum = held_turn ? state.angular_momentum[i] : Vec3(keep_spin * state.angular_momentum[i]);
  const Vec3 angular = held_turn ? Vec3(-law.angular * dt * momentum) : Vec3(momentum - state.angular_momentum[i]);
  ledger.dissipated -= 0.5 * impulse.dot(velocity + state.velocity[i]) + 0.5 * (held_turn ? 2.0 : 1.0 + keep_spin) * angular.dot(omega);
  ledger.external_impulse += impulse;
  ledger.external_angular_impulse += state.position[i].cross(impulse) + angular;
  if (held) {
    ledger.pin_impulse -= impulse;
    ledger.pin_angular_impulse -= state.position[i].cross(impulse);
    ledger.external_work -= impulse.dot(velocity);
  }
  if (held_turn) {
    ledger.pin_angular_impulse -= angular;
    ledger.external_work -= angular.dot(omega);
  }
  state.velocity[i] = velocity;
  state.angular_momentum[i] = momentum;
}

}  // namespace

void apply_friction(const ParticleSet& set, const std::vector<Friction>& friction, double dt, PairOrder order,
                    ParticleState& state, Ledger& ledger) {
  const bool forward = order == PairOrder::Forward;
  for (std::size_t list = 0; list < friction.size(); ++list) {
    const Friction& law = friction[forward ? list : friction.size() - 1 - list];
    SUPPLE_EXPECTS(law.linear >= 0.0 && law.angular >= 0.0 && law.first.size() == law.second.size());
    for (std::size_t step = 0; step < law.first.size(); ++step) {
      const std::size_t bond = forward ? step : law.first.size() - 1 - step;
      if (is_free_isotropic(set, law.first[bond]) && is_free_isotropic(set, law.second[bond])) {
        rub_free_isotropic(set, {law.first[bond], law.second[bond]}, {dt * law.linear, dt * law.angular}, state, ledger);
        continue;
      }
      const Side a = side_of(set, law.first[bond]);
      const Side b = side_of(set, law.second[bond]);
      if (law.linear > 0.0) rub(set, a, b, dt * law.linear, state, ledger);
      if (law.angular > 0.0) rub_spins(set, a, b, dt * law.angular, state, ledger);
    }
  }
}

void apply_medium(const ParticleSet& set, const std::vector<MediumDamping>& medium, double dt, ParticleState& state,
                  Ledger& ledger) {
  for (const MediumDamping& law : medium) {
    const double keep = math::exp(-law.linear * dt);
    const double keep_spin = math::exp(-law.angular * dt);
    for (std::size_t i = 0; i < set.size(); ++i) {
      if (set.object[i] != law.object) continue;
      if ((set.pinned[i] & (kPinPosition | kPinOrientation)) != 0) {
        drag_pinned(set, law, i, dt, state, ledger);
        continue;
      }
      const Vec3 velocity = keep * state.velocity[i];
      const Vec3 impulse = set.mass[i] * (velocity - state.velocity[i]);
      const Vec3 omega = angular_velocity(set, state, i);
      const Vec3 momentum = keep_spin * state.angular_momentum[i];
      const Vec3 angular = momentum - state.angular_momentum[i];
      ledger.dissipated -=
          0.5 * impulse.dot(velocity + state.velocity[i]) + 0.5 * (1.0 + keep_spin) * angular.dot(omega);
      ledger.external_impulse += impulse;
      ledger.external_angular_impulse += state.position[i].cross(impulse) + angular;
      state.velocity[i] = velocity;
      state.angular_momentum[i] = momentum;
    }
  }
}

void for_each_damping(const ParticleSet& set, const ParticleState& state, const Interactions& interactions, const PairHessianVisitor& visit) {
  for (const Friction& law : interactions.friction) {
    for (std::size_t bond = 0; bond < law.first.size(); ++bond) {
      const std::uint32_t a = law.first[bond], b = law.second[bond];
      // The slip dx_B - dx_A + arm (dtheta_A + dtheta_B) and the relative spin: see `add_friction_loads`.
      const Mat3 arm = law.linear * 0.5 * cross_matrix(state.position[b] - state.position[a]);
      const Mat3 slide = law.linear * Mat3::Identity(), spin = law.angular * Mat3::Identity();
      const Mat3 both = 0.5 * cross_matrix(state.position[b] - state.position[a]).transpose() * arm;
      PairHessian d;
      d << slide, -arm, -slide, -arm,                                               //
          -arm.transpose(), both + spin, arm.transpose(), both - spin,              //
          -slide, arm, slide, arm,                                                  //
          -arm.transpose(), both - spin, arm.transpose(), both + spin;
      visit(a, b, d);
    }
  }
  for_each_stiffness_damping(set, state, interactions, visit);
}

void add_friction_loads(const ParticleSet& set, const std::vector<Friction>& friction, const ParticleState& state,
                        Loads& loads) {
  for (const Friction& law : friction) {
    for (std::size_t bond = 0; bond < law.first.size(); ++bond) {
      const std::size_t a = law.first[bond];
      const std::size_t b = law.second[bond];
      const Vec3 r = state.position[b] - state.position[a];
      const Vec3 spin_a = angular_velocity(set, state, a);
      const Vec3 spin_b = angular_velocity(set, state, b);
      const Vec3 slip = state.velocity[b] - state.velocity[a] - 0.5 * (spin_a + spin_b).cross(r);
      const Vec3 force_b = -law.linear * slip;
      const Vec3 torque = -0.5 * r.cross(force_b);
      const Vec3 couple_b = -law.angular * (spin_b - spin_a);
      loads.force[a] -= force_b;
      loads.force[b] += force_b;
      loads.torque[a] += torque - couple_b;
      loads.torque[b] += torque + couple_b;
    }
  }
}

void add_medium_loads(const ParticleSet& set, const std::vector<MediumDamping>& medium, const ParticleState& state,
                      Loads& loads) {
  for (const MediumDamping& law : medium) {
    for (std::size_t i = 0; i < set.size(); ++i) {
      if (set.object[i] != law.object) continue;
      loads.force[i] -= law.linear * set.mass[i] * state.velocity[i];
      loads.torque[i] -= law.angular * state.angular_momentum[i];
    }
  }
}

}  // namespace supple::core
