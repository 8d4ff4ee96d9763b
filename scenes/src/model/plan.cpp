#include "supple/scenes/accuracy.h"
#include "supple/scenes/plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "file/fields/fields_rules.h"
#include "file/read_scene_faults.h"
#include "model/model_contact.h"
#include "supple/implicit/mesh_routes.h"

namespace supple::scenes {
namespace {

using namespace data;

constexpr std::array<StageInfo, kStageCount> kTable{{
    {Stage::Interact, "accumulate_interactions", "core", kState, kForces},
    {Stage::PlaceSkeleton, "place_skeleton", "implicit", kState, kSkeleton},
    {Stage::IndexField, "index_field", "implicit", kSkeleton, kField},
    {Stage::SampleSurface, "sample_surface", "implicit", kState | kField, kSamples | kState},
    {Stage::FindContacts, "find_contacts", "collision", kSamples | kField, kPairs},
    {Stage::SolveContactSurface, "solve_contact_surface", "collision", kPairs | kField, kContacts},
    {Stage::React, "react", "collision", kContacts | kField | kState, kForces},
    {Stage::Integrate, "advance", "core", kState | kForces, kState},
    {Stage::Polygonise, "polygonise", "implicit", kField, kMesh},
    {Stage::Render, "render", "render", kMesh, kImage},
    {Stage::Export, "export", "core", kState, 0},
}};

std::string count(std::size_t n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

std::string list(std::initializer_list<std::pair<bool, const char*>> items) {
  std::string text;
  for (const auto& [on, name] : items) {
    if (!on) continue;
    if (!text.empty()) text += ", ";
    text += name;
  }
  return text;
}

/// Objects and fixed bodies that may touch another one; several for an object that may touch itself.
std::size_t contact_body_count(const Model& model) {
  const auto n = static_cast<std::uint32_t>(model.objects.size());
  const auto count = static_cast<std::uint32_t>(n + model.fixed.size());
  const auto collides = [&](std::uint32_t i) { return i >= n || model.objects[i].collides; };
  std::size_t bodies = 0;
  for (std::uint32_t a = 0; a < count; ++a) {
    if (!collides(a)) continue;
    bool partner = false;
    for (std::uint32_t b = 0; b < count && !partner; ++b) {
      partner = b != a && collides(b) && !(a >= n && b >= n) &&
                (!model.rules.allowed || model.rules.allowed(std::min(a, b), std::max(a, b)));
    }
    bodies += std::max<std::size_t>(a < n ? own_contacts(model.objects[a]) : 0, partner ? 1 : 0);
  }
  return bodies;
}

/// Estimates of the ways to a mesh, all objects together, where the particles begin.
implicit::RouteEstimate routes_of(const Model& model) {
  implicit::RouteEstimate sum;
  for (const ObjectModel& object : model.objects) {
    if (object.skeleton.primitive.empty()) continue;
    std::vector<Pose> poses;
    for (std::uint32_t i = object.first; i < object.last; ++i) {
      poses.push_back({model.initial.position[i], model.initial.orientation[i]});
    }
    implicit::PlacedSkeleton placed;
    implicit::place_skeleton(object.skeleton, poses, placed);
    const implicit::RouteEstimate one = implicit::estimate_routes(object.skeleton, placed.support, object.cell);
    sum.leaves += one.leaves;
    sum.cubes_ms += one.cubes_ms;
    sum.openvdb_ms += one.openvdb_ms;
  }
  return sum;
}

/// Which mesher is taken, and why.
std::string meshing_of(const Scene& scene, const Model& model) {
  const MeshingDesc& d = scene.output.meshing;
  const bool error = d.error || std::any_of(model.objects.begin(), model.objects.end(), [](const ObjectModel& o) { return o.own_error; });
  const std::string touching = ", tetrahedra where objects touch";
  switch (d.method) {
    case MeshingName::Tetrahedra: return "tetrahedra";
    case MeshingName::Delaunay: return "Delaunay refinement by CGAL; where objects touch, of free and contact surfaces between common boundary curves";
    case MeshingName::OpenVdb: return "OpenVDB grid and volumeToMesh" + touching;
    case MeshingName::Cubes: return std::string(error ? "marching cubes to the given error" : "marching cubes") + touching;
    case MeshingName::Auto: break;
  }
  if (d.error) return "marching cubes to the given error" + touching;
  const implicit::RouteEstimate routes = routes_of(model);
  const auto time = [](double ms) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.2g ms", ms);
    return std::string(text.data());
  };
  const std::string other = std::isfinite(routes.openvdb_ms) ? "OpenVDB " + time(routes.openvdb_ms) : "cells are too small for OpenVDB";
  const std::string text = std::string("auto: ") + (routes.prefers_cubes() ? "marching cubes" : "OpenVDB") + " (estimated cost: marching cubes " + time(routes.cubes_ms) + ", " + other + ")";
  const bool graph = std::any_of(model.objects.begin(), model.objects.end(), [](const ObjectModel& o) {
    return o.skeleton.blend.rule == implicit::BlendRule::Graph;
  });
  return text + (graph ? ", vertices on creases" : "") + touching;
}

/// Which rule integrates over the contact surface, and why.
std::string rule_of_contact(const Scene& scene) {
  const RuleName rule = scene.contact.rule;
  if (rule != RuleName::Auto) return std::string(name_of(rule)) + ": set in the scene";
  return "auto: panels where the pressure has many maxima, polar where patches are star-shaped about their peak, else march; relative error " + number_text(contact_error(scene));
}

}  // namespace

std::span<const StageInfo> stage_table() { return kTable; }

const StageInfo& info(Stage stage) { return kTable[static_cast<std::size_t>(stage)]; }

OutputRequest requested_outputs(const Scene& scene) {
  const OutputDesc& o = scene.output;
  return {.images = o.images.has_value(),
          .film = o.film.has_value(),
          .meshes = !o.mesh.empty(),
          .grids = !o.grid.empty(),
          .contacts = !o.contacts.empty(),
          .particles = !o.particles.empty(),
          .samples = !o.samples.empty()};
}

bool StepPlan::on(Stage stage) const { return stages[static_cast<std::size_t>(stage)].on; }

StepPlan plan_step(const Scene& scene, const Model& model, const OutputRequest& outputs) {
  StepPlan plan;
  const auto add = [&](Stage stage, bool on, std::string reason) {
    plan.stages.push_back({stage, on, std::move(reason)});
  };

  const std::size_t laws = model.interactions.law_count();
  const std::size_t loads = model.interactions.external.size();
  const bool gravity = !scene.gravity.isZero();
  const bool driven = laws > 0 || loads > 0 || gravity;
  add(Stage::Interact, driven,
      driven ? count(laws, "interaction law", "interaction laws") + ", " + count(loads, "external load", "external loads") +
                   (gravity ? ", gravity" : "")
             : "no interaction, load or gravity acts on a particle");

  const std::size_t bodies = contact_body_count(model);
  const bool contact = bodies >= 2;
  const bool surfaces = std::any_of(model.objects.begin(), model.objects.end(),
                                    [](const ObjectModel& o) { return !o.skeleton.primitive.empty(); });
  const bool mesh_wanted = outputs.images || outputs.meshes;
  const bool field = surfaces && (contact || mesh_wanted || outputs.grids || outputs.samples);
  std::string field_reason;
  if (!surfaces) {
    field_reason = "no object has a skeleton";
  } else if (field) {
    field_reason = "needed by " + list({{contact, "contact"}, {outputs.images, "images"}, {outputs.meshes, "mesh files"},
                                        {outputs.grids, "grid files"}, {outputs.samples, "sample tables"}}) +
                   (contact ? "" : " (at output frames only)");
  } else {
    field_reason = "no contact is possible and no image, mesh, grid or sample is requested";
  }
  add(Stage::PlaceSkeleton, field, field_reason);
  add(Stage::IndexField, field, field_reason);

  const std::string contact_reason =
      contact ? count(bodies, "body", "bodies") + " may touch"
              : (bodies == 0 && model.objects.size() < 2 ? "a single object has nothing to touch"
                                                         : "fewer than two bodies may touch");
  add(Stage::SampleSurface, contact, contact ? contact_reason + "; only parts near another body are sampled" : contact_reason);
  add(Stage::FindContacts, contact, contact_reason);
  add(Stage::SolveContactSurface, contact, contact ? "runs when find_contacts leaves a pair; " + rule_of_contact(scene) : contact_reason);
  add(Stage::React, contact, contact ? "runs when a contact surface was found" : contact_reason);
  add(Stage::Integrate, true, plan_integrator(scene, model).reason);

  const bool mesh = mesh_wanted && surfaces;
  add(Stage::Polygonise, mesh,
      mesh ? "needed by " + list({{outputs.images, "images"}, {outputs.meshes, "mesh files"}}) + "; " + meshing_of(scene, model)
           : (surfaces ? "no image or mesh file is requested" : "no object has a skeleton"));
  add(Stage::Render, outputs.images, outputs.images ? "images are requested" : "no image is requested");
  const bool files = outputs.images || outputs.film || outputs.meshes || outputs.grids || outputs.contacts || outputs.particles ||
                     outputs.samples;
  add(Stage::Export, files,
      files ? list({{outputs.images, "images"}, {outputs.film, "film"}, {outputs.meshes, "mesh files"},
                    {outputs.grids, "grid files"}, {outputs.contacts, "contact tables"},
                    {outputs.particles, "particle tables"}, {outputs.samples, "sample tables"}})
            : "no output file is requested");
  return plan;
}

core::StepLimits step_limits(const Scene& scene, const Model& model, double frequency, const core::Speeds& speeds) {
  return {.frequency = frequency,
          .length = model.smallest_length,
          .speed = std::max(speeds.linear, model.solid_speed) + scene.gravity.norm() / scene.frame_rate,
          .angular_speed = speeds.angular};
}

namespace {

/// Steps a frame that methods take where the particles begin; infinite: no number is enough.
class StepCounts {
 public:
  StepCounts(const Scene& scene, const Model& model)
      : scene_(scene), model_(model), speeds_(core::largest_speeds(model.particles, model.initial)), frame_(1.0 / scene.frame_rate),
        longest_(std::min(frame_, scene.time_step.size.value_or(frame_))) {}

  [[nodiscard]] double frame() const { return frame_; }
  [[nodiscard]] double longest() const { return longest_; }
  [[nodiscard]] double of(double frequency, const StepBounds& bounds) const {
    return of_step(core::stable_step(scaled(step_limits(scene_, model_, frequency, speeds_), bounds)));
  }
  /// What implicit steps of an accuracy must follow: contacts, and the slowest waves through an object, of about half the frequency
  /// pair_frequency x length / size. What is faster hardly moves the object.
  [[nodiscard]] double resolved(double pair_frequency) const {
    double frequency = pair_contact_frequency(model_);
    for (const ObjectModel& object : model_.objects) {
      if (object.separate || object.last - object.first < 2) continue;
      frequency = std::max(frequency, 0.5 * pair_frequency * model_.smallest_length / size_of(object));
    }
    return frequency;
  }
  /// Explicit steps blur friction below a speed v of about mu a dt, a the acceleration by which contact stops a body, but for springs that hold; a part
  /// of what v adds up to over the scene, as measured, is to stay within the accuracy.
  [[nodiscard]] double to_resolve_friction(double accuracy) const {
    constexpr double kPart = 0.25;
    const double friction = largest_friction(model_);
    if (friction == 0.0 || model_.reaction.stick.stiffness > 0.0) return 1.0;
    double size = std::numeric_limits<double>::infinity();
    for (const ObjectModel& object : model_.objects) {
      if (object.collides) size = std::min(size, size_of(object));
    }
    const double drive = scene_.gravity.norm() + largest_push(), speed = std::max(speeds_.linear, std::sqrt(drive * size));
    const double blur = kPart * friction * (drive + model_.contact_frequency * speed);  // of v, by dt [m/s^2]
    return of_step(blur > 0.0 ? accuracy * size / (blur * scene_.duration) : frame_);
  }

  /// Half steps of damping must be shorter than what is damped fastest takes to stop.
  [[nodiscard]] double to_resolve_damping(double rate, double accuracy) const {
    constexpr double kPart = 1.0;  // of 1 / rate, at the coarsest accuracy
    return of_step(rate > 0.0 ? kPart * std::sqrt(accuracy / kDefaultAccuracy) / rate : frame_);
  }

 private:
  /// By the loads on one object, over its mass [m/s^2].
  [[nodiscard]] double largest_push() const {
    double largest = 0.0;
    for (const ObjectModel& object : model_.objects) {
      double force = 0.0, mass = 0.0;
      for (std::uint32_t i = object.first; i < object.last; ++i) mass += model_.particles.mass[i];
      for (const core::ExternalLoad& load : model_.interactions.external) {
        if (load.particle < object.first || load.particle >= object.last) continue;
        force += load.force.norm() * (load.course ? load.course->largest() : 1.0);
      }
      if (force > 0.0) largest = std::max(largest, force / mass);
    }
    return largest;
  }
  [[nodiscard]] double of_step(double step) const {
    if (!(step > 0.0)) return std::numeric_limits<double>::infinity();
    return std::ldexp(1.0, core::halvings(frame_, std::min(step, longest_)));
  }

  const Scene& scene_;
  const Model& model_;
  core::Speeds speeds_;
  double frame_, longest_;
};

/// Whether implicit methods can simulate the model, and are not refused: they minimise an energy, and would damp the motion that fluids are simulated for.
bool suits_implicit(const Model& model) {
  return model.interactions.literal_form.empty() && model.interactions.geometric_lennard_jones.empty() && model.interactions.gay_berne.empty();
}

std::string steps_text(double count, const char* kind = "") { return number_text(count) + ' ' + kind + (count == 1.0 ? "step" : "steps"); }

/// `auto` without `accuracy`.
void choose_by_stability(const Scene& scene, const Model& model, const StepCounts& counts, IntegratorPlan& plan) {
  const double explicit_steps = counts.of(std::hypot(plan.pair_frequency, model.contact_frequency), {});
  const double implicit_steps = counts.of(model.contact_frequency, {});
  const bool refused = explicit_steps > scene.time_step.max_substeps;
  const bool implicit = suits_implicit(model) && (refused || explicit_steps > kImplicitCost * implicit_steps);
  plan.settings.method = implicit ? core::Integrator::BackwardEuler : core::Integrator::Symplectic;
  const std::string taken = steps_text(explicit_steps) + " of velocity Verlet per frame";
  const std::string size =
      counts.longest() < counts.frame() ? " (time_step.size: at most " + number_text(counts.longest()) + " s)" : "";
  if (!implicit) {
    plan.reason = "symplectic: " + taken + " at the start" + size;
    return;
  }
  plan.reason = "backward_euler: " + steps_text(implicit_steps) + " per frame instead of " + taken + size +
                (refused ? ", which are more than time_step.max_substeps" : "; damps motion that its steps do not resolve");
}

/// `auto` with it. @return false: the scene does not allow as many steps
bool choose_by_accuracy(const Scene& scene, const Model& model, const StepCounts& counts, double accuracy, IntegratorPlan& plan) {
  const AccuracyRules rules = accuracy_rules(accuracy);
  const double stable = counts.of(std::hypot(plan.pair_frequency, model.contact_frequency), rules.explicit_steps);
  const double friction = counts.to_resolve_friction(accuracy), damping = counts.to_resolve_damping(plan.damping_rate, accuracy);
  const double explicit_steps = std::max({stable, friction, damping});
  const double implicit_steps = counts.of(counts.resolved(plan.pair_frequency), rules.implicit_steps);
  const bool dissipates = explicit_steps > stable, touches = model.contact_frequency > 0.0;
  const bool dies_out = !model.interactions.stiffness_damping.empty() && plan.damping_rate >= plan.pair_frequency;
  const double cost = dies_out      ? kDampedStepCost
                      : !dissipates ? kImplicitCost
                      : touches     ? kImplicitStepCost
                                    : implicit_pair_cost(model.particles.size());
  const bool refused = explicit_steps > scene.time_step.max_substeps;
  const bool implicit = suits_implicit(model) && (refused || explicit_steps > cost * implicit_steps);
  plan.settings.method = implicit ? core::Integrator::ImplicitMidpoint : core::Integrator::Symplectic;
  plan.reason = std::string(implicit ? "implicit_midpoint" : "symplectic") + ": accuracy " + number_text(accuracy) + " takes " +
                steps_text(implicit_steps, "implicit ") + " per frame, or " + number_text(explicit_steps) + " of velocity Verlet" +
                (!dissipates ? "" : friction < damping ? ", to resolve damping between particles" : ", to resolve friction") +
                (refused ? ", which are more than time_step.max_substeps" : "; an implicit step costs as much as " + number_text(std::round(cost)));
  return (implicit ? implicit_steps : explicit_steps) <= scene.time_step.max_substeps;
}

/// The method `implicit`.
void take_implicit(const Scene& scene, const Model& model, const StepCounts& counts, IntegratorPlan& plan) {
  constexpr double kResolved = 1.5;  // omega dt up to which implicit midpoint follows a contact [rad]
  const double fixed = scene.time_step.substeps ? std::ldexp(counts.frame(), -core::halvings(counts.frame(), counts.longest())) / *scene.time_step.substeps : 0.0;
  if (fixed * model.contact_frequency > kResolved) {
    plan.settings.method = core::Integrator::BackwardEuler;
    plan.reason = "backward_euler: steps of " + number_text(fixed) + " s, fixed by the scene, are longer than a contact lasts";
    return;
  }
  plan.settings.method = core::Integrator::ImplicitMidpoint;
  plan.reason = "implicit_midpoint: " + (fixed > 0.0 ? "steps of " + number_text(fixed) + " s" : steps_text(counts.of(counts.resolved(plan.pair_frequency), plan.bounds)) + " per frame") +
                " resolve contact";
}

/// What follows from the method.
void set_limits(const Scene& scene, const Model& model, const StepCounts& counts, const std::optional<double>& accuracy, IntegratorPlan& plan) {
  const bool implicit = core::is_implicit(plan.settings.method);
  const double all = std::hypot(plan.pair_frequency, model.contact_frequency);
  const double by_accuracy = accuracy ? accuracy_rules(*accuracy).tolerance : 1e-9;
  plan.settings.tolerance = scene.integrator.tolerance.value_or(implicit ? by_accuracy : 1e-6);
  const bool resolves = accuracy || scene.integrator.method == MethodName::Implicit;
  plan.limiting_frequency = !implicit ? all : !plan.chosen ? 0.0 : resolves ? counts.resolved(plan.pair_frequency) : model.contact_frequency;
  if (!implicit && accuracy && plan.chosen) {
    const double steps = std::max(counts.to_resolve_friction(*accuracy), counts.to_resolve_damping(plan.damping_rate, *accuracy));
    if (std::isfinite(steps)) plan.limiting_frequency = std::max(all, plan.bounds.phase * steps / counts.frame());
  }
  if (plan.settings.method == core::Integrator::Adaptive) {
    plan.limiting_frequency = 0.0;
    plan.settings.first_step = core::stable_step({.frequency = all});
    if (!std::isfinite(plan.settings.first_step)) plan.settings.first_step = 0.0;
  }
}

}  // namespace

IntegratorPlan plan_integrator(const Scene& scene, const Model& model) {
  using core::Integrator;
  const StepCounts counts(scene, model);
  IntegratorPlan plan;
  plan.pair_frequency = core::largest_frequency(model.particles, model.rest, model.interactions);
  plan.damping_rate = core::largest_damping_rate(model.particles, model.rest, model.interactions);
  plan.settings.rotation = scene.integrator.rotation == RotationName::Splitting ? core::RotationUpdate::Splitting
                                                                               : core::RotationUpdate::Exponential;
  plan.settings.length = model.smallest_length;
  plan.settings.max_substeps = scene.time_step.max_substeps;
  const MethodName method = scene.integrator.method;
  plan.chosen = (method == MethodName::Auto || method == MethodName::Implicit) && !scene.time_step.substeps;
  std::optional<double> accuracy = accuracy_of(scene);
  const AccuracyRules rules = accuracy_rules(accuracy.value_or(kDefaultAccuracy));
  if (method == MethodName::Implicit) plan.bounds = rules.implicit_steps;
  switch (method) {
    case MethodName::Auto:
      if (!plan.chosen) {
        plan.reason = "symplectic: the scene fixes the time step";
      } else {
        const bool reached = accuracy && choose_by_accuracy(scene, model, counts, *accuracy, plan);
        // Waves too stiff for the default accuracy are left unresolved; an accuracy that the scene gives is not.
        if (!reached) accuracy = scene.accuracy;
        if (!accuracy) choose_by_stability(scene, model, counts, plan);
      }
      break;
    case MethodName::Symplectic: plan.settings.method = Integrator::Symplectic; break;
    case MethodName::Rk4: plan.settings.method = Integrator::RungeKutta4; break;
    case MethodName::Adaptive: plan.settings.method = Integrator::Adaptive; break;
    case MethodName::BackwardEuler: plan.settings.method = Integrator::BackwardEuler; break;
    case MethodName::ImplicitMidpoint: plan.settings.method = Integrator::ImplicitMidpoint; break;
    case MethodName::Implicit: take_implicit(scene, model, counts, plan); break;
  }
  if (plan.reason.empty()) plan.reason = std::string(name_of(method)) + ": given by the scene";
  if (accuracy) plan.bounds = core::is_implicit(plan.settings.method) ? rules.implicit_steps : rules.explicit_steps;
  if (accuracy) plan.slow_slip = rules.slow_slip;
  set_limits(scene, model, counts, accuracy, plan);
  return plan;
}

double implicit_pair_cost(std::size_t particles) {
  constexpr double kOfTen = 32.0, kGrowth = 2.0 / 3.0;
  return kOfTen * std::pow(std::max(1.0, static_cast<double>(particles) / 10.0), kGrowth);
}

double stick_speed(const Scene& scene, const Model& model) {
  constexpr double kCreep = 1e-7;  // smallest lengths per second [1/s]
  return std::min(scene.contact.friction_speed, kCreep * model.smallest_length);
}

bool well_formed(const StepPlan& plan) {
  if (plan.stages.size() != static_cast<std::size_t>(kStageCount)) return false;
  // Empty meshes and zero forces exist before any stage runs; everything else must have been written.
  DataMask available = kState | kForces | kMesh;
  for (const PlannedStage& planned : plan.stages) {
    if (!planned.on) continue;
    if ((info(planned.stage).reads & ~available) != 0) return false;
    available |= info(planned.stage).writes;
  }
  return true;
}

}  // namespace supple::scenes
