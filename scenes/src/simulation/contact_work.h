/// Work dissipated by damping and friction of each pair so far.
#pragma once

#include <span>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Adds the work of a step, by the trapezoidal rule. @param pairs  in contact at its end   @param power  of each, by `react` [W]; empty: no contact
void book_pair_work(std::span<const collision::ContactSurface::Summary> pairs, std::span<const double> power, double step, RunRecord& record);

/// Renumbers the bodies: entries keep their body names; entries of bodies that no longer exist are removed.
void rename_pair_work(const Model& model, const std::vector<Body>& before, const std::vector<Body>& now, RunRecord& record);

/// Work of all pairs [J].
[[nodiscard]] double all_pair_work(const RunRecord& record);

/// Work of a pair [J]; 0 without dissipation.
[[nodiscard]] double pair_work(const RunRecord& record, const collision::BodyPair& bodies);

}  // namespace supple::scenes
