/// Writes the outputs of a run, frame by frame.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "output/files/folder_lock.h"
#include "output/files/scene_grids.h"
#include "output/pictures/picture.h"
#include "simulation/scene_samples.h"
#include "supple/core/io/usd_file.h"
#include "supple/scenes/run.h"

namespace supple::scenes {

/// Reports the progress of a run to RunOptions::progress.
class Reporter {
 public:
  Reporter(const RunOptions& options, int frame_count);
  void operator()(const std::string& stage, int frame, double done);

 private:
  const RunOptions& options_;
  int frame_count_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::optional<double> first_;  ///< share that was done at the first report
};

/// Stems of the pictures of a scene, one per camera.
[[nodiscard]] std::vector<std::string> image_names(const Scene& scene);

class FrameWriter {
 public:
  /// Makes the folders. @throws Error{Io}
  FrameWriter(const Scene& scene, const Model& model, const RunOptions& options, OutputRequest outputs);

  /// Writes all requested outputs of the present frame. Samples follow from all earlier frames, so every frame must be passed.
  void write(Simulation& simulation, Reporter& report, double done);
  /// Writes films, contact sheets and lists over all existing frames 1 .. last. Returns the film, if there is one.
  std::filesystem::path finish(Simulation& simulation, Reporter& report, int last);

  /// Whether frames 1 .. last all have a picture in the look of this writer. @param from  frames after it are looked at first
  [[nodiscard]] bool pictures_are_there(int last, int from) const;
  /// What pictures depend on besides the state.
  [[nodiscard]] static PictureLook look_of(const Scene& scene, const RunOptions& options);

  /// Whether frames have separate files or share one.
  [[nodiscard]] bool writes_frames() const;
  /// Whether frames must be written in order, by one writer.
  [[nodiscard]] bool needs_order() const { return samples_ || animation_; }
  /// Whether an earlier frame must be processed again: for a file over all frames or for samples, or because one of its own
  /// files is absent or its picture shows another scene or state.
  [[nodiscard]] bool renews(int frame, std::uint64_t state_hash) const;
  /// Writes the files again that `renews` found.
  void renew(Simulation& simulation, Reporter& report, double done);
  [[nodiscard]] int pictures_drawn() const { return pictures_drawn_; }
  /// CPU time of pictures by parts [s].
  [[nodiscard]] PictureTimes picture_times() const;
  void add_warnings(std::vector<std::string>& warnings) const;

 private:
  [[nodiscard]] bool wanted(int frame) const { return options_.frames.empty() || options_.frames.contains(frame); }
  [[nodiscard]] std::filesystem::path picture_path(std::size_t camera, int frame, ImageName format) const;
  [[nodiscard]] std::string look() const;
  [[nodiscard]] bool files_are_there(int frame) const;
  void write(Simulation& simulation, Reporter& report, double done, bool draws, bool files);
  [[nodiscard]] bool pictures_are_current(int frame, std::uint64_t state_hash) const;
  void draw(Simulation& simulation, Reporter& report, double done);
  void follow(Simulation& simulation, Reporter& report, double done);
  void write_meshes(const Simulation& simulation, const std::vector<Mesh>& meshes);
  void write_tables(Simulation& simulation);
  std::filesystem::path make_film(const std::string& name, int last);
  /// @param what  of several tables in one folder: the part of their names after the scene's
  void write_time_list(const std::string& part, int last, const std::string& what = {});

  const Scene& scene_;
  const RunOptions& options_;
  OutputRequest outputs_;
  std::string name_;
  std::vector<std::string> image_names_;  // one per camera
  std::vector<ImageName> image_formats_;
  std::unique_ptr<ScenePictures> pictures_;
  std::unique_ptr<io::UsdAnimation> animation_;
  std::unique_ptr<SceneSamples> samples_;
  SceneGrids grids_;
  std::string look_;  // of pictures, see frame_looks.h
  std::set<std::string> removed_films_;
  int pictures_drawn_ = 0;
  int images_ = 0;
  double encode_s_ = 0.0;
  std::vector<std::string> warnings_;
};

}  // namespace supple::scenes
