/// @file search_files.h
/// What searches of meshes tell, a file a frame, so that it counts for the run whoever made the frame and when.
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "supple/scenes/mesh_search.h"

namespace supple::scenes {

/// {"pieces": 1, "undecided": 0, "unsearched": {"ball": {"cost": 2}}, "blunt": {"ball": 3}}
[[nodiscard]] nlohmann::ordered_json json_of(const SearchCounts& counts);

/// searches/NAME.0012.json, which is absent where there is nothing to tell. @throws Error{Io}
void write_searches(const std::filesystem::path& folder, const std::string& name, int frame, const SearchCounts& counts);

/// The same of a frame of which no meshes are made: what the file says of meshes stays.
void write_short_bulges(const std::filesystem::path& folder, const std::string& name, int frame, const SearchCounts& counts);

/// Of frames 1 to `last` that are among `frames`, or of all where that is empty. What is absent or none of ours counts as nothing.
[[nodiscard]] SearchCounts read_searches(const std::filesystem::path& folder, const std::string& name, const std::set<int>& frames, int last);

}  // namespace supple::scenes
