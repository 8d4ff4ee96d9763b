/// @file unreached.h
/// Pictures of a run with other solids than those that it was made with, where nothing came to either.
#pragma once

#include <filesystem>
#include <set>

#include "supple/scenes/state.h"

namespace supple::scenes {

/// `scene_to_draw` for the last one of the saved frames of a run. @param frames  those to choose from; empty: all
[[nodiscard]] Scene scene_to_draw(const Scene& scene, const std::filesystem::path& folder, const std::set<int>& frames);

}  // namespace supple::scenes
