/// @file supple/core/integrate.h
/// Time stepping of oriented particles: velocity Verlet (kick, drift, kick) with the rotation of a free rigid body
/// split into rotations about its principal axes (Dullweber, Leimkuhler, McLachlan 1997; Reich & McLachlan). Second
/// order, symplectic and reversible without damping; |L| of a free body is exact. For equal principal moments the
/// split is one exact exponential.
#pragma once

#include <functional>
#include <span>

#include "supple/core/executor.h"
#include "supple/core/interactions.h"
#include "supple/core/particles.h"

namespace supple::core {

struct ImplicitContact;

/// exp of a rotation vector [rad]: (sin(|t|/2) t/|t|, cos(|t|/2)), by series near 0.
[[nodiscard]] Quat rotation_exp(const Vec3& rotation);
/// Rotation vector of a unit quaternion, |t| <= pi [rad].
[[nodiscard]] Vec3 rotation_log(const Quat& q);

/// Free rotation over dt: orientation and world angular momentum, by the axis splitting R3 R2 R1 R2 R3.
void rotate_free(Quat& orientation, const Vec3& angular_momentum, const Vec3& inertia, double dt);

/// The same by the midpoint rule on the rotation group: one exponential of the angular velocity at the midpoint attitude,
/// which is found by iteration. Second order and reversible; equal to `rotate_free` for equal principal moments.
void rotate_free_exponential(Quat& orientation, const Vec3& angular_momentum, const Vec3& inertia, double dt);

/// How a free body rotates within a step.
enum class RotationUpdate : std::uint8_t { Splitting, Exponential };

/// A sum of vectors whose rounding error does not grow with the number of its terms (Kahan 1965): the impulses of gravity over a million equal steps would
/// else be off by a million roundings of one sign.
struct VectorSum : Vec3 {
  Vec3 rest = Vec3::Zero();  ///< what rounding has left out

  VectorSum() : Vec3(Vec3::Zero()) {}
  VectorSum& operator+=(const Vec3& term) {
    const Vec3 whole = term + rest, before = *this;
    Vec3::operator=(before + whole);
    rest = whole - (*this - before);
    return *this;
  }
  VectorSum& operator-=(const Vec3& term) { return *this += -term; }
};

/// Work, heat and impulses of all steps so far; part of State.
struct Ledger {
  double external_work = 0.0;       ///< work of external loads and gravity [J]
  double dissipated = 0.0;          ///< energy dissipated by friction, medium damping and contact [J], >= 0
  VectorSum external_impulse;                   ///< of external loads, gravity, medium damping, fixed bodies [N s]
  VectorSum external_angular_impulse;           ///< of the same about the world origin [N m s]
  VectorSum pin_impulse;                        ///< of the pins [N s]
  VectorSum pin_angular_impulse;                ///< of the pins about the world origin [N m s]
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

/// Loads of one force evaluation, separated as in the ledger.
struct ForceSample {
  Loads internal;   ///< pair laws and contact
  Loads external;   ///< gravity and external loads
  Vec3 force_on_fixed = Vec3::Zero();   ///< contact force on fixed bodies [N], whose impulse the moving ones lose
  Vec3 moment_on_fixed = Vec3::Zero();  ///< about the world origin [N m]
  double power_of_fixed = 0.0;          ///< power of moving obstacles on the other bodies [W]
  double dissipated_at_fixed = 0.0;     ///< its part that damping and friction dissipate [W]
  Loads dissipative;  ///< the dissipative part of `internal` (contact damping, friction); empty: none

  /// Zero loads on n particles, none dissipative.
  void reset(std::size_t n);
};

/// Stages 1 to 7 as one call: loads at a state and a time. Velocities are those of the half step.
using ForceModel = std::function<void(const ParticleState& state, double time, ForceSample& out)>;

/// Data that the next step reuses; part of State.
struct KickState {
  ForceSample sample;      ///< the force of the next kick
  bool valid = false;      ///< whether there is one
  double next_step = 0.0;  ///< next trial step of an adaptive integrator [s]; 0: not chosen yet
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

/// A pin that moves: where it leads what it holds of its particle.
struct LedPin {
  std::uint32_t particle = 0;
  std::uint8_t pins = 0;  ///< kPinPosition, kPinOrientation: what is led
  std::function<Pose(double time)> place;  ///< of the particle
};

/// Particles and everything that acts on them.
struct StepProblem {
  const ParticleSet& set;
  const Interactions& interactions;
  const ForceModel& forces;
  /// Of the implicit methods: contact as a part of the step; `forces` then leave it out. Null: all that acts beside the pair laws is frozen.
  ImplicitContact* contact = nullptr;
  /// Pins that move, at most one of a particle, particles ascending. Those of particles that `set.pinned` does not hold are ignored. Within a step the velocity is constant; the pins' work is external.
  std::span<const LedPin> led{};
};

/// What a step changes.
struct StepTarget {
  ParticleState& state;
  KickState& kick;
  Ledger& ledger;
};

/// One step of size dt: damping dt/2 in pair order, kick dt/2, drift dt, forces, kick dt/2, damping dt/2 in reverse
/// pair order. Friction between particles is integrated implicitly pair by pair (unconditionally stable, momentum
/// exact); medium damping by its exact exponential. Pinned particles move as their pins do; their impulse goes to the ledger.
/// Calls `forces` once (twice when `kick` is not valid).
void advance(const StepProblem& problem, double time, double dt, const StepTarget& target,
             RotationUpdate rotation = RotationUpdate::Splitting);

/// Total kinetic energy [J], momentum [N s] and angular momentum about the world origin [N m s].
struct Motion {
  double kinetic_energy = 0.0;
  Vec3 momentum = Vec3::Zero();
  Vec3 angular_momentum = Vec3::Zero();
  double momentum_scale = 0.0;          ///< sum m |v| [N s]
  /// Sum of (|x - c| + k) m |v| + |L| [N m s]: c is the centre of mass, k the root mean square distance of a particle's own mass
  /// from its centre, 2 k^2 = tr I / m. Without k the scale of a single particle that does not rotate would be zero.
  double angular_momentum_scale = 0.0;
};
[[nodiscard]] Motion measure_motion(const ParticleSet& set, const ParticleState& state);

/// The reason why a state cannot be continued.
struct Divergence {
  bool found = false;
  std::uint32_t particle = 0;
  std::string cause;   ///< e.g. "speed", "position is not finite"
  double value = 0.0;
  double limit = 0.0;
};
/// @param length, speed  largest plausible values in this scene [m], [m/s]
[[nodiscard]] Divergence find_divergence(const ParticleSet& set, const ParticleState& state, double length, double speed);

/// Deviation of a set of points from its rest shape after the best rigid fit (Kabsch): RMS and largest distance [m].
struct ShapeError {
  double rms = 0.0;
  double largest = 0.0;
};
[[nodiscard]] ShapeError shape_error(std::span<const Vec3> rest, std::span<const Vec3> now);

/// Oscillation of points between two times [m]: O^2 = sum_i |dx_i - mean dx|^2 = sum |dx_i|^2 - |sum dx_i|^2 / N, which
/// a common translation leaves at 0 (Lombardo & Puech 1995, sec. 3, with the 1/N that a printed formula lacks).
[[nodiscard]] double oscillation(std::span<const Vec3> before, std::span<const Vec3> after);

/// Largest step [s] allowed by the stability limits: c1/omega_max, c2 r0/v_max, c4/|omega|_max
/// (harmonic limit omega dt < 2; c1 = .3 keeps the energy error below 1 %).
struct StepLimits {
  double frequency = 0.0;        ///< largest angular frequency [rad/s], pair laws and contact
  double length = 0.0;           ///< smallest length to resolve, r0 [m]
  double speed = 0.0;            ///< [m/s]
  double angular_speed = 0.0;    ///< [rad/s]
};
[[nodiscard]] double stable_step(const StepLimits& limits);
/// Smallest k such that frame / 2^k <= step.
[[nodiscard]] int halvings(double frame, double step);

}  // namespace supple::core
