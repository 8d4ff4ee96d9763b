/// Whether the meshes of a state would be refused for their size, before any is made.
#pragma once

#include <functional>

#include "supple/core/executor.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Looks at all but Delaunay's meshes and, of bodies that touch no other, those within a given error, which choose their cells as they go.
/// Of an error where bodies touch as much is told as follows from meshes that take about a second.
/// @param shown  which surfaces a mesh is wanted of, by their boxes; empty: all
/// @throws Error{Limit} as Simulation::meshes
void expect_mesh_sizes(Simulation& simulation, const std::function<bool(const Box&)>& shown, const Executor& executor);

}  // namespace supple::scenes
