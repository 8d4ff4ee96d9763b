#include "supple/core/integrate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "integrate/step.h"
#include "laws/damping.h"
#include "laws/lanes.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

/// Work of the dissipative loads in a kick, exact: each acts along the mean of the velocities before and after.
double dissipated_by(const ParticleSet& set, const ForceSample& sample, double dt, const ParticleState& before_kick) {
  double work = 0.0;
  for (std::size_t i = 0; i < sample.dissipative.force.size(); ++i) {
    const Vec3& f = sample.dissipative.force[i];
    const Vec3& t = sample.dissipative.torque[i];
    if (f == Vec3::Zero() && t == Vec3::Zero()) continue;
    if (holds_position(set, i)) {
      work += dt * f.dot(before_kick.velocity[i]);
    } else {
      const Vec3 force = free_translation(set.pinned[i], sample.internal.force[i] + sample.external.force[i]);
      work += dt * f.dot(before_kick.velocity[i] + 0.5 * dt / set.mass[i] * force);
    }
    if (holds_orientation(set, i)) {
      work += dt * t.dot(angular_velocity(set, before_kick, i));
    } else {
      const Vec3 torque = free_rotation(set.pinned[i], sample.internal.torque[i] + sample.external.torque[i]);
      const Vec3 mean = before_kick.angular_momentum[i] + 0.5 * dt * torque;
      const Quat& q = before_kick.orientation[i];
      work += dt * t.dot(q * (q.conjugate() * mean).cwiseQuotient(set.inertia[i]));
    }
  }
  return -work;
}

bool are_free(const ParticleSet& set, std::size_t i, std::size_t count) {
  std::uint8_t pinned = 0;
  for (std::size_t k = i; k < i + count; ++k) pinned |= set.pinned[k];
  return pinned == 0;
}

/// Whether no load acts on four particles in a row.
bool are_unloaded(const Loads& loads, std::size_t i) {
  const double* const force = loads.force[i].data();
  const double* const torque = loads.torque[i].data();
  __m256d any = _mm256_setzero_pd();
  for (int k = 0; k < 12; k += 4) {
    any = _mm256_or_pd(any, _mm256_or_pd(_mm256_loadu_pd(force + k), _mm256_loadu_pd(torque + k)));
  }
  const __m256d is_zero = _mm256_cmp_pd(any, _mm256_setzero_pd(), _CMP_EQ_OQ);
  return _mm256_movemask_pd(is_zero) == 0xf;
}

/// Four free particles in a row at once where no external load acts; their bits are those of one by one.
bool kick_four(const ParticleSet& set, const ForceSample& sample, std::size_t i, double dt, ParticleState& state) {
  if (i + 4 > set.size() || !are_free(set, i, 4) || !are_unloaded(sample.external, i)) return false;
  const __m256d inverse_mass = _mm256_div_pd(_mm256_set1_pd(1.0), _mm256_loadu_pd(&set.mass[i]));
  const std::array<Lanes, 3> mass_of{_mm256_permute4x64_pd(inverse_mass, 0b01000000),
                                     _mm256_permute4x64_pd(inverse_mass, 0b10100101),
                                     _mm256_permute4x64_pd(inverse_mass, 0b11111110)};
  const double* const force = sample.internal.force[i].data();
  const double* const torque = sample.internal.torque[i].data();
  double* const velocity = state.velocity[i].data();
  double* const momentum = state.angular_momentum[i].data();
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t at = 4 * k;
    (Lanes::load_any(velocity + at) + mass_of[k] * (Lanes(dt) * Lanes::load_any(force + at))).store_any(velocity + at);
    (Lanes::load_any(momentum + at) + Lanes(dt) * Lanes::load_any(torque + at)).store_any(momentum + at);
  }
  return true;
}

void kick(const ParticleSet& set, const ForceSample& sample, double dt, ParticleState& state, Ledger& ledger) {
  ledger.dissipated += dissipated_by(set, sample, dt, state);
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (kick_four(set, sample, i, dt, state)) {
      i += 3;
      continue;
    }
    const Vec3& x = state.position[i];
    const Vec3& external_force = sample.external.force[i];
    const Vec3& external_torque = sample.external.torque[i];
    const Vec3 impulse = dt * (sample.internal.force[i] + external_force);
    const Vec3 angular = dt * (sample.internal.torque[i] + external_torque);
    if (external_force != Vec3::Zero() || external_torque != Vec3::Zero()) {
      ledger.external_impulse += dt * external_force;
      ledger.external_angular_impulse += dt * (x.cross(external_force) + external_torque);
    }
    apply_impulse(set, i, impulse, angular, state, ledger);
  }
  ledger.external_impulse -= dt * sample.force_on_fixed;
  ledger.external_angular_impulse -= dt * sample.moment_on_fixed;
  ledger.external_work += dt * sample.power_of_fixed;
  ledger.dissipated += dt * sample.dissipated_at_fixed;
}

void turn_free(RotationUpdate rotation, Quat& orientation, const Vec3& angular_momentum, const Vec3& inertia,
               double dt) {
  if (rotation == RotationUpdate::Splitting) {
    rotate_free(orientation, angular_momentum, inertia, dt);
  } else {
    rotate_free_exponential(orientation, angular_momentum, inertia, dt);
  }
}

/// Four free particles in a row at once where that is possible; their bits are those of `rotate_free`.
bool drift_four(const ParticleSet& set, std::size_t i, double dt, ParticleState& state) {
  if (i + 4 > set.size() || !are_free(set, i, 4)) return false;
  if (!rotate_four(&state.angular_momentum[i], &set.inertia[i], dt, &state.orientation[i])) return false;
  double* const position = state.position[i].data();
  const double* const velocity = state.velocity[i].data();
  for (std::size_t k = 0; k < 12; k += 4) {
    (Lanes::load_any(position + k) + Lanes(dt) * Lanes::load_any(velocity + k)).store_any(position + k);
  }
  return true;
}

void drift(const ParticleSet& set, RotationUpdate rotation, double dt, ParticleState& state) {
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (drift_four(set, i, dt, state)) {
      i += 3;
      continue;
    }
    if (!holds_position(set, i)) state.position[i] += dt * state.velocity[i];
    if (!holds_orientation(set, i) && state.angular_momentum[i] != Vec3::Zero()) {
      turn_free(rotation, state.orientation[i], state.angular_momentum[i], set.inertia[i], dt);
    }
  }
}

/// The rotation vector of the drift that led to `state`; the drift is undone, because it is reversible.
Vec3 drifted_rotation(const ParticleSet& set, RotationUpdate rotation, const ParticleState& state, std::size_t i,
                      double dt) {
  Quat before = state.orientation[i];
  turn_free(rotation, before, state.angular_momentum[i], set.inertia[i], -dt);
  return rotation_log(state.orientation[i] * before.conjugate());
}

/// Half the work of the external loads over the drift that led to `state`, velocities and momenta still being its own.
double half_work(const ParticleSet& set, RotationUpdate rotation, const Loads& external, const ParticleState& state,
                 double dt) {
  double work = 0.0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (i + 4 <= set.size() && are_unloaded(external, i)) {
      i += 3;
      continue;
    }
    work += 0.5 * dt * external.force[i].dot(state.velocity[i]);
    if (external.torque[i] == Vec3::Zero()) continue;
    if (holds_orientation(set, i)) {
      work += 0.5 * dt * external.torque[i].dot(angular_velocity(set, state, i));
    } else {
      work += 0.5 * external.torque[i].dot(drifted_rotation(set, rotation, state, i, dt));
    }
  }
  return work;
}

/// Half a step's kick by external loads that change in it: their work is their impulse times the mean velocity.
void kick_changing(const ParticleSet& set, const ForceSample& sample, double dt, ParticleState& state, Ledger& ledger) {
  const auto half_of_work = [&] {
    double work = 0.0;
    for (std::size_t i = 0; i < set.size(); ++i) {
      const Vec3 &force = sample.external.force[i], &torque = sample.external.torque[i];
      work += 0.5 * dt * force.dot(state.velocity[i]);
      if (torque != Vec3::Zero()) work += 0.5 * dt * torque.dot(angular_velocity(set, state, i));
    }
    return work;
  };
  ledger.external_work += half_of_work();
  kick(set, sample, dt, state, ledger);
  ledger.external_work += half_of_work();
}

void save_loads(const Loads& loads, StateWriter& out) {
  out.write(loads.force);
  out.write(loads.torque);
}

void load_loads(Loads& loads, StateReader& in) {
  in.read(loads.force);
  in.read(loads.torque);
}

void save_vector(const Vec3& v, StateWriter& out) {
  for (int k = 0; k < 3; ++k) out.write(v[k]);
}

void load_vector(Vec3& v, StateReader& in) {
  for (int k = 0; k < 3; ++k) in.read(v[k]);
}

void hash_vector(const Vec3& v, Hasher& hasher) {
  for (int k = 0; k < 3; ++k) hasher.add(v[k]);
}

/// What is held of a particle that a pin leads; 0: nothing.
std::uint8_t led_by(const ParticleSet& set, const LedPin& pin) { return set.pinned[pin.particle] & pin.pins; }

double turning_energy(const ParticleSet& set, const ParticleState& state, std::size_t i) {
  return 0.5 * state.angular_momentum[i].dot(angular_velocity(set, state, i));
}

Vec3 momentum_of(const ParticleSet& set, std::size_t i, const Quat& q, const Vec3& spin) {
  return q * set.inertia[i].cwiseProduct(q.conjugate() * spin);
}

/// The pin changes a velocity and an angular momentum; it gives the energy and the momentum.
void push_led(const ParticleSet& set, std::size_t i, const Vec3& velocity, const Vec3& momentum, const StepTarget& target) {
  auto& [state, kick_state, ledger] = target;
  const double turning = turning_energy(set, state, i);
  const Vec3 gained = set.mass[i] * (velocity - state.velocity[i]);
  ledger.external_work += 0.5 * gained.dot(velocity + state.velocity[i]);
  ledger.pin_impulse += gained;
  ledger.pin_angular_impulse += state.position[i].cross(gained) + (momentum - state.angular_momentum[i]);
  state.velocity[i] = velocity;
  state.angular_momentum[i] = momentum;
  ledger.external_work += turning_energy(set, state, i) - turning;
}

}  // namespace

void begin_pins(const StepProblem& problem, double time, double dt, const StepTarget& target) {
  const ParticleSet& set = problem.set;
  ParticleState& state = target.state;
  auto next = problem.led.begin();
  for (std::size_t i = 0; i < set.size(); ++i) {
    std::uint8_t still = set.pinned[i];
    if (next != problem.led.end() && next->particle == i) still &= static_cast<std::uint8_t>(~led_by(set, *next++));
    if (still == 0) continue;
    state.velocity[i] = free_translation(still, state.velocity[i]);
    state.angular_momentum[i] = free_rotation(still, state.angular_momentum[i]);
  }
  for (const LedPin& pin : problem.led) {
    const std::uint8_t led = led_by(set, pin);
    if (led == 0) continue;
    const std::size_t i = pin.particle;
    const Pose end = pin.place(time + dt);
    Vec3 velocity = state.velocity[i], momentum = state.angular_momentum[i];
    if ((led & kPinPosition) != 0) velocity = 1.0 / dt * (end.position - state.position[i]);
    if ((led & kPinOrientation) != 0) {
      const Vec3 spin = 1.0 / dt * rotation_log(end.orientation * state.orientation[i].conjugate());
      momentum = momentum_of(set, i, state.orientation[i], spin);
    }
    push_led(set, i, velocity, momentum, target);
  }
}

void place_led(const StepProblem& problem, double time, ParticleState& state) {
  for (const LedPin& pin : problem.led) {
    const std::uint8_t led = led_by(problem.set, pin);
    if (led == 0) continue;
    const Pose pose = pin.place(time);
    if ((led & kPinPosition) != 0) state.position[pin.particle] = pose.position;
    if ((led & kPinOrientation) != 0) state.orientation[pin.particle] = pose.orientation;
  }
}

void end_pins(const StepProblem& problem, double end, double dt, const StepTarget& target) {
  const ParticleSet& set = problem.set;
  ParticleState& state = target.state;
  for (const LedPin& pin : problem.led) {
    if ((led_by(set, pin) & kPinOrientation) == 0) continue;
    const std::size_t i = pin.particle;
    const Pose begin = pin.place(end - dt), now = pin.place(end);
    const Vec3 spin = 1.0 / dt * rotation_log(now.orientation * begin.orientation.conjugate());
    const double before = turning_energy(set, state, i);
    state.orientation[i] = now.orientation;
    target.ledger.external_work += turning_energy(set, state, i) - before;
    push_led(set, i, state.velocity[i], momentum_of(set, i, now.orientation, spin), target);
  }
  place_led(problem, end, state);
}

void ForceSample::reset(std::size_t n) {
  internal.reset(n);
  external.reset(n);
  force_on_fixed.setZero();
  moment_on_fixed.setZero();
  power_of_fixed = dissipated_at_fixed = 0.0;
  dissipative.reset(0);
}

void evaluate(const ForceModel& forces, const ParticleState& state, double time, ForceSample& sample) {
  const std::size_t n = state.size();
  sample.reset(n);
  forces(state, time, sample);
  SUPPLE_EXPECTS(sample.internal.force.size() == n && sample.external.force.size() == n);
}

void Ledger::save(StateWriter& out) const {
  out.write(external_work);
  out.write(dissipated);
  for (const VectorSum* v : {&external_impulse, &external_angular_impulse, &pin_impulse, &pin_angular_impulse}) {
    save_vector(*v, out);
    save_vector(v->rest, out);
  }
}

void Ledger::load(StateReader& in) {
  in.read(external_work);
  in.read(dissipated);
  for (VectorSum* v : {&external_impulse, &external_angular_impulse, &pin_impulse, &pin_angular_impulse}) {
    load_vector(*v, in);
    load_vector(v->rest, in);
  }
}

void Ledger::hash(Hasher& hasher) const {
  hasher.add(external_work);
  hasher.add(dissipated);
  for (const VectorSum* v : {&external_impulse, &external_angular_impulse, &pin_impulse, &pin_angular_impulse}) {
    hash_vector(*v, hasher);
    hash_vector(v->rest, hasher);
  }
}

void KickState::save(StateWriter& out) const {
  out.write(std::uint64_t{valid ? 1U : 0U});
  out.write(next_step);
  save_loads(sample.internal, out);
  save_loads(sample.external, out);
  save_vector(sample.force_on_fixed, out);
  save_vector(sample.moment_on_fixed, out);
  out.write(sample.power_of_fixed);
  out.write(sample.dissipated_at_fixed);
  save_loads(sample.dissipative, out);
}

void KickState::load(StateReader& in) {
  std::uint64_t flag = 0;
  in.read(flag);
  valid = flag != 0;
  in.read(next_step);
  load_loads(sample.internal, in);
  load_loads(sample.external, in);
  load_vector(sample.force_on_fixed, in);
  load_vector(sample.moment_on_fixed, in);
  in.read(sample.power_of_fixed);
  in.read(sample.dissipated_at_fixed);
  load_loads(sample.dissipative, in);
}

void KickState::hash(Hasher& hasher) const {
  hasher.add(std::uint64_t{valid ? 1U : 0U});
  hasher.add(next_step);
  if (!valid) return;
  for (const Loads* loads : {&sample.internal, &sample.external, &sample.dissipative}) {
    hasher.add(loads->force);
    hasher.add(loads->torque);
  }
  hash_vector(sample.force_on_fixed, hasher);
  hash_vector(sample.moment_on_fixed, hasher);
  hasher.add(sample.power_of_fixed);
  hasher.add(sample.dissipated_at_fixed);
}

void advance(const StepProblem& problem, double time, double dt, const StepTarget& target, RotationUpdate rotation) {
  const ParticleSet& set = problem.set;
  const Interactions& interactions = problem.interactions;
  const ForceModel& forces = problem.forces;
  const auto& [state, kick_state, ledger] = target;
  SUPPLE_EXPECTS(dt > 0.0 && state.size() == set.size());
  ForceSample& sample = kick_state.sample;
  begin_pins(problem, time, dt, target);
  if (!kick_state.valid) evaluate(forces, state, time, sample);

  // Each kick has the mean of the external loads over its half of the step, for loads of any duration.
  const auto changes = [&](double from, double to) {
    return std::any_of(interactions.external.begin(), interactions.external.end(),
                       [&](const ExternalLoad& load) { return load.changes(from, to); });
  };
  const double middle = time + 0.5 * dt, end = time + dt;
  const bool starts = changes(time, middle), ends = changes(middle, end);
  const bool changing = starts || ends;  // the work of halves adds up only if both are booked in the same way
  if (starts) external_loads(set, interactions, time, middle, sample.external);

  apply_medium(set, interactions.medium, 0.5 * dt, state, ledger);
  apply_stiffness_damping(set, interactions, 0.5 * dt, PairOrder::Forward, state, ledger);
  apply_friction(set, interactions.friction, 0.5 * dt, PairOrder::Forward, state, ledger);
  (changing ? kick_changing : kick)(set, sample, 0.5 * dt, state, ledger);
  drift(set, rotation, dt, state);
  place_led(problem, end, state);
  if (!changing) ledger.external_work += half_work(set, rotation, sample.external, state, dt);
  evaluate(forces, state, end, sample);
  kick_state.valid = true;
  if (ends) external_loads(set, interactions, middle, end, sample.external);
  if (!changing) ledger.external_work += half_work(set, rotation, sample.external, state, dt);
  (changing ? kick_changing : kick)(set, sample, 0.5 * dt, state, ledger);
  if (ends) external_loads(set, interactions, end, end, sample.external);
  apply_friction(set, interactions.friction, 0.5 * dt, PairOrder::Backward, state, ledger);
  apply_stiffness_damping(set, interactions, 0.5 * dt, PairOrder::Backward, state, ledger);
  apply_medium(set, interactions.medium, 0.5 * dt, state, ledger);
  end_pins(problem, end, dt, target);
}

double stable_step(const StepLimits& limits) {
  double step = std::numeric_limits<double>::infinity();
  const auto limit = [&step](double scale, double rate) {
    if (rate > 0.0) step = std::min(step, scale / rate);
  };
  limit(0.3, limits.frequency);
  if (limits.length > 0.0) limit(0.1 * limits.length, limits.speed);
  limit(0.3, limits.angular_speed);
  return step;
}

int halvings(double frame, double step) {
  SUPPLE_EXPECTS(frame > 0.0 && step > 0.0);
  int k = 0;
  while (std::ldexp(frame, -k) > step) ++k;
  return k;
}

}  // namespace supple::core
