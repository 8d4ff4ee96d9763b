#include "supple/scenes/run.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <new>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

#include "file/read_scene_faults.h"
#include "model/warnings.h"
#include "output/files/folder_lock.h"
#include "output/files/frame_writer.h"
#include "output/files/output_files.h"
#include "output/files/saved_frames.h"
#include "output/meshes/search_files.h"
#include "output/pictures/drawing_crew.h"
#include "output/pictures/frame_looks.h"
#include "output/run/result_file.h"
#include "output/run/run_origin.h"
#include "output/run/stage_errors.h"
#include "output/run/unreached.h"
#include "supple/core/cpu_time.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/output_limits.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// A run is continued in its own folder only. @throws Error{Io} where there are states and none is of this name
void check_continues(const fs::path& folder, const std::string& name) {
  const std::set<std::string> saved = saved_scenes(folder);
  if (saved.empty() || saved.contains(name)) return;
  throw Error(ErrorKind::Io, Fault{.place = (folder / "states").string(),
                                   .key = {},
                                   .expected = "expected saved states of '" + name + "' to continue from",
                                   .found = "those of '" + *saved.begin() + "'",
                                   .hint = "resume the scene that was run here, or choose another --out"});
}

/// Warns where explicit steps reduce friction below speeds far above contact.friction_speed.
void add_blurred_friction(const Scene& scene, const Simulation& simulation, std::vector<std::string>& warnings) {
  constexpr double kFarMore = 10.0;
  const auto& speeds = simulation.friction_speeds();
  if (core::is_implicit(simulation.integrator().settings.method)) return;
  const auto worst = std::max_element(speeds.begin(), speeds.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (worst == speeds.end() || !(worst->second > kFarMore * scene.contact.friction_speed)) return;
  warnings.push_back("contact.friction_speed: explicit steps reduce friction below " + short_text(worst->second) + " m/s between '" + worst->first.first +
                     "' and '" + worst->first.second + "', not only below the " + number_text(scene.contact.friction_speed) +
                     " m/s of the scene; integrator.method: implicit keeps to that speed");
}

SimulationOptions simulation_options(const RunOptions& options) {
  return {.threads = options.threads, .skip = options.skip, .profile = options.profile, .delaunay = options.delaunay, .interrupt = options.interrupt,
          .memory = options.scene_memory, .divide = options.divide};
}

/// A run whose estimated error exceeds the accuracy of the scene names the stage with the largest error.
void add_missed_accuracy(const Scene& scene, const StageErrors& errors, std::vector<std::string>& warnings) {
  if (!scene.accuracy) return;
  const bool by_time = errors.time.share >= errors.contact.share;
  const ErrorEstimate& worst = by_time ? errors.time : errors.contact;
  if (!(worst.share > *scene.accuracy)) return;
  warnings.push_back("accuracy: " + std::string(by_time ? "errors of time steps" : "errors of contact") + " displace '" + worst.object + "' by about " +
                     short_text(worst.position) + " m at the end of the run, " + short_text(worst.share) + " of its size, more than the accuracy " +
                     number_text(*scene.accuracy) + "; use a larger accuracy or a smaller " + (by_time ? "time_step.size" : "contact.error"));
}

OutputRequest outputs_of(const Scene& scene, const RunOptions& options) {
  OutputRequest outputs = requested_outputs(scene);
  if (options.no_pictures) outputs.images = outputs.film = false;
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

/// Checks that the requested frames exist in the scene. @throws Error{Usage}
void check_frames(const Scene& scene, const std::set<int>& frames) {
  if (frames.empty() || (*frames.begin() <= scene.frame_count() && *frames.rbegin() >= 1)) return;
  throw Error(ErrorKind::Usage, Fault{.place = "--frames",
                                      .key = {},
                                      .expected = "expected a frame from 1 to " + std::to_string(scene.frame_count()),
                                      .found = *frames.rbegin() < 1 ? "none after 0" : "none before " + std::to_string(*frames.begin()),
                                      .hint = "frame n shows t = (n - 1) / frame_rate"});
}

/// Checks files and programs for pictures before hours of work, and before anything is removed.
/// @throws Error
void check_needs(const Scene& scene, const RunOptions& options, const OutputRequest& outputs) {
  if (!outputs.images) return;
  expect_within(scene, count_scene(scene, options.scene_memory), options.scene_memory);
  check_pictures(scene);
  const std::set<int>& frames = options.frames;
  const bool from_first = frames.empty() || (*frames.begin() == 1 && *frames.rbegin() == static_cast<int>(frames.size()));
  if (outputs.film && from_first) render::find_film_program();
}

constexpr int kSignalExit = 128;
constexpr int kMostFrames = 1'000'001;  // of a scene
constexpr std::size_t kMostOverloads = 10;  // overloads in warnings; the report has all
constexpr double kMuchEnergy = 0.05;        // energy_error above which a warning blames an automatically chosen implicit method
constexpr const char* kResultFile = "result.json";

std::string overload_text(const RunRecord::Overload& o) {
  std::array<char, 160> numbers{};
  std::snprintf(numbers.data(), numbers.size(), " overloaded from t = %.6g s: energy of approach and contact %.4g J, more than half of their capacity, %.4g J",
                o.time, o.energy, o.capacity);
  return o.a + " and " + o.b + numbers.data();
}

bool was_interrupted(const RunOptions& options, RunResult& result) {
  if (options.interrupt == nullptr || options.interrupt->load() == 0) return false;
  result.reason = "interrupted by signal " + std::to_string(options.interrupt->load());
  result.exit_code = kSignalExit + options.interrupt->load();
  return true;
}

/// From its making on.
class TimeLimit {
 public:
  /// @param seconds  0: none
  explicit TimeLimit(double seconds) : seconds_(seconds) {}
  /// Whether it has passed; the result then reports it.
  [[nodiscard]] bool passed(RunResult& result) const {
    if (!(seconds_ > 0.0) || seconds_since(begin_) < seconds_) return false;
    result.reason = "time limit: expected an end within " + short_text(seconds_) + " s, found frame " + std::to_string(result.frames) +
                    " saved; --resume continues from it";
    result.exit_code = static_cast<int>(ErrorKind::Limit);
    return true;
  }

 private:
  double seconds_;
  Clock::time_point begin_ = Clock::now();
};

/// Runs `body`, which fills `result`; whatever happens a report of this name is left behind.
template <class Body>
RunResult guarded(const Scene& scene, const RunOptions& options, const char* report_name,
                  std::optional<Simulation>& simulation, const Body& body) {
  RunResult result;
  result.folder = options.folder;
  result.report = options.folder / report_name;
  const auto begin = Clock::now();
  const double cpu_before = process_cpu_seconds();
  try {
    const InterruptScope scope(options.interrupt);
    body(result);
    const bool limited = result.exit_code == static_cast<int>(ErrorKind::Limit);
    result.outcome = result.exit_code == 0 ? "done" : limited ? outcome_of(ErrorKind::Limit) : "interrupted";
  } catch (const Interrupted&) {
    (void)was_interrupted(options, result);
    result.outcome = "interrupted";
  } catch (const Error& error) {
    result.outcome = outcome_of(error.kind());
    result.reason = error.what();
    result.exit_code = static_cast<int>(error.kind());
  } catch (const fs::filesystem_error& error) {
    result.outcome = outcome_of(ErrorKind::Io);
    result.reason = error.what();
    result.exit_code = static_cast<int>(ErrorKind::Io);
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
    const std::vector<std::string> warnings = simulation->warnings();
    result.warnings.insert(result.warnings.begin(), warnings.begin(), warnings.end());
    result.searches = read_searches(options.folder, scene_name(scene), options.frames, result.frames);
    set_missed(scene.output.meshing, result.searches, result.warnings);
    const auto& overloads = simulation->state().record.overloads;
    for (std::size_t k = 0; k < std::min(overloads.size(), kMostOverloads); ++k) result.warnings.push_back(overload_text(overloads[k]));
    if (overloads.size() > kMostOverloads) {
      result.warnings.push_back(std::to_string(overloads.size() - kMostOverloads) + " more pairs were overloaded ('overloads' in the report)");
    }
    const IntegratorPlan& plan = simulation->integrator();
    add_blurred_friction(scene, *simulation, result.warnings);
    const double error = simulation->audits().energy_error;
    if (plan.chosen && plan.settings.method == core::Integrator::BackwardEuler && error > kMuchEnergy) {
      result.warnings.push_back("integrator.method: auto chose backward_euler, which damps motion that its steps do not resolve: the energy balance is off by " +
                                std::to_string(std::lround(100.0 * error)) + " %; implicit_midpoint conserves energy");
    }
  }
  // A report of an earlier run stays if nothing was done.
  if (result.exit_code != 0 && result.frames == 0 && fs::exists(result.report)) {
    result.report.clear();
  } else {
    write_result_file(scene, result, simulation ? &*simulation : nullptr, {seconds_since(begin), process_cpu_seconds() - cpu_before});
  }
  return result;
}

/// The requested frames from `first` to `last`.
std::vector<int> frames_to_draw(const RunOptions& options, int first, int last) {
  std::vector<int> frames;
  for (int frame = first; frame <= last; ++frame) {
    if (options.frames.empty() || options.frames.contains(frame)) frames.push_back(frame);
  }
  return frames;
}

/// The report is of the run as a whole.
void show_last(Simulation& simulation, const RunOptions& options, int last) {
  if (simulation.frame() != last) simulation.restore(load_frame(options.folder, simulation.scene(), last));
}

void save_frame(const fs::path& folder, const Simulation& simulation) {
  save_state(state_path(folder, scene_name(simulation.scene()), simulation.frame()), simulation.state(), origin_of(simulation.scene()));
}

/// The last frame that a run simulates.
int last_frame_of(const Scene& scene, const RunOptions& options) {
  return options.frames.empty() ? scene.frame_count() : std::min(scene.frame_count(), *options.frames.rbegin());
}

/// A variation starts from a frame that the scene and the request have, and in a folder of its own. @throws Error{Usage}
void check_start(const Scene& scene, const RunOptions& options) {
  if (!options.from) return;
  const int last = last_frame_of(scene, options);
  const auto fail_start = [](std::string place, std::string expected, std::string found, std::string hint) {
    throw Error(ErrorKind::Usage, Fault{.place = std::move(place), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
  };
  if (options.from->frame < 1 || options.from->frame > last) {
    fail_start("--from-frame", "expected a frame from 1 to " + std::to_string(last), std::to_string(options.from->frame), "the run goes on from there to its last frame");
  }
  if (options.resume) fail_start("--from-frame", "expected it without --resume", "both", "--resume alone continues a variation that was begun");
  std::error_code ignored;
  if (fs::equivalent(options.from->folder, options.folder, ignored)) {
    fail_start("--out", "expected another folder than that of the run that is varied", options.folder.string(), "a variation is a run of its own");
  }
}

/// Data of a resumed run.
struct Resuming {
  const Scene& scene;
  const RunOptions& options;
  Simulation& simulation;
  FrameWriter& writer;
  Reporter& report;
  RunResult& result;
  const std::function<bool()>& stopped;  ///< by a signal or by the time limit
};

/// Makes the state of a frame from that of the previous one and saves it. @return false where the run was stopped first
bool simulate_again(const Resuming& run, int frame, double done) {
  Simulation& simulation = run.simulation;
  run.report("simulate", frame, done);
  if (frame > 1 && simulation.frame() != frame - 1) simulation.restore(load_frame(run.options.folder, run.scene, frame - 1));
  while (simulation.frame() < frame && !run.stopped()) simulation.step();
  if (simulation.frame() < frame) return false;
  save_frame(run.options.folder, simulation);
  return true;
}

/// Frames `first` to `last` of the saved ones: absent outputs are written, and a lost or damaged state is simulated again.
/// @return false where the run was stopped first
bool take_up(const Resuming& run, int first, int last, UnusableFrames& unusable) {
  for (int frame = first; frame <= last; ++frame) {
    if (run.stopped()) return false;
    const double done = static_cast<double>(frame) / last;
    std::optional<State> state = usable_frame(run.options.folder, run.scene, frame, unusable);
    const bool again = !state;
    if (again && !simulate_again(run, frame, done)) return false;
    const bool renews = run.writer.writes_frames() && run.writer.renews(frame, again ? run.simulation.state_hash() : state->hash());
    if (!again && (renews || frame == last)) run.simulation.restore(std::move(*state));
    if (renews) run.writer.renew(run.simulation, run.report, done);
  }
  run.result.frames = last;
  return true;
}

/// Goes on from the saved states, if there are any. Where nothing is written of frames, those before the first one saved are not
/// missed. @return false where the run was stopped first
bool resume(const Resuming& run) {
  const std::optional<RunOrigin> origin = read_origin(run.options.folder);
  const int start = origin ? origin->frame : 1;
  run.result.origin = origin;
  const auto saved = saved_range(run.options.folder, scene_name(run.scene), run.scene.frame_count());
  if (!saved && !origin) return true;
  UnusableFrames unusable;
  if (origin && !usable_frame(run.options.folder, run.scene, start, unusable)) {
    start_from({origin->folder, start}, run.simulation);
    save_frame(run.options.folder, run.simulation);
  }
  int first = run.writer.writes_frames() ? start : saved ? saved->first : start;
  if (first > start && !usable_frame(run.options.folder, run.scene, first, unusable)) first = start;
  unusable = {};
  const bool whole = take_up(run, first, saved ? saved->last : start, unusable);
  const std::vector<std::string> sentences = unusable.sentences();
  run.result.warnings.insert(run.result.warnings.end(), sentences.begin(), sentences.end());
  return whole;
}

/// Files over all frames, and what was drawn.
void finish(FrameWriter& writer, Simulation& simulation, Reporter& report, RunResult& result) {
  if (!result.film_is_left) result.film = writer.finish(simulation, report, result.frames);
  result.pictures_drawn += writer.pictures_drawn();
  result.pictures.add(writer.picture_times(), 1.0);
  writer.add_warnings(result.warnings);
  std::sort(result.warnings.begin(), result.warnings.end());  // of several members
  result.warnings.erase(std::unique(result.warnings.begin(), result.warnings.end()), result.warnings.end());
}

/// Outputs again of the saved states.
RunResult replay(const Scene& scene, const RunOptions& options, const OutputRequest& outputs, const char* report_name) {
  const bool pictures_only = outputs.images;
  const std::string name = scene_name(scene);
  check_frames(scene, options.frames);
  const auto saved = saved_range(options.folder, name, scene.frame_count());
  if (!saved) {
    throw Error(ErrorKind::Io, Fault{.place = (options.folder / "states").string(),
                                     .key = {},
                                     .expected = "expected saved states of a run",
                                     .found = "none",
                                     .hint = "run the scene first: supple run SCENE --out FOLDER"});
  }
  const int last = saved->last;
  io::make_writable_folder(options.folder);
  std::optional<FolderLock> lock;
  std::optional<SharedFolder> share;
  if (pictures_only) {
    share.emplace(options.folder, name, FrameWriter::look_of(scene, options), options.interrupt);
  } else {
    lock.emplace(options.folder);
    remove_temporaries(options.folder, name);
  }

  std::optional<Simulation> simulation;
  return guarded(scene, options, report_name, simulation, [&](RunResult& result) {
    check_needs(scene, options, outputs);
    const double before = resident_bytes();
    simulation.emplace(scene, simulation_options(options));
    FrameWriter writer(scene, simulation->model(), options, outputs);
    Reporter report(options, last);
    std::vector<int> frames;
    result.origin = read_origin(options.folder);
    for (int frame = first_frame_of(options.folder); frame <= last; ++frame) {
      const bool wanted = options.frames.empty() || options.frames.contains(frame);
      // Samples depend on all frames before.
      if (wanted || (outputs.samples && frame < *options.frames.rbegin())) frames.push_back(frame);
    }
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (was_interrupted(options, result)) return;
      const int frame = frames[i];
      if (pictures_only && writer.pictures_drawn() > 0) {  // the first one shows what each needs
        const int members = crew_size(scene, options, frames.size() - i, resident_bytes() - before);
        if (members > 1) {
          DrawingCrew crew({scene, options, outputs, {frames.begin() + static_cast<std::ptrdiff_t>(i), frames.end()}, last}, members,
                           {*simulation, writer, result}, report);
          crew.join();
          if (was_interrupted(options, result)) return;
          break;
        }
      }
      State state = load_frame(options.folder, scene, frame);
      if (pictures_only && !options.overwrite && !writer.renews(frame, state.hash())) {
        ++result.pictures_kept;
        continue;
      }
      simulation->restore(std::move(state));
      writer.write(*simulation, report, static_cast<double>(frame) / last);
    }
    show_last(*simulation, options, last);
    result.frames = last;
    if (share) {
      const bool complete = writer.pictures_are_there(last, frames.empty() ? 0 : frames.back());
      result.film_is_left = !complete && share->leaves_to_others();
      if (!result.film_is_left) share->take_turn();
    }
    finish(writer, *simulation, report, result);
  });
}

}  // namespace

void leave_failure(const fs::path& folder, const std::string& name, const Error& error) {
  if (error.kind() != ErrorKind::Scene) return;
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
    write_result_file(scene, result, nullptr, {});
  } catch (const Error&) {
    // The first error is the one to report; this folder cannot take a file.
  }
}

std::string scene_name(const Scene& scene) {
  const std::string stem = scene.source.stem().string();
  return stem.empty() || stem.front() == '.' ? "scene" : stem;
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
    std::string_view rest = part;
    // A number behind `lead`, if that is there; 0 where no number is.
    const auto number = [&rest](std::string_view lead, int& value) {
      if (!rest.starts_with(lead)) return false;
      rest.remove_prefix(lead.size());
      rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
      const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
      if (error != std::errc()) value = 0;
      rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
      return true;
    };
    int first = 0, step = 1;
    number("", first);
    int last = first;
    if (number("-", last)) number(":", step);
    if (!rest.empty() || first < 1 || last < first || step < 1 || last > kMostFrames) fail(part);
    for (std::int64_t frame = first; frame <= last; frame += step) frames.insert(static_cast<int>(frame));
    at = comma + 1;
  }
  return frames;
}

RunResult run_scene(const Scene& scene, const RunOptions& options) {
  const TimeLimit limit(options.time_limit);
  const OutputRequest outputs = outputs_of(scene, options);
  const std::string name = scene_name(scene);
  check_frames(scene, options.frames);
  check_start(scene, options);
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

  if (options.resume) check_continues(options.folder, name);

  std::optional<Simulation> simulation;
  return guarded(scene, options, kResultFile, simulation, [&](RunResult& result) {
    const std::function<bool()> stopped = [&] { return was_interrupted(options, result) || limit.passed(result); };
    check_needs(scene, options, outputs);
    if (options.overwrite && !options.resume) {
      for (const std::string& earlier : saved_scenes(options.folder)) remove_outputs(options.folder, earlier);
    }
    if (!options.resume) remove_outputs(options.folder, name);
    const double before = resident_bytes();
    simulation.emplace(scene, simulation_options(options));
    const int last_frame = last_frame_of(scene, options);
    FrameWriter writer(scene, simulation->model(), options, outputs);
    Reporter report(options, last_frame);
    if (options.from) {
      result.origin = start_from(*options.from, *simulation);
      write_origin(options.folder, *result.origin);
    }
    if (options.resume && !resume({scene, options, *simulation, writer, report, result, stopped})) return;
    const auto save = [&] {
      save_frame(options.folder, *simulation);
      result.frames = simulation->frame();
    };
    if (result.frames == 0) {
      // Requested frames may be far back.
      if (!options.frames.empty() && !options.frames.contains(1)) expect_output_sizes(*simulation, outputs);
      writer.write(*simulation, report, 1.0 / last_frame);
      save();
    }
    RunOptions drawing = options;
    drawing.overwrite = true;
    std::optional<DrawingCrew> crew;
    std::exception_ptr diverged;
    std::optional<StageErrorEstimator> errors;
    if (options.estimate_errors) errors.emplace(scene, simulation_options(options), last_frame);
    try {
      while (result.frames < last_frame && !stopped()) {
        // The first picture shows what each needs.
        if (!crew && writer.pictures_drawn() > 0 && !writer.needs_order()) {
          std::vector<int> frames = frames_to_draw(options, result.frames + 1, last_frame);
          const int members = crew_size(scene, options, frames.size(), resident_bytes() - before);
          if (members > 1) {
            crew.emplace(DrawingCrew::Work{scene, drawing, outputs, std::move(frames), result.frames}, members,
                         DrawingCrew::Leader{*simulation, writer, result}, report);
          }
        }
        const int next = simulation->frame() + 1;
        crew ? crew->simulating(next) : report("simulate", next, static_cast<double>(next - 1) / last_frame);
        if (errors) errors->begin(*simulation);
        while (simulation->frame() < next && !stopped()) simulation->step();
        if (simulation->frame() < next) break;
        StageProfile& steps = simulation->profile(Stage::Integrate);
        if (errors) steps.apart_s += errors->end(*simulation);
        steps.scale();
        if (crew) {
          save();
          if (!crew->saved(next)) break;
        } else {
          writer.write(*simulation, report, static_cast<double>(next) / last_frame);
          save();
        }
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Diverged) throw;
      diverged = std::current_exception();  // earlier frames are still drawn
    }
    if (crew) {
      limit.passed(result) ? crew->leave() : crew->join();
      show_last(*simulation, options, result.frames);
    }
    if (errors) {
      result.errors = errors->estimate(simulation->model());
      add_missed_accuracy(scene, result.errors, result.warnings);
    }
    if (diverged) std::rethrow_exception(diverged);
    if (stopped()) return;
    finish(writer, *simulation, report, result);
  });
}

RunResult render_run(const Scene& scene, const RunOptions& options) {
  OutputRequest outputs = outputs_of(scene, options);
  outputs.images = true;
  outputs.contacts = outputs.particles = outputs.meshes = outputs.grids = outputs.samples = false;
  return replay(scene_to_draw(scene, options.folder, options.frames), options, outputs, "render.json");
}

std::vector<fs::path> make_sheets(const Scene& scene, const fs::path& folder) {
  std::vector<fs::path> sheets;
  if (const auto saved = saved_range(folder, scene_name(scene), scene.frame_count())) {
    for (const std::string& name : image_names(scene)) {
      const fs::path sheet = write_contact_sheet(folder, name, look_at_frames(folder, name, saved->last));
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
  return replay(scene_to_draw(scene, options.folder, options.frames), options, outputs, "export.json");
}

}  // namespace supple::scenes
