#include "model/time_steps.h"

#include <algorithm>
#include <cmath>

#include "model/model_faults.h"
#include "supple/core/error.h"
#include "supple/core/integrate.h"

namespace supple::scenes {
namespace {

constexpr std::uint64_t kStepsPerRefinement = 4;
constexpr int kMostHalvings = 20;      // 2^20 substeps, the most that a scene may allow
constexpr double kDampedShare = 0.4;  // of the inverse of d v: largest share of a speed that a step may dissipate

int log2_of(int n) {
  int k = 0;
  while ((1 << k) < n) ++k;
  return k;
}

/// Hint for the cause of the smallest step.
std::string what_needs(const core::StepLimits& limits, double damping) {
  const double step = core::stable_step(limits);
  if (step == core::stable_step({.length = limits.length, .speed = limits.speed})) {
    return "reduce the largest speed, " + number_text(limits.speed) + " m/s past lengths of " + number_text(limits.length) + " m";
  }
  if (step == core::stable_step({.angular_speed = limits.angular_speed})) return "reduce the largest angular speed, " + number_text(limits.angular_speed) + " rad/s";
  if (damping > 2.0) return "lower the dissipation of contact (or raise the restitution)";
  return "soften the stiffest interaction or contact, or make the lightest particle heavier";
}

/// Damping d v p dissipates at most d v w of its speed per second, w the contact's frequency: the ratio of that rate to w.
double damping_of(const Model& model, const core::Speeds& speeds) {
  return std::max(1.0, kDampedShare * model.largest_dissipation * (speeds.linear + model.solid_speed));
}

bool is_explicit(const IntegratorPlan& integrator) {
  const core::Integrator method = integrator.settings.method;
  return method == core::Integrator::Symplectic || method == core::Integrator::RungeKutta4;
}

/// Of the present state.
core::StepLimits limits_of(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                           const core::ParticleState& particles) {
  const core::Speeds speeds = core::largest_speeds(model.particles, particles);
  double frequency = integrator.limiting_frequency;
  if (is_explicit(integrator)) {
    const double contact = model.contact_frequency * damping_of(model, speeds);
    frequency = std::max(frequency, std::hypot(core::largest_frequency(model.particles, particles, laws), contact));
  }
  return scaled(step_limits(scene, model, frequency, speeds), integrator.bounds);
}

/// k of the longest steps that the scene allows.
int least_halvings(const Scene& scene) {
  const TimeStepDesc& desc = scene.time_step;
  return (desc.size ? core::halvings(1.0 / scene.frame_rate, *desc.size) : 0) + (desc.substeps ? log2_of(*desc.substeps) : 0);
}

/// k of the coarsest stable step [s], not coarser than the scene allows; 0: the coarsest allowed.
int halvings_for(const Scene& scene, double step) {
  const double frame_time = 1.0 / scene.frame_rate;
  return std::max(least_halvings(scene), step > 0.0 && step < frame_time ? core::halvings(frame_time, step) : 0);
}

/// Of the coarsest step that is stable now.
int stable_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                    const State& state) {
  const core::StepLimits limits = limits_of(scene, model, integrator, laws, state.particles);
  const double step = core::stable_step(limits);
  const bool possible = step > 0.0;
  const int least = least_halvings(scene), k = halvings_for(scene, step);
  const int most = scene.time_step.max_substeps;
  if (!possible || (k > least && k > log2_of(most))) {
    const core::Speeds speeds = core::largest_speeds(model.particles, state.particles);
    const double damping = is_explicit(integrator) ? damping_of(model, speeds) : 1.0;
    throw Error(ErrorKind::Limit,
                Fault{.place = place_of(scene, "time_step.max_substeps"),
                      .key = "time_step.max_substeps",
                      .expected = "expected a stable step with at most " + std::to_string(most) + " substeps per frame",
                      .found = "one of " + number_text(step) + " s (" + (possible ? number_text(std::ldexp(1.0, k)) : "no number of") +
                               " substeps) at frame " + std::to_string(state.frame),
                      .hint = "raise time_step.max_substeps, or " + what_needs(limits, damping)});
  }
  return k;
}

}  // namespace

int first_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                   const State& state) {
  return fixes_step(scene) ? least_halvings(scene) : stable_halvings(scene, model, integrator, laws, state);
}

int wanted_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                    const State& state) {
  if (fixes_step(scene)) return least_halvings(scene);
  const double step = core::stable_step(limits_of(scene, model, integrator, laws, state.particles));
  return step > 0.0 ? std::min(halvings_for(scene, step), kMostHalvings) : kMostHalvings;
}

int next_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                  const State& state) {
  if (fixes_step(scene) || state.steps % kStepsPerRefinement != 0) return state.halvings;
  return std::max(state.halvings, stable_halvings(scene, model, integrator, laws, state));
}

double automatic_step(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                      const core::ParticleState& particles) {
  const double frame_time = 1.0 / scene.frame_rate, step = core::stable_step(limits_of(scene, model, integrator, laws, particles));
  return step > 0.0 && step < frame_time ? std::ldexp(frame_time, -core::halvings(frame_time, step)) : std::min(step, frame_time);
}

bool contact_bounds_hold(const Model& model, const core::ParticleState& particles, double step) {
  const core::Speeds speeds = core::largest_speeds(model.particles, particles);
  return step <= core::stable_step({.frequency = model.contact_frequency * damping_of(model, speeds)});
}

}  // namespace supple::scenes
