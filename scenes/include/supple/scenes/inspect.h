/// @file supple/scenes/inspect.h
/// Looking at runs that are done: what `supple info` and `supple compare` do.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

namespace supple::scenes {

/// What a run folder holds, for reading: outcome, audits, objects, time by stage, and the files by kind.
/// @throws Error{Io} without a result.json, Error{Corrupt} when it is none
[[nodiscard]] std::string describe_run(const std::filesystem::path& folder);

struct ComparisonOptions {
  std::filesystem::path first, second;  ///< run folders
  std::filesystem::path folder;         ///< where the comparison goes
  double gain = 8.0;                    ///< of the difference pictures
  bool film = true;
  std::string camera{};                 ///< whose frames, where a run has several cameras
  const std::atomic<int>* interrupt = nullptr;  ///< ends the comparison when set by another thread or a signal; null: never
};

struct FrameComparison {
  int frame = 0;
  double psnr = 0.0;                    ///< [dB], infinite for equal pictures
  int largest = 0;                      ///< difference of a channel, 0 .. 255
};

struct Comparison {
  std::vector<FrameComparison> frames;  ///< those that both runs have, ascending
  int only_first = 0, only_second = 0;  ///< frames that only one of them has
  std::filesystem::path film;           ///< empty: none
};

/// Puts the frames of two runs side by side with their difference (absolute, times gain): folder/frames/compare.0001.png,
/// compare.mp4 and compare.csv (frame, PSNR, largest difference).
/// @throws Error{Io} without a common frame or where another process uses the folder, Error{Usage} when the sizes differ or it
///   is open which camera is meant, Interrupted
[[nodiscard]] Comparison compare_runs(const ComparisonOptions& options);

}  // namespace supple::scenes
