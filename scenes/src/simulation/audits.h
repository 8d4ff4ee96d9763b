/// Audits of a run: motion and energy compared with frame 1 and the ledger.
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

/// Energy beyond the initial energy plus external work minus dissipation [J]
[[nodiscard]] double unaccounted_energy(double energy, const State& state);
/// Energy without a source, where it is nearly all energy. @param before  unexplained energy when stepping began [J]
[[nodiscard]] std::optional<double> find_created_energy(const Energies& now, double before, const State& state);

/// These deviations over their scales.
[[nodiscard]] Audits audits_of(const RunRecord& record);

}  // namespace supple::scenes
