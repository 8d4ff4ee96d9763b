/// Choice of the time step: a frame interval has 2^k steps.
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

/// As `first_halvings`, but refuses nothing: for queries of a state from which no step is made. At most 20.
[[nodiscard]] int wanted_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                                  const State& state);

/// The same for later steps: laws get stiffer where particles come close. Within a frame steps only become finer, as
/// they stay on its time grid.
[[nodiscard]] int next_halvings(const Scene& scene, const Model& model, const IntegratorPlan& integrator, const core::Interactions& laws,
                                const State& state);

/// The automatic step, regardless of the keys of the scene [s]; 0: none is fine enough.
[[nodiscard]] double automatic_step(const Scene& scene, const Model& model, const IntegratorPlan& integrator,
                                    const core::Interactions& laws, const core::ParticleState& particles);

/// Whether a step [s] keeps the bounds of automatic steps for stiffness and damping of contacts.
[[nodiscard]] bool contact_bounds_hold(const Model& model, const core::ParticleState& particles, double step);

}  // namespace supple::scenes
