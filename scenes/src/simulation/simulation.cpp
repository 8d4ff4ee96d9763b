#include "simulation/simulation_impl.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "model/model_faults.h"
#include "simulation/audits.h"
#include "simulation/contact_work.h"
#include "simulation/held_volumes.h"
#include "simulation/pair_contacts.h"
#include "simulation/pieces.h"
#include "simulation/reach.h"
#include "simulation/stages.h"
#include "supple/core/cpu_time.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"

namespace supple::scenes {
namespace {

constexpr std::uint64_t kTimedEvery = 61;  // see StageProfile::cpu_s
constexpr std::chrono::milliseconds kLongStep(1);  // a thousand readings of the clock

/// Measured times of the stages of a step, each with two readings of the clock [s].
double measured_inside(const Profile& profile) {
  double sum = 0.0;
  for (std::size_t s = 0; s < static_cast<std::size_t>(Stage::Integrate); ++s) {
    const StageProfile& p = profile[s];
    sum += p.first_s + p.later_s + p.apart_s + 2.0 * process_cpu_clock_cost() * static_cast<double>(p.timed + p.apart);
  }
  return sum;
}

}  // namespace

Simulation::Impl::Impl(Scene s, SimulationOptions o)
    : scene(std::move(s)),
      model(build_model(scene, o.memory)),
      options(std::move(o)),
      executor(options.threads),
      plan(plan_step(scene, model, requested_outputs(scene))),
      laws(model.interactions),
      particles(model.particles),
      frame(model, bodies),
      workspace(model.particles, laws),
      integrator(plan_integrator(scene, model)),
      pulled(model, bodies) {
  if (core::is_implicit(integrator.settings.method)) model.reaction.friction_speed = stick_speed(scene, model);
  if (scene.output.meshing.method == MeshingName::Delaunay && !options.delaunay) {
    ModelFaults faults(scene);
    faults.add("output.meshing.method", "expected a program with the component supple_cgal for delaunay", "one without it",
               "install libcgal-dev and build again, or use method: cubes");
    faults.raise();
  }
  state.particles = model.initial;
  state.links = core::unbroken(model.links);
  state.broken_for.assign(model.links.size(), 0.0);
  std::uint32_t volumes = 0;
  for (ObjectModel& object : model.objects) {
    object.first_volume = volumes;
    volumes += std::max<std::uint32_t>(1, static_cast<std::uint32_t>(object.target.size()));
  }
  state.volumes.resize(volumes);
  form_bodies();
  measure_targets(context(), state.particles, state.volumes, pulled, model);
  for (const Body& body : bodies) state.samples.push_back(fresh_samples(body));
  if (scene.sleep) state.sleep.reset(bodies.size());
  form_awake();
  state.halvings = (options.questions ? wanted_halvings : first_halvings)(scene, model, integrator, laws, state);
  leave_overlapping();
  book_reach(model, state, 0.0, state.record);
  look_for_solids(model, state.record);
  book_audits();
  created_before = 0.0;
  place_cameras();
  warnings = find_odd_start(scene, context(), state.particles, pulled);
}

StageContext Simulation::Impl::context() {
  return {.model = model,
          .bodies = bodies,
          .rules = rules,
          .executor = executor,
          .profile = profile,
          .skip = options.skip,
          .timing = timing,
          .delaunay = &options.delaunay,
          .interrupt = options.interrupt,
          .time = time(),
          .step = held_step(),
          .awake = awake.size() < bodies.size() ? &awake : nullptr,
          .sticks = &state.sticks};
}

/// A step, and the audits of a frame that it ends. Steps are measured as a whole with all stages inside, or not at all. Those in
/// which all sleep are no calls, so that each one measured stands for those up to the next.
void Simulation::Impl::step() {
  StageProfile& p = profile[static_cast<std::size_t>(Stage::Integrate)];
  timing = options.profile || step_was_long ? StepTiming::Apart : steps_made % kTimedEvery == 0 ? StepTiming::Sample : StepTiming::None;
  const bool timed = timing != StepTiming::None;
  const auto started = std::chrono::steady_clock::now();
  const std::uint64_t calls = p.calls;
  const double inside = timed ? measured_inside(profile) : 0.0, begin = timed ? process_cpu_seconds() : 0.0;
  try {
    make_step();
  } catch (const Interrupted&) {  // in the middle of the step
    drop_results();
    if (last_frame.record.valid) take(last_frame);
    throw;
  }
  ++steps_made;
  const double end = timed ? process_cpu_seconds() : 0.0;
  const double taken = timed ? end - begin - process_cpu_clock_cost() - (measured_inside(profile) - inside) : 0.0;
  if (timed && p.calls == calls) p.apart_s += taken * static_cast<double>(timing == StepTiming::Apart ? 1 : kTimedEvery);
  if (timed && p.calls > calls) p.book(taken, timing == StepTiming::Apart);
  timing = StepTiming::None;
  step_was_long = std::chrono::steady_clock::now() - started > kLongStep;
  if (state.substep == 0) {
    const double before = process_cpu_seconds();
    const std::optional<RunRecord::Overload> passing = book_audits();
    p.apart_s += process_cpu_seconds() - before;
    if (passing && scene.contact.core == CoreName::Soft) throw_passing(*passing);
    check_energy();
  }
  p.scale();
}

void Simulation::Impl::make_step() {
  begin_step();
  if (awake.empty()) {
    frame.surface.clear();
    frame.traction_force.clear();
  } else {
    book_reach(model, state, 0.0, state.record);
    const std::vector<Vec3> before = state.particles.velocity;
    integrate();
    // Forces may be found at trial places, which differ from those between the ends of the step by what the change of velocity makes.
    constexpr double kTrials = 2.0;
    book_reach(model, state, kTrials * dt() * largest_difference(before, state.particles.velocity), state.record);
  }
  ++state.steps;
  ++state.substep;
  check_divergence();
  check_fixed_step();
  book_contacts();
  commit_friction();
  wake_touched();
  watch_pressing();
  update_links();
  hold_volumes();
  lay_to_sleep();
  make_appear();
  if (state.substep == (1 << state.halvings)) {
    look_for_solids(model, state.record);
    state.substep = 0;
    ++state.frame;
  }
}

/// The length of the step, what its checks compare with, and what of the scene takes part in it.
void Simulation::Impl::begin_step() {
  drop_results();
  release_pins();
  switch_contacts();
  if (state.substep == 0) {
    last_frame = state;
    state.halvings = std::max(0, first_halvings(scene, model, integrator, laws, state) + options.finer);
    note_coarse_steps();
  } else {
    refine_step();
  }
  if (!created_before && energies_balance()) created_before = unaccounted_energy(energies().total(), state);
  if (fixes_step(scene)) {
    step_begin = state.particles;
    if (!state.kick.valid) check_fixed_push();  // else the step before has done so
  }
  if (bodies.size() != model.objects.size() && note_apart(context(), state.particles, pulled, state.apart)) divide_anew();
  wake_loaded();
}

/// Stages 1 to 8 for what is awake.
void Simulation::Impl::integrate() {
  const bool implicit = core::is_implicit(integrator.settings.method);
  if (implicit && fixes_step(scene) && contact_on()) {
    (void)advance_divided(time(), dt(), core::halvings(scene.time_step.max_substeps, 1 << state.halvings), measure_within(time()));
  } else {
    advance_particles(time(), dt());
    if (implicit) book_implicit(time() + dt(), dt());
  }
  StageProfile& p = profile[static_cast<std::size_t>(Stage::Integrate)];
  ++p.calls;
  for (const std::uint32_t i : awake) p.visited += bodies[i].origin.is_group() ? 0 : bodies[i].particle.size();
  p.present += particles.size();
}

/// Throws, with the last frame as the state, where particles are farther or faster than any of the scene can be.
void Simulation::Impl::check_divergence() {
  const double until = std::max(scene.duration, time());
  const core::Divergence divergence =
      core::find_divergence(model.particles, state.particles, model.believable.distance(until), model.believable.fastest(until));
  if (!divergence.found) return;
  const std::uint64_t step = state.steps;
  const double at = time();
  if (last_frame.record.valid) take(last_frame);
  throw_diverged(divergence, step, at);
}

/// Implicit steps have booked their contacts themselves; where all sleeps nothing changes.
void Simulation::Impl::book_contacts() {
  const bool implicit = core::is_implicit(integrator.settings.method);
  if (awake.empty() || !implicit) book_pair_contacts(context(), frame, {.end = time(), .size = dt(), .mean_forces = implicit, .depths = {}}, state);
  if (awake.empty() || implicit) return;
  book_pair_work(frame.surface.summary, frame.pair_power, dt(), state.record);
  if (state.substep == (1 << state.halvings) && contact_on()) friction.look(context(), frame);
}

/// One call of the integrator. Implicit methods book what contacts dissipate.
void Simulation::Impl::advance_particles(double begin, double h) {
  // Velocity Verlet observes this by itself; an adaptive integrator chooses steps of its own inside this one.
  const core::Integrator method = integrator.settings.method;
  const bool whole = method != core::Integrator::Symplectic && method != core::Integrator::Adaptive;
  awake_laws.load_span = whole ? std::array{begin, begin + h} : std::array<double, 2>{};
  const core::ForceModel forces = [this](const core::ParticleState& at_state, double at, core::ForceSample& out) {
    evaluate_forces(at_state, at, out);
  };
  core::ImplicitContact contact = implicit_contact();
  EndDepths depths;
  if (contact.find) {
    contact.find = [&depths, find = std::move(contact.find)](const core::ParticleState& pose, double at, core::ContactPoints& out) {
      find(pose, at, out);
      depths.predict(pose, out);
    };
  }
  const core::StepReport report = core::advance(integrator.settings, {particles, awake_laws, forces, contact.find ? &contact : nullptr, model.led}, begin, h,
                                                {state.particles, state.kick, state.ledger}, {executor, workspace, integrator_workspace});
  book_work(report);
  if (!core::is_implicit(method)) return;
  end_depths = depths.at_end(state.particles, frame.surface.summary);
  frame.pair_power.resize(contact.load.size());
  frame.traction_force.resize(contact.load.size());
  frame.friction_speed.resize(contact.load.size());
  for (std::size_t k = 0; k < contact.load.size(); ++k) {
    frame.pair_power[k] = contact.load[k].dissipated / h;
    frame.traction_force[k] = contact.load[k].force;
    const double friction_of_pair = collision::material_of(frame.bodies, rules, frame.surface.summary[k].bodies).friction;
    frame.friction_speed[k] = friction_of_pair > 0.0 ? contact.load[k].stick_speed : 0.0;
  }
}

/// Whether a step from `before` and `ledger` to the present state gave the scene energy: its contacts were not those that it was made with.
bool Simulation::Impl::creates_energy(const Energies& before, const core::Ledger& ledger, const Energies& now) const {
  constexpr double kShare = 0.1;  // of the energy that takes part
  if (!energies_balance()) return false;
  const double given = state.ledger.external_work - ledger.external_work, lost = state.ledger.dissipated - ledger.dissipated;
  const double part = before.kinetic + before.contact + std::abs(given);
  return now.total() - before.total() - given + lost > kShare * part + 1e-9 * std::abs(before.total());
}

Simulation::Impl::Measured Simulation::Impl::measure_within(double at) {
  const Energies energies = energies_within(at);
  return {energies, pulled.surface.summary};
}

/// An implicit step that the scene fixes. Contact is found once in a step, at a predicted pose: where bodies pass each other within it, or contact there
/// gives them energy, it is made as two steps of half its size, and so on. @param halvings  how often at most   @param first  the state before
/// @return the state after
/// @throws Error{Diverged} where that is not enough
Simulation::Impl::Measured Simulation::Impl::advance_divided(double begin, double h, int halvings, const Measured& first) {
  const State before = state;
  advance_particles(begin, h);
  Profile unused{};
  StageContext quiet = quiet_context(unused);
  quiet.time = begin + h;
  const TakenStep step{.before = before.particles, .after = state.particles, .end = begin + h, .size = h};
  Measured last = measure_within(begin + h);
  const EndContacts ends{.before = first.contacts, .after = last.contacts};
  const auto missed = find_missed_contact(quiet, step, state.samples, pulled, &ends, pulled);
  if (missed && halvings == 0) throw_too_coarse(*missed);
  if (halvings > 0 && (missed || creates_energy(first.energies, before.ledger, last.energies))) {
    if (!divided_noted) {
      divided_noted = true;
      warnings.push_back("time_step.substeps: steps of " + short_text(h) + " s pass contacts; those that do are divided (first at frame " +
                         std::to_string(state.frame) + ')');
    }
    state = before;
    const Measured middle = advance_divided(begin, 0.5 * h, halvings - 1, first);
    return advance_divided(begin + 0.5 * h, 0.5 * h, halvings - 1, middle);
  }
  book_implicit(begin + h, h);
  return last;
}

/// What the contacts of an implicit step did, before it is divided no further.
void Simulation::Impl::book_implicit(double end, double h) {
  friction.look(context(), frame);
  book_pair_work(frame.surface.summary, frame.pair_power, h, state.record);
  book_pair_contacts(context(), frame, {.end = end, .size = h, .mean_forces = true, .depths = end_depths}, state);
}

/// Substeps stay on the grid of the frame.
void Simulation::Impl::refine_step() {
  state.halvings -= options.finer;
  const int next = next_halvings(scene, model, integrator, laws, state) + options.finer;
  state.halvings += options.finer;
  const int halvings = std::max(state.halvings, next);
  state.substep <<= halvings - state.halvings;
  state.halvings = halvings;
}

void Simulation::Impl::evaluate_forces(const core::ParticleState& at_state, double at, core::ForceSample& out) {
  out.reset(particles.size());
  if (!options.skip || plan.on(Stage::Interact) || !added_loads.empty()) {
    StageProfile& p = profile[static_cast<std::size_t>(Stage::Interact)];
    StageTimer timer(p, timing);
    const core::InteractionCounts counts = core::accumulate_interactions(particles, at_state, awake_laws, executor, workspace, out.internal);
    core::add_external_loads(particles, awake_laws, at, out.external);
    p.visited += counts.pairs_visited;
    p.present += counts.pairs_present;
  }
  if (contact_on() && !core::is_implicit(integrator.settings.method)) {
    StageContext now = context();
    now.time = at;
    find_contact_surface(now, at_state, state.samples, frame, false);
    stages::react(now, frame, out);
  }
}

/// Contact as a part of an implicit step; null where the method is explicit or nothing touches.
core::ImplicitContact Simulation::Impl::implicit_contact() {
  core::ImplicitContact contact{.find = {}, .stick_speed = model.reaction.friction_speed, .slow_slip = integrator.slow_slip};
  if (!core::is_implicit(integrator.settings.method)) return contact;
  frame.surface.clear();
  if (!contact_on()) return contact;
  contact.find = [this](const core::ParticleState& pose, double at, core::ContactPoints& out) {
    StageContext now = context();
    now.time = at;
    find_contact_surface(now, pose, state.samples, frame, false);
    stages::linearise(now, frame, out);
  };
  return contact;
}

/// After a step: springs of friction yield and follow their contacts. What the dissipative loads put into them is not lost.
void Simulation::Impl::commit_friction() {
  const collision::StickRule& rule = model.reaction.stick;
  if (!(rule.stiffness > 0.0) || awake.empty() || !contact_on() || core::is_implicit(integrator.settings.method)) return;
  if (integrator.settings.method != core::Integrator::Symplectic) {
    // The last trial of other methods need not be the state they end with.
    std::vector<implicit::SampleState> trial = state.samples;
    find_contact_surface(context(), state.particles, trial, frame, false);
  }
  std::vector<std::uint8_t> resting;
  if (awake.size() < bodies.size()) {
    resting.assign(bodies.size(), 1);
    for (const std::uint32_t i : awake) resting[i] = 0;
    resting.resize(frame.bodies.size(), 1);
  }
  const double before = collision::stick_energy(rule, state.sticks);
  collision::commit_sticks(frame.bodies, rules, frame.surface, rule, resting, state.sticks);
  state.ledger.dissipated -= collision::stick_energy(rule, state.sticks) - before;
}

void Simulation::Impl::book_work(const core::StepReport& report) {
  work.substeps += report.substeps;
  work.rejected += report.rejected;
  work.force_evaluations += report.force_evaluations;
  work.newton_iterations += report.newton_iterations;
  work.gradient_iterations += report.gradient_iterations;
  work.last_correction = std::max(work.last_correction, report.last_correction);
  if (report.within_tolerance) return;
  work.within_tolerance = false;
  if (integrator.settings.method != core::Integrator::Adaptive) return;
  if (last_frame.record.valid) take(last_frame);
  throw Error(ErrorKind::Limit,
              Fault{.place = scene.source.string(),
                    .key = "time_step.max_substeps",
                    .expected = "expected the error of a step within integrator.tolerance = " +
                                std::to_string(integrator.settings.tolerance),
                    .found = "more in steps of " + std::to_string(dt() / integrator.settings.max_substeps) +
                             " s at frame " + std::to_string(state.frame),
                    .hint = "raise integrator.tolerance or time_step.max_substeps, or soften stiff interactions and contacts"});
}

Simulation::Simulation(Scene scene, SimulationOptions options)
    : impl_(std::make_unique<Impl>(std::move(scene), std::move(options))) {}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

const Scene& Simulation::scene() const { return impl_->scene; }
const Model& Simulation::model() const { return impl_->model; }
const State& Simulation::state() const { return impl_->state; }
const std::vector<Body>& Simulation::bodies() const { return impl_->bodies; }
const core::Interactions& Simulation::laws() const { return impl_->laws; }
int Simulation::frame() const { return impl_->state.frame; }
double Simulation::time() const { return impl_->time(); }
double Simulation::time_step() const { return impl_->dt(); }
std::uint64_t Simulation::state_hash() const { return impl_->state.hash(); }
void Simulation::expect_steps() const {
  (void)first_halvings(impl_->scene, impl_->model, impl_->integrator, impl_->laws, impl_->state);
}
void Simulation::step() { impl_->step(); }

void Simulation::step_frame() { advance_to(impl_->state.frame + 1); }

bool Simulation::advance_to(int frame, const std::function<bool()>& go_on) {
  while (impl_->state.frame < frame) {
    impl_->step();
    if (impl_->state.frame < frame && go_on && !go_on()) return false;
  }
  return true;
}

void Simulation::adopt(State state) { impl_->adopt(std::move(state)); }

void Simulation::set_particles(const ParticleChange& change) { impl_->set_particles(change); }

void Simulation::set_loads(const core::Loads& loads) { impl_->set_loads(loads); }

void Simulation::restore(State state) {
  SUPPLE_EXPECTS(state.particles.size() == impl_->model.particles.size());
  SUPPLE_EXPECTS(state.links.broken.size() == impl_->model.links.size());
  SUPPLE_EXPECTS(state.broken_for.size() == impl_->model.links.size());
  SUPPLE_EXPECTS(state.volumes.size() == impl_->state.volumes.size());
  impl_->drop_results();
  renumber_solids(impl_->model, state);
  impl_->take(std::move(state));
  // Which samples there are depends on the solids; a state may be drawn with others.
  for (std::size_t i = 0; i < impl_->bodies.size(); ++i) {
    implicit::SampleState& samples = impl_->state.samples[i];
    if (samples.distance.size() != impl_->bodies[i].samples.size()) samples = fresh_samples(impl_->bodies[i]);
  }
}

const std::vector<Mesh>& Simulation::meshes() { return impl_->pull_meshes(); }

const collision::ContactSurface& Simulation::contacts() {
  impl_->pull_contacts();
  return impl_->pulled.surface;
}

std::vector<double> Simulation::energy_estimates() {
  impl_->pull_contacts();
  const Frame& frame = impl_->pulled;
  return collision::estimate_energies(frame.bodies, frame.candidates, impl_->model.contact, impl_->executor, frame.surface);
}

std::span<const collision::ContactBody> Simulation::contact_bodies() {
  impl_->pull_contacts();
  return impl_->pulled.bodies;
}

const std::vector<Vec3>& Simulation::contact_forces() {
  impl_->pull_contacts();
  return impl_->pulled.traction_force;
}

const std::vector<double>& Simulation::contact_powers() {
  impl_->pull_contacts();
  return impl_->pulled.pair_power;
}

const std::vector<implicit::Field>& Simulation::fields() {
  impl_->pull_fields();
  return impl_->pulled.field;
}

const Division& Simulation::division() { return impl_->pull_division(); }

void Simulation::add_field_content(std::uint32_t body, ContentWords& words) {
  impl_->pull_fields();
  impl_->pull_contacts();
  SUPPLE_EXPECTS(body < impl_->pulled.bodies.size());
  scenes::add_field_content(impl_->bodies, impl_->pulled, body, words);
}

const core::Loads& Simulation::contact_loads() {
  impl_->pull_contacts();
  impl_->pulled_sample.internal.force.resize(impl_->model.particles.size(), Vec3::Zero());
  impl_->pulled_sample.internal.torque.resize(impl_->model.particles.size(), Vec3::Zero());
  return impl_->pulled_sample.internal;
}

const IntegratorPlan& Simulation::integrator() const { return impl_->integrator; }
const std::map<std::pair<std::string, std::string>, double>& Simulation::friction_speeds() const { return impl_->friction.speeds(); }
const core::StepReport& Simulation::integration() const { return impl_->work; }

double Simulation::cell() const { return impl_->model.cell; }

void Simulation::set_cells(int cells) {
  SUPPLE_EXPECTS(cells > 0);
  impl_->pull_fields();
  Box all;
  for (std::size_t i = 0; i < surface_count(impl_->bodies); ++i) {
    if (!impl_->bodies[i].skeleton.primitive.empty()) all = all.united(impl_->pulled.field[i].surface_box());
  }
  if (!all.empty()) {
    impl_->model.cell = all.extent().maxCoeff() / cells;
    impl_->model.thinnest.reset();
    for (ObjectModel& object : impl_->model.objects) object.cell = impl_->model.cell;
  }
  impl_->pulled_meshes = false;
}

void Simulation::set_cell(double cell) {
  SUPPLE_EXPECTS(cell > 0.0);
  if (cell == impl_->model.cell) return;
  impl_->model.cell = cell;
  impl_->model.thinnest.reset();
  for (ObjectModel& object : impl_->model.objects) {
    if (!object.own_cell) object.cell = cell;
  }
  impl_->pulled_meshes = false;
}

void Simulation::set_shown(std::function<bool(const Box&)> shown) {
  impl_->shown = std::move(shown);
  impl_->pulled_meshes = false;
}

Energies Simulation::energies() { return impl_->energies(); }

std::vector<std::string> Simulation::warnings() const {
  std::vector<std::string> warnings = impl_->warnings;
  impl_->unmet.add_to(impl_->model.contact.error, warnings);
  add_missed_volumes(impl_->model, impl_->state.volumes, warnings);
  return warnings;
}

const SearchCounts& Simulation::searches() const { return impl_->searches; }

Audits Simulation::audits() const { return audits_of(impl_->state.record); }

Profile Simulation::profile() const { return impl_->profile; }

StageProfile& Simulation::profile(Stage stage) { return impl_->profile[static_cast<std::size_t>(stage)]; }

}  // namespace supple::scenes
