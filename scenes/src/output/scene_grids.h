/// Stage 11: the grids of a frame, in one file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "supple/core/content_versions.h"
#include "supple/implicit/surface_grid.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Writes the grids of frame after frame and keeps what nothing changed: leaves that no primitive reaches that moved, of bodies that touch
/// no other; whole grids of bodies that touch, where neither they nor what they touch changed; of the grid of all bodies, leaves
/// that no changed one reaches. What is kept holds for any state.
class SceneGrids {
 public:
  /// FOLDER/grids/NAME.0012.vdb @throws Error{Limit} with the scene's key
  void write(const std::filesystem::path& folder, const std::string& name, int frame, Simulation& simulation);

 private:
  std::vector<implicit::GridUpdater> updater_;              // by body
  std::map<std::uint64_t, implicit::SurfaceGrid> divided_;  // of bodies that touch, by what they depend on
  implicit::UnionUpdater united_;
  ContentVersions versions_;
};

/// Of bodies that touch no other. @throws Error{Limit} as SceneGrids::write
void expect_grid_sizes(Simulation& simulation, const Executor& executor);

}  // namespace supple::scenes
