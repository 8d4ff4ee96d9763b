#include "supple/scenes/job.h"

#include <algorithm>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "output/run/spare_memory.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "sweep/job_scripts.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using Words = std::vector<std::string>;

constexpr const char* kPlan = "sweep.json";
constexpr std::size_t kLargestPlan = std::size_t{1} << 28;  // [bytes]
constexpr std::size_t kLongestJobName = 128;                // of OpenJD, in characters
constexpr int kNotice = 60;                                 // between SIGTERM and SIGKILL [s]

/// What the tasks of a job call. One of several tasks gets its frames or its point as two more words.
struct Commands {
  std::string name;      ///< of the job
  std::string about;     ///< one line
  Words before;          ///< before all others; empty: nothing
  Words each, last;
  fs::path logs;
  int tasks = 0, chunk = 0, frames = 0;
  bool sweep = false;
};

[[noreturn]] void refuse_other(const std::string& place, const std::string& what, const std::string& expected, const std::string& found) {
  throw Error(ErrorKind::Scene, Fault{.place = place,
                                      .key = {},
                                      .expected = "expected the " + what + " that the job was written for, with fingerprint " + expected,
                                      .found = found,
                                      .hint = "write the job again with `supple job`, or use the earlier " + what});
}

std::string plan_text(const fs::path& folder) {
  const std::vector<std::byte> bytes = io::read_file(folder / kPlan, kLargestPlan);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Number of entries in the plan's array "points". @throws Error{Io}
int count_points(const fs::path& folder) {
  const SpareMemory spare(kSpareForJson);
  const ordered_json plan = ordered_json::parse(plan_text(folder), nullptr, false);
  const bool good = plan.is_object() && plan.contains("points") && plan["points"].is_array() && !plan["points"].empty();
  if (good) return static_cast<int>(plan["points"].size());
  throw Error(ErrorKind::Io, Fault{.place = (folder / kPlan).string(),
                                   .key = "points",
                                   .expected = "expected the plan of a sweep with a list of points",
                                   .found = "none",
                                   .hint = "supple sweep SCENE --out FOLDER --plan-only writes it"});
}

fs::path whole(const fs::path& path) { return fs::absolute(path).lexically_normal(); }

Commands commands_of(const Scene& scene, const JobOptions& options) {
  const SceneSource* source = source_of(scene);
  SUPPLE_EXPECTS(source != nullptr && options.chunk >= 1 && options.threads >= 1);
  const std::string threads = std::to_string(options.threads), fingerprint = fingerprint_of(scene);
  Words tail{whole(scene.source).string(), "--out", whole(options.folder).string()};
  for (const std::string& set : source->overrides) tail.insert(tail.end(), {"--set", set});
  for (const fs::path& path : source->allowed) tail.insert(tail.end(), {"--allow-path", whole(path).string()});
  tail.insert(tail.end(), {"--threads", threads, "--fingerprint", fingerprint, "--progress", "none", "--quiet"});
  Commands out;
  out.name = scene_name(scene);
  out.frames = scene.frame_count();
  out.chunk = options.chunk;
  out.tasks = (out.frames - 1) / out.chunk + 1;
  out.before = {options.program, "run"};
  out.before.insert(out.before.end(), tail.begin(), tail.end());
  out.before.insert(out.before.end(), {"--no-pictures", "--resume"});
  out.each = {options.program, "render"};
  out.each.insert(out.each.end(), tail.begin(), tail.end());
  out.last = out.each;
  out.logs = whole(options.folder) / "logs";
  out.about = "Job of the scene '" + out.name + "', fingerprint " + fingerprint + ": " + counted(static_cast<std::size_t>(out.frames), "frame") + " in " +
              counted(static_cast<std::size_t>(out.tasks), "task") + ".";
  return out;
}

Commands commands_of(const fs::path& folder, const JobOptions& options) {
  SUPPLE_EXPECTS(options.threads >= 1);
  const std::string fingerprint = sweep_fingerprint(folder);
  Commands out;
  out.sweep = true;
  out.name = whole(folder / "").parent_path().filename().string();
  out.tasks = count_points(folder);
  out.each = {options.program, "sweep", whole(folder).string(), "--fingerprint", fingerprint, "--threads", std::to_string(options.threads), "--quiet"};
  out.last = out.each;
  out.last.emplace_back("--collect");
  out.logs = whole(folder) / "logs";
  out.about = "Job of the sweep '" + out.name + "', fingerprint " + fingerprint + ": " + counted(static_cast<std::size_t>(out.tasks), "point") + ".";
  return out;
}

[[noreturn]] void refuse_word(const std::string& word, const std::string& expected) {
  throw Error(ErrorKind::Usage, Fault{.place = "supple job",
                                      .key = {},
                                      .expected = "expected " + expected,
                                      .found = '\'' + word + '\'',
                                      .hint = "choose other names of files and folders"});
}

/// In single quotes of Bash.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) c == '\'' ? text += "'\\''" : text += c;
  return text + '\'';
}

std::string array_of(const Words& words) {
  std::string text = "(";
  for (const std::string& word : words) {
    if (text.size() > 1) text += ' ';
    text += quoted(word);
  }
  return text + ')';
}

/// JSON, which is Python where no literal is `true`, `false` or `null`. @throws Error{Usage} for words that are not UTF-8
std::string json_text(const ordered_json& json, int indent) {
  try {
    return json.dump(indent);
  } catch (const ordered_json::type_error&) {
    refuse_word(json.dump(-1, ' ', false, ordered_json::error_handler_t::replace), "names in UTF-8");
  }
}

std::string filled(std::string text, const std::string& about, const std::string& commands) {
  for (const auto& [mark, value] : {std::pair{std::string("@JOB@"), about}, {std::string("@COMMANDS@"), commands}}) text.replace(text.find(mark), mark.size(), value);
  return text;
}

/// One line, without what would end a comment or a docstring.
std::string comment_of(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ' || c == '"' || c == '\\') c = '_';
  }
  return text;
}

std::string slurm_job(const Commands& job, int threads) {
  std::string commands = "name=" + quoted(job.name) + "\nlogs=" + quoted(job.logs.string()) + "\nthreads=" + std::to_string(threads) + '\n';
  if (job.sweep) {
    commands += "points=" + std::to_string(job.tasks) + "\npoint=" + array_of(job.each) + "\ncollect=" + array_of(job.last);
  } else {
    commands += "frames=" + std::to_string(job.frames) + "\nchunk=" + std::to_string(job.chunk) + "\nsimulate=" + array_of(job.before) + "\ndraw=" + array_of(job.each);
  }
  return filled(slurm_script(job.sweep), comment_of(job.about), commands);
}

std::string ray_job(const Commands& job, int threads) {
  std::string commands = "THREADS = " + std::to_string(threads) + '\n';
  if (job.sweep) {
    commands += "POINTS = " + std::to_string(job.tasks) + "\nPOINT = " + json_text(job.each, -1) + "\nCOLLECT = " + json_text(job.last, -1);
  } else {
    commands += "FRAMES = " + std::to_string(job.frames) + "\nCHUNK = " + std::to_string(job.chunk) + "\nSIMULATE = " + json_text(job.before, -1) +
                "\nDRAW = " + json_text(job.each, -1);
  }
  return filled(ray_script(job.sweep), comment_of(job.about), commands);
}

/// A step of OpenJD. @param varying  words that tasks differ by
ordered_json step_of(const std::string& name, const Words& command, const Words& varying, int threads) {
  for (const std::string& word : command) {
    if (word.find("{{") != std::string::npos) refuse_word(word, "names without '{{', which OpenJD replaces");
  }
  Words arguments(command.begin() + 1, command.end());
  arguments.insert(arguments.end(), varying.begin(), varying.end());
  ordered_json step = {{"name", name}};
  step["script"]["actions"]["onRun"] = {{"command", "{{Param.Program}}"},
                                        {"args", arguments},
                                        {"cancelation", {{"mode", "NOTIFY_THEN_TERMINATE"}, {"notifyPeriodInSeconds", kNotice}}}};
  step["hostRequirements"]["amounts"] = ordered_json::array({{{"name", "amount.worker.vcpu"}, {"min", threads}}});
  return step;
}

void depend(ordered_json& step, const char* on) { step["dependencies"] = ordered_json::array({{{"dependsOn", on}}}); }

/// Parameters of the tasks of a step: integers, by the expression of their ranges.
void vary(ordered_json& step, const std::vector<std::pair<std::string, std::string>>& parameters) {
  ordered_json& space = step["parameterSpace"];
  std::string together;
  for (const auto& [name, range] : parameters) {
    space["taskParameterDefinitions"].push_back({{"name", name}, {"type", "INT"}, {"range", range}});
    together += (together.empty() ? "" : ", ") + name;
  }
  if (parameters.size() > 1) space["combination"] = '(' + together + ')';
}

/// "1-91:10": from `first` to at most `last`.
std::string range_of(int first, int last, int step) {
  return std::to_string(first) + (last > first ? '-' + std::to_string(last) + (step > 1 ? ':' + std::to_string(step) : "") : "");
}

std::string openjd_job(const Commands& job, const std::string& program, int threads) {
  ordered_json steps = ordered_json::array();
  if (job.sweep) {
    steps.push_back(step_of("Point", job.each, {"--point", "{{Task.Param.Point}}"}, threads));
    vary(steps[0], {{"Point", range_of(1, job.tasks, 1)}});
    steps.push_back(step_of("Collect", job.last, {}, 1));
    depend(steps[1], "Point");
  } else {
    const int last = job.tasks * job.chunk;
    steps.push_back(step_of("Simulate", job.before, {}, threads));
    steps.push_back(step_of("Draw", job.each, {"--frames", "{{Task.Param.First}}-{{Task.Param.Last}}"}, threads));
    depend(steps[1], "Simulate");
    vary(steps[1], {{"First", range_of(1, last - job.chunk + 1, job.chunk)}, {"Last", range_of(job.chunk, last, job.chunk)}});
    steps.push_back(step_of("Film", job.last, {}, threads));
    depend(steps[2], "Draw");
  }
  std::string name = comment_of(job.name);
  const bool short_ascii = name.size() <= kLongestJobName && std::all_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 0x7F; });
  if (!short_ascii || name.find("{{") != std::string::npos) name = "supple";
  const ordered_json json = {{"specificationVersion", "jobtemplate-2023-09"},
                             {"name", name},
                             {"description", comment_of(job.about)},
                             {"parameterDefinitions", {{{"name", "Program"}, {"type", "STRING"}, {"default", program}, {"description", "The tool, as the machines find it."}}}},
                             {"steps", steps}};
  return json_text(json, 2) + '\n';
}

std::string job_text(const Commands& job, const JobOptions& options) {
  switch (options.format) {
    case JobFormat::OpenJd: return openjd_job(job, options.program, options.threads);
    case JobFormat::Slurm: return slurm_job(job, options.threads);
    case JobFormat::Ray: break;
  }
  return ray_job(job, options.threads);
}

}  // namespace

std::string fingerprint_of(const Scene& scene, bool pictures) {
  Hasher hasher;
  hasher.add(scene.content_hash);
  if (pictures) hasher.add(scene.picture_hash);
  hasher.add(static_cast<std::uint64_t>(scene.frame_count()));
  return to_hex(hasher.value());
}

void expect_fingerprint(const Scene& scene, const std::string& fingerprint) {
  const std::string found = fingerprint_of(scene);
  if (found != fingerprint) refuse_other(scene.source.string(), "scene", fingerprint, found);
}

std::string scene_job(const Scene& scene, const JobOptions& options) { return job_text(commands_of(scene, options), options); }

bool is_sweep(const fs::path& folder) { return fs::is_regular_file(folder / kPlan); }

std::string sweep_fingerprint(const fs::path& folder) {
  const std::string text = plan_text(folder);
  return to_hex(hash_bytes(std::as_bytes(std::span(text))));
}

void expect_sweep_fingerprint(const fs::path& folder, const std::string& fingerprint) {
  const std::string found = sweep_fingerprint(folder);
  if (found != fingerprint) refuse_other((folder / kPlan).string(), "sweep", fingerprint, found);
}

std::string sweep_job(const fs::path& folder, const JobOptions& options) { return job_text(commands_of(folder, options), options); }

}  // namespace supple::scenes
