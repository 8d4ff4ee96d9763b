#include "supple/core/parts.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"

namespace supple::core {

void gather_poses(const ParticleState& state, std::span<const std::uint32_t> particles, std::vector<Pose>& out) {
  out.resize(particles.size());
  for (std::size_t k = 0; k < particles.size(); ++k) {
    out[k] = {state.position[particles[k]], state.orientation[particles[k]]};
  }
}

void gather_motion(const ParticleSet& set, const ParticleState& state, std::span<const std::uint32_t> particles,
                   std::vector<Vec3>& velocity, std::vector<Vec3>& spin) {
  velocity.resize(particles.size());
  spin.resize(particles.size());
  for (std::size_t k = 0; k < particles.size(); ++k) {
    velocity[k] = state.velocity[particles[k]];
    spin[k] = angular_velocity(set, state, particles[k]);
  }
}

void add_part_loads(std::span<const Vec3> force, std::span<const Vec3> torque, std::span<const std::uint32_t> particles,
                    Loads& loads) {
  SUPPLE_EXPECTS(force.size() == torque.size() && force.size() == particles.size());
  for (std::size_t k = 0; k < force.size(); ++k) {
    loads.force[particles[k]] += force[k];
    loads.torque[particles[k]] += torque[k];
  }
}

Speeds largest_speeds(const ParticleSet& set, const ParticleState& state) {
  Speeds largest;
  for (std::uint32_t i = 0; i < state.size(); ++i) {
    largest.linear = std::max(largest.linear, state.velocity[i].norm());
    largest.angular = std::max(largest.angular, angular_velocity(set, state, i).norm());
  }
  return largest;
}

}  // namespace supple::core
