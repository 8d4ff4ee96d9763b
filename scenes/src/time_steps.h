/// How fine steps must be: a frame interval is cut into 2^k of them.
#pragma once

#include "supple/core/interactions.h"
#include "supple/scenes/model.h"
#include "supple/scenes/plan.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// k of the first step of a frame: as the scene fixes it, or the coarsest that is stable.
/// @throws Error{Limit} when that is more than time_step.max_substeps
[[nodiscard]] int first_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                                 const State& state);

/// The same for the steps that follow: laws get stiffer where particles come close. Within a frame steps only become finer, as
/// they stay on its grid.
[[nodiscard]] int next_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                                const State& state);

}  // namespace supple::scenes
