/// What a run reports about itself: motion and energy against frame 1 and against what the ledger booked.
#pragma once

#include <optional>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "supple/scenes/model.h"
#include "supple/scenes/simulation.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Keeps the largest deviations so far in state.record, which begins with its first call. @param energy  kinetic + pair + contact, now [J]
void book_audits(const Model& model, const std::vector<Body>& bodies, double energy, const collision::ContactSurface& surface, State& state);

/// What is there beyond the energy at the start, external work and what damping has taken [J]
[[nodiscard]] double unaccounted_energy(double energy, const State& state);
/// Energy from nowhere, where it is nearly all that there is. @param before  what was unaccounted for where stepping began [J]
[[nodiscard]] std::optional<double> find_created_energy(const Energies& now, double before, const State& state);

/// Those deviations over their scales.
[[nodiscard]] Audits audits_of(const RunRecord& record);

}  // namespace supple::scenes
