/// result.json: the report of a run.
#pragma once

#include "supple/scenes/run.h"

namespace supple::scenes {

/// Times of a command [s].
struct TimeTaken {
  double wall = 0.0;
  double cpu = 0.0;  ///< of all threads
};

/// @param simulation  may be null when the run failed before it began
void write_result_file(const Scene& scene, const RunResult& result, const Simulation* simulation, const TimeTaken& taken);

}  // namespace supple::scenes
