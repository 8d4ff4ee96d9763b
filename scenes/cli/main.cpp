/// The command line tool: parses arguments, calls the library, prints. It has no functions beyond the library.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "benchmarks.h"
#include "describe.h"
#include "fit.h"
#include "job.h"
#include "library.h"
#include "print.h"
#include "program.h"
#include "progress_bar.h"
#include "supple/core/counted.h"
#include "sweep.h"
#include "templates.h"
#include "usage.h"
#include "view.h"
#include "view_server.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/scenes/check.h"
#include "supple/scenes/estimate.h"
#include "supple/scenes/gltf.h"
#include "supple/scenes/inspect.h"
#include "supple/scenes/job.h"
#include "supple/scenes/limits.h"
#include "supple/scenes/model.h"
#include "supple/scenes/preview.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#ifdef SUPPLE_HAS_CGAL
#include "supple/cgal/surface_meshes.h"
#endif

namespace {

using namespace supple;
using tool::interrupted;
using tool::print;
namespace fs = std::filesystem;

constexpr int kUsage = 2;

constexpr const char* kFilmRule =
    "A film and a contact sheet contain only pictures drawn by the same build with the same keys. The film is made if all frames from\n"
    "1 to the last simulated one have such a picture. Otherwise there is no film, an earlier film of other pictures is removed, and a\n"
    "warning names the frames.\n\n";

struct Arguments {
  std::string scene;
  std::vector<std::string> set;
  std::vector<fs::path> allowed;
  std::string out;
  std::optional<std::string> frames;
  std::string progress = "auto";
  std::string context = "auto";
  std::string points;
  std::string state;
  std::string query;
  std::string group;
  std::string from;
  std::string other;
  std::string camera;
  std::string meshes;
  std::string grids;
  std::string particles;
  std::string contacts;
  std::string sample_tables;
  std::string fingerprint;
  std::vector<std::string> words;
  int from_frame = 0;  // 0: not given
  std::string from_folder;
  int threads = 0;
  int at_once = 0;
  int port = 0;
  double memory = 0.0;      // [byte]; 0: not given
  double time_limit = 0.0;  // [s]; 0: none
  int cells = 0;
  double error = 0.0;
  double gain = 8.0;
  bool overwrite = false;
  bool resume = false;
  bool simulate_only = false;
  bool no_pictures = false;
  bool render_only = false;
  bool dry_run = false;
  bool preview = false;
  bool profile = false;
  bool quiet = false;
  bool samples = false;
  bool json = false;
  bool list = false;
  bool sheet = false;
  bool no_film = false;
  bool view = false;
  bool gltf = false;
};

void print_profile(const scenes::RunResult& result) {
  print(std::cout, "stages: see \"stages\" in %s\n", result.report.c_str());
  if (result.pictures.images == 0) return;
  const auto& t = result.pictures.render;
  print(std::cout, "pictures: %d, CPU ms in all: context %.1f, shaders %.1f, upload %.1f, draw %.1f, read back %.1f, encode %.1f\n",
              result.pictures.images, 1e3 * t.context, 1e3 * t.shaders, 1e3 * t.upload, 1e3 * t.draw, 1e3 * t.read_back,
              1e3 * result.pictures.encode_s);
}

int report(const scenes::RunResult& result, const Arguments& arguments) {
  for (const std::string& warning : result.warnings) print(std::cerr, "warning: %s\n", warning.c_str());
  if (result.outcome != "done") {
    print(std::cerr, "%s\n", result.reason.c_str());
    print(std::cerr, "stopped: %s, last good frame %d, %s\n", result.outcome.c_str(), result.frames,
          result.report.empty() ? "the report of the earlier run stays" : result.report.c_str());
    return result.exit_code;
  }
  if (!arguments.quiet) {
    print(std::cout, "folder: %s\n", result.folder.c_str());
    if (result.pictures_kept > 0) print(std::cout, "frames: %d drawn, %d kept\n", result.pictures_drawn, result.pictures_kept);
    if (!result.film.empty()) print(std::cout, "film:   %s\n", result.film.c_str());
    if (result.film_is_left) print(std::cout, "film:   left to the other processes that draw here\n");
    print(std::cout, "result: %s (state %s)\n", result.report.c_str(), to_hex(result.state_hash).c_str());
    if (arguments.profile) print_profile(result);
  }
  return 0;
}

/// Adds the optional components of this program.
scenes::SimulationOptions simulation_options(int threads) {
  scenes::SimulationOptions options;
  options.threads = threads;
#ifdef SUPPLE_HAS_CGAL
  options.delaunay = cgal::delaunay_mesh;
#endif
  return options;
}

/// Of a simulation that answers questions and takes no step.
scenes::SimulationOptions question_options(int threads, double memory) {
  scenes::SimulationOptions options = simulation_options(threads);
  options.questions = true;
  options.interrupt = &interrupted;
  if (memory > 0.0) options.memory = memory;
  return options;
}

scenes::RunOptions run_options(const Arguments& arguments, const fs::path& folder, tool::ProgressBar& bar) {
  scenes::RunOptions options;
  options.folder = folder;
  if (arguments.frames) options.frames = scenes::parse_frames(*arguments.frames);
  options.threads = arguments.threads;
  options.overwrite = arguments.overwrite;
  options.resume = arguments.resume;
  if (arguments.from_frame > 0) options.from = {.folder = arguments.from_folder, .frame = arguments.from_frame};
  options.simulate_only = arguments.simulate_only;
  options.no_pictures = arguments.no_pictures;
  options.profile = arguments.profile;
  options.estimate_errors = options.contact_sheet = options.divide = !arguments.preview;
  options.context = arguments.context;
  options.frames_at_once = arguments.at_once;
  options.memory = arguments.memory;
  if (arguments.memory > 0.0) options.scene_memory = arguments.memory;
  options.time_limit = arguments.time_limit;
  options.delaunay = simulation_options(0).delaunay;
  options.progress = [&bar](const scenes::Progress& progress) { bar.show(progress); };
  options.interrupt = &interrupted;
  return options;
}

/// Previews and variations have folders of their own, so that they replace no run.
fs::path folder_of(const std::string& name, const Arguments& arguments) {
  if (!arguments.out.empty()) return arguments.out;
  if (arguments.from_frame > 0) return fs::path("out") / (name + "_from_" + std::to_string(arguments.from_frame));
  return fs::path("out") / (arguments.preview ? name + "_preview" : name);
}
fs::path folder_of(const scenes::Scene& scene, const Arguments& arguments) { return folder_of(scenes::scene_name(scene), arguments); }

tool::ProgressBar make_bar(const Arguments& arguments) {
  return tool::ProgressBar(arguments.quiet ? tool::ProgressStyle::None : tool::progress_style(arguments.progress));
}

/// A scene, or its preview, whose frames are every so manyth of the scene's.
struct SceneToRun {
  scenes::Scene scene;
  int stride = 1;
  std::shared_ptr<const scenes::Model> whole{};  ///< of the scene that a preview shows: solids of meshes that it has are not made again
};

SceneToRun read_for_run(const Arguments& arguments) {
  try {
    scenes::Scene scene = scenes::read_scene(arguments.scene, arguments.set, arguments.allowed);
    if (!arguments.fingerprint.empty()) scenes::expect_fingerprint(scene, arguments.fingerprint);
    if (!arguments.preview) return {.scene = std::move(scene)};
    auto whole = std::make_shared<const scenes::Model>(scenes::build_model(scene));
    std::vector<std::string> set = scenes::preview_overrides(scene, *whole);
    set.insert(set.begin(), arguments.set.begin(), arguments.set.end());
    return {.scene = scenes::read_scene(arguments.scene, set, arguments.allowed), .stride = scenes::preview_stride(scene), .whole = std::move(whole)};
  } catch (const Error& error) {
    if (arguments.dry_run) throw;  // it leaves no files
    const std::string name = fs::path(arguments.scene).stem().string();
    scenes::leave_failure(folder_of(name, arguments), name, error);
    throw;
  }
}

/// `--frames` are those of the whole scene.
std::set<int> frames_of_preview(const std::set<int>& frames, int stride) {
  std::set<int> shown;
  for (const int frame : frames) shown.insert(frame >= 1 ? 1 + (frame - 1) / stride : frame);
  return shown;
}

int run(const Arguments& arguments) {
  const auto [scene, stride, whole] = read_for_run(arguments);
  tool::ProgressBar bar = make_bar(arguments);
  if (arguments.dry_run) {
    scenes::RunOptions options = run_options(arguments, {}, bar);
    options.frames = frames_of_preview(options.frames, stride);
    std::cout << scenes::text_of(scenes::estimate_run(scene, options));
    return 0;
  }
  scenes::RunOptions options = run_options(arguments, folder_of(scene, arguments), bar);
  options.frames = frames_of_preview(options.frames, stride);
  if (arguments.preview && !arguments.quiet) {
    print(std::cout, "preview: a quarter of the size, %s, coarse meshes and contact\n", stride == 1 ? "all frames" : ("one frame of " + std::to_string(stride)).c_str());
  }
  if (options.from && options.from->folder.empty()) options.from->folder = fs::path("out") / scenes::scene_name(scene);
  std::optional<tool::ViewServer> server;
  if (arguments.view) {
    server.emplace(scene, tool::ViewServer::Settings{.folder = options.folder, .port = arguments.port, .memory = options.scene_memory, .interrupt = &interrupted});
    options.progress = [&bar, &server](const scenes::Progress& progress) {
      server->begin();  // states of an earlier run are removed before the first report
      bar.show(progress);
    };
    print(std::cout, "view:   %s\n", server->address().c_str());
    std::cout.flush();
  }
  const scenes::RunResult result = scenes::run_scene(scene, options);
  bar.finish();
  const int code = report(result, arguments);
  if (server && interrupted == 0) {
    server->end();
    if (!arguments.quiet) print(std::cout, "view:   served until Control-C\n");
    std::cout.flush();
    server->wait();
  }
  return code;
}

int render(const Arguments& arguments) {
  const scenes::Scene scene = scenes::read_scene(arguments.scene, arguments.set, arguments.allowed);
  if (!arguments.fingerprint.empty()) scenes::expect_fingerprint(scene, arguments.fingerprint);
  if (arguments.sheet) {
    for (const auto& sheet : scenes::make_sheets(scene, folder_of(scene, arguments))) print(std::cout, "sheet:  %s\n", sheet.c_str());
    return 0;
  }
  tool::ProgressBar bar = make_bar(arguments);
  const scenes::RunResult result = scenes::render_run(scene, run_options(arguments, folder_of(scene, arguments), bar));
  bar.finish();
  return report(result, arguments);
}

int export_files(Arguments arguments) {
  bool frames_too = !arguments.gltf;  // files of single frames
  for (const auto& [key, formats] : {std::pair{"mesh", &arguments.meshes}, {"grid", &arguments.grids},
                                     {"particles", &arguments.particles}, {"contacts", &arguments.contacts},
                                     {"samples", &arguments.sample_tables}}) {
    frames_too = frames_too || !formats->empty();
    if (!formats->empty()) arguments.set.push_back("output." + std::string(key) + "=[" + *formats + ']');
  }
  const scenes::Scene scene = scenes::read_scene(arguments.scene, arguments.set, arguments.allowed);
  tool::ProgressBar bar = make_bar(arguments);
  if (arguments.gltf) {
    const fs::path file = scenes::write_gltf(scene, run_options(arguments, folder_of(scene, arguments), bar));
    bar.finish();
    if (!arguments.quiet) print(std::cout, "gltf:   %s\n", file.c_str());
    if (!frames_too) return 0;
  }
  const scenes::RunResult result = scenes::export_run(scene, run_options(arguments, folder_of(scene, arguments), bar));
  bar.finish();
  return report(result, arguments);
}

int compare(const Arguments& arguments) {
  const scenes::Comparison result = scenes::compare_runs({.first = arguments.scene,
                                                          .second = arguments.other,
                                                          .folder = arguments.out.empty() ? "out/compare" : arguments.out,
                                                          .gain = arguments.gain,
                                                          .film = !arguments.no_film,
                                                          .camera = arguments.camera,
                                                          .interrupt = &interrupted});
  const auto worst = std::min_element(result.frames.begin(), result.frames.end(),
                                      [](const auto& a, const auto& b) { return a.psnr < b.psnr; });
  const auto equal = std::count_if(result.frames.begin(), result.frames.end(), [](const auto& f) { return f.largest == 0; });
  print(std::cout, "frames: %zu in both, %td equal, %d and %d in one only\n", result.frames.size(), equal, result.only_first,
              result.only_second);
  print(std::cout, "worst:  frame %d, PSNR %.2f dB, largest difference %d of 255\n", worst->frame, worst->psnr, worst->largest);
  if (!result.film.empty()) print(std::cout, "film:   %s\n", result.film.c_str());
  return 0;
}

int check(const Arguments& arguments) {
  const scenes::Scene scene = scenes::read_scene(arguments.scene, arguments.set, arguments.allowed);
  const double build = arguments.memory > 0.0 ? arguments.memory : scenes::kCheckMemory;
  const scenes::CheckReport found = scenes::check_scene(scene, question_options(1, arguments.memory), build,
                                                         arguments.time_limit > 0.0 ? arguments.time_limit : scenes::kCheckSeconds);
  for (const std::string& warning : found.warnings) print(std::cerr, "warning: %s\n", warning.c_str());
  if (!arguments.quiet) {
    print(std::cout, "%s: %s (%s, %s, %s)\n", arguments.scene.c_str(),
                found.built ? "no fault found" : "no fault found in keys, files and counts", counted(found.objects, "object").c_str(),
                counted(found.particles, "particle").c_str(), counted(static_cast<std::size_t>(found.frames), "frame").c_str());
    std::cout << found.mesh_obstacles;
  }
  return 0;
}

int explain(const Arguments& arguments) {
  scenes::Scene scene = scenes::read_scene(arguments.scene, arguments.set, arguments.allowed);
  if (arguments.simulate_only) scene.output = {};
  scenes::Simulation simulation(std::move(scene), question_options(1, arguments.memory));
  std::cout << scenes::explain(simulation);
  return 0;
}

int query(const Arguments& arguments) {
  scenes::Scene scene = scenes::read_scene(arguments.scene, arguments.set, arguments.allowed);
  if (arguments.error > 0.0) scene.contact.error = arguments.error;
  if (!arguments.state.empty()) scene = scenes::scene_to_draw(scene, arguments.state);
  const scenes::StateOrigin origin = scenes::origin_of(scene);
  scenes::Simulation simulation(std::move(scene), question_options(arguments.threads, arguments.memory));
  if (!arguments.state.empty()) simulation.restore(scenes::load_state(arguments.state, origin));
  std::string answer;
  if (arguments.query == "forces") {
    answer = scenes::query_forces(simulation);
  } else if (arguments.query == "contact") {
    answer = scenes::query_contact(simulation, arguments.samples);
  } else if (arguments.query == "field") {
    if (arguments.points.empty()) {
      throw Error(ErrorKind::Usage, Fault{.place = "--points",
                                          .key = {},
                                          .expected = "expected a CSV file of points for `query field`",
                                          .found = "none",
                                          .hint = "supple query field SCENE --points points.csv"});
    }
    answer = scenes::query_field(simulation, arguments.points);
  } else {
    answer = scenes::query_mesh(simulation, {.cells = arguments.cells, .out = arguments.out});
  }
  std::cout << answer;
  return 0;
}

int bench(const Arguments& arguments) {
  const std::string& group = arguments.group.empty() && !arguments.words.empty() ? arguments.words.front() : arguments.group;
  if (!arguments.list && !group.empty()) tool::run_benchmark(group, arguments.words);
  std::cout << tool::list_benchmarks();
  return 0;
}

void scene_option(CLI::App* verb, Arguments& a) {
  verb->add_option("scene", a.scene, "scene file (YAML)")->required();
  verb->add_option("--set", a.set, "override a key, e.g. --set objects.ball.particles.mass=2; may be repeated")->take_all();
  verb->add_option("--allow-path", a.allowed, "file or folder outside the scene's folder that the scene may read; may be repeated")->take_all();
}

void run_flags(CLI::App* verb, Arguments& a) {
  scene_option(verb, a);
  verb->add_option("--out", a.out, "output folder (default: out/NAME)");
  verb->add_option("--frames", a.frames, "frames to output, e.g. 1-50,60,70-90:2 (default: all)");
  verb->add_option("--threads", a.threads, "number of threads (default: all); does not change results")->check(CLI::Range(0, 1024));
  verb->add_option("--progress", a.progress, "auto, bar, plain or none")
      ->check(CLI::IsMember({"auto", "bar", "plain", "none"}));
  verb->add_option("--context", a.context, "OpenGL context: auto, osmesa (software) or egl")
      ->check(CLI::IsMember({"auto", "osmesa", "egl"}));
  verb->add_flag("--profile", a.profile, "measures the time of every stage");
  verb->add_flag("--quiet", a.quiet, "print warnings and errors only");
}

/// NaN where the text is no finite number.
double number_in(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool good = error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
  return good ? value : std::numeric_limits<double>::quiet_NaN();
}

void memory_flag(CLI::App* verb, Arguments& a, const std::string& what) {
  const auto bytes = [](const std::string& text) {
    const double value = scenes::parse_bytes(text);
    return value > 0.0 ? std::string() : "expected an amount of memory > 0, such as 4G, 800M or (in GB) 0.8, found " + text;
  };
  verb->add_option_function<std::string>("--memory", [&a](const std::string& text) { a.memory = scenes::parse_bytes(text); }, what)->check(bytes);
}

void time_flag(CLI::App* verb, Arguments& a, const std::string& what) {
  verb->add_option("--time-limit", a.time_limit, what)
      ->check([](const std::string& text) { return number_in(text) > 0.0 ? std::string() : "expected a number > 0 [s], found " + text; });
}

void fingerprint_option(CLI::App* verb, Arguments& a) {
  verb->add_option("--fingerprint", a.fingerprint, "refuse a scene of another fingerprint; job files (`supple job`) hold that of their scene");
}

void drawing_flags(CLI::App* verb, Arguments& a) {
  verb->add_option("--at-once", a.at_once, "frames drawn at the same time (default: one per thread, as memory allows); does not change results")
      ->check(CLI::Range(0, 64));
  memory_flag(verb, a, "limit of memory for the scene, which is refused if it needs more (default: 8G), and for frames drawn at the same time (default: half of the free memory)");
}

/// @param silent  standard output is closed: text that only accompanies files is not printed
int parse_and_call(int argc, char** argv, bool silent) {
  Arguments a;
  a.quiet = silent;
  CLI::App app("supple simulates and draws deformable bodies: oriented particles, implicit surfaces, exact contact");
  app.set_version_flag("--version", SUPPLE_VERSION);
  app.require_subcommand(1);
  app.footer("Exit codes: 0 done, 1 internal error, 2 usage, 3 invalid scene, 4 input/output, 5 diverged, 6 limit,\n"
             "7 unusable saved state, 130/143 interrupted.");

  CLI::App* run_verb = app.add_subcommand("run", "simulate a scene and write its outputs");
  run_flags(run_verb, a);
  run_verb->add_flag("--overwrite", a.overwrite, "replace an earlier result in the folder, whatever its scene");
  run_verb->add_flag("--resume", a.resume, "continue from the saved states in the folder; frames whose states are lost or damaged are simulated again");
  CLI::Option* from_frame = run_verb->add_option("--from-frame", a.from_frame, "start a variation: from the state that an earlier run saved of this frame, with the values of now")
                                ->check(CLI::Range(1, 1'000'001));
  run_verb->add_option("--from", a.from_folder, "with --from-frame: folder of that run (default: out/NAME)")->needs(from_frame);
  run_verb->add_flag("--simulate-only", a.simulate_only, "no pictures, film, meshes, grids or samples");
  run_verb->add_flag("--no-pictures", a.no_pictures, "no pictures and no film, which `supple render` makes, in several processes at the same time if that is wanted");
  fingerprint_option(run_verb, a);
  drawing_flags(run_verb, a);
  time_flag(run_verb, a, "stop after this many seconds, between two steps; --resume continues from the last saved state");
  run_verb->add_flag("--view", a.view, "serve a page to this machine that follows the run (`supple view`)");
  run_verb->add_option("--port", a.port, "with --view: port of the page (default: any that is free)")->check(CLI::Range(0, 65535));
  run_verb->add_flag("--render-only", a.render_only, "draw pictures and film from the saved states of an earlier run, as `supple render` does");
  run_verb->add_flag("--dry-run", a.dry_run, "print particles, steps, triangles, memory, disk and time that the run would take, from a sample of its frames; writes nothing")
      ->excludes("--render-only")->excludes("--resume")->excludes("--overwrite");
  run_verb->add_flag("--preview", a.preview, "a quick film: pictures of a quarter of the size, 8 to 24 frames per second, coarse meshes and contact, no estimates of errors; the folder is out/NAME_preview")
      ->excludes("--render-only")->excludes(from_frame);
  run_verb->footer(std::string(kFilmRule) +
                   "With --frames a run ends after the last of them; result.json holds its last frame, and --resume continues from there.\n\n"
                   "Example: supple run scenes/library/figures/ball_hits_spiral.yaml --out out/spiral");

  CLI::App* render_verb = app.add_subcommand("render", "draw the frames of a run again from its saved states");
  run_flags(render_verb, a);
  render_verb->add_flag("--overwrite", a.overwrite, "draw all pictures again, also those that are up to date");
  drawing_flags(render_verb, a);
  fingerprint_option(render_verb, a);
  render_verb->add_flag("--sheet", a.sheet, "make only the contact sheet, from the existing pictures");
  render_verb->footer(std::string(kFilmRule) +
                      "Several processes may draw frames of one run at the same time, all in one look. One that finds all frames drawn makes the film.\n\n"
                      "Example: supple render scenes/library/contacts/two_balls.yaml --out out/two_balls --frames 10-20");

  CLI::App* export_verb = app.add_subcommand("export", "write files for other tools from the saved states of a run");
  run_flags(export_verb, a);
  export_verb->add_option("--mesh", a.meshes, "meshes of the surfaces: ply, obj, usd, separated by commas");
  export_verb->add_flag("--gltf", a.gltf, "one binary glTF file with meshes, materials and cameras of all frames: NAME.glb");
  export_verb->add_option("--grid", a.grids, "fields: vdb");
  export_verb->add_option("--particles", a.particles, "particles and bonds: csv, vtk");
  export_verb->add_option("--contacts", a.contacts, "points of the contact surfaces: csv, vtk");
  export_verb->add_option("--samples", a.sample_tables, "points spread evenly over the surfaces: csv, vtk");
  memory_flag(export_verb, a, "limit of memory for the scene, which is refused if it needs more (default: 8G)");
  export_verb->footer("Example: supple export scenes/library/contacts/two_balls.yaml --out out/two_balls --mesh usd --particles vtk");

  tool::ViewArguments view_arguments;
  view_arguments.quiet = silent;
  CLI::App* view_verb = tool::add_view(app, view_arguments);

  tool::SweepArguments sweep_arguments;
  sweep_arguments.quiet = silent;
  CLI::App* sweep_verb = tool::add_sweep(app, sweep_arguments);

  tool::FitArguments fit_arguments;
  CLI::App* fit_verb = tool::add_fit(app, fit_arguments);

  tool::JobArguments job_arguments;
  CLI::App* job_verb = tool::add_job(app, job_arguments);

  CLI::App* info_verb = app.add_subcommand("info", "show what a run folder holds: outcome, audits, times, files");
  info_verb->add_option("run", a.scene, "run folder")->required();
  info_verb->footer("Example: supple info out/two_balls");

  CLI::App* compare_verb = app.add_subcommand("compare", "put frames of two runs side by side, with their difference");
  compare_verb->add_option("first", a.scene, "run folder")->required();
  compare_verb->add_option("second", a.other, "run folder")->required();
  compare_verb->add_option("--out", a.out, "output folder (default: out/compare)");
  compare_verb->add_option("--gain", a.gain, "factor of the differences in the pictures (default: 8)")->check(CLI::Range(1.0, 255.0));
  compare_verb->add_option("--camera", a.camera, "camera whose frames are compared, for runs with several cameras");
  compare_verb->add_flag("--no-film", a.no_film, "frames and table only");
  compare_verb->footer("Example: supple compare out/literal out/consistent --out out/compare");

  CLI::App* check_verb = app.add_subcommand("check", "read a scene and report every error in it");
  scene_option(check_verb, a);
  check_verb->add_flag("--quiet", a.quiet, "print warnings and errors only");
  memory_flag(check_verb, a, "limit of memory of the check (default: 200M); of a scene that needs more only the counts are checked");
  time_flag(check_verb, a, "limit of processor time for building the scene and its first contacts (default: 0.7 s)");
  check_verb->footer("Example: supple check my_scene.yaml");

  CLI::App* explain_verb = app.add_subcommand("explain", "print which stages a scene runs, each with the reason");
  scene_option(explain_verb, a);
  explain_verb->add_flag("--simulate-only", a.simulate_only, "explain the scene without its outputs");
  memory_flag(explain_verb, a, "limit of memory for the scene, which is refused if it needs more (default: 8G)");
  explain_verb->footer("Example: supple explain scenes/library/contacts/two_balls.yaml");

  CLI::App* query_verb = app.add_subcommand("query", "print forces, contact, field or mesh of a state as JSON");
  query_verb->add_option("what", a.query, "forces, contact, field or mesh")
      ->required()
      ->check(CLI::IsMember({"forces", "contact", "field", "mesh"}));
  scene_option(query_verb, a);
  query_verb->add_option("--state", a.state, "saved state to use instead of the initial one");
  query_verb->add_option("--points", a.points, "field: CSV file of points (x, y, z in m)");
  query_verb->add_option("--cells", a.cells, "mesh: cells along the longest side")->check(CLI::Range(4, 4096));
  query_verb->add_option("--out", a.out, "mesh: .ply or .obj file, or folder, to write");
  query_verb->add_option("--error", a.error, "contact: relative error, 1e-10 to 0.1, instead of contact.error")->check([](const std::string& text) {
    const double error = number_in(text);  // CLI::Range prints its bounds with six digits
    return error >= 1e-10 && error <= 0.1 ? std::string() : "expected a number from 1e-10 to 0.1, found " + text;
  });
  query_verb->add_option("--threads", a.threads, "number of threads (default: all)")->check(CLI::Range(0, 1024));
  query_verb->add_flag("--samples", a.samples, "contact: also every quadrature point of the contact surface");
  query_verb->add_flag("--json", a.json, "JSON (always; accepted for scripts)");
  memory_flag(query_verb, a, "limit of memory for the scene, which is refused if it needs more (default: 8G)");
  query_verb->footer("Example: supple query contact scenes/library/contacts/two_balls.yaml --error 1e-6");

  CLI::App* bench_verb = app.add_subcommand("bench", "run benchmarks: time, size, error and hash");
  bench_verb->add_option("group", a.group, "group or group/name, e.g. core or core/melt; further arguments and options are passed to its program");
  bench_verb->allow_extras();
  bench_verb->add_flag("--list", a.list, "list the groups");
  bench_verb->add_flag("--json", a.json, "JSON lines (always; accepted for scripts)");
  bench_verb->footer("Example: supple bench core/integrators integrators.svg");

  CLI::App* reference_verb = app.add_subcommand("reference", "print every key of scene files, with defaults and units");
  reference_verb->add_flag("--schema", a.json, "print a JSON Schema for editors instead");
  reference_verb->footer("Example: supple reference --schema > supple.schema.json");

  CLI::App* describe_verb = app.add_subcommand("describe", "print completions for a shell, or a manual page");
  describe_verb->add_option("form", a.query, "bash, zsh or man")->required()->check(CLI::IsMember({"bash", "zsh", "man"}));
  describe_verb->footer("Example: source <(supple describe bash)");

  CLI::App* scenes_verb = app.add_subcommand("scenes", "list the scenes of the library, which every command takes by name");
  scenes_verb->footer("Example: supple run two_balls");

  CLI::App* new_verb = app.add_subcommand("new", "write a small scene from a template");
  new_verb->add_option("name", a.scene, "name of the scene; the file is NAME.yaml")->required();
  new_verb->add_option("--template", a.from, "template of the scene")->default_val("ball");
  std::string known = "Templates:\n";
  for (const tool::Template& one : tool::templates()) known += "  " + std::string(one.name) + ": " + std::string(one.meaning) + '\n';
  new_verb->footer(known + "\nExample: supple new my_scene --template jelly && supple run my_scene.yaml");

  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {  // the version, too
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    tool::expect_known_words(app, std::span(argv, static_cast<std::size_t>(argc)).subspan(1));
    std::ostringstream text;
    app.exit(error, text, text);
    std::cerr << tool::printable_lines(text.str());
    return kUsage;
  }
  a.words = bench_verb->remaining();
  if (view_verb->parsed()) return tool::view(view_arguments, interrupted);
  if (fit_verb->parsed()) tool::start_fit(std::span(argv, static_cast<std::size_t>(argc)), silent);
  if (job_verb->parsed()) return tool::write_job(job_arguments);
  if (sweep_verb->parsed()) return tool::sweep(sweep_arguments, simulation_options(0).delaunay, interrupted);
  if (scenes_verb->parsed()) {
    std::cout << tool::list_library();
    return 0;
  }
  for (const CLI::App* verb : {run_verb, render_verb, export_verb, check_verb, explain_verb, query_verb}) {
    if (verb->parsed()) a.scene = tool::find_scene(a.scene);
  }
  if (run_verb->parsed()) return a.render_only ? render(a) : run(a);
  if (render_verb->parsed()) return render(a);
  if (export_verb->parsed()) return export_files(a);
  if (info_verb->parsed()) {
    std::cout << tool::printable_lines(scenes::describe_run(a.scene));
    return 0;
  }
  if (compare_verb->parsed()) return compare(a);
  if (check_verb->parsed()) return check(a);
  if (explain_verb->parsed()) return explain(a);
  if (bench_verb->parsed()) return bench(a);
  if (describe_verb->parsed()) {
    std::cout << (a.query == "bash" ? tool::bash_completion(app) : a.query == "zsh" ? tool::zsh_completion(app) : tool::man_page(app, SUPPLE_VERSION));
    return 0;
  }
  if (new_verb->parsed()) {
    const std::string path = tool::write_new_scene(a.scene, a.from);
    print(std::cout, "Wrote %s. Next: supple run %s\n", path.c_str(), path.c_str());
    return 0;
  }
  if (reference_verb->parsed()) {
    std::cout << (a.json ? scenes::scene_json_schema() : scenes::scene_reference());
    return 0;
  }
  return query(a);
}

}  // namespace

int main(int argc, char** argv) { return supple::tool::run_program(argc, argv, parse_and_call); }
