/// @file tests/scenes/run_scenes.h
/// Scenes from text and from the library, run for some frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/source_dir.h"

namespace supple::scenes {

inline Scene library_scene(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return read_scene(source_dir() / "scenes/library" / (name + ".yaml"), overrides);
}

inline Simulation make(const std::string& text, SimulationOptions options = {}) {
  return Simulation(parse_scene(text, "test.yaml", "."), options);
}

inline void run(Simulation& simulation, int frames) {
  while (simulation.frame() < frames) simulation.step_frame();
}

inline std::uint64_t hash_after(const Scene& scene, int frames, SimulationOptions options) {
  Simulation simulation(scene, options);
  run(simulation, frames);
  return simulation.state_hash();
}

}  // namespace supple::scenes
