/// @file saved_frames.h
/// Saved states of a run, one per frame, and frame numbers as text.
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "supple/scenes/state.h"

namespace supple::scenes {

/// The first and the last frame up to `frame_count` whose states exist; nothing where none does.
struct SavedRange {
  int first = 1;
  int last = 1;
};
[[nodiscard]] std::optional<SavedRange> saved_range(const std::filesystem::path& folder, const std::string& name, int frame_count);

/// Frames that are saved, ascending. @param wanted  those to choose from; empty: all   @throws Error{Io} where there are none
[[nodiscard]] std::vector<int> saved_frames(const std::filesystem::path& folder, const Scene& scene, const std::set<int>& wanted);

/// The state of a frame, for reading. @throws as load_state; Error{Io} where it is absent
[[nodiscard]] State load_frame(const std::filesystem::path& folder, const Scene& scene, int frame);

/// Frames whose states are unusable for a run, and why.
struct UnusableFrames {
  std::vector<int> lost;
  std::vector<int> damaged;
  /// "frame 12 is simulated again: its saved state is lost"
  [[nodiscard]] std::vector<std::string> sentences() const;
};

/// The state of a frame, to continue from; nothing where it is absent or damaged, which is recorded.
/// @throws as load_state where it is complete but of another frame, scene or build
[[nodiscard]] std::optional<State> usable_frame(const std::filesystem::path& folder, const Scene& scene, int frame, UnusableFrames& unusable);

/// "frame 8", "frames 3, 5-9". @param frames  ascending
[[nodiscard]] std::string frames_text(const std::vector<int>& frames);

}  // namespace supple::scenes
