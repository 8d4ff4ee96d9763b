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

/// Writes the grids of successive frames and keeps unchanged data: for bodies that touch no other, OpenVDB leaves that no moved primitive
/// reaches; for bodies that touch, whole grids where neither they nor their partners changed; for the grid of all bodies, leaves
/// that no changed body reaches. The kept data are valid for any state.
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
