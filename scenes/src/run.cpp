#include "supple/scenes/run.h"

#include <sys/file.h>
#include <sys/resource.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <mutex>
#include <new>
#include <optional>
#include <thread>

#include "frame_writer.h"
#include "output_files.h"
#include "result_file.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"

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

std::optional<int> last_saved_frame(const fs::path& folder, const std::string& name, int frame_count) {
  for (int frame = frame_count; frame >= 1; --frame) {
    if (fs::exists(state_path(folder, name, frame))) return frame;
  }
  return std::nullopt;
}

OutputRequest outputs_of(const Scene& scene, const RunOptions& options) {
  OutputRequest outputs = requested_outputs(scene);
  if (options.simulate_only) outputs.images = outputs.film = outputs.meshes = outputs.grids = outputs.samples = false;
  return outputs;
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

/// What pictures need and a scene only names is looked for before hours of work, and before anything is removed.
/// @throws Error
void check_needs(const Scene& scene, const RunOptions& options, const OutputRequest& outputs) {
  if (!outputs.images) return;
  check_textures(scene);
  if (scene.render.renderer == RendererName::Path && !render::has_path_tracer()) {
    static_cast<void>(render::make_renderer({.kind = render::RendererKind::Path}));  // says what is absent
  }
  if (outputs.film && options.frames.empty()) render::find_film_program();
}

constexpr int kSignalExit = 128;
constexpr std::size_t kMostOverloads = 10;  // that are told; the report has all
constexpr const char* kResultFile = "result.json";

std::string overload_text(const RunRecord::Overload& o) {
  std::array<char, 160> numbers{};
  std::snprintf(numbers.data(), numbers.size(), " overloaded from t = %.6g s: energy of approach and contact %.4g J, more than half of what they can hold, %.4g J",
                o.time, o.energy, o.capacity);
  return o.a + " and " + o.b + numbers.data();
}

bool was_interrupted(const RunOptions& options, RunResult& result) {
  if (options.interrupt == nullptr || options.interrupt->load() == 0) return false;
  result.reason = "interrupted by signal " + std::to_string(options.interrupt->load());
  result.exit_code = kSignalExit + options.interrupt->load();
  return true;
}

/// Runs `body`, which fills `result`; whatever happens a report of this name is left behind.
template <class Body>
RunResult guarded(const Scene& scene, const RunOptions& options, const char* report_name,
                  std::optional<Simulation>& simulation, const Body& body) {
  RunResult result;
  result.folder = options.folder;
  result.report = options.folder / report_name;
  const auto begin = Clock::now();
  try {
    body(result);
    result.outcome = result.exit_code == 0 ? "done" : "interrupted";
  } catch (const Error& error) {
    result.outcome = outcome_of(error.kind());
    result.reason = error.what();
    result.exit_code = static_cast<int>(error.kind());
  } catch (const std::bad_alloc&) {
    result.outcome = outcome_of(ErrorKind::Limit);
    result.reason = kOutOfMemory;
    result.exit_code = static_cast<int>(ErrorKind::Limit);
  } catch (const std::exception& error) {
    result.outcome = outcome_of(ErrorKind::Internal);
    result.reason = error.what();
    result.exit_code = static_cast<int>(ErrorKind::Internal);
  }
  if (simulation) {
    result.state_hash = simulation->state_hash();
    result.warnings.insert(result.warnings.begin(), simulation->warnings().begin(), simulation->warnings().end());
    const auto& overloads = simulation->state().record.overloads;
    for (std::size_t k = 0; k < std::min(overloads.size(), kMostOverloads); ++k) result.warnings.push_back(overload_text(overloads[k]));
    if (overloads.size() > kMostOverloads) {
      result.warnings.push_back(std::to_string(overloads.size() - kMostOverloads) + " more pairs were overloaded ('overloads' in the report)");
    }
  }
  // Where nothing was done, the report of an earlier run stays.
  const bool refused = result.exit_code != 0 && result.frames == 0 && fs::exists(result.report);
  if (!refused) write_result_file(scene, result, simulation ? &*simulation : nullptr, seconds_since(begin));
  return result;
}

/// Memory of this process, and what the machine has free [byte].
double resident_bytes() {
  std::ifstream file("/proc/self/statm");
  double size = 0.0, resident = 0.0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}
double free_bytes() { return static_cast<double>(sysconf(_SC_AVPHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE)); }

/// How many frames to draw at once when each needs `share` bytes.
int crew_size(const RunOptions& options, std::size_t frames, double share) {
  const int most = std::min<int>(static_cast<int>(std::min<std::size_t>(frames, 64)),
                                 options.frames_at_once > 0 ? options.frames_at_once : Executor(options.threads).threads());
  const double memory = options.memory > 0.0 ? options.memory : 0.5 * free_bytes();
  const double room = share > 0.0 ? memory / share : most;
  return std::max(1, static_cast<int>(std::min<double>(most, room)));
}

/// Draws frames at the same time, each by a simulation and a renderer of its own, so that no byte depends on the others.
class DrawingCrew {
 public:
  DrawingCrew(const Scene& scene, const RunOptions& options, const OutputRequest& outputs, std::span<const int> frames, Reporter& report)
      : scene_(scene), options_(options), outputs_(outputs), frames_(frames), report_(report) {}

  /// @throws what the first of the frames that failed threw
  void draw(int members, RunResult& result, Simulation& booked) {
    options_.threads = std::max(1, Executor(options_.threads).threads() / members);
    options_.progress = [&](const Progress& progress) {
      const std::lock_guard lock(mutex_);
      report_(progress.stage, progress.frame, static_cast<double>(progress.frame) / frames_.back());
    };
    std::vector<std::thread> threads;
    for (int i = 0; i < members; ++i) threads.emplace_back([&] { work(members, result, booked); });
    for (std::thread& thread : threads) thread.join();
    if (failure_) std::rethrow_exception(failure_);
    std::sort(result.warnings.begin(), result.warnings.end());
    result.warnings.erase(std::unique(result.warnings.begin(), result.warnings.end()), result.warnings.end());
  }

 private:
  void work(int members, RunResult& result, Simulation& booked) {
    std::unique_lock lock(mutex_);  // libraries of contexts are opened one after the other
    int frame = frames_.front();
    try {
      Simulation simulation(scene_, SimulationOptions{options_.threads, options_.skip, options_.profile, options_.delaunay});
      FrameWriter writer(scene_, simulation.model(), options_, outputs_);
      Reporter report(options_, frames_.back());
      while (next_ < frames_.size() && !failure_ && (options_.interrupt == nullptr || options_.interrupt->load() == 0)) {
        frame = frames_[next_++];
        lock.unlock();
        State state = load_state(state_path(options_.folder, scene_name(scene_), frame), scene_.content_hash);
        const bool draws = options_.overwrite || writer.renews(frame, state.hash());
        if (draws) {
          simulation.restore(std::move(state));
          writer.write(simulation, report, 0.0);
        }
        lock.lock();
        if (!draws) ++result.pictures_kept;
      }
      book(members, simulation, writer, result, booked);
    } catch (...) {
      if (!lock.owns_lock()) lock.lock();
      if (!failure_ || frame < failed_) failure_ = std::current_exception();
      failed_ = std::min(failed_, frame);
    }
  }

  /// Clocks count the CPU time of the process, so each saw the work of all.
  void book(int members, Simulation& simulation, const FrameWriter& writer, RunResult& result, Simulation& booked) const {
    result.pictures_drawn += writer.pictures_drawn();
    writer.add_warnings(result.warnings);
    const double share = 1.0 / members;
    result.pictures.add(writer.picture_times(), share);
    for (const Stage stage : {Stage::Polygonise, Stage::Render, Stage::Export}) {
      const StageProfile& own = simulation.profile(stage);
      StageProfile& sum = booked.profile(stage);
      sum.calls += own.calls;
      sum.visited += own.visited;
      sum.present += own.present;
      sum.cpu_s += share * own.cpu_s;
    }
  }

  const Scene& scene_;
  RunOptions options_;
  OutputRequest outputs_;
  std::span<const int> frames_;
  Reporter& report_;
  std::mutex mutex_;  // of all below, and of what is booked
  std::size_t next_ = 0;
  std::exception_ptr failure_;
  int failed_ = std::numeric_limits<int>::max();
};

/// Outputs again of the saved states.
RunResult replay(const Scene& scene, const RunOptions& options, const OutputRequest& outputs, const char* report_name) {
  const bool pictures_only = outputs.images;
  const std::string name = scene_name(scene);
  io::make_writable_folder(options.folder);
  const FolderLock lock(options.folder);
  remove_temporaries(options.folder, name);

  std::optional<Simulation> simulation;
  return guarded(scene, options, report_name, simulation, [&](RunResult& result) {
    check_needs(scene, options, outputs);
    const auto last = last_saved_frame(options.folder, name, scene.frame_count());
    if (!last) {
      throw Error(ErrorKind::Io, Fault{.place = (options.folder / "states").string(),
                                       .key = {},
                                       .expected = "expected saved states of a run",
                                       .found = "none",
                                       .hint = "run the scene first: supple run SCENE --out FOLDER"});
    }
    const double before = resident_bytes();
    simulation.emplace(scene, SimulationOptions{options.threads, options.skip, options.profile, options.delaunay});
    FrameWriter writer(scene, simulation->model(), options, outputs);
    Reporter report(options, *last);
    std::vector<int> frames;
    for (int frame = 1; frame <= *last; ++frame) {
      const bool wanted = options.frames.empty() || options.frames.contains(frame);
      // Samples depend on all frames before.
      if (wanted || (outputs.samples && frame < *options.frames.rbegin())) frames.push_back(frame);
    }
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (was_interrupted(options, result)) return;
      const int frame = frames[i];
      if (pictures_only && writer.pictures_drawn() > 0) {  // the first one shows what each needs
        const std::span<const int> rest = std::span<const int>(frames).subspan(i);
        const int crew = crew_size(options, rest.size(), resident_bytes() - before);
        if (crew > 1) {
          result.frames_at_once = crew;
          DrawingCrew(scene, options, outputs, rest, report).draw(crew, result, *simulation);
          if (was_interrupted(options, result)) return;
          break;
        }
      }
      State state = load_state(state_path(options.folder, name, frame), scene.content_hash);
      if (pictures_only && !options.overwrite && !writer.renews(frame, state.hash())) {
        ++result.pictures_kept;
        continue;
      }
      simulation->restore(std::move(state));
      writer.write(*simulation, report, static_cast<double>(frame) / *last);
    }
    if (simulation->frame() != *last) {  // the report is of the run as a whole
      simulation->restore(load_state(state_path(options.folder, name, *last), scene.content_hash));
    }
    result.frames = *last;
    result.pictures_drawn += writer.pictures_drawn();
    result.film = writer.finish(*simulation, report, *last);
    result.pictures.add(writer.picture_times(), 1.0);
    writer.add_warnings(result.warnings);
  });
}

}  // namespace

void leave_failure(const fs::path& folder, const std::string& name, const Error& error) {
  try {
    if (fs::exists(folder / kResultFile)) return;
    io::make_writable_folder(folder);
    Scene scene;
    scene.source = name + ".yaml";
    RunResult result;
    result.folder = folder;
    result.report = folder / kResultFile;
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
  io::make_writable_folder(options.folder / "states");
  const FolderLock lock(options.folder);
  remove_temporaries(options.folder, name);
  const bool began = fs::exists(options.folder / kResultFile) && !fs::is_empty(options.folder / "states");
  if (!options.overwrite && !options.resume && began) {
    throw Error(ErrorKind::Io, Fault{.place = options.folder.string(),
                                     .key = {},
                                     .expected = "expected an output folder without an earlier result",
                                     .found = "a result.json",
                                     .hint = "use --overwrite to replace it, --resume to continue, or another --out"});
  }

  std::optional<Simulation> simulation;
  return guarded(scene, options, kResultFile, simulation, [&](RunResult& result) {
        check_needs(scene, options, outputs);
        if (!options.resume) remove_outputs(options.folder, name);
        simulation.emplace(scene, SimulationOptions{options.threads, options.skip, options.profile, options.delaunay});
        const int frame_count = scene.frame_count();
        FrameWriter writer(scene, simulation->model(), options, outputs);
        Reporter report(options, frame_count);
        bool fresh = true;
        if (options.resume) {
          if (const auto last = last_saved_frame(options.folder, name, frame_count)) {
            for (int frame = 1; writer.writes_frames() && frame <= *last; ++frame) {
              State state = load_state(state_path(options.folder, name, frame), scene.content_hash);
              if (!writer.renews(frame, state.hash())) continue;
              simulation->restore(std::move(state));
              writer.renew(*simulation, report, static_cast<double>(frame) / frame_count);
            }
            simulation->restore(load_state(state_path(options.folder, name, *last), scene.content_hash));
            result.frames = *last;
            fresh = false;
          }
        }
        const auto finish_frame = [&] {
          const double done = static_cast<double>(simulation->frame()) / frame_count;
          writer.write(*simulation, report, done);
          save_state(state_path(options.folder, name, simulation->frame()), simulation->state(), scene.content_hash);
          result.frames = simulation->frame();
        };
        if (fresh) finish_frame();
        while (simulation->frame() < frame_count) {
          if (was_interrupted(options, result)) return;
          report("simulate", simulation->frame() + 1, static_cast<double>(simulation->frame()) / frame_count);
          const int shown = simulation->frame();
          while (simulation->frame() == shown) {
            if (was_interrupted(options, result)) return;
            simulation->step();
          }
          finish_frame();
        }
        result.pictures_drawn = writer.pictures_drawn();
        result.film = writer.finish(*simulation, report, frame_count);
        result.pictures = writer.picture_times();
        writer.add_warnings(result.warnings);
      });
}

RunResult render_run(const Scene& scene, const RunOptions& options) {
  OutputRequest outputs = outputs_of(scene, options);
  outputs.images = true;
  outputs.contacts = outputs.particles = outputs.meshes = outputs.grids = outputs.samples = false;
  return replay(scene, options, outputs, "render.json");
}

std::vector<fs::path> make_sheets(const Scene& scene, const fs::path& folder) {
  std::vector<fs::path> sheets;
  if (const auto last = last_saved_frame(folder, scene_name(scene), scene.frame_count())) {
    for (const std::string& name : image_names(scene)) {
      const fs::path sheet = write_contact_sheet(folder, name, *last);
      if (!sheet.empty()) sheets.push_back(sheet);
    }
  }
  if (sheets.empty()) {
    throw Error(ErrorKind::Io, Fault{.place = (folder / "frames").string(),
                                     .key = {},
                                     .expected = "expected frames of a run",
                                     .found = "none",
                                     .hint = "draw them first: supple render SCENE --out FOLDER"});
  }
  return sheets;
}

RunResult export_run(const Scene& scene, const RunOptions& options) {
  OutputRequest outputs = outputs_of(scene, options);
  outputs.images = outputs.film = false;
  if (!outputs.contacts && !outputs.particles && !outputs.meshes && !outputs.grids && !outputs.samples) {
    throw Error(ErrorKind::Usage, Fault{.place = scene.source.string(),
                                        .key = "output",
                                        .expected = "expected a mesh, grid, particles, contacts or samples to export",
                                        .found = "none",
                                        .hint = "name them: supple export SCENE --mesh usd --particles vtk"});
  }
  return replay(scene, options, outputs, "export.json");
}

}  // namespace supple::scenes
