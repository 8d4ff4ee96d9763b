/// Finds outputs that would be refused for their size, before a step is made.
#pragma once

#include "supple/scenes/plan.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Checks the present state: meshes, also those of pictures, grids of bodies that touch no other, and samples. Makes none of them except
/// coarse meshes of bodies that touch, where an error is given; evaluates other fields only where the bounding box of a surface may be too large.
/// @throws Error{Limit} as the output would, naming the key and the cell that would fit
void expect_output_sizes(Simulation& simulation, const OutputRequest& outputs);

}  // namespace supple::scenes
