#include "simulation/simulation_impl.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <utility>

#include "model/led_pins.h"
#include "simulation/contact_work.h"
#include "simulation/held_volumes.h"
#include "simulation/pieces.h"
#include "simulation/rest.h"
#include "supple/core/parts.h"

namespace supple::scenes {

/// Bodies, rules and frames for the present pieces.
void Simulation::Impl::form_bodies() {
  bodies = make_bodies(model, state.links, state.broken_for);
  scale_kernels(model, state.volumes, bodies);
  watch.forget();
  rules = make_body_rules(model, bodies, state.apart);
  frame = Frame(model, bodies);
  renew_pulled();
}

/// Components and groups of one object that overlap at the start would be pushed apart: they touch once they have been apart.
void Simulation::Impl::leave_overlapping() {
  if (std::all_of(model.objects.begin(), model.objects.end(), [](const ObjectModel& o) { return o.component.empty() && o.group.empty(); })) return;
  pull_contacts();
  if (!note_overlapping(bodies, pulled, model)) return;
  divide_anew();
  renew_pulled();
  drop_results();
}

/// The remaining laws, and data derived from them.
void Simulation::Impl::form_laws() {
  laws = core::intact(model.interactions, model.links, state.links);
  laws.external.insert(laws.external.end(), added_loads.begin(), added_loads.end());
  form_awake();
}

/// Particles and laws while some bodies rest.
void Simulation::Impl::form_awake() {
  awake.clear();
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    if (!state.sleep.asleep(i)) awake.push_back(i);
  }
  frame.resting_placed = false;
  particles = model.particles;
  if (awake.size() == bodies.size()) {
    awake_laws = laws;
  } else {
    std::vector<std::uint8_t> resting(particles.size(), 0);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (!state.sleep.asleep(i)) continue;
      for (const std::uint32_t p : bodies[i].particle) {
        resting[p] = 1;
        particles.pinned[p] |= core::kPinPosition | core::kPinOrientation;
      }
    }
    awake_laws = core::without_resting(particles, laws, resting);
  }
  workspace = core::InteractionWorkspace(particles, awake_laws);
  if (!scene.sleep) return;
  integrator_workspace = core::IntegratorWorkspace();
  tied = tied_bodies(bodies, laws);
}

/// Bodies as the links that are left make them.
void Simulation::Impl::part_bodies() {
  const std::vector<Body> before = std::move(bodies);
  form_bodies();
  if (scene.sleep) state.sleep.reset(bodies.size());
  form_awake();
  const auto same_parts = [](const Body& a, const Body& b) { return a.origin.group == b.origin.group && a.particle == b.particle; };
  if (std::equal(bodies.begin(), bodies.end(), before.begin(), before.end(), same_parts)) {
    const auto same_cuts = [](const Body& a, const Body& b) { return a.origin.cut == b.origin.cut; };
    if (!std::equal(bodies.begin(), bodies.end(), before.begin(), same_cuts)) divide_anew();
    return;
  }
  rename_pair_work(model, before, bodies, state.record);
  state.ledger.dissipated += collision::stick_energy(model.reaction.stick, state.sticks);  // bodies have other numbers now
  state.sticks = {};
  state.kick.valid = false;
  state.apart = inherited_apart(model, before, state.apart, bodies);
  state.samples = inherited_samples(before, state.samples, bodies);
  divide_anew();
}

/// Other bodies of one object touch now.
void Simulation::Impl::divide_anew() {
  rules = make_body_rules(model, bodies, state.apart);
  frame.pairs_present.reset();
}

/// Links whose cut is due and that hold.
std::vector<std::uint32_t> Simulation::Impl::due_cuts() const {
  constexpr double kRounding = 1e-12;  // of a time that is a sum of steps
  std::vector<std::uint32_t> due;
  for (const CutEvent& cut : model.cuts) {
    if (time() < cut.time * (1.0 - kRounding)) continue;
    std::copy_if(cut.links.begin(), cut.links.end(), std::back_inserter(due), [&](std::uint32_t link) { return state.links.broken[link] == 0; });
  }
  return due;
}

/// Before a step: frees particles whose pins end, and wakes their bodies.
void Simulation::Impl::release_pins() {
  if (model.releases.empty()) return;
  std::vector<std::uint8_t> now = pinned_at(model, time());
  if (now == model.particles.pinned) return;
  std::vector<std::uint32_t> freed;
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    const auto differs = [&](std::uint32_t p) { return now[p] != model.particles.pinned[p]; };
    if (std::any_of(bodies[i].particle.begin(), bodies[i].particle.end(), differs)) freed.push_back(i);
  }
  model.particles.pinned = std::move(now);
  form_bodies();
  form_laws();
  wake(freed);
  if (!scene.sleep) return;
  for (const std::uint32_t i : freed) state.sleep.quiet_for[i] = 0.0;
}

/// Before a step: lets pairs touch, or pass through each other, from this time on. What this changes of the contact energy is external work.
void Simulation::Impl::switch_contacts() {
  if (model.windows.empty() && model.appearances.empty()) return;
  std::vector<collision::BodyPair> now = closed_at(model, time());
  if (now == model.closed) return;
  const double held = contact_energy();
  std::vector<collision::BodyPair> changed;
  std::set_symmetric_difference(now.begin(), now.end(), model.closed.begin(), model.closed.end(), std::back_inserter(changed));
  const auto of_window = [&](std::uint32_t object) {
    return std::any_of(changed.begin(), changed.end(), [&](const collision::BodyPair& pair) { return pair.a == object || pair.b == object; });
  };
  std::vector<std::uint32_t> roused;
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    if (of_window(bodies[i].object)) roused.push_back(i);
  }
  model.closed = std::move(now);
  state.kick.valid = false;
  divide_anew();
  renew_pulled();
  drop_results();
  wake(roused);
  if (scene.sleep) {
    for (const std::uint32_t i : roused) state.sleep.quiet_for[i] = 0.0;
  }
  state.ledger.external_work += contact_energy() - held;
}

/// After a step: objects whose time came within it get their velocities. They are freed before the next one. Their energy and momentum come from outside.
void Simulation::Impl::make_appear() {
  const double now = time(), before = now - dt();
  const auto due = [&](const Appearance& appearance) {
    return is_there(model, appearance.object, now) && !is_there(model, appearance.object, before);
  };
  if (std::none_of(model.appearances.begin(), model.appearances.end(), due)) return;
  const double energy = energies().total();
  const core::Motion motion = core::measure_motion(model.particles, state.particles);
  for (const Appearance& appearance : model.appearances) {
    if (!due(appearance)) continue;
    const auto first = static_cast<std::ptrdiff_t>(model.objects[appearance.object].first);
    std::copy(appearance.velocity.begin(), appearance.velocity.end(), state.particles.velocity.begin() + first);
    std::copy(appearance.angular_momentum.begin(), appearance.angular_momentum.end(), state.particles.angular_momentum.begin() + first);
  }
  drop_results();
  const core::Motion after = core::measure_motion(model.particles, state.particles);
  state.ledger.external_impulse += after.momentum - motion.momentum;
  state.ledger.external_angular_impulse += after.angular_momentum - motion.angular_momentum;
  state.ledger.external_work += energies().total() - energy;
}

/// Between two steps: breaks and yields links. New pieces get new seeds and forces. The energy of surfaces that no longer
/// exist is booked with the links.
void Simulation::Impl::update_links() {
  if (model.links.size() == 0) return;
  const bool fades = age_broken_links(model, dt(), state);
  const core::LinkChange change =
      core::update_links({model.particles, state.particles, laws}, model.links, dt(), state.links, state.ledger, due_cuts());
  if (change.any()) form_laws();
  if (change.any() || fades) state.kick.valid = false;
  if (change.broke == 0 && !fades) return;
  const double held = contact_energy();
  part_bodies();
  drop_results();
  const double lost = held - contact_energy();
  state.ledger.dissipated += lost;
  state.links.released += lost;
}

/// After a step: scales kernels, with the particles at rest. The change of the contact energy is external work.
void Simulation::Impl::hold_volumes() {
  std::vector<implicit::VolumeState> next = state.volumes;
  if (!control_volumes(context(), state.particles, dt(), pulled, next)) return;
  const bool same = std::equal(next.begin(), next.end(), state.volumes.begin(),
                               [](const auto& a, const auto& b) { return a.scale == b.scale; });
  const double before = same ? 0.0 : contact_energy();
  state.volumes = std::move(next);
  if (same) return;
  scale_kernels(model, state.volumes, bodies);
  drop_results();
  const double after = contact_energy();
  state.ledger.external_work += after - before;
  if (before > 0.0 || after > 0.0) state.kick.valid = false;  // it pushes from now on as it is now
}

/// Wakes the islands of bodies. @return those that were asleep
std::vector<std::uint32_t> Simulation::Impl::wake(const std::vector<std::uint32_t>& which) {
  std::vector<std::uint32_t> rose = collision::wake(which, state.sleep);
  if (rose.empty()) return rose;
  form_awake();
  state.kick.valid = false;
  return rose;
}

/// Before a step: bodies under a load that changes in it, or near an obstacle that moves, are awake and not quiet.
void Simulation::Impl::wake_loaded() {
  if (!scene.sleep) return;
  std::vector<std::uint32_t> loaded = newly_loaded(bodies, laws, time(), time() + dt());
  for (const core::LedPin& pin : model.led) {
    if (!leads(pin, time(), time() + dt())) continue;
    for (std::uint32_t i = 0; i < bodies.size(); ++i) {
      if (std::find(bodies[i].particle.begin(), bodies[i].particle.end(), pin.particle) != bodies[i].particle.end()) loaded.push_back(i);
    }
  }
  if (awake.size() < bodies.size()) {
    const std::vector<std::uint32_t> stirred = find_stirred(context(), state.particles, time() + dt(), frame);
    loaded.insert(loaded.end(), stirred.begin(), stirred.end());
  }
  wake(loaded);
  for (const std::uint32_t i : loaded) state.sleep.quiet_for[i] = 0.0;
}

/// After a step: what an awake body touches wakes. With velocity Verlet it gets the half kick that its pins took.
void Simulation::Impl::wake_touched() {
  if (awake.size() == bodies.size()) return;
  std::vector<std::uint32_t> touched;
  for (const auto& s : frame.surface.summary) {
    if (!(s.force.norm() > 0.0)) continue;
    for (const std::uint32_t i : {s.bodies.a, s.bodies.b}) {
      if (state.sleep.asleep(i)) touched.push_back(i);
    }
  }
  if (touched.empty()) return;
  const core::Loads loads = state.kick.sample.internal;
  const std::vector<std::uint32_t> rose = wake(touched);
  if (integrator.settings.method != core::Integrator::Symplectic) return;
  for (const std::uint32_t i : rose) {
    if (!bodies[i].origin.is_group()) give_half_kick(bodies[i], particles, loads, dt(), state);
  }
}

/// After a step: islands that have been quiet for long enough stop, and their energy is booked as held and dissipated.
void Simulation::Impl::lay_to_sleep() {
  if (!scene.sleep || awake.empty()) return;
  std::vector<collision::BodyPair> joined = tied;
  for (const auto& s : frame.surface.summary) {
    if (s.force.norm() > 0.0) joined.push_back(s.bodies);
  }
  std::vector<collision::BodyMotion> motion = motions_of(bodies, awake, particles, state.particles, laws, time());
  for (const std::uint32_t i : awake) {
    // Bodies whose kernels still change do not rest.
    if (model.objects[bodies[i].object].holds_volume) motion[i].energy = std::numeric_limits<double>::infinity();
  }
  const std::vector<std::uint32_t> slept =
      collision::fall_asleep({scene.sleep->speed, scene.sleep->time}, dt(), motion, joined, state.sleep);
  if (slept.empty()) return;
  for (const std::uint32_t i : slept) still(bodies[i], particles, state);
  form_awake();
  state.kick.valid = false;
}

}  // namespace supple::scenes
