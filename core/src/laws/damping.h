// Velocity-dependent loads of one half step: friction between particles and the drag of a medium.
#pragma once

#include "laws/pair_hessians.h"
#include "supple/core/integrate.h"

namespace supple::core {

/// Gives particle i an impulse and an angular impulse about its centre; what a pin holds is booked as the pin's, with the work of one that moves.
inline void apply_impulse(const ParticleSet& set, std::size_t i, const Vec3& impulse, const Vec3& angular,
                          ParticleState& state, Ledger& ledger) {
  const double inverse_mass = 1.0 / set.mass[i];
  const std::uint8_t pinned = set.pinned[i];
  if (pinned == 0) {
    state.velocity[i] += inverse_mass * impulse;
    state.angular_momentum[i] += angular;
    return;
  }
  const Vec3 free = free_translation(pinned, impulse);
  const Vec3 free_angular = free_rotation(pinned, angular);
  state.velocity[i] += inverse_mass * free;
  state.angular_momentum[i] += free_angular;
  ledger.pin_impulse -= impulse - free;
  ledger.pin_angular_impulse -= state.position[i].cross(impulse - free) + (angular - free_angular);
  if ((pinned & kPinPosition) != 0) ledger.external_work -= impulse.dot(state.velocity[i]);
  if ((pinned & kPinOrientation) != 0) ledger.external_work -= angular.dot(angular_velocity(set, state, i));
}

/// The order in which the pairs are visited: the second half step mirrors the first.
enum class PairOrder { Forward, Backward };

/// Friction of all pairs over dt, each pair implicitly: J = -(1 + Z + Z^2/2)^-1 (1 + Z/2) dt c u at its mid point, u the
/// relative velocity, K the inverse effective mass there and Z = dt c K: second order, and stable for any Z. Momentum is
/// exact, the energy lost is booked exactly.
void apply_friction(const ParticleSet& set, const std::vector<Friction>& friction, double dt, PairOrder order,
                    ParticleState& state, Ledger& ledger);

/// v' = -gamma v and L' = -gamma_r L over dt, exactly.
void apply_medium(const ParticleSet& set, const std::vector<MediumDamping>& medium, double dt, ParticleState& state,
                  Ledger& ledger);

/// Stiffness damping of all pairs over dt, each pair implicitly as friction is, with its 12 x 12 stiffness. Allocates.
void apply_stiffness_damping(const ParticleSet& set, const Interactions& interactions, double dt, PairOrder order,
                             ParticleState& state, Ledger& ledger);

/// `for_each_damping` of stiffness damping alone.
void for_each_stiffness_damping(const ParticleSet& set, const ParticleState& state, const Interactions& interactions,
                                const PairHessianVisitor& visit);

/// Calls visit(a, b, D) for every pair that friction or stiffness damping acts on: its loads on (dx_A, dtheta_A, dx_B, dtheta_B) are -D times its
/// velocities. D is symmetric and positive semi-definite, and rigid motions of the pair have none.
void for_each_damping(const ParticleSet& set, const ParticleState& state, const Interactions& interactions, const PairHessianVisitor& visit);

/// The same as forces and torques at a state, for integrators without half steps; added to `loads`.
void add_friction_loads(const ParticleSet& set, const std::vector<Friction>& friction, const ParticleState& state,
                        Loads& loads);
void add_medium_loads(const ParticleSet& set, const std::vector<MediumDamping>& medium, const ParticleState& state,
                      Loads& loads);
void add_stiffness_damping_loads(const ParticleSet& set, const Interactions& interactions, const ParticleState& state,
                                 Loads& loads);

}  // namespace supple::core
