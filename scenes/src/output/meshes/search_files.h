/// @file search_files.h
/// Results of the searches of meshes, one file per frame, so that the report of a run counts all frames, whenever they were made.
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "supple/scenes/mesh_search.h"

namespace supple::scenes {

/// {"pieces": 1, "undecided": 0, "unsearched": {"ball": {"cost": 2}}, "blunt": {"ball": 3}}
[[nodiscard]] nlohmann::ordered_json json_of(const SearchCounts& counts);

/// Writes searches/NAME.0012.json, or removes it where there is nothing to report. @throws Error{Io}
void write_searches(const std::filesystem::path& folder, const std::string& name, int frame, const SearchCounts& counts);

/// The same for a frame without meshes: the counts of meshes in the file stay.
void write_short_bulges(const std::filesystem::path& folder, const std::string& name, int frame, const SearchCounts& counts);

/// Sum over frames 1 to `last` that are among `frames`, or all where that is empty. Absent and foreign files count as empty.
[[nodiscard]] SearchCounts read_searches(const std::filesystem::path& folder, const std::string& name, const std::set<int>& frames, int last);

}  // namespace supple::scenes
