/// Velocities of the surfaces of a frame.
#pragma once

#include "simulation/frame.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Adds the columns of implicit::add_motion to the mesh of a body, also where kernels grow to hold a volume or blends fade. @pre the frame has the body's field, poses, velocities and spins
void add_surface_motion(const StageContext& context, const State& state, std::size_t body, const Frame& frame, Mesh& mesh);

}  // namespace supple::scenes
