/// Stage 11: files of one frame, each complete when it has its name.
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

/// Names of the scenes whose states lie in the folder.
[[nodiscard]] std::set<std::string> saved_scenes(const std::filesystem::path& folder);

/// Removes what an earlier run of this scene left in the folder (states, frames, tables, film, result), and nothing that a run
/// does not write.
void remove_outputs(const std::filesystem::path& folder, const std::string& name);

/// Removes files of an interrupted run of this scene that never got their names, and folders in which its films were made.
void remove_temporaries(const std::filesystem::path& folder, const std::string& name);

/// Books process CPU time of a scope on a stage.
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
