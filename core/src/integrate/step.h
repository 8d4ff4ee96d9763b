// What the integrators share.
#pragma once

#include "supple/core/integrate.h"

namespace supple::core {

inline bool holds_position(const ParticleSet& set, std::size_t i) { return (set.pinned[i] & kPinPosition) != 0; }
inline bool holds_orientation(const ParticleSet& set, std::size_t i) { return (set.pinned[i] & kPinOrientation) != 0; }

/// Takes the velocity and the angular momentum that a pin holds.
void stop_pinned(const ParticleSet& set, ParticleState& state);

/// `rotate_free` of four particles in a row, to the same bits; those without angular momentum are left alone. @return
/// false, having done nothing, where one has unequal moments or turns so far that the series of the others does not hold.
[[nodiscard]] bool rotate_four(const Vec3* angular_momentum, const Vec3* inertia, double dt, Quat* orientation);

/// Clears `sample` and requests the loads.
void evaluate(const ForceModel& forces, const ParticleState& state, double time, ForceSample& sample);

}  // namespace supple::core
