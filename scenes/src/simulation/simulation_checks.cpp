#include "simulation/simulation_impl.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "file/read_scene_faults.h"
#include "file/scene_places.h"
#include "simulation/audits.h"
#include "simulation/pieces.h"
#include "simulation/stages.h"
#include "supple/core/error.h"

namespace supple::scenes {

/// At the start of a frame: warns once if steps fixed by the scene are far beyond those known to be stable.
void Simulation::Impl::note_coarse_steps() {
  constexpr double kProven = 5.0;  // automatic steps have margins of five to seven over the proven bounds
  if (!fixes_step(scene) || coarse_noted) return;
  const double step = automatic_step(scene, model, integrator, laws, state.particles);
  if (dt() <= kProven * step) return;
  coarse_noted = true;
  warnings.push_back("time_step.substeps: steps of " + short_text(dt()) + " s may be too coarse, automatic steps would be " +
                     short_text(step) + " s (at frame " + std::to_string(state.frame) + "); see energy_error");
}

/// After a fixed step: checks for contact that it missed, or that created energy. @throws Error{Diverged}
void Simulation::Impl::check_fixed_step() {
  // Implicit steps are checked, and divided, where they are made.
  if (!fixes_step(scene) || awake.empty() || !contact_on() || core::is_implicit(integrator.settings.method)) return;
  Profile unused{};
  const StageContext quiet = quiet_context(unused);
  const TakenStep step{.before = step_begin, .after = state.particles, .end = time(), .size = dt()};
  const auto found = find_missed_contact(quiet, step, state.samples, seen_contacts(quiet), nullptr, pulled);
  if (found) throw_too_coarse(*found);
  check_fixed_push();
}

/// Where pairs are pushed by forces of the present state. @throws Error{Diverged}
void Simulation::Impl::check_fixed_push() {
  const core::Integrator method = integrator.settings.method;
  // The adaptive method makes as many substeps as contacts need; implicit steps are stable.
  if (method == core::Integrator::Adaptive || core::is_implicit(method) || !contact_on() || contact_bounds_hold(model, step_begin, dt())) return;
  Profile unused{};
  const StageContext quiet = quiet_context(unused);
  const TakenStep step{.before = step_begin, .after = state.particles, .end = time(), .size = dt()};
  const double limit = method == core::Integrator::RungeKutta4 ? 8.0 : 4.0;
  const auto found =
      find_unstable_contact(quiet, step, state.samples, seen_contacts(quiet), limit, pulled);
  if (found) throw_too_coarse(*found);
}

/// The contacts of the present state: from the last step of velocity Verlet; for other methods they are computed again.
const Frame& Simulation::Impl::seen_contacts(const StageContext& quiet) {
  if (integrator.settings.method == core::Integrator::Symplectic && state.kick.valid) return frame;
  std::vector<implicit::SampleState> trial = state.samples;
  find_contact_surface(quiet, state.particles, trial, pulled, false);
  return pulled;
}

/// At the end of a step: overloaded pairs are recorded, and pushed back with contact.core: barrier. @throws Error{Diverged} where bodies pass through each other
void Simulation::Impl::watch_pressing() {
  if (!contact_on()) return;
  add_unresolved(context(), scene.contact.rule, frame.surface, warnings);
  unmet.look(context(), frame.surface, time());
  const bool barrier = scene.contact.core == CoreName::Barrier;
  if (barrier && integrator.settings.method != core::Integrator::Symplectic) {
    // The last trial of other methods need not be the state they end with.
    std::vector<implicit::SampleState> trial = state.samples;
    find_contact_surface(context(), state.particles, trial, frame, false);
  }
  const std::optional<RunRecord::Overload> passing = watch.look(context(), state.particles, frame, time(), state.record);
  if (passing && !barrier) throw_passing(*passing);
  if (barrier && hold_cores(context(), frame, state.particles, state.ledger, state.record)) state.kick.valid = false;
}

/// Whether all loads have an energy whose changes are booked: volume control adds energy, some selectable rules have none, and
/// obstacles may jump within steps that the scene fixes.
bool Simulation::Impl::energies_balance() const {
  const bool pumped = std::any_of(model.objects.begin(), model.objects.end(), [](const ObjectModel& o) { return o.holds_volume; });
  const bool jumps = fixes_step(scene) && model.solid_speed > 0.0;
  return !pumped && !jumps && model.interactions.literal_form.empty() && model.reaction.split == collision::SplitRule::Energy;
}

/// At a frame: a run whose energy has no source is useless. @throws Error{Diverged}
void Simulation::Impl::check_energy() {
  constexpr double kNoMotion = 1e-10;  // of the largest plausible speed: a millionth of the total size per frame
  if (!energies_balance()) return;
  const Energies now = energies();
  const std::optional<double> created = find_created_energy(now, created_before.value_or(0.0), state);
  const double slow = kNoMotion * model.believable.margin;
  double mass = 0.0;
  for (const double m : model.particles.mass) mass += m;
  if (!created || !(*created > 0.5 * mass * slow * slow)) return;
  double most = -1.0, own_mass = 0.0, speed = 0.0;
  const ObjectModel* fastest = nullptr;
  for (const ObjectModel& object : model.objects) {
    double energy = 0.0, m = 0.0, v = 0.0;
    for (std::uint32_t i = object.first; i < object.last; ++i) {
      m += model.particles.mass[i];
      energy += 0.5 * model.particles.mass[i] * state.particles.velocity[i].squaredNorm();
      v = std::max(v, state.particles.velocity[i].norm());
    }
    if (energy <= most) continue;
    most = energy;
    own_mass = m;
    speed = v;
    fastest = &object;
  }
  const double given = std::max(0.0, now.total() - *created);
  const Error error(ErrorKind::Diverged,
                    Fault{.place = scene.source.string(),
                          .key = {},
                          .expected = "diverged at step " + std::to_string(state.steps) + " (t = " + short_text(time()) + " s): '" + fastest->name +
                                      "' moves at up to " + short_text(speed) + " m/s; all the energy that was put into the run, " + short_text(given) +
                                      " J, could give it " + short_text(std::sqrt(2.0 * given / own_mass)) + " m/s",
                          .found = short_text(*created) + " J without a source",
                          .hint = fixes_step(scene) ? "the scene fixes the time step; set time_step.substeps to auto"
                                                    : "check stiffness, mass and strength of the objects concerned"});
  drop_results();
  if (last_frame.record.valid) take(last_frame);
  throw error;
}

void Simulation::Impl::throw_too_coarse(const TooCoarse& found) {
  const double needed = automatic_step(scene, model, integrator, laws, step_begin);
  const double substeps = needed > 0.0 ? frame_time() / needed : 0.0;
  const bool refused = !(needed > 0.0) || substeps > scene.time_step.max_substeps;
  const Error error(ErrorKind::Diverged,
                    Fault{.place = place_of(scene, "time_step.substeps"),
                          .key = "time_step.substeps",
                          .expected = "expected steps fine enough to follow contacts: at t = " + short_text(time()) + " s '" +
                                      body_name(model, bodies, found.bodies.a) + "' and '" +
                                      body_name(model, bodies, found.bodies.b) + '\'' + found.how,
                          .found = "steps of " + short_text(dt()) + " s, automatic steps would be " + short_text(needed) + " s",
                          .hint = "set substeps to auto" +
                                  (refused ? ", and max_substeps at least " + number_text(substeps) : std::string())});
  if (last_frame.record.valid) take(last_frame);
  throw error;
}

/// With the last frame as the state, which keeps what is known of overloads.
void Simulation::Impl::throw_passing(const RunRecord::Overload& found) {
  const Error error(ErrorKind::Diverged,
                    Fault{.place = scene.source.string(),
                          .key = {},
                          .expected = "overloaded at step " + std::to_string(state.steps) + " (t = " + short_text(found.time) + " s): '" + found.a +
                                      "' and '" + found.b + "' pass through each other; their contact holds at most " + short_text(found.capacity) + " J",
                          .found = short_text(found.energy) + " J of approach and contact",
                          .hint = "raise the modulus of the softer one, lower masses, speeds or loads, or set contact.core to barrier"});
  drop_results();
  std::vector<RunRecord::Overload> overloads = std::move(state.record.overloads);
  if (last_frame.record.valid) take(last_frame);
  state.record.overloads = std::move(overloads);
  throw error;
}

void Simulation::Impl::throw_diverged(const core::Divergence& divergence, std::uint64_t step_number, double at) const {
  const auto object = std::find_if(model.objects.begin(), model.objects.end(), [&](const ObjectModel& o) {
    return o.first <= divergence.particle && divergence.particle < o.last;
  });
  const std::string particle =
      object == model.objects.end()
          ? "particle " + std::to_string(divergence.particle)
          : object->name + ", particle " + std::to_string(divergence.particle - object->first);
  throw Error(ErrorKind::Diverged,
              Fault{.place = scene.source.string(),
                    .key = {},
                    .expected = "diverged at step " + std::to_string(step_number) + " (t = " + std::to_string(at) +
                                " s): " + divergence.cause + " of " + particle,
                    .found = std::to_string(divergence.value) + ", plausible up to " + std::to_string(divergence.limit),
                    .hint = fixes_step(scene)
                                ? "the scene fixes the time step; set time_step.substeps to auto"
                                : "check stiffness, mass and strength of the objects concerned"});
}

}  // namespace supple::scenes
