#include "simulation/simulation_impl.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "simulation/pieces.h"
#include "simulation/reach.h"
#include "simulation/rest.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

/// `now` with the changes applied. @throws Error{Usage} naming the array, and the row of the fault
core::ParticleState changed_particles(const ParticleChange& change, const core::ParticleSet& set, const core::ParticleState& now) {
  const auto fail = [](const std::string& array, std::string expected, std::string found) {
    throw Error(ErrorKind::Usage, Fault{.place = array, .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = {}});
  };
  const auto take = [&](const std::string& name, const auto& array, auto& to, const auto& good, const char* what) {
    if (!array) return;
    if (array->size() != now.size()) fail(name, "expected " + counted(now.size(), "row"), std::to_string(array->size()));
    const auto bad = std::find_if_not(array->begin(), array->end(), good);
    if (bad != array->end()) fail(name, what, "others in row " + std::to_string(bad - array->begin()));
    to = *array;
  };
  const char* const finite = "expected finite numbers";
  const auto is_finite = [](const Vec3& v) { return v.allFinite(); };
  if (change.angular_momentum && change.angular_velocity) fail("angular_velocity", "expected it, or angular_momentum", "both");
  core::ParticleState next = now;
  take("position", change.position, next.position, is_finite, finite);
  take("orientation", change.orientation, next.orientation, [](const Quat& q) { return q.coeffs().allFinite() && q.norm() > 0.0; },
       "expected finite quaternions of a length > 0");
  take("velocity", change.velocity, next.velocity, is_finite, finite);
  take("angular_momentum", change.angular_momentum, next.angular_momentum, is_finite, finite);
  take("angular_velocity", change.angular_velocity, next.angular_momentum, is_finite, finite);
  for (std::size_t p = 0; p < next.size(); ++p) {
    Quat& q = next.orientation[p];
    if (q.coeffs() != now.orientation[p].coeffs()) q.normalize();
    if (change.angular_velocity) {
      next.angular_momentum[p] = q * set.inertia[p].cwiseProduct(q.conjugate() * (*change.angular_velocity)[p]);
    }
    next.velocity[p] = core::free_translation(set.pinned[p], next.velocity[p]);
    next.angular_momentum[p] = core::free_rotation(set.pinned[p], next.angular_momentum[p]);
  }
  return next;
}

bool same_motion(const core::ParticleState& a, const core::ParticleState& b, std::uint32_t p) {
  return a.position[p] == b.position[p] && a.orientation[p].coeffs() == b.orientation[p].coeffs() && a.velocity[p] == b.velocity[p] &&
         a.angular_momentum[p] == b.angular_momentum[p];
}

}  // namespace

void Simulation::Impl::take(State other) {
  core::ParticleState arrays = std::move(state.particles);
  arrays = other.particles;
  state = std::move(other);
  state.particles = std::move(arrays);
  created_before.reset();
  if (!model.releases.empty()) model.particles.pinned = pinned_at(model, time());
  model.closed = closed_at(model, time());
  form_bodies();
  form_laws();
  SUPPLE_EXPECTS(state.samples.size() == bodies.size());
  SUPPLE_EXPECTS(state.sleep.island.size() == (scene.sleep ? bodies.size() : 0));
  std::vector<std::uint32_t> pushed;  // a state may have been given an impulse
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    if (state.sleep.asleep(i) && motion_of(bodies[i], particles, state.particles, laws).energy > 0.0) pushed.push_back(i);
  }
  wake(pushed);
}

void Simulation::Impl::adopt(State other) {
  const auto check = [](const char* what, std::size_t expected, std::size_t found) {
    if (expected == found) return;
    throw Error(ErrorKind::Usage, Fault{.place = "state",
                                        .key = {},
                                        .expected = "expected " + std::to_string(expected) + ' ' + what,
                                        .found = std::to_string(found),
                                        .hint = "the scenes must have the same objects"});
  };
  check("particles", state.particles.size(), other.particles.size());
  check("bonds that can break or yield", model.links.size(), other.links.broken.size());
  check("held volumes", state.volumes.size(), other.volumes.size());
  other.kick = {};
  other.ledger = {};
  other.record = {};
  // Distances of samples continue from their present values, if the number is the same.
  const std::vector<Body> parted = make_bodies(model, other.links, other.broken_for);
  other.samples.resize(parted.size());
  for (std::size_t i = 0; i < parted.size(); ++i) {
    if (other.samples[i].distance.size() != parted[i].samples.size()) other.samples[i] = fresh_samples(parted[i]);
  }
  other.sleep = {};
  if (scene.sleep) other.sleep.reset(other.samples.size());
  if (!(model.reaction.stick.stiffness > 0.0)) other.sticks = {};
  drop_results();
  take(std::move(other));
  book_reach(model, state, 0.0, state.record);
  look_for_solids(model, state.record);
  book_audits();
}

void Simulation::Impl::set_particles(const ParticleChange& change) {
  const core::ParticleState next = changed_particles(change, model.particles, state.particles);
  std::vector<std::uint32_t> changed;
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    const auto differs = [&](std::uint32_t p) { return !same_motion(next, state.particles, p); };
    if (std::any_of(bodies[i].particle.begin(), bodies[i].particle.end(), differs)) changed.push_back(i);
  }
  if (changed.empty()) return;
  const double energy = energies().total();
  const core::Motion motion = core::measure_motion(model.particles, state.particles);
  state.particles = next;
  book_reach(model, state, 0.0, state.record);
  look_for_solids(model, state.record);
  state.kick.valid = false;
  drop_results();
  wake(changed);
  if (scene.sleep) {
    for (const std::uint32_t i : changed) state.sleep.quiet_for[i] = 0.0;
  }
  const core::Motion now = core::measure_motion(model.particles, state.particles);
  state.ledger.external_impulse += now.momentum - motion.momentum;
  state.ledger.external_angular_impulse += now.angular_momentum - motion.angular_momentum;
  state.ledger.external_work += energies().total() - energy;
}

void Simulation::Impl::set_loads(const core::Loads& loads) {
  const std::size_t n = loads.force.empty() && loads.torque.empty() ? 0 : particles.size();
  const auto refuse = [](const std::string& expected, const std::string& found) {
    throw Error(ErrorKind::Usage, Fault{.place = "set_loads", .key = {}, .expected = expected, .found = found, .hint = {}});
  };
  if (loads.force.size() != n || loads.torque.size() != n) {
    refuse("expected " + std::to_string(particles.size()) + " forces and torques, one per particle", std::to_string(loads.force.size()) + " and " + std::to_string(loads.torque.size()));
  }
  for (std::size_t p = 0; p < n; ++p) {
    if (!loads.force[p].allFinite() || !loads.torque[p].allFinite()) refuse("expected finite values", "others, of particle " + std::to_string(p));
  }
  std::vector<std::uint8_t> loaded(particles.size(), 0);  // before or from now on
  for (const core::ExternalLoad& load : added_loads) loaded[load.particle] = 1;
  added_loads.clear();
  for (std::uint32_t p = 0; p < n; ++p) {
    if (loads.force[p].isZero(0.0) && loads.torque[p].isZero(0.0)) continue;
    constexpr double kForever = std::numeric_limits<double>::infinity();
    added_loads.push_back({.particle = p, .force = loads.force[p], .torque = loads.torque[p], .begin = -kForever, .end = kForever});
    loaded[p] = 1;
  }
  laws.external.resize(model.interactions.external.size());
  laws.external.insert(laws.external.end(), added_loads.begin(), added_loads.end());
  std::vector<std::uint32_t> stirred;
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    if (std::any_of(bodies[i].particle.begin(), bodies[i].particle.end(), [&](std::uint32_t p) { return loaded[p] != 0; })) stirred.push_back(i);
  }
  wake(stirred);
  if (scene.sleep) {
    for (const std::uint32_t i : stirred) state.sleep.quiet_for[i] = 0.0;
  }
  if (awake.size() < bodies.size()) form_awake();
  if (awake.size() == bodies.size()) awake_laws.external = laws.external;
  drop_results();
  if (!state.kick.valid) return;
  state.kick.sample.external.reset(particles.size());
  core::add_external_loads(particles, awake_laws, time(), state.kick.sample.external);
}

}  // namespace supple::scenes
