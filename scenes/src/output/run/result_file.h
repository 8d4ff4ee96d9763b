/// result.json: the report of a run.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "supple/scenes/run.h"

namespace supple::scenes {

/// Times of a command [s].
struct TimeTaken {
  double wall = 0.0;
  double cpu = 0.0;  ///< of all threads
};

/// The content of the report. @param simulation  may be null when the run failed before it began
[[nodiscard]] nlohmann::ordered_json report_of(const Scene& scene, const RunResult& result, const Simulation* simulation, const TimeTaken& taken);

/// Writes it to result.report.
void write_result_file(const Scene& scene, const RunResult& result, const Simulation* simulation, const TimeTaken& taken);

}  // namespace supple::scenes
