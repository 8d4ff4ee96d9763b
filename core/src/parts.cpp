#include "supple/core/parts.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"

namespace supple::core {

void gather_poses(const ParticleState& state, std::uint32_t first, std::uint32_t last, std::vector<Pose>& out) {
  SUPPLE_EXPECTS(first <= last && last <= state.size());
  out.resize(last - first);
  for (std::uint32_t i = first; i < last; ++i) out[i - first] = {state.position[i], state.orientation[i]};
}

void gather_spins(const ParticleSet& set, const ParticleState& state, std::uint32_t first, std::uint32_t last,
                  std::vector<Vec3>& out) {
  SUPPLE_EXPECTS(first <= last && last <= state.size());
  out.resize(last - first);
  for (std::uint32_t i = first; i < last; ++i) out[i - first] = angular_velocity(set, state, i);
}

void add_part_loads(std::span<const Vec3> force, std::span<const Vec3> torque, std::uint32_t first, Loads& loads) {
  SUPPLE_EXPECTS(force.size() == torque.size() && first + force.size() <= loads.force.size());
  for (std::size_t k = 0; k < force.size(); ++k) {
    loads.force[first + k] += force[k];
    loads.torque[first + k] += torque[k];
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
