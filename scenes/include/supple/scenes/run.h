/// @file supple/scenes/run.h
/// A whole run, from scene to files: what `supple run`, `supple render` and `supple export` do.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/render/renderer.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Frames asked for: "1-50,60,70-90:2". @throws Error{Usage}
[[nodiscard]] std::set<int> parse_frames(const std::string& text);

struct Progress {
  std::string stage;       ///< "simulate", "surface", "render", "film"
  int frame = 0;           ///< the frame at work
  int frame_count = 0;
  double elapsed_s = 0.0;
  double left_s = -1.0;    ///< estimate; negative while unknown
  double frames_per_s = 0.0;  ///< of the frames done since the first report; 0 while there is none
};

struct RunOptions {
  std::filesystem::path folder;                 ///< where everything goes
  std::set<int> frames{};                        ///< frames to output; empty: all. `run_scene` simulates no further than the last of them
  int threads = 0;                              ///< 0: all the machine has
  bool overwrite = false;                       ///< a folder with a result may be replaced
  bool resume = false;                          ///< continue from the states in the folder; those that are lost or damaged are simulated again
  bool simulate_only = false;                   ///< no images, meshes, grids, samples or film
  bool skip = true;                             ///< see SimulationOptions::skip
  bool profile = false;
  implicit::DelaunayMesher delaunay{};          ///< see SimulationOptions::delaunay
  std::string context = "auto";                 ///< auto, osmesa or egl
  int frames_at_once = 0;                       ///< in work at the same time where pictures are drawn, the one that is simulated too; 0: one a thread, as memory allows
  double memory = 0.0;                          ///< for that, beyond the first one [byte]; 0: half of what the machine has free
  double scene_memory = kDefaultMemory;         ///< that the scene may take, by what is counted before it is built [byte]
  double time_limit = 0.0;                      ///< stop between two steps after this long [s]; 0: never. Leaves ErrorKind::Limit
  std::function<void(const Progress&)> progress{}; ///< never twice at the same time, but from several threads; may be empty
  const std::atomic<int>* interrupt = nullptr;  ///< non-zero (the signal's number): the run ends soon, in whatever it does; frames that were saved stay
};

inline constexpr const char* kOutOfMemory =
    "memory: expected enough for the scene, found none left; fewer particles, bonds, samples or cells need less";

/// CPU time of all pictures of a run, by their parts.
struct PictureTimes {
  int images = 0;
  render::RenderTimes render;
  double encode_s = 0.0;    ///< PNG
  /// Adds the images of another, and a share of its times.
  void add(const PictureTimes& other, double share) {
    images += other.images;
    render.add(other.render, share);
    encode_s += share * other.encode_s;
  }
};

struct RunResult {
  std::string outcome;      ///< done, diverged, interrupted, limit, io, invalid
  std::string reason;       ///< empty when done
  int exit_code = 0;
  int frames = 0;           ///< the last frame reached
  std::uint64_t state_hash = 0;
  std::filesystem::path folder;
  int pictures_drawn = 0;
  int frames_at_once = 1;   ///< that were in work at the same time
  int pictures_kept = 0;    ///< those of `render_run` that were there already and show this scene and state
  std::filesystem::path report; ///< result.json, render.json or export.json
  std::filesystem::path film;   ///< empty: none
  std::vector<std::string> warnings;
  SearchCounts searches;    ///< of the meshes of all frames, those that were kept too
  PictureTimes pictures;
};

/// Looks for what pictures need, as runs that draw do before they begin: the files that textures name, and the path tracer.
/// @throws Error{Io} naming key and file, Error{Usage} in builds without the renderer asked for
void check_pictures(const Scene& scene);

/// Simulates, surfaces, renders and films a scene into options.folder:
/// frames/NAME.0001.png, NAME.mp4, NAME_sheet.png, states/NAME.0001.state, meshes/, searches/, NAME.usda, grids/, contacts/,
/// particles/, samples/, NAME_contacts.pvd, NAME_particles.pvd, NAME_samples.pvd as asked for, and always result.json, also when the run failed. Files appear under their names when they are complete.
/// @throws Error{Io} when not even the folder can be made or is in use, Error{Usage}
[[nodiscard]] RunResult run_scene(const Scene& scene, const RunOptions& options);

/// Draws the frames of a finished or interrupted run again from its saved states, with the scene's camera and looks.
/// Pictures that are there and show the same scene and state are kept, unless options.overwrite. Leaves render.json.
[[nodiscard]] RunResult render_run(const Scene& scene, const RunOptions& options);

/// NAME_sheet.png of the frames that a run has, one a camera: twelve spread over all, 4 a row.
/// @throws Error{Io} when there are none
std::vector<std::filesystem::path> make_sheets(const Scene& scene, const std::filesystem::path& folder);

/// Writes the files that the scene's `output` asks for, images and film left out, from the saved states of a run. Leaves
/// export.json as its report. @throws Error{Usage} when no file is asked for
[[nodiscard]] RunResult export_run(const Scene& scene, const RunOptions& options);

/// Leaves a result.json that says what is wrong with a scene that was read. Does nothing where the scene could not be read (Error{Io}),
/// the folder cannot be made, or it holds an earlier result.
void leave_failure(const std::filesystem::path& folder, const std::string& name, const Error& error);

/// File stem of a scene: its file name without extension.
[[nodiscard]] std::string scene_name(const Scene& scene);

}  // namespace supple::scenes
