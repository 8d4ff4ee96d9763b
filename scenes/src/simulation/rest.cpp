#include "simulation/rest.h"

#include <algorithm>

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
    if (bodies[i].origin.is_group()) continue;  // rests with the body that it is part of
    for (const std::uint32_t p : bodies[i].particle) body_of[p] = i;
    mass[i] = mass_of(bodies[i], set);
  }
  for (const core::ExternalLoad& load : laws.external) {
    const std::uint32_t i = body_of[load.particle];
    if (i != kNobody) motion[i].load += load.factor(time) / mass[i] * core::free_translation(set.pinned[load.particle], load.force);
  }
  return motion;
}

std::vector<collision::BodyPair> tied_bodies(const std::vector<Body>& bodies, const core::Interactions& laws) {
  std::vector<collision::BodyPair> tied;
  const std::size_t surfaces = surface_count(bodies);
  for (std::size_t i = surfaces; i < bodies.size(); ++i) {
    const auto whole = std::find_if(bodies.begin(), bodies.begin() + static_cast<std::ptrdiff_t>(surfaces), [&](const Body& body) {
      return body.object == bodies[i].object && body.origin.piece == bodies[i].origin.piece && body.origin.component == bodies[i].origin.component;
    });
    tied.push_back({static_cast<std::uint32_t>(whole - bodies.begin()), static_cast<std::uint32_t>(i)});
  }
  for (const auto& [a, b] : core::acting_objects(laws)) {
    std::uint32_t first = 0;
    while (first < surfaces && bodies[first].object != a && bodies[first].object != b) ++first;
    for (std::uint32_t i = first + 1; i < surfaces; ++i) {
      if (bodies[i].object == a || bodies[i].object == b) tied.push_back({first, i});
    }
  }
  return tied;
}

std::vector<std::uint32_t> newly_loaded(const std::vector<Body>& bodies, const core::Interactions& laws, double from, double to) {
  std::vector<std::uint32_t> loaded;
  for (const core::ExternalLoad& load : laws.external) {
    if (!load.changes(from, to)) continue;
    for (std::uint32_t i = 0; i < bodies.size(); ++i) {
      if (std::binary_search(bodies[i].particle.begin(), bodies[i].particle.end(), load.particle)) loaded.push_back(i);
    }
  }
  return loaded;
}

void still(const Body& body, const core::ParticleSet& set, State& state) {
  for (const std::uint32_t p : body.particle) {
    Vec3 &v = state.particles.velocity[p], &turn = state.particles.angular_momentum[p];
    const Vec3 momentum = set.mass[p] * v;
    state.ledger.dissipated += 0.5 * momentum.dot(v) + 0.5 * turn.dot(core::angular_velocity(set, state.particles, p));
    state.ledger.pin_impulse -= momentum;
    state.ledger.pin_angular_impulse -= state.particles.position[p].cross(momentum) + turn;
    v.setZero();
    turn.setZero();
  }
}

void give_half_kick(const Body& body, const core::ParticleSet& set, const core::Loads& loads, double dt, State& state) {
  for (const std::uint32_t p : body.particle) {
    const Vec3 j = core::free_translation(set.pinned[p], 0.5 * dt * loads.force[p]);
    const Vec3 turn = core::free_rotation(set.pinned[p], 0.5 * dt * loads.torque[p]);
    state.particles.velocity[p] += j / set.mass[p];
    state.particles.angular_momentum[p] += turn;
    state.ledger.pin_impulse += j;
    state.ledger.pin_angular_impulse += state.particles.position[p].cross(j) + turn;
  }
}

}  // namespace supple::scenes
