/// @file supple/scenes/check.h
/// What `supple check` does: a scene's faults, without a run.
#pragma once

#include <string>
#include <vector>

#include "supple/scenes/simulation.h"

namespace supple::scenes {

struct CheckReport {
  std::size_t objects = 0;
  std::size_t particles = 0;
  int frames = 0;
  bool built = false;                  ///< false: the scene is so large that only its counts were checked
  std::vector<std::string> warnings;
  std::string mesh_obstacles;          ///< one line each: largest distance of its surface from its triangles; empty unless built
};

/// Checks a scene that was read: estimates its memory, builds it, checks that the files of its pictures exist, the sizes of its
/// outputs, and its first time step. A scene that needs more memory than `build` is not built, and what takes more processor time than `seconds` is
/// broken off; then only keys, counts and files are checked, which a warning says.
/// @param options  `memory`: limit of memory for a run [byte]; `questions` is set
/// @param build    limit of memory for the whole check [byte]
/// @param seconds  limit of processor time for building the scene and its first contacts [s]
/// @throws Error naming all faults found, OverBudget where a run would be refused for its memory
[[nodiscard]] CheckReport check_scene(const Scene& scene, SimulationOptions options, double build = kCheckMemory, double seconds = kCheckSeconds);

}  // namespace supple::scenes
