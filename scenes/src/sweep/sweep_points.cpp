#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <exception>
#include <map>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "file/yaml/yaml_quantity.h"
#include "output/files/folder_lock.h"
#include "output/run/program_identity.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/child_process.h"
#include "supple/scenes/job.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "supple/scenes/sweep.h"
#include "sweep/measures.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kRowFile = "row.json";
constexpr std::size_t kLargestRow = std::size_t{1} << 26;  // [byte]
constexpr std::chrono::milliseconds kPointNotice{600};      // for a point to end by itself when the sweep is interrupted
constexpr const char* kUnfinished = "unfinished";
constexpr const char* kCrashed = "crashed";

const SweepPoint& point_with(const SweepPlan& plan, const fs::path& folder, int number) {
  if (number >= 1 && static_cast<std::size_t>(number) <= plan.points.size()) return plan.points[static_cast<std::size_t>(number) - 1];
  throw Error(ErrorKind::Usage, Fault{.place = "--point",
                                      .key = {},
                                      .expected = "expected a point from 1 to " + std::to_string(plan.points.size()),
                                      .found = std::to_string(number),
                                      .hint = (folder / "sweep.json").string() + " lists them"});
}

/// The row in a folder; null where there is none, or one that cannot be read.
ordered_json read_row(const fs::path& place) {
  std::error_code ignored;
  if (!fs::exists(place / kRowFile, ignored)) return nullptr;
  const std::vector<std::byte> bytes = io::read_file(place / kRowFile, kLargestRow);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  ordered_json row = ordered_json::parse(text, text + bytes.size(), nullptr, false);
  const auto is = [&row](const char* key, auto type) { return row.contains(key) && (row[key].*type)(); };
  const bool whole = row.is_object() && is("fingerprint", &ordered_json::is_string) && is("outcome", &ordered_json::is_string) && is("reason", &ordered_json::is_string) &&
                     is("exit_code", &ordered_json::is_number_integer) && is("values", &ordered_json::is_object);
  return whole ? row : ordered_json(nullptr);
}

SweepRow row_of(int number, const ordered_json& row) {
  if (row.is_null()) return {.number = number, .outcome = "missing", .reason = {}};
  return {.number = number, .outcome = row["outcome"].get<std::string>(), .reason = row["reason"].get<std::string>(), .exit_code = row["exit_code"].get<int>()};
}

struct PointFiles {
  fs::path place;
  const SweepPoint& point;
  std::string fingerprint;
};

void write_row(const PointFiles& files, const SweepRow& row, const ordered_json& values) {
  const ordered_json json = {{"number", row.number}, {"set", files.point.set},    {"fingerprint", files.fingerprint}, {"outcome", row.outcome},
                             {"reason", row.reason}, {"exit_code", row.exit_code}, {"values", values}};
  io::write_atomically(files.place / kRowFile, std::string_view(json.dump(1, ' ', false, ordered_json::error_handler_t::replace) + '\n'));
}

/// Removes what a process that was killed while it wrote the row has left.
void remove_row_temporaries(const fs::path& place) {
  std::error_code ignored;
  std::vector<fs::path> left;
  for (const fs::directory_entry& entry : fs::directory_iterator(place, ignored)) {
    const std::string file = entry.path().filename().string();
    if (file.starts_with(std::string(".") + kRowFile + '.') && file.ends_with(".tmp")) left.push_back(entry.path());
  }
  for (const fs::path& path : left) fs::remove(path, ignored);
}

/// Of everything that the row follows from: the build, the scene with its frames, what is written and measured.
std::string row_fingerprint(const SweepPlan& plan, const Scene& scene) {
  Hasher hasher;
  hasher.add(std::string_view(program_identity()));
  hasher.add(std::string_view(fingerprint_of(scene, plan.outputs)));
  hasher.add(std::string_view(plan.measures));
  return to_hex(hasher.value());
}

/// Of a scene that cannot be read: of what is said about it.
std::string row_fingerprint(const Error& error) {
  Hasher hasher;
  hasher.add(std::string_view(program_identity()));
  hasher.add(std::string_view(error.what()));
  return to_hex(hasher.value());
}

/// A point's scene, and what its row is known by.
struct Prepared {
  std::optional<Scene> scene;  ///< none: it has faults
  std::string faults;
  std::string fingerprint;
};

/// @throws Error as read_scene, but not Error{Scene}
Prepared prepare(const SweepPlan& plan, const SweepPoint& point) {
  Prepared out;
  try {
    out.scene = read_scene(plan.scene, point.set, plan.allowed);
    out.fingerprint = row_fingerprint(plan, *out.scene);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::Scene) throw;
    out.faults = error.what();
    out.fingerprint = row_fingerprint(error);
  }
  return out;
}

bool is_kept(const ordered_json& row, const std::string& fingerprint, SweepRow& out) {
  if (row.is_null() || row["fingerprint"] != fingerprint) return false;
  const SweepRow found = row_of(out.number, row);
  if (!found.finished()) return false;
  out = found;
  out.kept = true;
  return true;
}

RunOptions run_options_of(const SweepPlan& plan, const PointOptions& options, const fs::path& place, bool resume) {
  return {.folder = place,
          .threads = options.threads,
          .overwrite = !resume,
          .resume = resume,
          .simulate_only = !plan.outputs,
          .delaunay = options.delaunay,
          .scene_memory = options.memory,
          .time_limit = options.time_limit,
          .interrupt = options.interrupt};
}

/// The row as CSV has it (RFC 4180).
std::string cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

std::string cell(const ordered_json& value) {
  if (value.is_null()) return {};
  return cell(value.is_string() ? value.get<std::string>() : value.dump());
}

/// The value of "key=value": a quantity as the number that means the same without a unit, a text without its quotes.
std::string plain_value(const std::string& setting) {
  const std::string text = setting.substr(setting.find('=') + 1);
  if (text.starts_with('"')) {
    const ordered_json quoted = ordered_json::parse(text, nullptr, false);
    return quoted.is_string() ? quoted.get<std::string>() : text;
  }
  if (text.find(' ') == std::string::npos) return text;
  const auto quantity = read_any_quantity(text);
  if (!quantity) return text;
  constexpr double kDegrees = 57.295779513082320877;  // keys without a unit have angles in degrees
  const double value = quantity->dimension == kAngle.dimension ? quantity->factor * kDegrees : quantity->factor;
  return ordered_json(value).dump();
}

/// Runs the points of one sweep by several threads, each waiting for a process at a time.
class PointRunner {
 public:
  PointRunner(const fs::path& folder, const SweepPlan& plan, const SweepOptions& options) : folder_(folder), plan_(plan), options_(options) {}

  void run() {
    const unsigned processors = std::max(1U, std::thread::hardware_concurrency());
    const std::size_t jobs = std::min<std::size_t>(options_.jobs > 0 ? static_cast<std::size_t>(options_.jobs) : processors, plan_.points.size());
    {
      std::vector<std::jthread> workers;
      try {
        for (std::size_t k = 0; k < jobs; ++k) workers.emplace_back([this] { work(); });
      } catch (const std::system_error&) {  // the machine has no more threads: this one helps those that began
        work();
      }
    }
    if (failure_) std::rethrow_exception(failure_);
    heed(options_.interrupt);
  }

 private:
  void work() {
    for (std::size_t i = next_++; i < plan_.points.size(); i = next_++) {
      try {
        const SweepRow row = run_one(plan_.points[i]);
        const std::scoped_lock lock(mutex_);
        if (failure_) return;
        ++progress_.done;
        progress_.count = static_cast<int>(plan_.points.size());
        progress_.failed += row.outcome == "done" ? 0 : 1;
        if (options_.progress) options_.progress(progress_);
      } catch (...) {
        const std::scoped_lock lock(mutex_);
        if (!failure_) failure_ = std::current_exception();
        next_ = plan_.points.size();
        return;
      }
    }
  }

  SweepRow run_one(const SweepPoint& point) {
    const fs::path place = folder_ / point.folder;
    remove_row_temporaries(place);
    SweepRow kept{.number = point.number, .outcome = {}, .reason = {}};
    const ordered_json before = read_row(place);
    if (!before.is_null() && is_kept(before, prepare(plan_, point).fingerprint, kept)) return kept;
    std::vector<std::string> words = options_.command;
    words.insert(words.end(), {folder_.string(), "--point", std::to_string(point.number)});
    io::ProgramEnd end;
    try {
      end = io::run_program(words.front(), words, options_.interrupt, kPointNotice);
    } catch (const std::system_error& error) {
      throw Error(ErrorKind::Io, Fault{.place = words.front(), .key = {}, .expected = "cannot be started: " + error.code().message(), .found = {}, .hint = {}});
    }
    const ordered_json row = read_row(place);
    SweepRow found = row_of(point.number, row);
    if (WIFEXITED(end.status) && found.outcome != kUnfinished && found.outcome != "missing") return found;
    return write_crash(point, row, end);
  }

  /// The row of a process that ended without one.
  SweepRow write_crash(const SweepPoint& point, const ordered_json& row, const io::ProgramEnd& end) {
    SweepRow crash{.number = point.number, .outcome = kCrashed, .reason = {}};
    crash.exit_code = WIFEXITED(end.status) ? WEXITSTATUS(end.status) : 128 + WTERMSIG(end.status);
    crash.reason = WIFEXITED(end.status) ? "its process ended with exit code " + std::to_string(crash.exit_code) : "its process was ended by signal " + std::to_string(WTERMSIG(end.status));
    const std::size_t last = end.messages.find_last_not_of("\r\n ");
    if (last != std::string::npos) crash.reason += ": " + end.messages.substr(0, last + 1);
    io::make_writable_folder(folder_ / point.folder);
    write_row({folder_ / point.folder, point, row.is_null() ? "" : row["fingerprint"].get<std::string>()}, crash, ordered_json::object());
    return crash;
  }

  const fs::path& folder_;
  const SweepPlan& plan_;
  const SweepOptions& options_;
  std::atomic<std::size_t> next_{0};
  std::mutex mutex_;
  SweepProgress progress_{};
  std::exception_ptr failure_;
};

}  // namespace

SweepRow run_point(const fs::path& folder, int number, const PointOptions& options) {
  const SweepPlan plan = read_plan(folder);
  const SweepPoint& point = point_with(plan, folder, number);
  const fs::path place = folder / point.folder;
  io::make_writable_folder(place);
  const ordered_json before = read_row(place);
  SweepRow row{.number = number, .outcome = kUnfinished, .reason = {}};
  const Prepared prepared = prepare(plan, point);
  const PointFiles files{place, point, prepared.fingerprint};
  if (is_kept(before, files.fingerprint, row)) return row;
  if (!prepared.scene) {
    row.outcome = "invalid";
    row.reason = prepared.faults;
    row.exit_code = static_cast<int>(ErrorKind::Scene);
    write_row(files, row, ordered_json::object());
    return row;
  }
  const bool resume = !before.is_null() && before["fingerprint"] == files.fingerprint;
  write_row(files, row, ordered_json::object());
  const RunResult result = run_scene(*prepared.scene, run_options_of(plan, options, place, resume));
  remove_row_temporaries(place);
  row.outcome = result.outcome;
  row.reason = result.reason;
  row.exit_code = result.exit_code;
  write_row(files, row, result.outcome == "done" ? measure_run(plan, point, place) : ordered_json::object());
  return row;
}

std::vector<SweepRow> run_sweep(const fs::path& folder, const SweepOptions& options) {
  SUPPLE_EXPECTS(!options.command.empty());
  const SweepPlan plan = read_plan(folder);
  const FolderLock lock(folder);
  PointRunner(folder, plan, options).run();
  (void)collect_sweep(folder);
  std::vector<SweepRow> rows;
  for (const SweepPoint& point : plan.points) rows.push_back(row_of(point.number, read_row(folder / point.folder)));
  return rows;
}

fs::path collect_sweep(const fs::path& folder) {
  const SweepPlan plan = read_plan(folder);
  std::vector<ordered_json> rows;
  std::vector<std::string> columns;
  for (const SweepPoint& point : plan.points) {
    rows.push_back(read_row(folder / point.folder));
    if (rows.back().is_null()) continue;
    for (const auto& [name, value] : rows.back()["values"].items()) {
      if (std::find(columns.begin(), columns.end(), name) == columns.end()) columns.push_back(name);
    }
  }
  const fs::path path = folder / "table.csv";
  io::AtomicFile table(path);
  std::string line = "point";
  for (const std::string& key : plan.parameters) line += ',' + cell(key);
  line += ",outcome";
  for (const std::string& name : columns) line += ',' + cell(name);
  table.append(line + ",reason\n");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const SweepPoint& point = plan.points[i];
    const SweepRow row = row_of(point.number, rows[i]);
    line = std::to_string(point.number);
    for (const std::string& key : plan.parameters) {
      const auto at = std::find_if(point.set.begin(), point.set.end(), [&](const std::string& setting) { return setting.starts_with(key + '='); });
      line += ',' + (at == point.set.end() ? std::string() : cell(plain_value(*at)));
    }
    line += ',' + cell(row.outcome);
    for (const std::string& name : columns) line += ',' + (rows[i].is_null() ? std::string() : cell(rows[i]["values"].value(name, ordered_json())));
    table.append(line + ',' + cell(row.reason) + '\n');
  }
  table.commit();
  return path;
}

}  // namespace supple::scenes
