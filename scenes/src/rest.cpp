#include "rest.h"

#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

double mass_of(const Body& body, const core::ParticleSet& set) {
  double mass = 0.0;
  for (const std::uint32_t p : body.particle) mass += set.mass[p];
  return mass;
}

}  // namespace

collision::BodyMotion motion_of(const Body& body, const core::ParticleSet& set, const core::ParticleState& state,
                                const core::Interactions& laws) {
  collision::BodyMotion motion;
  for (const std::uint32_t p : body.particle) {
    motion.energy += 0.5 * set.mass[p] * state.velocity[p].squaredNorm() +
                     0.5 * state.angular_momentum[p].dot(core::angular_velocity(set, state, p));
    motion.velocity += set.mass[p] * state.velocity[p];
    motion.load += set.mass[p] * core::free_translation(set.pinned[p], laws.gravity);
  }
  const double mass = mass_of(body, set);
  return {motion.energy / mass, motion.velocity / mass, motion.load / mass};
}

std::vector<collision::BodyMotion> motions_of(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& awake,
                                              const core::ParticleSet& set, const core::ParticleState& state,
                                              const core::Interactions& laws, double time) {
  std::vector<collision::BodyMotion> motion(bodies.size());
  for (const std::uint32_t i : awake) motion[i] = motion_of(bodies[i], set, state, laws);
  if (laws.external.empty()) return motion;
  constexpr std::uint32_t kNobody = 0xffffffff;
  std::vector<std::uint32_t> body_of(set.size(), kNobody);
  std::vector<double> mass(bodies.size(), 0.0);
  for (const std::uint32_t i : awake) {
    for (const std::uint32_t p : bodies[i].particle) body_of[p] = i;
    mass[i] = mass_of(bodies[i], set);
  }
  for (const core::ExternalLoad& load : laws.external) {
    const std::uint32_t i = body_of[load.particle];
    if (i != kNobody) motion[i].load += load.factor(time) / mass[i] * core::free_translation(set.pinned[load.particle], load.force);
  }
  return motion;
}

}  // namespace supple::scenes
