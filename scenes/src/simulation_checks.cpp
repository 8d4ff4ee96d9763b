#include "simulation_impl.h"

#include <algorithm>

#include "pieces.h"
#include "read_scene_faults.h"
#include "scene_places.h"
#include "supple/core/error.h"

namespace supple::scenes {

/// At the start of a frame: steps that the scene fixes may be far beyond those known to be stable, which the run says once.
void Simulation::Impl::note_coarse_steps() {
  constexpr double kProven = 5.0;  // automatic steps have margins of five to seven to what their bounds prove
  if (!fixes_step(scene) || coarse_noted) return;
  const double step = automatic_step(scene, model, integrator, laws, state.particles);
  if (dt() <= kProven * step) return;
  coarse_noted = true;
  warnings.push_back("time_step.substeps: steps of " + short_text(dt()) + " s may be too coarse, automatic ones would be of " +
                     short_text(step) + " s (at frame " + std::to_string(state.frame) + "); see energy_error");
}

/// After a step that the scene fixes: what contact it missed, or made energy by. @throws Error{Diverged}
void Simulation::Impl::check_fixed_step() {
  if (!fixes_step(scene) || awake.empty() || !contact_on()) return;
  Profile unused{};
  const StageContext quiet = quiet_context(unused);
  const TakenStep step{.before = step_begin, .after = state.particles, .end = time(), .size = dt()};
  const auto found = find_missed_contact(quiet, step, state.samples, seen_contacts(quiet), pulled);
  if (found) throw_too_coarse(*found);
  check_fixed_push();
}

/// Where pairs are pushed by forces of the present state. @throws Error{Diverged}
void Simulation::Impl::check_fixed_push() {
  const core::Integrator method = integrator.settings.method;
  // The adaptive method takes as many steps within one as contacts ask for; implicit steps hold any.
  if (method == core::Integrator::Adaptive || core::is_implicit(method) || !contact_on() || contact_bounds_hold(model, step_begin, dt())) return;
  Profile unused{};
  const StageContext quiet = quiet_context(unused);
  const TakenStep step{.before = step_begin, .after = state.particles, .end = time(), .size = dt()};
  const double limit = method == core::Integrator::RungeKutta4 ? 8.0 : 4.0;
  const auto found =
      find_unstable_contact(quiet, step, state.samples, seen_contacts(quiet), limit, pulled);
  if (found) throw_too_coarse(*found);
}

/// The contacts of the present state: the last step's of velocity Verlet, of other methods they are found anew.
const Frame& Simulation::Impl::seen_contacts(const StageContext& quiet) {
  if (integrator.settings.method == core::Integrator::Symplectic && state.kick.valid) return frame;
  std::vector<implicit::SampleState> trial = state.samples;
  find_contact_surface(quiet, state.particles, trial, pulled, false);
  return pulled;
}

/// At the end of a step: pairs that press harder than they can hold are noted, and turned back by hard cores.
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
  watch.look(context(), frame, time(), state.record);
  if (barrier && hold_cores(context(), frame, state.particles, state.ledger, state.record)) state.kick.valid = false;
}

void Simulation::Impl::throw_too_coarse(const TooCoarse& found) {
  const double needed = automatic_step(scene, model, integrator, laws, step_begin);
  const double substeps = needed > 0.0 ? frame_time() / needed : 0.0;
  const bool refused = !(needed > 0.0) || substeps > scene.time_step.max_substeps;
  const Error error(ErrorKind::Diverged,
                    Fault{.place = place_of(scene, "time_step.substeps"),
                          .key = "time_step.substeps",
                          .expected = "expected steps that contacts can be followed by: at t = " + short_text(time()) + " s '" +
                                      body_name(model, bodies, found.bodies.a) + "' and '" +
                                      body_name(model, bodies, found.bodies.b) + '\'' + found.how,
                          .found = "steps of " + short_text(dt()) + " s, automatic ones would be of " + short_text(needed) + " s",
                          .hint = "let substeps be auto" +
                                  (refused ? ", and max_substeps at least " + number_text(substeps) : std::string())});
  if (last_frame.record.valid) take(last_frame);
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
                    .found = std::to_string(divergence.value) + ", believable up to " + std::to_string(divergence.limit),
                    .hint = fixes_step(scene)
                                ? "the scene fixes its own time step; let time_step.substeps be auto"
                                : "check stiffness, mass and strength of the objects concerned"});
}

}  // namespace supple::scenes
