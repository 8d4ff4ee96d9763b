/// @file supple/scenes/estimate.h
/// What a run takes, before it is made: `supple run --dry-run`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "supple/scenes/run.h"

namespace supple::scenes {

struct RunEstimate {
  std::size_t objects = 0, particles = 0;
  int frames = 0;             ///< that the run simulates
  int followed = 0;           ///< frames of the coarse simulation, of which the costs of the others are those of the last
  int calibrated = 0;         ///< frames made in full
  std::uint64_t steps = 0;
  double triangles = 0.0;     ///< of the surfaces of one frame, mean
  double memory = 0.0;        ///< with one frame in work at a time [byte]
  double disk = 0.0;          ///< of all files [byte]
  double simulation_s = 0.0;  ///< CPU time of steps, with those of the error estimate [s]
  double drawing_s = 0.0;     ///< CPU time of meshes, pictures and other files [s]
  double film_s = 0.0;        ///< CPU time of the program that encodes the film [s]
  double wall_s = 0.0;        ///< with the threads of the options, on an idle machine [s]
};

/// Follows the scene with coarse contact to its end, or as long as `follow_s`, and makes a sample of frames from its states in full, outputs included, in a folder
/// that is removed. CPU times of the sample over those of the same coarse frames scale the time of all coarse frames. Frames in which bodies touch and the others are
/// counted apart: their meshes differ.
/// @param options  frames, threads, limits and components of the run; its folder is not touched
/// @param follow_s  CPU time of the coarse simulation [s]
/// @throws as `run_scene`
[[nodiscard]] RunEstimate estimate_run(const Scene& scene, const RunOptions& options, double follow_s = 60.0);

/// "particles  64", a line each.
[[nodiscard]] std::string text_of(const RunEstimate& estimate);

}  // namespace supple::scenes
