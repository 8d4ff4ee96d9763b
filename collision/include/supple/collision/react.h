/// @file supple/collision/react.h
/// Stage 7: tractions on the contact surface and their split to the parts of each body. Elastic part: the gradient of
/// U = integral of [min(p_A, p_B)]+ dV, so part k of A gets F_k = integral over V_A of grad p_Ak dV and the torque
/// integral of (x - x_k) x grad p_Ak; the difference to the force and moment on Sigma (quadrature error) is spread over
/// the parts as a rigid-consistent load by their mean contribution, weighted with p dA, so that momentum is exact.
/// Dissipative part: t = -p [(1 + d v_n)_+ - 1] N - mu p_d f1(|v_t|) v_t/|v_t| on A, distributed by the contributions
/// lambda_k = f_k / f that also interpolate the velocity, so that its power is never positive.
/// With springs (stick.h) friction is the force -k_t (displacement + damping rate) of a pair's spring on its two parts, at
/// most mu N with N = |integral of p N dA|, and a couple about the normal against their twist.
#pragma once

#include "supple/collision/bodies.h"
#include "supple/collision/contact_surface.h"
#include "supple/collision/stick.h"
#include "supple/core/executor.h"

namespace supple::collision {

enum class SplitRule : std::uint8_t {
  Energy,        ///< gradient of the contact energy (the default)
  Contribution,  ///< elastic part by lambda_k too (Desbrun & Gascuel 1995); not a gradient
};

struct ReactionSettings {
  SplitRule split = SplitRule::Energy;
  double friction_speed = 1e-3;  ///< regularisation speed of Coulomb friction [m/s], > 0
  /// For which an explicit method holds these loads [s]: it raises `friction_speed` of pairs that would turn back within it, to and
  /// fro at every step. 0: nothing does.
  double step = 0.0;
  StickRule stick{};             ///< with a stiffness: friction by springs in place of `friction_speed`
};

/// f1(y) = 2 y/e - y^2/e^2 for y < e, 1 beyond.
[[nodiscard]] double friction_mollifier(double speed, double regularisation) noexcept;

struct ReactionReport {
  double energy = 0.0;              ///< contact energy [J]
  double dissipated_power = 0.0;    ///< of damping and friction [W], >= 0; with springs also what goes into them
};

/// What reactions follow from.
struct ReactionInputs {
  std::span<const ContactBody> bodies;
  const ContactRules& rules;
  const ContactSurface& surface;
  ReactionSettings settings{};
  const StickState* sticks = nullptr;  ///< the springs of `ReactionSettings::stick`; pairs without one have no friction yet
};

/// What reactions are added to; what is empty or null is not asked for.
struct ReactionOutputs {
  std::span<PartLoads> loads;                    ///< by body, sized to the parts of each
  std::span<PartLoads> dissipative{};            ///< the dissipative part of the same loads, sized like `loads`
  std::vector<Vec3>* traction_force = nullptr;   ///< replaced: the force on A of each pair, dissipative part included [N], shape [pairs]
  std::vector<double>* pair_power = nullptr;     ///< replaced: what damping and friction take of each pair [W], shape [pairs]
  std::vector<double>* friction_speed = nullptr; ///< replaced: below which friction falls to zero [m/s], 0 without such friction, shape [pairs]
};

/// Adds to out.loads[i] what contact does to body i. Forces and moments of a pair sum to zero.
ReactionReport react(const ReactionInputs& in, const Executor& executor, const ReactionOutputs& out);

}  // namespace supple::collision
