/// result.json: what came out of a run, for people and programs.
#pragma once

#include "supple/scenes/run.h"

namespace supple::scenes {

/// @param simulation  may be null when the run failed before it began
void write_result_file(const Scene& scene, const RunResult& result, const Simulation* simulation, double wall_s);

}  // namespace supple::scenes
