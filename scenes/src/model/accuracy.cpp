#include "supple/scenes/accuracy.h"

#include <algorithm>
#include <cmath>

namespace supple::scenes {

AccuracyRules accuracy_rules(double accuracy) {
  constexpr double kCoarsest = 1e-2;
  constexpr StepBounds kExplicit{.phase = 0.3, .travel = 0.1}, kImplicit{.phase = 0.8, .travel = 0.2};  // at the coarsest accuracy
  const double finer = std::sqrt(accuracy / kCoarsest);
  return {.contact_error = accuracy,
          .mesh_share = std::max(accuracy, 1e-4),
          .noise = std::clamp(10.0 * accuracy, 0.01, 0.1),
          .tolerance = 1e-3 * accuracy,
          .slow_slip = std::min(1e-2, 10.0 * accuracy),
          .explicit_steps = {.phase = kExplicit.phase * finer, .travel = kExplicit.travel * finer},
          .implicit_steps = {.phase = kImplicit.phase * finer, .travel = kImplicit.travel * finer}};
}

void set_by_accuracy(double accuracy, Scene& scene) {
  scene.render.noise = accuracy_rules(accuracy).noise;
}

bool leaves_steps_open(const Scene& scene) {
  const auto literal = [](const ObjectDesc& object) {
    return std::any_of(object.interactions.begin(), object.interactions.end(), [](const InteractionDesc& law) { return law.paper_literal; });
  };
  return !scene.time_step.size && !scene.time_step.substeps && scene.integrator.method == MethodName::Auto &&
         std::none_of(scene.objects.begin(), scene.objects.end(), literal);
}

std::optional<double> accuracy_of(const Scene& scene) {
  if (scene.accuracy) return scene.accuracy;
  return leaves_steps_open(scene) ? std::optional(kDefaultAccuracy) : std::nullopt;
}

double contact_error(const Scene& scene) {
  constexpr double kOwn = 1e-4;  // of scenes without an accuracy
  if (scene.contact.error) return *scene.contact.error;
  const std::optional<double> accuracy = accuracy_of(scene);
  return accuracy ? accuracy_rules(*accuracy).contact_error : kOwn;
}

core::StepLimits scaled(core::StepLimits limits, const StepBounds& bounds) {
  constexpr StepBounds kDefault;
  limits.frequency *= kDefault.phase / bounds.phase;
  limits.length *= bounds.travel / kDefault.travel;
  return limits;
}

}  // namespace supple::scenes
