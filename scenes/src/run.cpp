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
#include <new>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

#include "drawing_crew.h"
#include "folder_lock.h"
#include "frame_writer.h"
#include "output_files.h"
#include "result_file.h"
#include "search_files.h"
#include "warnings.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/output_limits.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

std::optional<int> last_saved_frame(const fs::path& folder, const std::string& name, int frame_count) {
  for (int frame = frame_count; frame >= 1; --frame) {
    if (fs::exists(state_path(folder, name, frame))) return frame;
  }
  return std::nullopt;
}

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

/// What pictures need and a scene only names is looked for before hours of work, and before anything is removed; and
/// that the frames asked for are some of the scene's.
/// @throws Error
void check_needs(const Scene& scene, const RunOptions& options, const OutputRequest& outputs) {
  if (!options.frames.empty() && (*options.frames.begin() > scene.frame_count() || *options.frames.rbegin() < 1)) {
    throw Error(ErrorKind::Usage, Fault{.place = "--frames",
                                        .key = {},
                                        .expected = "expected a frame from 1 to " + std::to_string(scene.frame_count()),
                                        .found = *options.frames.rbegin() < 1 ? "none after 0" : "none before " + std::to_string(*options.frames.begin()),
                                        .hint = "frame n shows t = (n - 1) / frame_rate"});
  }
  if (!outputs.images) return;
  check_pictures(scene);
  if (outputs.film && options.frames.empty()) render::find_film_program();
}

constexpr int kSignalExit = 128;
constexpr int kMostFrames = 1'000'001;  // of a scene
constexpr std::size_t kMostOverloads = 10;  // that are told; the report has all
constexpr double kMuchEnergy = 0.05;        // energy_error that implicit steps which nobody asked for are blamed for
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
    const double error = simulation->audits().energy_error;
    if (plan.chosen && plan.settings.method == core::Integrator::BackwardEuler && error > kMuchEnergy) {
      result.warnings.push_back("integrator.method: auto took backward_euler, which damps what its steps do not resolve: the balance of energy is off by " +
                                std::to_string(std::lround(100.0 * error)) + " %; implicit_midpoint keeps it");
    }
  }
  // Where nothing was done, the report of an earlier run stays.
  const bool refused = result.exit_code != 0 && result.frames == 0 && fs::exists(result.report);
  if (!refused) write_result_file(scene, result, simulation ? &*simulation : nullptr, seconds_since(begin));
  return result;
}

/// Those from `first` to `last` that are asked for.
std::vector<int> frames_to_draw(const RunOptions& options, int first, int last) {
  std::vector<int> frames;
  for (int frame = first; frame <= last; ++frame) {
    if (options.frames.empty() || options.frames.contains(frame)) frames.push_back(frame);
  }
  return frames;
}

/// The report is of the run as a whole.
void show_last(Simulation& simulation, const RunOptions& options, const std::string& name, int last) {
  if (simulation.frame() != last) simulation.restore(load_state(state_path(options.folder, name, last), simulation.scene().content_hash));
}

/// Files over all frames, and what was drawn.
void finish(FrameWriter& writer, Simulation& simulation, Reporter& report, RunResult& result) {
  result.film = writer.finish(simulation, report, result.frames);
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
    simulation.emplace(scene, SimulationOptions{options.threads, options.skip, options.profile, options.delaunay, options.interrupt});
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
        const int members = crew_size(options, frames.size() - i, resident_bytes() - before);
        if (members > 1) {
          DrawingCrew crew(scene, options, outputs, {frames.begin() + static_cast<std::ptrdiff_t>(i), frames.end()}, *last, members,
                           {*simulation, writer, result}, report);
          crew.join();
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
    show_last(*simulation, options, name, *last);
    result.frames = *last;
    finish(writer, *simulation, report, result);
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

  if (options.resume) check_continues(options.folder, name);

  std::optional<Simulation> simulation;
  return guarded(scene, options, kResultFile, simulation, [&](RunResult& result) {
    check_needs(scene, options, outputs);
    if (options.overwrite && !options.resume) {
      for (const std::string& earlier : saved_scenes(options.folder)) remove_outputs(options.folder, earlier);
    }
    if (!options.resume) remove_outputs(options.folder, name);
    const double before = resident_bytes();
    simulation.emplace(scene, SimulationOptions{options.threads, options.skip, options.profile, options.delaunay, options.interrupt});
    const int frame_count = scene.frame_count();
    FrameWriter writer(scene, simulation->model(), options, outputs);
    Reporter report(options, frame_count);
    if (options.resume) {
      if (const auto last = last_saved_frame(options.folder, name, frame_count)) {
        for (int frame = 1; writer.writes_frames() && frame <= *last; ++frame) {
          if (was_interrupted(options, result)) return;
          State state = load_state(state_path(options.folder, name, frame), scene.content_hash);
          if (!writer.renews(frame, state.hash())) continue;
          simulation->restore(std::move(state));
          writer.renew(*simulation, report, static_cast<double>(frame) / frame_count);
        }
        simulation->restore(load_state(state_path(options.folder, name, *last), scene.content_hash));
        result.frames = *last;
      }
    }
    const auto save = [&] {
      save_state(state_path(options.folder, name, simulation->frame()), simulation->state(), scene.content_hash);
      result.frames = simulation->frame();
    };
    if (result.frames == 0) {
      // Frames that are asked for may lie far behind.
      if (!options.frames.empty() && !options.frames.contains(1)) expect_output_sizes(*simulation, outputs);
      writer.write(*simulation, report, 1.0 / frame_count);
      save();
    }
    RunOptions drawing = options;
    drawing.overwrite = true;
    std::optional<DrawingCrew> crew;
    std::exception_ptr diverged;
    try {
      while (result.frames < frame_count && !was_interrupted(options, result)) {
        // The first picture shows what each needs.
        if (!crew && writer.pictures_drawn() > 0 && !writer.needs_order()) {
          std::vector<int> frames = frames_to_draw(options, result.frames + 1, frame_count);
          const int members = crew_size(options, frames.size(), resident_bytes() - before);
          if (members > 1) {
            crew.emplace(scene, drawing, outputs, std::move(frames), result.frames, members,
                         DrawingCrew::Leader{*simulation, writer, result}, report);
          }
        }
        const int next = simulation->frame() + 1;
        crew ? crew->simulating(next) : report("simulate", next, static_cast<double>(next - 1) / frame_count);
        while (simulation->frame() < next && !was_interrupted(options, result)) simulation->step();
        if (simulation->frame() < next) break;
        if (crew) {
          save();
          if (!crew->saved(next)) break;
        } else {
          writer.write(*simulation, report, static_cast<double>(next) / frame_count);
          save();
        }
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Diverged) throw;
      diverged = std::current_exception();  // what came before is still drawn
    }
    if (crew) {
      crew->join();
      show_last(*simulation, options, name, result.frames);
    }
    if (diverged) std::rethrow_exception(diverged);
    if (was_interrupted(options, result)) return;
    finish(writer, *simulation, report, result);
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
