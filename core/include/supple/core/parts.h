/// @file supple/core/parts.h
/// Particles as the parts of a body, for the field and contact modules.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/particles.h"

namespace supple::core {

/// Poses of the particles listed, shape [particles].
void gather_poses(const ParticleState& state, std::span<const std::uint32_t> particles, std::vector<Pose>& out);

/// Velocities of the centres [m/s] and angular velocities [rad/s], world axes, shape [particles].
void gather_motion(const ParticleSet& set, const ParticleState& state, std::span<const std::uint32_t> particles,
                   std::vector<Vec3>& velocity, std::vector<Vec3>& spin);

/// Adds the loads of part k to particle particles[k].
void add_part_loads(std::span<const Vec3> force, std::span<const Vec3> torque, std::span<const std::uint32_t> particles,
                    Loads& loads);

/// Largest speed [m/s] and angular speed [rad/s] of all particles.
struct Speeds {
  double linear = 0.0;
  double angular = 0.0;
};
[[nodiscard]] Speeds largest_speeds(const ParticleSet& set, const ParticleState& state);

}  // namespace supple::core
