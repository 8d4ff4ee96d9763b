#include "supple/scenes/simulation.h"

#include <algorithm>
#include <cmath>

#include "audits.h"
#include "camera.h"
#include "fixed_step.h"
#include "frame.h"
#include "held_volumes.h"
#include "model_faults.h"
#include "overload.h"
#include "picture.h"
#include "pieces.h"
#include "read_scene_faults.h"
#include "rest.h"
#include "time_steps.h"
#include "warnings.h"
#include "supple/core/error.h"
#include "supple/core/parts.h"

namespace supple::scenes {
namespace {

/// `now` with what changes of it. @throws Error{Usage} naming the array, and the row where one is at fault
core::ParticleState changed_particles(const ParticleChange& change, const core::ParticleSet& set, const core::ParticleState& now) {
  const auto fail = [](const std::string& array, std::string expected, std::string found) {
    throw Error(ErrorKind::Usage, Fault{.place = array, .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = {}});
  };
  const auto take = [&](const std::string& name, const auto& array, auto& to, const auto& good, const char* what) {
    if (!array) return;
    if (array->size() != now.size()) fail(name, "expected " + std::to_string(now.size()) + " rows", std::to_string(array->size()));
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

struct Simulation::Impl {
  Scene scene;
  Model model;
  SimulationOptions options;
  Executor executor;
  StepPlan plan;
  Profile profile{};
  State state;
  State last_frame;
  core::ParticleState step_begin;  ///< of the last step, where the scene fixes it
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
  UnmetContacts unmet;
  SearchCounts searches;      ///< of the meshes of this state,
  SearchCounts all_searches;  ///< and of all so far
  bool coarse_noted = false;  ///< in the warnings

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
    measure_targets(context(), state.particles, state.volumes, pulled, model);
    for (const Body& body : bodies) state.samples.push_back(fresh_samples(body));
    if (scene.sleep) state.sleep.reset(bodies.size());
    form_awake();
    state.halvings = first_halvings(scene, model, integrator, laws, state);
    leave_overlapping();
    book_audits();
    place_cameras();
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
            .interrupt = options.interrupt,
            .time = time(),
            .step = held_step(),
            .awake = awake.size() < bodies.size() ? &awake : nullptr,
            .sticks = &state.sticks};
  }

  /// Cameras that the scene leaves open see what is there now, and the ground below it.
  void place_cameras() {
    const std::span<const CameraDesc> cameras = cameras_of(scene);
    Box seen;
    if (std::any_of(cameras.begin(), cameras.end(), is_open)) {
      pull_fields();
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        const LookDesc& look = scene.objects[bodies[i].object].look;
        if (!bodies[i].skeleton.primitive.empty() && (look.surface || look.wireframe)) seen = seen.united(pulled.field[i].surface_box());
      }
      const std::vector<Mesh> obstacles = obstacle_meshes(scene, model, time());
      for (std::size_t i = 0; i < obstacles.size(); ++i) {
        if (scene.obstacles[i].shape == ObstacleName::Plane) continue;
        for (const Vec3& p : obstacles[i].position) seen.include(p);
      }
      if (scene.ground && scene.ground->visible && !seen.empty()) seen.lower.z() = std::min(seen.lower.z(), scene.ground->height);
    }
    model.cameras = placed_cameras(scene, seen);
  }

  /// Nothing is pulled; meshers keep what they know, which holds for any state.
  void renew_pulled() {
    DivisionMeshers dividing = std::move(pulled.dividing);
    pulled = Frame(model, bodies);
    pulled.dividing = std::move(dividing);
  }

  /// Bodies, rules and frames for the present pieces.
  void form_bodies() {
    bodies = make_bodies(model, parted_links(model, state.links, state.broken_for));
    fade_blends(model, state.links, state.broken_for, bodies);
    scale_kernels(model, state.volumes, bodies);
    watch.forget();
    rules = make_body_rules(model, bodies, state.apart);
    frame = Frame(model, bodies);
    renew_pulled();
  }

  /// Components of one object that overlap at the start would be driven apart: they meet once they have been apart.
  void leave_overlapping() {
    if (std::all_of(model.objects.begin(), model.objects.end(), [](const ObjectModel& o) { return o.component.empty(); })) return;
    pull_contacts();
    if (!note_overlapping(bodies, pulled, model)) return;
    divide_anew();
    renew_pulled();
    drop_results();
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
    tied = tied_bodies(bodies, laws);
  }

  void take(State other) {
    core::ParticleState arrays = std::move(state.particles);
    arrays = other.particles;
    state = std::move(other);
    state.particles = std::move(arrays);
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

  void adopt(State other) {
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
    // Distances of samples go on from where they are, if there are as many.
    const std::vector<Body> parted = make_bodies(model, parted_links(model, other.links, other.broken_for));
    other.samples.resize(parted.size());
    for (std::size_t i = 0; i < parted.size(); ++i) {
      if (other.samples[i].distance.size() != parted[i].samples.size()) other.samples[i] = fresh_samples(parted[i]);
    }
    other.sleep = {};
    if (scene.sleep) other.sleep.reset(other.samples.size());
    if (!(model.reaction.stick.stiffness > 0.0)) other.sticks = {};
    drop_results();
    take(std::move(other));
    book_audits();
  }

  void set_particles(const ParticleChange& change) {
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

  /// Between two steps: breaks and yields links. Seeds of the new pieces begin anew, and so do the forces. What their surfaces held that is
  /// no longer there goes with the links.
  void update_links() {
    if (model.links.size() == 0) return;
    const bool fades = age_broken_links(model, dt(), state);
    const core::LinkChange change = core::update_links(model.particles, state.particles, laws, model.links, dt(),
                                                       state.links, state.ledger);
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

  /// Bodies as the links that are left make them.
  void part_bodies() {
    const std::vector<Body> before = std::move(bodies);
    form_bodies();
    if (scene.sleep) state.sleep.reset(bodies.size());
    form_awake();
    if (bodies.size() == before.size()) return;
    state.ledger.dissipated += collision::stick_energy(model.reaction.stick, state.sticks);  // bodies have other numbers now
    state.sticks = {};
    state.kick.valid = false;
    state.apart = inherited_apart(model, before, state.apart, bodies);
    state.samples = inherited_samples(before, state.samples, bodies);
    divide_anew();
  }

  /// Other bodies of one object touch now.
  void divide_anew() {
    rules = make_body_rules(model, bodies, state.apart);
    frame.pairs_present.reset();
  }

  [[nodiscard]] double frame_time() const { return 1.0 / scene.frame_rate; }
  [[nodiscard]] double dt() const { return std::ldexp(frame_time(), -state.halvings); }
  /// For which loads act unchanged [s]; the adaptive method chooses steps of its own.
  [[nodiscard]] double held_step() const { return integrator.settings.method != core::Integrator::Adaptive ? dt() : 0.0; }
  [[nodiscard]] double time() const { return (state.frame - 1) * frame_time() + state.substep * dt(); }
  [[nodiscard]] bool contact_on() const { return !options.skip || plan.on(Stage::FindContacts); }

  /// Substeps stay on the grid of the frame.
  void refine_step() {
    const int halvings = next_halvings(scene, model, integrator, laws, state);
    state.substep <<= halvings - state.halvings;
    state.halvings = halvings;
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
    std::vector<std::uint32_t> loaded = newly_loaded(bodies, laws, time(), time() + dt());
    if (awake.size() < bodies.size()) {
      const std::vector<std::uint32_t> stirred = find_stirred(context(), state.particles, time() + dt(), frame);
      loaded.insert(loaded.end(), stirred.begin(), stirred.end());
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
    const std::vector<std::uint32_t> rose = wake(touched);
    if (integrator.settings.method != core::Integrator::Symplectic) return;
    for (const std::uint32_t i : rose) give_half_kick(bodies[i], particles, loads, dt(), state);
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
    for (const std::uint32_t i : slept) still(bodies[i], particles, state);
    form_awake();
    state.kick.valid = false;
  }

  void step() {
    drop_results();
    if (state.substep == 0) {
      last_frame = state;
      state.halvings = first_halvings(scene, model, integrator, laws, state);
      note_coarse_steps();
    } else {
      refine_step();
    }
    if (fixes_step(scene)) {
      step_begin = state.particles;
      if (!state.kick.valid) check_fixed_push();  // else the step before has done so
    }
    if (bodies.size() != model.objects.size() && note_apart(context(), state.particles, pulled, state.apart)) divide_anew();
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
    const double until = std::max(scene.duration, time());
    const core::Divergence divergence =
        core::find_divergence(model.particles, state.particles, model.believable.distance(until), model.believable.fastest(until));
    if (divergence.found) {
      const std::uint64_t step = state.steps;
      const double at = time();
      if (last_frame.record.valid) take(last_frame);
      throw_diverged(divergence, step, at);
    }
    check_fixed_step();
    commit_friction();
    wake_touched();
    watch_pressing();
    update_links();
    hold_volumes();
    lay_to_sleep();
    if (state.substep == (1 << state.halvings)) {
      state.substep = 0;
      ++state.frame;
      book_audits();
    }
  }

  /// At the start of a frame: steps that the scene fixes may be far beyond those known to be stable, which the run says once.
  void note_coarse_steps() {
    constexpr double kProven = 5.0;  // automatic steps have margins of five to seven to what their bounds prove
    if (!fixes_step(scene) || coarse_noted) return;
    const double step = automatic_step(scene, model, integrator, laws, state.particles);
    if (dt() <= kProven * step) return;
    coarse_noted = true;
    warnings.push_back("time_step.substeps: steps of " + short_text(dt()) + " s may be too coarse, automatic ones would be of " +
                       short_text(step) + " s (at frame " + std::to_string(state.frame) + "); see energy_error");
  }

  /// After a step that the scene fixes: what contact it missed, or made energy by. @throws Error{Diverged}
  void check_fixed_step() {
    if (!fixes_step(scene) || awake.empty() || !contact_on()) return;
    Profile unused{};
    const StageContext quiet = quiet_context(unused);
    const TakenStep step{.before = step_begin, .after = state.particles, .end = time(), .size = dt()};
    const auto found = find_missed_contact(quiet, step, state.samples, seen_contacts(quiet), pulled);
    if (found) throw_too_coarse(*found);
    check_fixed_push();
  }

  /// Where pairs are pushed by forces of the present state. @throws Error{Diverged}
  void check_fixed_push() {
    const core::Integrator method = integrator.settings.method;
    // The adaptive method takes as many steps within one as contacts ask for.
    if (method == core::Integrator::Adaptive || !contact_on() || contact_bounds_hold(model, step_begin, dt())) return;
    Profile unused{};
    const StageContext quiet = quiet_context(unused);
    const TakenStep step{.before = step_begin, .after = state.particles, .end = time(), .size = dt()};
    const double limit = method == core::Integrator::RungeKutta4 ? 8.0 : 4.0;
    const auto found =
        find_unstable_contact(quiet, step, state.samples, seen_contacts(quiet), limit, core::is_implicit(method), pulled);
    if (found) throw_too_coarse(*found);
  }

  /// For looks that are no part of a step.
  StageContext quiet_context(Profile& unused) {
    StageContext quiet{model, bodies, rules, executor, unused, options.skip, false};
    quiet.time = time();
    return quiet;
  }

  /// The contacts of the present state: the last step's of velocity Verlet, of other methods they are found anew.
  const Frame& seen_contacts(const StageContext& quiet) {
    if (integrator.settings.method == core::Integrator::Symplectic && state.kick.valid) return frame;
    std::vector<implicit::SampleState> trial = state.samples;
    find_contact_surface(quiet, state.particles, trial, pulled, false);
    return pulled;
  }

  [[noreturn]] void throw_too_coarse(const TooCoarse& found) {
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

  /// After a step: kernels grow and shrink, with the particles where they are. What that adds to the energy of contact is work done from outside.
  void hold_volumes() {
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
                      .hint = fixes_step(scene)
                                  ? "the scene fixes its own time step; let time_step.substeps be auto"
                                  : "check stiffness, mass and strength of the objects concerned"});
  }

  void drop_results() {
    pulled_contacts = pulled_fields = pulled_meshes = false;
    meshes.clear();
    searches = {};
  }

  void pull_contacts() {
    if (pulled_contacts) return;
    if (contact_on()) {
      std::vector<implicit::SampleState> trial = state.samples;
      Profile unused{};
      StageContext quiet{model, bodies, rules, executor, unused, options.skip, false};
      quiet.sticks = &state.sticks;
      quiet.time = time();
      quiet.step = held_step();
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
      searches.add(pulled.missed);
      all_searches.add(pulled.missed);
      set_missed(scene.output.meshing, all_searches, warnings);
    } catch (const Error& error) {
      rethrow_with_places(scene, error);
    }
    pulled_meshes = true;
    return meshes;
  }

  /// Of the present bodies as they touch now, without springs of friction [J]
  double contact_energy() {
    pull_contacts();
    double sum = 0.0;
    for (const auto& s : pulled.surface.summary) sum += s.energy;
    return sum;
  }

  Energies energies() {
    Energies e;
    e.kinetic = core::measure_motion(model.particles, state.particles).kinetic_energy;
    e.interaction = core::potential_energy(model.particles, state.particles, laws);
    e.contact = contact_energy() + collision::stick_energy(model.reaction.stick, state.sticks);
    return e;
  }

  void book_audits() {
    const double energy = energies().total();  // and the contacts
    scenes::book_audits(model, bodies, energy, pulled.surface, state);
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

Profile Simulation::profile() const {
  Profile profile = impl_->profile;
  double& integrate = profile[static_cast<std::size_t>(Stage::Integrate)].cpu_s;
  for (std::size_t s = 0; s < static_cast<std::size_t>(Stage::Integrate); ++s) integrate -= profile[s].cpu_s;
  integrate = std::max(integrate, 0.0);
  return profile;
}

StageProfile& Simulation::profile(Stage stage) { return impl_->profile[static_cast<std::size_t>(stage)]; }

}  // namespace supple::scenes
