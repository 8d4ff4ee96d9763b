/// @file supple/core/literal_form.h
/// The form interaction exactly as Lombardo & Puech 1995, sec. 4 print it. For comparison only: use `FormRadius` or
/// `Form`.
#pragma once

#include <vector>

#include "supple/core/pair_laws.h"
#include "supple/core/particles.h"

namespace supple::core {

template <class Law>
struct BondedLaw;

/// Each particle X of a pair with the other Y, r' = x_Y - x_X, and its own radius R_X, gets
///   F_X = 2 k [r' + R_X (n_X - n_Y)] psi(d),   tau_X = +2 k R_X [n_X x (r' - R_X n_Y)] psi(d).
/// This law has no energy, and momentum is not conserved. Repeated from the paper (docs/notation.md):
///  - the sign of the torque, which turns n_X away from its rest direction;
///  - psi multiplied after differentiation, so that the slope of psi is missing;
///  - a radius for each particle: where R_A and R_B differ the two forces do not cancel,
///    F_A + F_B = 2 k (R_A - R_B) (n_A - n_B) psi, and the rest shape is not one of least energy.
struct LiteralForm {
  double strength = 0.0;  ///< k [N/m]
  double radius_a = 0.0;  ///< R_A [m]
  double radius_b = 0.0;  ///< R_B [m]
  Weight weight;
};

/// Loads on each particle; the forces are not opposite.
struct LiteralFormLoad {
  Vec3 force_a = Vec3::Zero();   ///< [N]
  Vec3 force_b = Vec3::Zero();   ///< [N]
  Vec3 torque_a = Vec3::Zero();  ///< [N m]
  Vec3 torque_b = Vec3::Zero();  ///< [N m]
};

[[nodiscard]] LiteralFormLoad evaluate(const LiteralForm& law, const PairPose& pose);
[[nodiscard]] Stiffness stiffness(const LiteralForm& law);

/// Adds the loads of all bonds of a list, in order, on the calling thread.
void accumulate_literal_form(const BondedLaw<LiteralForm>& list, const ParticleSet& set, const ParticleState& state,
                             Loads& loads);

}  // namespace supple::core
