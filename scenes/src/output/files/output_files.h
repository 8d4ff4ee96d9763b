/// Stage 11: files of one frame; a file gets its name when it is complete.
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// "name.0012.ext"
[[nodiscard]] std::string numbered(const std::string& name, int frame, const std::string& extension);
[[nodiscard]] std::filesystem::path state_path(const std::filesystem::path& folder, const std::string& name, int frame);
[[nodiscard]] std::filesystem::path frame_path(const std::filesystem::path& folder, const std::string& name, int frame);

/// Names of the scenes whose states are in the folder.
[[nodiscard]] std::set<std::string> saved_scenes(const std::filesystem::path& folder);

/// Removes files of an earlier run of this scene from the folder (states, frames, tables, film, result), and nothing that a run
/// does not write.
void remove_outputs(const std::filesystem::path& folder, const std::string& name);

/// Removes temporary files of an interrupted run of this scene, and folders in which its films were made.
void remove_temporaries(const std::filesystem::path& folder, const std::string& name);

/// Adds the process CPU time of a scope to a stage.
class StageClock {
 public:
  explicit StageClock(StageProfile& profile);
  ~StageClock();
  StageClock(const StageClock&) = delete;
  StageClock& operator=(const StageClock&) = delete;

 private:
  StageProfile& profile_;
  double begin_;
};

}  // namespace supple::scenes
