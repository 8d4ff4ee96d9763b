/// @file supple/scenes/run.h
/// A whole run, from scene to files: what `supple run`, `supple render` and `supple export` do.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/render/renderer.h"
#include "supple/scenes/accuracy.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Parses a list of frames such as "1-50,60,70-90:2". @throws Error{Usage}
[[nodiscard]] std::set<int> parse_frames(const std::string& text);

struct Progress {
  std::string stage;       ///< "simulate", "surface", "render", "film"
  int frame = 0;           ///< the present frame
  int frame_count = 0;
  double elapsed_s = 0.0;
  double left_s = -1.0;    ///< estimated time to the end [s]; negative while unknown
  double frames_per_s = 0.0;  ///< of the frames done since the first report; 0 while there is none
};

/// A state of another run that a run starts from.
struct RunStart {
  std::filesystem::path folder;  ///< of that run
  int frame = 1;
};

struct RunOptions {
  std::filesystem::path folder;                 ///< output folder
  std::set<int> frames{};                        ///< frames to output; empty: all. `run_scene` simulates no further than the last of them
  int threads = 0;                              ///< 0: all of the machine
  bool overwrite = false;                       ///< a folder with a result may be replaced
  bool resume = false;                          ///< continue from the states in the folder; frames whose states are lost or damaged are simulated again
  std::optional<RunStart> from{};               ///< start at this frame, from a saved state of a scene with the same objects and other values (Simulation::adopt)
  bool simulate_only = false;                   ///< no images, meshes, grids, samples or film
  bool skip = true;                             ///< see SimulationOptions::skip
  bool profile = false;
  bool estimate_errors = true;                  ///< simulate a sample of frames again, more accurately, for RunResult::errors
  bool divide = true;                           ///< see SimulationOptions::divide
  bool contact_sheet = true;                    ///< make the sheet of twelve pictures, too
  bool no_pictures = false;                     ///< no images and no film, which `render_run` makes of the saved states
  implicit::DelaunayMesher delaunay{};          ///< see SimulationOptions::delaunay
  std::string context = "auto";                 ///< auto, osmesa or egl
  int frames_at_once = 0;                       ///< frames in work at the same time when pictures are drawn, including the simulated one; 0: one per thread, as memory allows
  double memory = 0.0;                          ///< limit of memory for these beyond the first one [byte]; 0: half of the free memory
  double scene_memory = kDefaultMemory;         ///< limit of memory for the scene, by the counts made before it is built [byte]
  double time_limit = 0.0;                      ///< stop between two steps after this time [s]; 0: never. Ends with ErrorKind::Limit
  std::function<void(const Progress&)> progress{}; ///< called by several threads, but never at the same time; may be empty
  const std::atomic<int>* interrupt = nullptr;  ///< non-zero (the signal's number): the run ends soon, in whatever stage it is; saved frames stay
};

inline constexpr const char* kOutOfMemory =
    "memory: expected enough for the scene, found none left; fewer particles, bonds, samples or cells need less";

/// CPU time of all pictures of a run, by parts.
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

/// Where a run started that is a variation of another.
struct RunOrigin {
  std::filesystem::path folder;  ///< of the other run
  int frame = 1;
  std::uint64_t state_hash = 0;  ///< of its state there
  std::string differences;       ///< keys of that run's scene that differ, its values first: "objects.ball.particles.mass=2 (here 1)"; empty: none
};

struct RunResult {
  std::string outcome;      ///< done, diverged, interrupted, limit, io, invalid
  std::string reason;       ///< empty when done
  int exit_code = 0;
  int frames = 0;           ///< the last frame reached
  std::uint64_t state_hash = 0;
  std::filesystem::path folder;
  int pictures_drawn = 0;
  int frames_at_once = 1;   ///< frames that were in work at the same time
  int pictures_kept = 0;    ///< pictures of `render_run` that existed already and show this scene and state
  bool film_is_left = false; ///< frames are absent, and other processes that still draw make film and sheet
  std::filesystem::path report; ///< result.json, render.json or export.json; empty where nothing was done and that of an earlier run stays
  std::filesystem::path film;   ///< empty: none
  std::vector<std::string> warnings;
  SearchCounts searches;    ///< counts of the meshes of all frames, kept ones included
  PictureTimes pictures;
  StageErrors errors;       ///< of what `run_scene` simulated, where RunOptions asks for them
  std::optional<RunOrigin> origin{};  ///< of a variation
};

/// Checks the requirements of pictures, as runs that draw do before they begin: the files of textures, and the path tracer.
/// @throws Error{Io} naming key and file, Error{Usage} in builds without the requested renderer
void check_pictures(const Scene& scene);

/// Simulates, surfaces, renders and films a scene into options.folder:
/// frames/NAME.0001.png, NAME.mp4, NAME_sheet.png, states/NAME.0001.state, meshes/, searches/, NAME.usda, grids/, contacts/,
/// particles/, samples/, NAME_contacts.pvd, NAME_particles.pvd, NAME_samples.pvd as requested, and always result.json, also when the run failed. Files appear under their names when they are complete.
/// @throws Error{Io} when not even the folder can be made or is in use, Error{Usage}
[[nodiscard]] RunResult run_scene(const Scene& scene, const RunOptions& options);

/// Draws the frames of a finished or interrupted run again from its saved states, with the scene's camera and looks.
/// Existing pictures of the same scene and state are kept, unless options.overwrite. Writes render.json.
/// Several processes may do this in one folder at the same time, each with its own frames, all in one look. One that completes the frames makes
/// film and sheet; the last one does, or says which frames have no picture, where none completes them.
[[nodiscard]] RunResult render_run(const Scene& scene, const RunOptions& options);

/// Writes NAME_sheet.png, one per camera, from the frames of a run: twelve frames spread over all, 4 per row.
/// @throws Error{Io} when there are none
std::vector<std::filesystem::path> make_sheets(const Scene& scene, const std::filesystem::path& folder);

/// Writes the files that the scene's `output` requests, except images and film, from the saved states of a run. Writes
/// export.json as its report. @throws Error{Usage} when no file is requested
[[nodiscard]] RunResult export_run(const Scene& scene, const RunOptions& options);

/// Writes a result.json with the faults of a scene. Does nothing where the scene could not be read (Error{Io}),
/// the folder cannot be made, or it holds an earlier result.
void leave_failure(const std::filesystem::path& folder, const std::string& name, const Error& error);

/// File stem of a scene: its file name without extension.
[[nodiscard]] std::string scene_name(const Scene& scene);

}  // namespace supple::scenes
