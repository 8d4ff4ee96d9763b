#include "supple/scenes/run.h"

#include <sys/file.h>
#include <sys/resource.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <optional>

#include "output_files.h"
#include "picture.h"
#include "result_file.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/render/renderer.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// Holds the run folder for one process; a second run of the same folder is told so.
class FolderLock {
 public:
  explicit FolderLock(const fs::path& folder) {
    const fs::path path = folder / ".lock";
    file_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (file_ < 0 || flock(file_, LOCK_EX | LOCK_NB) != 0) {
      if (file_ >= 0) close(file_);
      throw Error(ErrorKind::Io, Fault{.place = folder.string(),
                                       .key = {},
                                       .expected = "expected an output folder that no other run uses",
                                       .found = "one that is locked",
                                       .hint = "wait for the other run or choose another --out"});
    }
  }
  ~FolderLock() { close(file_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int file_ = -1;
};

/// Files of an earlier, interrupted run of ours that never got their names.
void remove_temporaries(const fs::path& folder) {
  for (const auto& entry : fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied)) {
    if (entry.is_regular_file() && entry.path().extension() == ".tmp") {
      std::error_code ignored;
      fs::remove(entry.path(), ignored);
    }
  }
}

class Reporter {
 public:
  Reporter(const RunOptions& options, int frame_count) : options_(options), frame_count_(frame_count) {}

  void operator()(const std::string& stage, int frame, double done) {
    if (!options_.progress) return;
    const double elapsed = seconds_since(begin_);
    const double left = done > 0.02 ? elapsed * (1.0 - done) / done : -1.0;
    options_.progress({stage, frame, frame_count_, elapsed, left});
  }
  [[nodiscard]] double elapsed() const { return seconds_since(begin_); }

 private:
  const RunOptions& options_;
  int frame_count_;
  Clock::time_point begin_ = Clock::now();
};

std::optional<int> last_saved_frame(const fs::path& folder, const std::string& name, int frame_count) {
  for (int frame = frame_count; frame >= 1; --frame) {
    if (fs::exists(state_path(folder, name, frame))) return frame;
  }
  return std::nullopt;
}

render::ContextKind context_kind(const std::string& name) {
  if (name == "auto") return render::ContextKind::Auto;
  if (name == "osmesa") return render::ContextKind::OSMesa;
  if (name == "egl") return render::ContextKind::Egl;
  throw Error(ErrorKind::Usage, Fault{.place = "--context",
                                      .key = {},
                                      .expected = "expected auto, osmesa or egl",
                                      .found = name,
                                      .hint = {}});
}

/// What a run writes, frame by frame.
class FrameWriter {
 public:
  FrameWriter(const Scene& scene, const RunOptions& options, OutputRequest outputs)
      : scene_(scene), options_(options), outputs_(outputs), name_(scene_name(scene)) {
    context_ = context_kind(options.context);
    for (const CameraDesc& camera : cameras_of(scene))
      image_names_.push_back(camera.name.empty() ? name_ : name_ + '.' + camera.name);
  }

  void write(Simulation& simulation, Reporter& report, double done) {
    const int frame = simulation.frame();
    if (!options_.frames.empty() && !options_.frames.contains(frame)) return;
    const std::vector<Mesh>* meshes = nullptr;
    if (outputs_.images || outputs_.meshes) {
      report("surface", frame, done);
      meshes = &simulation.meshes();
    }
    if (outputs_.images) {
      report("render", frame, done);
      if (!pictures_) pictures_ = std::make_unique<ScenePictures>(scene_, simulation.model(), context_);
      for (std::size_t camera = 0; camera < image_names_.size(); ++camera) {
        render::Image image;
        {
          const StageClock clock(simulation.profile(Stage::Render));
          image = pictures_->draw(simulation, camera);
        }
        const StageClock clock(simulation.profile(Stage::Export));
        render::write_png(frame_path(options_.folder, image_names_[camera], frame), image);
        ++images_;
      }
    }
    const StageClock clock(simulation.profile(Stage::Export));
    if (outputs_.meshes) write_mesh_files(options_.folder, name_, frame, simulation, *meshes);
    if (outputs_.grids) write_grid_file(options_.folder, name_, frame, simulation);
    if (outputs_.contacts) write_contact_table(options_.folder, name_, frame, simulation);
    if (outputs_.particles) write_particle_table(options_.folder, name_, frame, simulation);
  }

  /// Film and contact sheet of each camera, of all frames 1 .. last that are there; returns the first film.
  fs::path finish(Simulation& simulation, Reporter& report, int last) {
    if (!outputs_.images) return {};
    const StageClock clock(simulation.profile(Stage::Export));
    report("film", last, 0.99);
    fs::path first_film;
    for (const std::string& name : image_names_) {
      write_contact_sheet(options_.folder, name, last);
      if (!outputs_.film) continue;
      bool all = true;
      for (int frame = 1; frame <= last && all; ++frame) all = fs::exists(frame_path(options_.folder, name, frame));
      if (!all) continue;
      const fs::path film = options_.folder / (name + ".mp4");
      render::encode_film(options_.folder / "frames", name, 1, last, scene_.frame_rate, film);
      if (first_film.empty()) first_film = film;
    }
    return first_film;
  }

 private:
  const Scene& scene_;
  const RunOptions& options_;
  OutputRequest outputs_;
  std::string name_;
  std::vector<std::string> image_names_;  ///< one a camera
  render::ContextKind context_ = render::ContextKind::Auto;
  std::unique_ptr<ScenePictures> pictures_;
  int images_ = 0;
};

OutputRequest outputs_of(const Scene& scene, const RunOptions& options) {
  OutputRequest outputs = requested_outputs(scene);
  if (options.simulate_only) outputs.images = outputs.film = outputs.meshes = outputs.grids = false;
  return outputs;
}

void make_folders(const fs::path& folder, const OutputRequest& outputs) {
  io::make_writable_folder(folder);
  io::make_writable_folder(folder / "states");
  if (outputs.images) io::make_writable_folder(folder / "frames");
  if (outputs.meshes) io::make_writable_folder(folder / "meshes");
  if (outputs.grids) io::make_writable_folder(folder / "grids");
  if (outputs.contacts) io::make_writable_folder(folder / "contacts");
  if (outputs.particles) io::make_writable_folder(folder / "particles");
}

std::string outcome_of(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::Diverged: return "diverged";
    case ErrorKind::Limit: return "limit";
    case ErrorKind::Io:
    case ErrorKind::Corrupt: return "io";
    case ErrorKind::Scene:
    case ErrorKind::Usage: return "invalid";
    case ErrorKind::Internal: break;
  }
  return "internal";
}

constexpr int kSignalExit = 128;

std::string overload_text(const RunRecord::Overload& o) {
  std::array<char, 160> numbers{};
  std::snprintf(numbers.data(), numbers.size(), " overloaded from t = %.6g s: energy of approach and contact %.4g J, capacity %.4g J",
                o.time, o.energy, o.capacity);
  return o.a + " and " + o.b + numbers.data();
}

/// Runs `body`, which fills `result`; whatever happens result.json is left behind.
template <class Body>
RunResult guarded(const Scene& scene, const RunOptions& options, std::optional<Simulation>& simulation,
                  const Body& body) {
  RunResult result;
  result.folder = options.folder;
  const auto begin = Clock::now();
  try {
    body(result);
    result.outcome = result.exit_code == 0 ? "done" : "interrupted";
  } catch (const Error& error) {
    result.outcome = outcome_of(error.kind());
    result.reason = error.what();
    result.exit_code = static_cast<int>(error.kind());
  } catch (const std::exception& error) {
    result.outcome = outcome_of(ErrorKind::Internal);
    result.reason = error.what();
    result.exit_code = static_cast<int>(ErrorKind::Internal);
  }
  if (simulation) {
    result.frames = simulation->frame();
    result.state_hash = simulation->state_hash();
    for (const auto& o : simulation->state().record.overloads) result.warnings.push_back(overload_text(o));
  }
  write_result_file(scene, result, simulation ? &*simulation : nullptr, seconds_since(begin));
  return result;
}

}  // namespace

void leave_failure(const fs::path& folder, const std::string& name, const Error& error) {
  try {
    if (fs::exists(folder / "result.json")) return;
    io::make_writable_folder(folder);
    Scene scene;
    scene.source = name + ".yaml";
    RunResult result;
    result.folder = folder;
    result.outcome = outcome_of(error.kind());
    result.reason = error.what();
    result.exit_code = static_cast<int>(error.kind());
    write_result_file(scene, result, nullptr, 0.0);
  } catch (const Error&) {
    // The first error is the one to report; this folder cannot take a file.
  }
}

std::string scene_name(const Scene& scene) {
  const std::string stem = scene.source.stem().string();
  return stem.empty() ? "scene" : stem;
}

std::set<int> parse_frames(const std::string& text) {
  std::set<int> frames;
  const auto fail = [&](const std::string& part) {
    throw Error(ErrorKind::Usage, Fault{.place = "--frames",
                                        .key = {},
                                        .expected = "expected frames like 1-50,60,70-90:2, counted from 1",
                                        .found = "'" + part + "'",
                                        .hint = {}});
  };
  std::size_t at = 0;
  while (at <= text.size()) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    const std::string part = text.substr(at, comma - at);
    int first = 0, last = 0, step = 1, used = 0;
    const int size = static_cast<int>(part.size());
    if (std::sscanf(part.c_str(), "%d-%d:%d%n", &first, &last, &step, &used) == 3 && used == size) {
    } else if (step = 1; std::sscanf(part.c_str(), "%d-%d%n", &first, &last, &used) == 2 && used == size) {
    } else if (std::sscanf(part.c_str(), "%d%n", &first, &used) == 1 && used == size) {
      last = first;
    } else {
      fail(part);
    }
    if (first < 1 || last < first || step < 1 || last > 10'000'000) fail(part);
    for (int frame = first; frame <= last; frame += step) frames.insert(frame);
    at = comma + 1;
  }
  return frames;
}

RunResult run_scene(const Scene& scene, const RunOptions& options) {
  const OutputRequest outputs = outputs_of(scene, options);
  const std::string name = scene_name(scene);
  make_folders(options.folder, outputs);
  const FolderLock lock(options.folder);
  remove_temporaries(options.folder);
  if (!options.overwrite && !options.resume && fs::exists(options.folder / "result.json")) {
    throw Error(ErrorKind::Io, Fault{.place = options.folder.string(),
                                     .key = {},
                                     .expected = "expected an output folder without an earlier result",
                                     .found = "a result.json",
                                     .hint = "use --overwrite to replace it, --resume to continue, or another --out"});
  }

  std::optional<Simulation> simulation;
  return guarded(scene, options, simulation, [&](RunResult& result) {
        if (!options.resume) remove_outputs(options.folder, name);
        simulation.emplace(scene, SimulationOptions{options.threads, options.skip, options.profile, options.delaunay});
        const int frame_count = scene.frame_count();
        FrameWriter writer(scene, options, outputs);
        Reporter report(options, frame_count);
        bool fresh = true;
        if (options.resume) {
          if (const auto last = last_saved_frame(options.folder, name, frame_count)) {
            simulation->restore(load_state(state_path(options.folder, name, *last), scene.content_hash));
            fresh = false;
          }
        }
        const auto finish_frame = [&] {
          const double done = static_cast<double>(simulation->frame()) / frame_count;
          writer.write(*simulation, report, done);
          save_state(state_path(options.folder, name, simulation->frame()), simulation->state(), scene.content_hash);
        };
        if (fresh) finish_frame();
        while (simulation->frame() < frame_count) {
          if (options.interrupt != nullptr && options.interrupt->load() != 0) {
            result.reason = "interrupted by signal " + std::to_string(options.interrupt->load());
            result.exit_code = kSignalExit + options.interrupt->load();
            return;
          }
          report("simulate", simulation->frame() + 1, static_cast<double>(simulation->frame()) / frame_count);
          simulation->step_frame();
          finish_frame();
        }
        result.film = writer.finish(*simulation, report, frame_count);
      });
}

RunResult render_run(const Scene& scene, const RunOptions& options) {
  OutputRequest outputs = outputs_of(scene, options);
  outputs.images = true;
  outputs.contacts = outputs.particles = outputs.meshes = outputs.grids = false;
  const std::string name = scene_name(scene);
  make_folders(options.folder, outputs);
  const FolderLock lock(options.folder);
  remove_temporaries(options.folder);

  std::optional<Simulation> simulation;
  return guarded(scene, options, simulation, [&](RunResult& result) {
        const int frame_count = scene.frame_count();
        const auto last = last_saved_frame(options.folder, name, frame_count);
        if (!last) {
          throw Error(ErrorKind::Io, Fault{.place = (options.folder / "states").string(),
                                           .key = {},
                                           .expected = "expected saved states of a run",
                                           .found = "none",
                                           .hint = "run the scene first: supple run SCENE --out FOLDER"});
        }
        simulation.emplace(scene, SimulationOptions{options.threads, options.skip, options.profile, options.delaunay});
        FrameWriter writer(scene, options, outputs);
        Reporter report(options, *last);
        for (int frame = 1; frame <= *last; ++frame) {
          if (options.interrupt != nullptr && options.interrupt->load() != 0) {
            result.reason = "interrupted by signal " + std::to_string(options.interrupt->load());
            result.exit_code = kSignalExit + options.interrupt->load();
            return;
          }
          if (!options.frames.empty() && !options.frames.contains(frame)) continue;
          simulation->restore(load_state(state_path(options.folder, name, frame), scene.content_hash));
          writer.write(*simulation, report, static_cast<double>(frame) / *last);
        }
        result.film = writer.finish(*simulation, report, *last);
      });
}

}  // namespace supple::scenes
