/// @file supple/core/parts.h
/// The particles [first, last) of one object as the parts of a body: what the field and contact modules take and return.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/particles.h"

namespace supple::core {

/// Poses of the particles, shape [last - first].
void gather_poses(const ParticleState& state, std::uint32_t first, std::uint32_t last, std::vector<Pose>& out);

/// Angular velocities [rad/s], world axes, shape [last - first].
void gather_spins(const ParticleSet& set, const ParticleState& state, std::uint32_t first, std::uint32_t last,
                  std::vector<Vec3>& out);

/// Adds loads of parts 0, 1 ... to the particles first, first + 1 ...
void add_part_loads(std::span<const Vec3> force, std::span<const Vec3> torque, std::uint32_t first, Loads& loads);

/// Largest speed [m/s] and angular speed [rad/s] of all particles.
struct Speeds {
  double linear = 0.0;
  double angular = 0.0;
};
[[nodiscard]] Speeds largest_speeds(const ParticleSet& set, const ParticleState& state);

}  // namespace supple::core
