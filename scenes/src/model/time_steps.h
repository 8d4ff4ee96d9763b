/// How fine steps must be: a frame interval is cut into 2^k of them.
#pragma once

#include "supple/core/interactions.h"
#include "supple/scenes/model.h"
#include "supple/scenes/plan.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Whether the scene fixes the step (`time_step.substeps`), rather than at most its largest size.
[[nodiscard]] inline bool fixes_step(const Scene& scene) { return scene.time_step.substeps.has_value(); }

/// k of the first step of a frame: as the scene fixes it, or the coarsest that is stable and no longer than time_step.size.
/// @throws Error{Limit} when a stable one takes more than time_step.max_substeps
[[nodiscard]] int first_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                                 const State& state);

/// As `first_halvings`, but refuses nothing: for questions about a state from which no step is made. None is finer than a frame's time over 2^20.
[[nodiscard]] int wanted_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                                  const State& state);

/// The same for the steps that follow: laws get stiffer where particles come close. Within a frame steps only become finer, as
/// they stay on its grid.
[[nodiscard]] int next_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                                const State& state);

/// What an automatic step would be, whatever the scene says of steps [s]; 0: none is fine enough.
[[nodiscard]] double automatic_step(const Scene& scene, const Model& model, const IntegratorPlan& integrator,
                                    const core::Interactions& laws, const core::ParticleState& particles);

/// Whether a step [s] keeps the bounds of automatic ones as to how stiff contacts are and how they damp.
[[nodiscard]] bool contact_bounds_hold(const Model& model, const core::ParticleState& particles, double step);

}  // namespace supple::scenes
