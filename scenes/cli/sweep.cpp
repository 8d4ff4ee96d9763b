#include "sweep.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <system_error>

#include "library.h"
#include "print.h"
#include "progress_bar.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/scenes/job.h"
#include "supple/scenes/limits.h"
#include "supple/scenes/sweep.h"

namespace supple::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFooter =
    "KEY=VALUES: a:b:N (N values in equal steps), a:b:logN (in equal ratios), [x, y, z] (any values; a value that is a list is [[...]]), or\n"
    "one value for all points. The grid of all combinations is run, the last key fastest. With --sample: a:b or a:b:log are ranges to draw from.\n\n"
    "DIR holds sweep.json (the plan), a folder for each point and table.csv. The same command again goes on with what is missing; failed\n"
    "points are rows with their outcome. Points are independent: other machines may run them with --point, and --collect joins the rows.\n\n"
    "Examples: supple sweep two_balls --set objects.left.contact.modulus=1e3:1e6:log9 --set objects.left.contact.friction=0:0.5:6 --out out/sweep\n"
    "          supple sweep out/sweep --point 3\n"
    "          supple sweep out/sweep --collect\n"
    "          supple sweep out/sweep --plot left-right.peak_force_n --over objects.left.contact.modulus";

[[noreturn]] void refuse(std::string place, std::string expected, std::string found, std::string hint) {
  throw Error(ErrorKind::Usage, Fault{.place = std::move(place), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
}

/// The folder of the sweep, with its plan.
fs::path planned(const SweepArguments& a) {
  if (fs::is_directory(a.what)) {
    if (!a.set.empty() || !a.sample.empty() || !a.measure.empty() || a.plan_only || !a.out.empty()) {
      refuse("supple sweep", "expected a scene with --set, --sample, --measure, --out or --plan-only", "the folder " + a.what, "the plan of a folder is fixed; make another one with another --out");
    }
    return a.what;
  }
  if (a.out.empty()) refuse("supple sweep", "expected --out DIR, the folder of the sweep", "none", "for example --out out/sweep");
  const scenes::SweepPlan plan = scenes::plan_sweep({.scene = find_scene(a.what),
                                                     .set = a.set,
                                                     .sample = a.sample,
                                                     .seed = a.seed,
                                                     .measures = a.measure,
                                                     .allowed = a.allowed,
                                                     .outputs = a.outputs});
  scenes::write_plan(a.out, plan, a.overwrite);
  if (a.plan_only && !a.quiet) print(std::cout, "plan:   %s (%s)\n", (fs::path(a.out) / "sweep.json").c_str(), counted(plan.points.size(), "point").c_str());
  return a.out;
}

int run_one(const fs::path& folder, const SweepArguments& a, const implicit::DelaunayMesher& delaunay, const std::atomic<int>& interrupt) {
  scenes::PointOptions options{.threads = a.threads, .time_limit = a.time_limit, .delaunay = delaunay, .interrupt = &interrupt};
  if (a.memory > 0.0) options.memory = a.memory;
  const scenes::SweepRow row = scenes::run_point(folder, a.point, options);
  if (!row.reason.empty()) print(std::cerr, "%s\n", row.reason.c_str());
  if (!a.quiet) print(std::cout, "point %d: %s%s\n", row.number, row.outcome.c_str(), row.kept ? " (kept)" : "");
  return row.finished() ? 0 : row.exit_code;
}

std::string exact(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.17g", value);
  return text.data();
}

/// This program, with the options that hold for every point.
std::vector<std::string> point_command(const SweepArguments& a) {
  std::vector<std::string> words{fs::read_symlink("/proc/self/exe").string(), "sweep", "--quiet", "--threads", std::to_string(a.threads)};
  if (a.memory > 0.0) words.insert(words.end(), {"--memory", exact(a.memory * 1e-9) + "G"});
  if (a.time_limit > 0.0) words.insert(words.end(), {"--time-limit", exact(a.time_limit)});
  return words;
}

int run_all(const fs::path& folder, const SweepArguments& a, const std::atomic<int>& interrupt) {
  ProgressBar bar(a.quiet ? ProgressStyle::None : progress_style(a.progress));
  scenes::SweepOptions options{.jobs = a.jobs, .command = point_command(a), .interrupt = &interrupt};
  using Clock = std::chrono::steady_clock;
  options.progress = [&bar, begin = Clock::now()](const scenes::SweepProgress& now) {
    const double elapsed = std::chrono::duration<double>(Clock::now() - begin).count(), each = elapsed / now.done;
    bar.show({.stage = "points", .frame = now.done, .frame_count = now.count, .elapsed_s = elapsed, .left_s = each * (now.count - now.done), .frames_per_s = 1.0 / each});
  };
  const std::vector<scenes::SweepRow> rows = scenes::run_sweep(folder, options);
  bar.finish();
  std::map<std::string, int> outcomes;
  for (const scenes::SweepRow& row : rows) ++outcomes[row.outcome];
  std::string counts;
  for (const auto& [outcome, count] : outcomes) counts += (counts.empty() ? "" : ", ") + std::to_string(count) + ' ' + outcome;
  if (!a.quiet) {
    print(std::cout, "points: %zu (%s)\n", rows.size(), counts.c_str());
    print(std::cout, "table:  %s\n", (folder / "table.csv").c_str());
  }
  return 0;
}

/// Leaves the plot to matplotlib, by the Python package. @throws Error{Io} where Python cannot be started
int plot(const fs::path& folder, const SweepArguments& a) {
  const char* named = std::getenv("SUPPLE_PYTHON");
  std::vector<std::string> words{named == nullptr || *named == '\0' ? "python3" : named, "-m", "supple", "plot", folder.string(), a.plot};
  for (const std::string& key : a.over) words.insert(words.end(), {"--over", key});
  if (!a.svg.empty()) words.insert(words.end(), {"--svg", a.svg});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::cout.flush();
  execvp(argv[0], argv.data());
  throw Error(ErrorKind::Io, Fault{.place = words[0],
                                   .key = {},
                                   .expected = "cannot be started: " + std::generic_category().message(errno),
                                   .found = {},
                                   .hint = "plots need Python with the package supple and matplotlib; SUPPLE_PYTHON names the interpreter"});
}

}  // namespace

CLI::App* add_sweep(CLI::App& app, SweepArguments& a) {
  CLI::App* verb = app.add_subcommand("sweep", "run a scene at many values of its keys, and make one table of the results");
  verb->add_option("scene", a.what, "scene file (YAML), or the folder of a sweep")->required();
  verb->add_option("--set", a.set, "KEY=VALUES, see below; may be repeated")->take_all();
  verb->add_option("--sample", a.sample, "random:N or lhs:N (Latin hypercube): N points from ranges instead of the grid");
  verb->add_option("--seed", a.seed, "seed of samples (default: 1)");
  verb->add_option("--measure", a.measure, "file (YAML) that names the columns of the table");
  verb->add_option("--out", a.out, "folder of the sweep");
  verb->add_option("--allow-path", a.allowed, "file or folder outside the scene's folder that the scene may read; may be repeated")->take_all();
  verb->add_option("--jobs", a.jobs, "points that run at the same time (default: one per processor)")->check(CLI::Range(1, 1024));
  verb->add_option("--threads", a.threads, "number of threads of each point (default: 1); does not change results")->check(CLI::Range(0, 1024));
  verb->add_option_function<std::string>("--memory", [&a](const std::string& text) { a.memory = scenes::parse_bytes(text); }, "limit of memory for each point's scene (default: 8G)")
      ->check([](const std::string& text) { return scenes::parse_bytes(text) > 0.0 ? std::string() : "expected an amount of memory > 0, such as 4G, found " + text; });
  verb->add_option("--time-limit", a.time_limit, "stop a point after this many seconds; it is then tried again by the next call")->check(CLI::PositiveNumber);
  verb->add_flag("--outputs", a.outputs, "points also write the pictures, meshes, grids and samples that the scene asks for");
  verb->add_flag("--plan-only", a.plan_only, "write the plan and run nothing");
  CLI::Option* point = verb->add_option("--point", a.point, "of a folder: run this point only; one that is finished is left as it is")
                           ->check(CLI::Range(1, static_cast<int>(scenes::kMostSweepPoints)));
  verb->add_flag("--collect", a.collect, "of a folder: make the table from the rows that are there")->excludes(point);
  CLI::Option* plot = verb->add_option("--plot", a.plot, "of a folder: draw a column of the table as SVG (with matplotlib, by the Python package)");
  verb->add_option("--over", a.over, "with --plot: key of an axis; twice for a map of colours (default: the first one or two keys)")->needs(plot)->take_all();
  verb->add_option("--svg", a.svg, "with --plot: file to write (default: COLUMN.svg in the folder)")->needs(plot);
  verb->add_option("--fingerprint", a.fingerprint, "of a folder: refuse a plan of another fingerprint; job files (`supple job`) hold that of their sweep");
  verb->add_flag("--overwrite", a.overwrite, "replace the plan of an earlier sweep in the folder");
  verb->add_option("--progress", a.progress, "auto, bar, plain or none")->check(CLI::IsMember({"auto", "bar", "plain", "none"}));
  verb->add_flag("--quiet", a.quiet, "print warnings and errors only");
  verb->footer(kFooter);
  return verb;
}

int sweep(const SweepArguments& a, const implicit::DelaunayMesher& delaunay, const std::atomic<int>& interrupt) {
  const fs::path folder = planned(a);
  if (!a.fingerprint.empty()) scenes::expect_sweep_fingerprint(folder, a.fingerprint);
  if (a.plan_only) return 0;
  if (a.point > 0) return run_one(folder, a, delaunay, interrupt);
  if (!a.plot.empty()) return plot(folder, a);
  if (!a.collect) return run_all(folder, a, interrupt);
  const fs::path table = scenes::collect_sweep(folder);
  if (!a.quiet) print(std::cout, "table:  %s\n", table.c_str());
  return 0;
}

}  // namespace supple::tool
