/// Scripts of job files, with @JOB@ for a line about the job and @COMMANDS@ for the assignments of what they call.
#pragma once

#include <string>
#include <string_view>

namespace supple::scenes {

/// Bash. Uses the arrays `simulate` and `draw` or `point` and `collect`, and name, logs, threads, frames and chunk or points.
[[nodiscard]] std::string slurm_script(bool sweep);
/// Python. Uses the lists SIMULATE and DRAW or POINT and COLLECT, and THREADS, FRAMES and CHUNK or POINTS.
[[nodiscard]] std::string ray_script(bool sweep);

}  // namespace supple::scenes
