/// @file reach.h
/// Where the surfaces of objects were during a run, and which solids they may have touched: what a later picture needs to know about other solids.
#pragma once

#include <vector>

#include "supple/scenes/state.h"

namespace supple::scenes {

/// Whether a solid acts on the motion even where nothing comes near: one that moves bounds the time step, one of primitives the spacing of samples.
[[nodiscard]] bool takes_part(const FixedBody& solid);
/// Whether F <= 0 of a solid at rest on all of a box [m]. False for solids that take part anyway.
[[nodiscard]] bool is_apart(const FixedBody& solid, const Box& box);

/// Largest distance of two vectors with the same index. @pre as many of both
[[nodiscard]] double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b);

/// Adds to the record what surfaces reach around the present state, in a stretch of time in which a particle moves by no more than `way` [m] from its place
/// in this state. The first call of a run names the solids.
void book_reach(const Model& model, const State& state, double way, RunRecord& record);
/// After the steps of a frame: which solids were reached in it. @pre book_reach was called
void look_for_solids(const Model& model, RunRecord& record);

/// After solids were added or left out that nothing touched: gives the others in a state the numbers that they have in this model.
void renumber_solids(const Model& model, State& state);

}  // namespace supple::scenes
