/// Outputs that would be refused for their size, found before a step is made.
#pragma once

#include "supple/scenes/plan.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Of the present state: meshes, also those that pictures need, grids of bodies that touch no other, and samples. Makes none of them but, to
/// an error, coarse meshes of bodies that touch, and looks at other fields only where the box of a surface is too large to be surely allowed.
/// @throws Error{Limit} as the output would, naming the key and the cell that would fit
void expect_output_sizes(Simulation& simulation, const OutputRequest& outputs);

}  // namespace supple::scenes
