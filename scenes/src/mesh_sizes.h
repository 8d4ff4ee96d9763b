/// Whether the meshes of a state would be refused for their size, before any is made.
#pragma once

#include <functional>

#include "supple/core/executor.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Looks at all but meshes within a given error and Delaunay's, which choose their cells as they go.
/// @param shown  which surfaces a mesh is wanted of, by their boxes; empty: all
/// @throws Error{Limit} as Simulation::meshes
void expect_mesh_sizes(Simulation& simulation, const std::function<bool(const Box&)>& shown, const Executor& executor);

}  // namespace supple::scenes
