// What the integrators share.
#pragma once

#include "supple/core/integrate.h"

namespace supple::core {

inline bool holds_position(const ParticleSet& set, std::size_t i) { return (set.pinned[i] & kPinPosition) != 0; }
inline bool holds_orientation(const ParticleSet& set, std::size_t i) { return (set.pinned[i] & kPinOrientation) != 0; }

/// At the start of a step: what pins hold has no velocity, or the constant one that leads it through the step.
void begin_pins(const StepProblem& problem, double time, double dt, const StepTarget& target);
/// Puts what moving pins hold to its place at a time.
void place_led(const StepProblem& problem, double time, ParticleState& state);
/// At the end of a step of size dt: places, and angular momenta of the velocities that the step had.
void end_pins(const StepProblem& problem, double end, double dt, const StepTarget& target);

/// `rotate_free` of four particles in a row, to the same bits; those without angular momentum are left alone. @return
/// false, having done nothing, where one has unequal moments or turns so far that the series of the others does not hold.
[[nodiscard]] bool rotate_four(const Vec3* angular_momentum, const Vec3* inertia, double dt, Quat* orientation);

/// Clears `sample` and requests the loads.
void evaluate(const ForceModel& forces, const ParticleState& state, double time, ForceSample& sample);

}  // namespace supple::core
