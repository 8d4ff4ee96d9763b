#include "supple/scenes/accuracy.h"

#include <algorithm>
#include <cmath>

namespace supple::scenes {

AccuracyRules accuracy_rules(double accuracy) {
  constexpr double kCoarsest = 1e-2;
  constexpr StepBounds kExplicit{.phase = 0.3, .travel = 0.1}, kImplicit{.phase = 0.6, .travel = 0.15};  // at the coarsest accuracy
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
  const AccuracyRules rules = accuracy_rules(accuracy);
  scene.contact.error = rules.contact_error;
  scene.render.noise = rules.noise;
}

core::StepLimits scaled(core::StepLimits limits, const StepBounds& bounds) {
  constexpr StepBounds kDefault;
  limits.frequency *= kDefault.phase / bounds.phase;
  limits.length *= bounds.travel / kDefault.travel;
  return limits;
}

}  // namespace supple::scenes
