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
  bool built = false;                  ///< false: the scene is so large that its counts alone were looked at
  std::vector<std::string> warnings;
  std::string mesh_obstacles;          ///< a line for each: how far its surface is from its triangles; empty unless built
};

/// Looks for faults of a scene that was read: counts what it takes, builds it, looks for the files of its pictures, at the sizes of its
/// outputs and at its first time step. Where it takes more than a check builds, counts and files are all that is looked at, which a warning says.
/// @param options  `memory`: that a run may take [byte]; `questions` is set
/// @param build    memory that may be taken to look at all of the scene [byte]
/// @throws Error naming all faults found, OverBudget where a run would be refused for its memory
[[nodiscard]] CheckReport check_scene(const Scene& scene, SimulationOptions options, double build = kCheckMemory);

}  // namespace supple::scenes
