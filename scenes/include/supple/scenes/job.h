/// @file supple/scenes/job.h
/// Files that run a scene or a sweep on many machines, by engines that exist: OpenJD, Slurm, Ray.
///
/// A scene is one task that simulates, tasks of some frames each that depend on it, and one that makes what is left: film and sheet. A sweep is one task for
/// each of its points, and one that joins their rows. Every task is a command of the tool that may be ended and called again at any moment: it does
/// what is missing, and nothing where all is there. All machines must see scene and output folder under the same names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "supple/scenes/scene.h"

namespace supple::scenes {

enum class JobFormat : std::uint8_t {
  OpenJd,  ///< template 2023-09 of Open Job Description, in JSON
  Slurm,   ///< Bash script that submits itself with sbatch: an array of tasks for the frames
  Ray,     ///< Python script
};

struct JobOptions {
  JobFormat format = JobFormat::OpenJd;
  std::filesystem::path folder{};    ///< output folder of the run; not of sweeps, which have their own
  std::string program = "supple";    ///< the tool, as the machines find it
  int chunk = 10;                    ///< frames of a task, >= 1
  int threads = 4;                   ///< threads of a task, and processors that it asks for, >= 1
};

/// 16 hexadecimal digits of all keys that act on motion, of the files they name and of the number of frames.
/// @param pictures  and of keys that act on pictures; fingerprints of jobs have them
[[nodiscard]] std::string fingerprint_of(const Scene& scene, bool pictures = true);
/// @throws Error{Scene} where the scene has another fingerprint
void expect_fingerprint(const Scene& scene, const std::string& fingerprint);

/// The text of a job file of a scene that was read from a file. The same scene and options give the same text.
/// @throws Error{Usage} where a name cannot be written in the format
[[nodiscard]] std::string scene_job(const Scene& scene, const JobOptions& options);

/// Whether a folder holds the plan of a sweep, sweep.json.
[[nodiscard]] bool is_sweep(const std::filesystem::path& folder);
/// 16 hexadecimal digits of the plan. @throws Error{Io}
[[nodiscard]] std::string sweep_fingerprint(const std::filesystem::path& folder);
/// @throws Error{Io} without a plan, Error{Scene} where the plan has another fingerprint
void expect_sweep_fingerprint(const std::filesystem::path& folder, const std::string& fingerprint);
/// The text of a job file of a sweep; points are counted from 1. @throws Error{Io} without a plan that lists points, Error{Usage} as scene_job
[[nodiscard]] std::string sweep_job(const std::filesystem::path& folder, const JobOptions& options);

}  // namespace supple::scenes
