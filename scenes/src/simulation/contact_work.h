/// What damping and friction of each pair took so far.
#pragma once

#include <span>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Adds a step's work, by the trapezoidal rule. @param pairs  that touch at its end   @param power  of each then, by `react` [W]; empty: none touches
void book_pair_work(std::span<const collision::ContactSurface::Summary> pairs, std::span<const double> power, double step, RunRecord& record);

/// Bodies of other numbers take over the work of those that have their names; that of others is forgotten.
void rename_pair_work(const Model& model, const std::vector<Body>& before, const std::vector<Body>& now, RunRecord& record);

/// Of all pairs [J].
[[nodiscard]] double all_pair_work(const RunRecord& record);

/// Of a pair [J]; 0 of one that took nothing.
[[nodiscard]] double pair_work(const RunRecord& record, const collision::BodyPair& bodies);

}  // namespace supple::scenes
