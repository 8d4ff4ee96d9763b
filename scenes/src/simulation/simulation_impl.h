/// @file simulation_impl.h
/// Implementation of Simulation: data and steps.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "model/time_steps.h"
#include "model/warnings.h"
#include "simulation/fixed_step.h"
#include "simulation/frame.h"
#include "simulation/friction_watch.h"
#include "simulation/overload.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

struct Simulation::Impl {
  Scene scene;
  Model model;
  SimulationOptions options;
  Executor executor;
  StepPlan plan;
  Profile profile{};
  StepTiming timing = StepTiming::None;  ///< of the step under way
  bool step_was_long = false;    ///< the last one
  std::uint64_t steps_made = 0;  ///< by this object
  State state;
  State last_frame;
  core::ParticleState step_begin;  ///< of the last step, where the scene fixes it
  // The model after State::links and State::apart.
  core::Interactions laws;
  // The same after State::sleep: resting particles are pinned, and laws between them are skipped.
  core::ParticleSet particles;
  core::Interactions awake_laws;
  std::vector<core::ExternalLoad> added_loads;     ///< loads besides those of the scene
  std::vector<std::uint32_t> awake;          ///< bodies, ascending
  std::vector<collision::BodyPair> tied;     ///< bodies that laws act between
  std::vector<Body> bodies;
  collision::ContactRules rules;
  Frame frame;
  OverloadWatch watch;
  FrictionWatch friction;
  core::InteractionWorkspace workspace;
  IntegratorPlan integrator;
  core::IntegratorWorkspace integrator_workspace;
  core::StepReport work;  ///< of all steps of this object
  std::vector<double> end_depths;  ///< of an implicit step, by pair of `frame.surface` [m]

  // Results at the current state; in a frame of their own, so that reading them cannot disturb stepping.
  Frame pulled;
  core::ForceSample pulled_sample;
  bool pulled_contacts = false;
  bool pulled_fields = false;
  std::optional<Division> division;  ///< views `pulled`
  std::vector<Mesh> meshes;
  bool pulled_meshes = false;
  std::function<bool(const Box&)> shown;
  std::vector<std::string> warnings;
  UnmetContacts unmet;
  SearchCounts searches;      ///< of the meshes of this state,
  SearchCounts all_searches;  ///< and of all so far
  bool coarse_noted = false;  ///< in the warnings
  bool divided_noted = false;
  std::optional<double> created_before;  ///< energy unaccounted for where stepping began; none: not looked at yet [J]

  // Steps.
  Impl(Scene s, SimulationOptions o);
  StageContext context();
  void step();
  void make_step();
  void begin_step();
  void refine_step();
  void integrate();
  void advance_particles(double begin, double h);
  /// Energies at a time within a step, and the contacts then.
  struct Measured {
    Energies energies;
    std::vector<collision::ContactSurface::Summary> contacts;
  };
  Measured measure_within(double at);
  Measured advance_divided(double begin, double h, int halvings, const Measured& first);
  [[nodiscard]] bool creates_energy(const Energies& before, const core::Ledger& ledger, const Energies& now) const;
  void book_contacts();
  void book_implicit(double end, double h);
  void evaluate_forces(const core::ParticleState& at_state, double at, core::ForceSample& out);
  core::ImplicitContact implicit_contact();
  void commit_friction();
  void book_work(const core::StepReport& report);
  [[nodiscard]] double frame_time() const { return 1.0 / scene.frame_rate; }
  [[nodiscard]] double dt() const { return std::ldexp(frame_time(), -state.halvings); }
  /// For which friction acts unchanged [s]: explicit steps of a size that is known.
  [[nodiscard]] double held_step() const {
    const core::Integrator method = integrator.settings.method;
    return method == core::Integrator::Adaptive || core::is_implicit(method) ? 0.0 : dt();
  }
  [[nodiscard]] double time() const { return (state.frame - 1) * frame_time() + state.substep * dt(); }
  [[nodiscard]] bool contact_on() const { return !options.skip || plan.on(Stage::FindContacts); }

  // Bodies, laws between them, and sleep: simulation_bodies.cpp.
  void form_bodies();
  void leave_overlapping();
  void form_laws();
  void form_awake();
  void part_bodies();
  void divide_anew();
  void update_links();
  [[nodiscard]] std::vector<std::uint32_t> due_cuts() const;
  void release_pins();
  void switch_contacts();
  void make_appear();
  void hold_volumes();
  std::vector<std::uint32_t> wake(const std::vector<std::uint32_t>& which);
  void wake_loaded();
  void wake_touched();
  void lay_to_sleep();

  // Restored and changed states: simulation_changes.cpp.
  void take(State other);
  void adopt(State other);
  void set_particles(const ParticleChange& change);
  void set_loads(const core::Loads& loads);

  // Checks after a step: simulation_checks.cpp.
  void note_coarse_steps();
  void check_fixed_step();
  void check_fixed_push();
  const Frame& seen_contacts(const StageContext& quiet);
  void watch_pressing();
  [[nodiscard]] bool energies_balance() const;
  void check_energy();
  void check_divergence();
  [[noreturn]] void throw_too_coarse(const TooCoarse& found);
  [[noreturn]] void throw_passing(const RunRecord::Overload& found);
  [[noreturn]] void throw_diverged(const core::Divergence& divergence, std::uint64_t step_number, double at) const;
  /// For evaluations that are not part of a step.
  StageContext quiet_context(Profile& unused) {
    StageContext quiet{model, bodies, rules, executor, unused, options.skip, StepTiming::None};
    quiet.time = time();
    return quiet;
  }

  // Results at the present state: simulation_results.cpp.
  void place_cameras();
  void renew_pulled();
  void drop_results();
  void pull_contacts();
  void pull_fields();
  const Division& pull_division();
  const std::vector<Mesh>& pull_meshes();
  double contact_energy();
  Energies energies();
  /// Of the state within a step, at a time of it; leaves the contacts there in `pulled`. Without springs of friction, which implicit steps do not have.
  Energies energies_within(double at);
  std::optional<RunRecord::Overload> book_audits();
};

}  // namespace supple::scenes
