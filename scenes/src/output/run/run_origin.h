/// @file run_origin.h
/// Runs that start from a state of another run: origin.json in their folder says which.
#pragma once

#include <filesystem>
#include <optional>

#include "supple/scenes/run.h"

namespace supple::scenes {

inline constexpr const char* kOriginFile = "origin.json";

/// Where the run in a folder started; none for one that began at frame 1 of its own scene. @throws Error{Corrupt} for another file of this name
[[nodiscard]] std::optional<RunOrigin> read_origin(const std::filesystem::path& folder);
void write_origin(const std::filesystem::path& folder, const RunOrigin& origin);
/// The first frame of the run in a folder.
[[nodiscard]] int first_frame_of(const std::filesystem::path& folder);

/// Puts a simulation at the state that a run starts from.
/// @throws Error{Io} where there is no such state, Error{Corrupt} for a damaged one, Error{Usage} where its objects are not those of the scene
RunOrigin start_from(const RunStart& start, Simulation& simulation);

}  // namespace supple::scenes
