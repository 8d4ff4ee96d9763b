/// Whether the meshes of a state would be refused for their size, before any is made.
#pragma once

#include <functional>

#include "supple/core/executor.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Checks all meshes except Delaunay meshes and, for bodies that touch no other, those with a given error, whose cells are not known in advance.
/// For an error where bodies touch, it checks as much as meshes of about a second of work show.
/// @param shown  selects surfaces to mesh, by their bounding boxes; empty: all
/// @throws Error{Limit} as Simulation::meshes
void expect_mesh_sizes(Simulation& simulation, const std::function<bool(const Box&)>& shown, const Executor& executor);

}  // namespace supple::scenes
