#include "supple/scenes/simulation.h"

#include <algorithm>
#include <cmath>

#include "frame.h"
#include "held_volumes.h"
#include "model_faults.h"
#include "overload.h"
#include "read_scene_faults.h"
#include "rest.h"
#include "warnings.h"
#include "supple/core/error.h"
#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

constexpr std::uint64_t kStepsPerRefinement = 4;
constexpr double kDampedShare = 0.4;  // of the inverse of d v: what a step may take of a speed by damping

int log2_of(int n) {
  int k = 0;
  while ((1 << k) < n) ++k;
  return k;
}

/// How to mend what asks for the smallest step.
std::string what_needs(const core::StepLimits& limits, double damping) {
  const double step = core::stable_step(limits);
  if (step == core::stable_step({.length = limits.length, .speed = limits.speed})) {
    return "slow down what moves " + number_text(limits.speed) + " m/s past lengths of " + number_text(limits.length) + " m";
  }
  if (step == core::stable_step({.angular_speed = limits.angular_speed})) return "slow down what turns " + number_text(limits.angular_speed) + " rad/s";
  if (damping > 2.0) return "lower the dissipation of contact (or ask for a higher restitution)";
  return "soften the stiffest interaction or contact, or make the lightest particle heavier";
}

double share(double value, double scale) { return scale > 0.0 ? value / scale : value; }

}  // namespace

struct Simulation::Impl {
  Scene scene;
  Model model;
  SimulationOptions options;
  Executor executor;
  StepPlan plan;
  Profile profile{};
  State state;
  State last_frame;
  // What State::links and State::apart leave of the model.
  core::Interactions laws;
  // What State::sleep leaves of these: particles that rest are pinned, and nothing is computed between them.
  core::ParticleSet particles;
  core::Interactions awake_laws;
  std::vector<std::uint32_t> awake;          ///< bodies, ascending
  std::vector<collision::BodyPair> tied;     ///< bodies that laws act between
  std::vector<Body> bodies;
  collision::ContactRules rules;
  Frame frame;
  OverloadWatch watch;
  core::InteractionWorkspace workspace;
  IntegratorPlan integrator;
  core::IntegratorWorkspace integrator_workspace;
  core::StepReport work;  ///< of all steps of this object

  // Results pulled at the current state; their own frame, so that pulling cannot disturb stepping.
  Frame pulled;
  core::ForceSample pulled_sample;
  bool pulled_contacts = false;
  bool pulled_fields = false;
  std::vector<Mesh> meshes;
  bool pulled_meshes = false;
  std::function<bool(const Box&)> shown;
  std::vector<std::string> warnings;

  Impl(Scene s, SimulationOptions o)
      : scene(std::move(s)),
        model(build_model(scene)),
        options(std::move(o)),
        executor(options.threads),
        plan(plan_step(scene, model, requested_outputs(scene))),
        laws(model.interactions),
        particles(model.particles),
        frame(model, bodies),
        workspace(model.particles, laws),
        integrator(plan_integrator(scene, model)),
        pulled(model, bodies) {
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
    measure_targets(context(), state.particles, pulled, model);
    for (const Body& body : bodies) state.samples.push_back({.distance = std::vector<double>(body.samples.size(), -1.0)});
    if (scene.sleep) state.sleep.reset(bodies.size());
    form_awake();
    choose_step();
    book_audits();
    warnings = find_odd_start(context(), state.particles, pulled);
  }

  StageContext context() {
    return {.model = model,
            .bodies = bodies,
            .rules = rules,
            .executor = executor,
            .profile = profile,
            .skip = options.skip,
            .every_call = options.profile,
            .delaunay = &options.delaunay,
            .time = time(),
            .awake = awake.size() < bodies.size() ? &awake : nullptr,
            .sticks = &state.sticks};
  }

  /// Bodies, rules and frames for the present pieces.
  void form_bodies() {
    bodies = make_bodies(model, parted_links(model, state.links, state.broken_for));
    fade_blends(model, state.links, state.broken_for, bodies);
    scale_kernels(model, state.volumes, bodies);
    watch.forget();
    rules = make_body_rules(model, bodies, state.apart);
    frame = Frame(model, bodies);
    pulled = Frame(model, bodies);
  }

  /// The laws that are left, and what is made from them.
  void form_laws() {
    laws = core::intact(model.interactions, model.links, state.links);
    form_awake();
  }

  /// What moves and acts while some bodies rest.
  void form_awake() {
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
    tie_bodies();
  }

  void take(State other) {
    state = std::move(other);
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

  /// Between two steps: breaks and yields links. Seeds of the new pieces begin anew, and so do the forces.
  void update_links() {
    if (model.links.size() == 0) return;
    const bool fades = age_broken_links();
    const core::LinkChange change = core::update_links(model.particles, state.particles, laws, model.links, dt(),
                                                       state.links, state.ledger);
    if (change.any()) form_laws();
    if (change.any() || fades) state.kick.valid = false;
    if (change.broke == 0 && !fades) return;
    const std::vector<Body> before = std::move(bodies);
    form_bodies();
    if (scene.sleep) state.sleep.reset(bodies.size());
    form_awake();
    if (bodies.size() == before.size()) return;
    state.ledger.dissipated += collision::stick_energy(model.reaction.stick, state.sticks);  // bodies have other numbers now
    state.sticks = {};
    state.kick.valid = false;
    inherit_apart(before);
    std::vector<implicit::SampleState> samples;
    for (const Body& body : bodies) {
      const auto same = std::find_if(before.begin(), before.end(),
                                     [&body](const Body& old) { return old.particle == body.particle; });
      samples.push_back(same != before.end() ? state.samples[static_cast<std::size_t>(same - before.begin())]
                                             : implicit::SampleState{std::vector<double>(body.samples.size(), -1.0)});
    }
    state.samples = std::move(samples);
    rules = make_body_rules(model, bodies, state.apart);
    frame.pairs_present.reset();
  }

  /// Links that broke grow older, up to the time in which their blend fades. @return whether any did
  bool age_broken_links() {
    bool any = false;
    for (std::size_t k = 0; k < state.broken_for.size(); ++k) {
      if (state.links.broken[k] == 0) continue;
      const double fade = model.objects[model.particles.object[model.links.first[k]]].fade;
      if (!(state.broken_for[k] < fade)) continue;
      state.broken_for[k] = std::min(state.broken_for[k] + dt(), fade);
      any = true;
    }
    return any;
  }

  /// Two pieces are apart when those that they broke from were.
  void inherit_apart(const std::vector<Body>& before) {
    const auto origin = [&before](const Body& body) {
      for (const Body& old : before) {
        if (std::binary_search(old.particle.begin(), old.particle.end(), body.particle.front())) return old.particle.front();
      }
      return body.particle.front();
    };
    const ApartPairs old_pairs = std::move(state.apart);
    state.apart.clear();
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (model.objects[bodies[i].object].separate) continue;
      for (std::size_t j = i + 1; j < bodies.size() && bodies[j].object == bodies[i].object; ++j) {
        const auto [a, b] = std::minmax({origin(bodies[i]), origin(bodies[j])});
        if (std::binary_search(old_pairs.begin(), old_pairs.end(), collision::BodyPair{a, b})) {
          state.apart.push_back({bodies[i].particle.front(), bodies[j].particle.front()});
        }
      }
    }
  }

  /// Pieces of one object whose surfaces are in separate boxes at the start of a step touch from then on.
  void note_apart() {
    if (bodies.size() == model.objects.size()) return;
    ApartPairs fresh;
    std::vector<std::uint8_t> placed(bodies.size(), 0);
    const auto surface_box = [&](std::size_t i) {
      if (placed[i] == 0) place_and_index(context(), state.particles, i, pulled);
      placed[i] = 1;
      return pulled.field[i].surface_box();
    };
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const ObjectModel& object = model.objects[bodies[i].object];
      if (!object.collides || object.separate || bodies[i].skeleton.primitive.empty()) continue;
      for (std::size_t j = i + 1; j < bodies.size() && bodies[j].object == bodies[i].object; ++j) {
        const collision::BodyPair pair{bodies[i].particle.front(), bodies[j].particle.front()};
        if (bodies[j].skeleton.primitive.empty() || std::binary_search(state.apart.begin(), state.apart.end(), pair)) continue;
        if (!surface_box(i).overlaps(surface_box(j))) fresh.push_back(pair);
      }
    }
    if (fresh.empty()) return;
    state.apart.insert(state.apart.end(), fresh.begin(), fresh.end());
    std::sort(state.apart.begin(), state.apart.end());
    rules = make_body_rules(model, bodies, state.apart);
    frame.pairs_present.reset();
  }

  [[nodiscard]] double frame_time() const { return 1.0 / scene.frame_rate; }
  [[nodiscard]] double dt() const { return std::ldexp(frame_time(), -state.halvings); }
  [[nodiscard]] double time() const { return (state.frame - 1) * frame_time() + state.substep * dt(); }
  [[nodiscard]] bool contact_on() const { return !options.skip || plan.on(Stage::FindContacts); }

  /// The step of the next frame interval: frame time / 2^k by the stability limits (or as the scene fixes it).
  void choose_step() {
    const TimeStepDesc& desc = scene.time_step;
    if (desc.substeps) {
      state.halvings = log2_of(*desc.substeps);
      return;
    }
    if (desc.size) {
      state.halvings = core::halvings(frame_time(), *desc.size);
      return;
    }
    state.halvings = needed_halvings();
  }

  /// Within a frame a step may only become finer: substeps stay on the grid of the frame.
  void refine_step() {
    if (scene.time_step.substeps || scene.time_step.size || state.steps % kStepsPerRefinement != 0) return;
    const int needed = needed_halvings();
    if (needed <= state.halvings) return;
    state.substep <<= needed - state.halvings;
    state.halvings = needed;
  }

  /// The coarsest step that is stable now; laws get stiffer where particles come close.
  [[nodiscard]] int needed_halvings() const {
    const TimeStepDesc& desc = scene.time_step;
    const core::Speeds speeds = core::largest_speeds(model.particles, state.particles);
    double frequency = integrator.limiting_frequency, damping = 1.0;
    const core::Integrator method = integrator.settings.method;
    if (method == core::Integrator::Symplectic || method == core::Integrator::RungeKutta4) {
      // Damping d v p takes at most d v w of its speed in a second, w the contact's frequency: fast where d v is large.
      damping = std::max(1.0, kDampedShare * model.largest_dissipation * (speeds.linear + model.solid_speed));
      frequency = std::max(frequency, std::hypot(core::largest_frequency(model.particles, state.particles, laws),
                                                 model.contact_frequency * damping));
    }
    const core::StepLimits limits = step_limits(scene, model, frequency, speeds);
    const double step = core::stable_step(limits);
    const bool possible = step > 0.0;
    const int k = possible && step < frame_time() ? core::halvings(frame_time(), step) : 0;
    if (!possible || k > log2_of(desc.max_substeps)) {
      throw Error(ErrorKind::Limit,
                  Fault{.place = place_of(scene, "time_step.max_substeps"),
                        .key = "time_step.max_substeps",
                        .expected = "expected a stable step with at most " + std::to_string(desc.max_substeps) +
                                    " substeps a frame",
                        .found = "one of " + number_text(step) + " s (" + (possible ? number_text(std::ldexp(1.0, k)) : "no number of") + " substeps) at frame " +
                                 std::to_string(state.frame),
                        .hint = "raise time_step.max_substeps, or " + what_needs(limits, damping)});
    }
    return k;
  }

  void evaluate_forces(const core::ParticleState& at_state, double at, core::ForceSample& out) {
    out.reset(particles.size());
    if (!options.skip || plan.on(Stage::Interact)) {
      StageProfile& p = profile[static_cast<std::size_t>(Stage::Interact)];
      StageTimer timer(p, options.profile);
      const core::InteractionCounts counts = core::accumulate_interactions(
          particles, at_state, awake_laws, at, executor, workspace, out.internal, out.external);
      p.visited += counts.pairs_visited;
      p.present += counts.pairs_present;
    }
    if (contact_on()) {
      StageContext now = context();
      now.time = at;
      find_contact_surface(now, at_state, state.samples, frame, false);
      apply_reactions(now, frame, out);
    }
  }

  /// Bodies that act on each other by laws, which makes them one island: the first of two objects with all others.
  void tie_bodies() {
    tied.clear();
    for (const auto& [a, b] : core::acting_objects(laws)) {
      std::uint32_t first = 0;
      while (first < bodies.size() && bodies[first].object != a && bodies[first].object != b) ++first;
      for (std::uint32_t i = first + 1; i < bodies.size(); ++i) {
        if (bodies[i].object == a || bodies[i].object == b) tied.push_back({first, i});
      }
    }
  }

  /// Wakes the islands of bodies. @return those that were asleep
  std::vector<std::uint32_t> wake(const std::vector<std::uint32_t>& which) {
    std::vector<std::uint32_t> rose = collision::wake(which, state.sleep);
    if (rose.empty()) return rose;
    form_awake();
    state.kick.valid = false;
    return rose;
  }

  /// Before a step: bodies under a load that changes in it, or near an obstacle that moves, are awake and not quiet.
  void wake_loaded() {
    if (!scene.sleep) return;
    std::vector<std::uint32_t> loaded;
    if (awake.size() < bodies.size()) loaded = find_stirred(context(), state.particles, frame);
    for (const core::ExternalLoad& load : laws.external) {
      if (!load.changes(time(), time() + dt())) continue;
      for (std::uint32_t i = 0; i < bodies.size(); ++i) {
        if (std::binary_search(bodies[i].particle.begin(), bodies[i].particle.end(), load.particle)) loaded.push_back(i);
      }
    }
    wake(loaded);
    for (const std::uint32_t i : loaded) state.sleep.quiet_for[i] = 0.0;
  }

  /// After a step: what an awake body touches wakes. With velocity Verlet it gets the half kick that its pins took.
  void wake_touched() {
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
    for (const std::uint32_t i : wake(touched)) {
      if (integrator.settings.method != core::Integrator::Symplectic) break;
      for (const std::uint32_t p : bodies[i].particle) {
        const Vec3 j = core::free_translation(particles.pinned[p], 0.5 * dt() * loads.force[p]);
        const Vec3 turn = core::free_rotation(particles.pinned[p], 0.5 * dt() * loads.torque[p]);
        state.particles.velocity[p] += j / particles.mass[p];
        state.particles.angular_momentum[p] += turn;
        state.ledger.pin_impulse += j;
        state.ledger.pin_angular_impulse += state.particles.position[p].cross(j) + turn;
      }
    }
  }

  /// After a step: islands that have been quiet for long enough stop, and what they had is booked as held and dissipated.
  void lay_to_sleep() {
    if (!scene.sleep || awake.empty()) return;
    std::vector<collision::BodyPair> joined = tied;
    for (const auto& s : frame.surface.summary) {
      if (s.force.norm() > 0.0) joined.push_back(s.bodies);
    }
    std::vector<collision::BodyMotion> motion = motions_of(bodies, awake, particles, state.particles, laws, time());
    for (const std::uint32_t i : awake) {
      // What still grows or shrinks does not rest.
      if (model.objects[bodies[i].object].holds_volume) motion[i].energy = std::numeric_limits<double>::infinity();
    }
    const std::vector<std::uint32_t> slept =
        collision::fall_asleep({scene.sleep->speed, scene.sleep->time}, dt(), motion, joined, state.sleep);
    if (slept.empty()) return;
    for (const std::uint32_t i : slept) {
      for (const std::uint32_t p : bodies[i].particle) {
        Vec3 &v = state.particles.velocity[p], &turn = state.particles.angular_momentum[p];
        const Vec3 momentum = particles.mass[p] * v;
        state.ledger.dissipated += 0.5 * momentum.dot(v) + 0.5 * turn.dot(core::angular_velocity(particles, state.particles, p));
        state.ledger.pin_impulse -= momentum;
        state.ledger.pin_angular_impulse -= state.particles.position[p].cross(momentum) + turn;
        v.setZero();
        turn.setZero();
      }
    }
    form_awake();
    state.kick.valid = false;
  }

  void step() {
    drop_results();
    if (state.substep == 0) {
      last_frame = state;
      choose_step();
    } else {
      refine_step();
    }
    note_apart();
    wake_loaded();
    // Velocity Verlet sees to it by itself; an adaptive integrator chooses steps of its own inside this one.
    const core::Integrator method = integrator.settings.method;
    const bool whole = method != core::Integrator::Symplectic && method != core::Integrator::Adaptive;
    awake_laws.load_span = whole ? std::array{time(), time() + dt()} : std::array<double, 2>{};
    const core::ForceModel forces = [this](const core::ParticleState& at_state, double at, core::ForceSample& out) {
      evaluate_forces(at_state, at, out);
    };
    if (awake.empty()) {
      frame.surface.clear();
    } else {
      StageProfile& p = profile[static_cast<std::size_t>(Stage::Integrate)];
      // Timed with the force evaluation inside, whose share `Simulation::profile` takes off again.
      StageTimer timer(p, options.profile);
      const core::StepReport report =
          core::advance(integrator.settings, particles, awake_laws, forces, time(), dt(), state.particles,
                        state.kick, state.ledger, executor, workspace, integrator_workspace);
      book_work(report);
      for (const std::uint32_t i : awake) p.visited += bodies[i].particle.size();
      p.present += particles.size();
    }
    ++state.steps;
    ++state.substep;
    const core::Divergence divergence =
        core::find_divergence(model.particles, state.particles, model.believable_distance, model.believable_speed);
    if (divergence.found) {
      const std::uint64_t step = state.steps;
      const double at = time();
      if (last_frame.record.valid) take(last_frame);
      throw_diverged(divergence, step, at);
    }
    commit_friction();
    wake_touched();
    watch_pressing();
    update_links();
    if (control_volumes(context(), state.particles, dt(), pulled, state.volumes)) scale_kernels(model, state.volumes, bodies);
    lay_to_sleep();
    if (state.substep == (1 << state.halvings)) {
      state.substep = 0;
      ++state.frame;
      book_audits();
    }
  }

  /// After a step: springs of friction yield and follow their contacts. What the dissipative loads put into them is not lost.
  void commit_friction() {
    const collision::StickRule& rule = model.reaction.stick;
    if (!(rule.stiffness > 0.0) || awake.empty() || !contact_on()) return;
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

  /// At the end of a step: pairs that press harder than they can hold are noted, and turned back by hard cores.
  void watch_pressing() {
    if (!contact_on()) return;
    add_unresolved(context(), scene.contact.rule, frame.surface, warnings);
    const bool barrier = scene.contact.core == CoreName::Barrier;
    if (barrier && integrator.settings.method != core::Integrator::Symplectic) {
      // The last trial of other methods need not be the state they end with.
      std::vector<implicit::SampleState> trial = state.samples;
      find_contact_surface(context(), state.particles, trial, frame, false);
    }
    watch.look(context(), frame, time(), state.record);
    if (barrier && hold_cores(context(), frame, state.particles, state.ledger, state.record)) state.kick.valid = false;
  }

  void book_work(const core::StepReport& report) {
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
                      .hint = "raise integrator.tolerance or time_step.max_substeps, or soften what is stiff"});
  }

  [[noreturn]] void throw_diverged(const core::Divergence& divergence, std::uint64_t step_number, double at) const {
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
                      .hint = scene.time_step.size || scene.time_step.substeps
                                  ? "the scene fixes its own time step; let it be auto"
                                  : "check stiffness, mass and strength of the objects concerned"});
  }

  void drop_results() {
    pulled_contacts = pulled_fields = pulled_meshes = false;
    meshes.clear();
  }

  void pull_contacts() {
    if (pulled_contacts) return;
    if (contact_on()) {
      std::vector<implicit::SampleState> trial = state.samples;
      Profile unused{};
      StageContext quiet{model, bodies, rules, executor, unused, options.skip, false};
      quiet.sticks = &state.sticks;
      quiet.time = time();
      find_contact_surface(quiet, state.particles, trial, pulled, true);
      pulled_sample.internal.reset(model.particles.size());
      apply_reactions(quiet, pulled, pulled_sample);
    }
    pulled_contacts = true;
    pulled_fields = false;
  }

  void pull_fields() {
    pull_contacts();
    if (pulled_fields) return;
    Profile unused{};
    place_and_index_all({model, bodies, rules, executor, unused, options.skip, false}, state.particles, pulled);
    pulled_fields = true;
  }

  const std::vector<Mesh>& pull_meshes() {
    if (pulled_meshes) return meshes;
    pull_fields();
    StageContext wanted = context();
    if (shown) wanted.shown = &shown;
    try {
      meshes = polygonise_objects(wanted, state.particles, laws, pulled);
    } catch (const Error& error) {
      rethrow_with_places(scene, error);
    }
    pulled_meshes = true;
    return meshes;
  }

  Energies energies() {
    pull_contacts();
    Energies e;
    e.kinetic = core::measure_motion(model.particles, state.particles).kinetic_energy;
    e.interaction = core::potential_energy(model.particles, state.particles, laws);
    for (const auto& s : pulled.surface.summary) e.contact += s.energy;
    e.contact += collision::stick_energy(model.reaction.stick, state.sticks);
    return e;
  }

  /// Compares motion and energy with frame 1 and with what the ledger booked; keeps the largest deviations.
  void book_audits() {
    RunRecord& r = state.record;
    const core::Motion motion = core::measure_motion(model.particles, state.particles);
    const double energy = energies().total();
    if (!r.valid) {
      r = {};
      r.valid = true;
      r.initial = motion;
      r.initial_energy = energy;
      r.objects.resize(model.objects.size());
    }
    const core::Ledger& ledger = state.ledger;
    const Vec3 momentum = motion.momentum - r.initial.momentum - ledger.external_impulse - ledger.pin_impulse;
    const Vec3 angular = motion.angular_momentum - r.initial.angular_momentum - ledger.external_angular_impulse -
                         ledger.pin_angular_impulse;
    r.momentum_error = std::max(r.momentum_error, momentum.norm());
    r.angular_momentum_error = std::max(r.angular_momentum_error, angular.norm());
    r.momentum_scale = std::max(r.momentum_scale, motion.momentum_scale);
    r.angular_momentum_scale = std::max(r.angular_momentum_scale, motion.angular_momentum_scale);
    r.largest_energy = std::max(r.largest_energy, energy);
    r.energy_error =
        std::max(r.energy_error, std::abs(energy - r.initial_energy - ledger.external_work + ledger.dissipated));
    r.most_dissipated = std::max(r.most_dissipated, ledger.dissipated);
    r.energy_returned = std::max(r.energy_returned, r.most_dissipated - ledger.dissipated);
    for (const auto& s : pulled.surface.summary) {
      r.contact_residual = std::max(r.contact_residual, s.residual);
      r.largest_overlap = std::max(r.largest_overlap, s.largest_overlap);
      double thickness = std::numeric_limits<double>::infinity();
      for (const std::uint32_t body : {s.bodies.a, s.bodies.b}) {
        if (body < bodies.size()) thickness = std::min(thickness, 2.0 * model.objects[bodies[body].object].iso_radius);
      }
      r.largest_overlap_share = std::max(r.largest_overlap_share, s.largest_overlap / thickness);
    }
    for (std::size_t i = 0; i < model.objects.size(); ++i) {
      const ObjectModel& o = model.objects[i];
      const std::size_t n = o.last - o.first;
      const core::ShapeError error = core::shape_error(std::span(model.rest.position).subspan(o.first, n),
                                                       std::span(state.particles.position).subspan(o.first, n));
      r.objects[i].final_shape_error = share(error.rms, o.rest_diameter);
      r.objects[i].largest_deformation = std::max(r.objects[i].largest_deformation, r.objects[i].final_shape_error);
    }
  }
};

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
void Simulation::step() { impl_->step(); }

void Simulation::step_frame() {
  const int target = impl_->state.frame + 1;
  while (impl_->state.frame < target) impl_->step();
}

void Simulation::restore(State state) {
  SUPPLE_EXPECTS(state.particles.size() == impl_->model.particles.size());
  SUPPLE_EXPECTS(state.links.broken.size() == impl_->model.links.size());
  SUPPLE_EXPECTS(state.broken_for.size() == impl_->model.links.size());
  SUPPLE_EXPECTS(state.volumes.size() == impl_->state.volumes.size());
  impl_->drop_results();
  impl_->take(std::move(state));
}

const std::vector<Mesh>& Simulation::meshes() { return impl_->pull_meshes(); }

const collision::ContactSurface& Simulation::contacts() {
  impl_->pull_contacts();
  return impl_->pulled.surface;
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

const core::Loads& Simulation::contact_loads() {
  impl_->pull_contacts();
  impl_->pulled_sample.internal.force.resize(impl_->model.particles.size(), Vec3::Zero());
  impl_->pulled_sample.internal.torque.resize(impl_->model.particles.size(), Vec3::Zero());
  return impl_->pulled_sample.internal;
}

const IntegratorPlan& Simulation::integrator() const { return impl_->integrator; }
const core::StepReport& Simulation::integration() const { return impl_->work; }

double Simulation::cell() const { return impl_->model.cell; }

void Simulation::set_cells(int cells) {
  SUPPLE_EXPECTS(cells > 0);
  impl_->pull_fields();
  Box all;
  for (std::size_t i = 0; i < impl_->bodies.size(); ++i) {
    if (!impl_->bodies[i].skeleton.primitive.empty()) all = all.united(impl_->pulled.field[i].surface_box());
  }
  if (!all.empty()) {
    impl_->model.cell = all.extent().maxCoeff() / cells;
    for (ObjectModel& object : impl_->model.objects) object.cell = impl_->model.cell;
  }
  impl_->pulled_meshes = false;
}

void Simulation::set_cell(double cell) {
  SUPPLE_EXPECTS(cell > 0.0);
  if (cell == impl_->model.cell) return;
  impl_->model.cell = cell;
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

const std::vector<std::string>& Simulation::warnings() const { return impl_->warnings; }

Audits Simulation::audits() const {
  const RunRecord& r = impl_->state.record;
  return {.momentum_error = share(r.momentum_error, r.momentum_scale),
          .angular_momentum_error = share(r.angular_momentum_error, r.angular_momentum_scale),
          .energy_error = share(r.energy_error, r.largest_energy),
          .energy_returned = share(r.energy_returned, r.largest_energy),
          .contact_residual = r.contact_residual,
          .largest_overlap = r.largest_overlap,
          .largest_overlap_share = r.largest_overlap_share};
}

Profile Simulation::profile() const {
  Profile profile = impl_->profile;
  double& integrate = profile[static_cast<std::size_t>(Stage::Integrate)].cpu_s;
  for (std::size_t s = 0; s < static_cast<std::size_t>(Stage::Integrate); ++s) integrate -= profile[s].cpu_s;
  integrate = std::max(integrate, 0.0);
  return profile;
}

StageProfile& Simulation::profile(Stage stage) { return impl_->profile[static_cast<std::size_t>(stage)]; }

}  // namespace supple::scenes
