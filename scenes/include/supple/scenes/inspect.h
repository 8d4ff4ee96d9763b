/// @file supple/scenes/inspect.h
/// Inspection of finished runs: `supple info` and `supple compare`.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

namespace supple::scenes {

/// The content of a run folder as text: outcome, audits, objects, time by stage, and the files by kind.
/// @throws Error{Io} without a result.json, Error{Corrupt} when it is none
[[nodiscard]] std::string describe_run(const std::filesystem::path& folder);

struct ComparisonOptions {
  std::filesystem::path first, second;  ///< run folders
  std::filesystem::path folder;         ///< output folder of the comparison
  double gain = 8.0;                    ///< factor of the differences in the pictures
  bool film = true;
  std::string camera{};                 ///< camera whose frames are compared, for runs with several
  const std::atomic<int>* interrupt = nullptr;  ///< ends the comparison when set by another thread or a signal; null: never
};

struct FrameComparison {
  int frame = 0;
  double psnr = 0.0;                    ///< [dB], infinite for equal pictures
  int largest = 0;                      ///< difference of a channel, 0 .. 255
};

struct Comparison {
  std::vector<FrameComparison> frames;  ///< frames that both runs have, ascending
  int only_first = 0, only_second = 0;  ///< frames that only one of them has
  std::filesystem::path film;           ///< empty: none
};

/// Puts the frames of two runs side by side with their difference (absolute, times gain): folder/frames/compare.0001.png,
/// compare.mp4 and compare.csv (frame, PSNR, largest difference).
/// @throws Error{Io} without a common frame or where another process uses the folder, Error{Usage} when the sizes differ or
///   the camera is ambiguous, Interrupted
[[nodiscard]] Comparison compare_runs(const ComparisonOptions& options);

}  // namespace supple::scenes
