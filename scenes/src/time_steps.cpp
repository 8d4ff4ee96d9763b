#include "time_steps.h"

#include <algorithm>
#include <cmath>

#include "model_faults.h"
#include "supple/core/error.h"
#include "supple/core/integrate.h"

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

/// Of the coarsest step that is stable now.
int stable_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                    const State& state) {
  const double frame_time = 1.0 / scene.frame_rate;
  const core::Speeds speeds = core::largest_speeds(model.particles, state.particles);
  double frequency = integrator.limiting_frequency, damping = 1.0;
  const core::Integrator method = integrator.settings.method;
  if (method == core::Integrator::Symplectic || method == core::Integrator::RungeKutta4) {
    // Damping d v p takes at most d v w of its speed in a second, w the contact's frequency: fast where d v is large.
    damping = std::max(1.0, kDampedShare * model.largest_dissipation * (speeds.linear + model.solid_speed));
    frequency = std::max(frequency, std::hypot(core::largest_frequency(model.particles, state.particles, laws), model.contact_frequency * damping));
  }
  const core::StepLimits limits = step_limits(scene, model, frequency, speeds);
  const double step = core::stable_step(limits);
  const bool possible = step > 0.0;
  const int k = possible && step < frame_time ? core::halvings(frame_time, step) : 0;
  const int most = scene.time_step.max_substeps;
  if (!possible || k > log2_of(most)) {
    throw Error(ErrorKind::Limit,
                Fault{.place = place_of(scene, "time_step.max_substeps"),
                      .key = "time_step.max_substeps",
                      .expected = "expected a stable step with at most " + std::to_string(most) + " substeps a frame",
                      .found = "one of " + number_text(step) + " s (" + (possible ? number_text(std::ldexp(1.0, k)) : "no number of") +
                               " substeps) at frame " + std::to_string(state.frame),
                      .hint = "raise time_step.max_substeps, or " + what_needs(limits, damping)});
  }
  return k;
}

}  // namespace

int first_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                   const State& state) {
  const TimeStepDesc& desc = scene.time_step;
  if (desc.substeps) return log2_of(*desc.substeps);
  if (desc.size) return core::halvings(1.0 / scene.frame_rate, *desc.size);
  return stable_halvings(scene, model, integrator, laws, state);
}

int next_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                  const State& state) {
  const bool fixed = scene.time_step.substeps || scene.time_step.size;
  if (fixed || state.steps % kStepsPerRefinement != 0) return state.halvings;
  return std::max(state.halvings, stable_halvings(scene, model, integrator, laws, state));
}

}  // namespace supple::scenes
