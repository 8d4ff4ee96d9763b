#include "sweep/measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include <nlohmann/json.hpp>

#include "file/read_scene_archive.h"
#include "output/files/saved_frames.h"
#include "output/run/result_file.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "sweep/frame_columns.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

void measure_fields(FieldArchive& archive, Measure& m) {
  archive("result", m.result, {}, "path of a value in result.json");
  archive("pair", m.pair, {}, "two objects or obstacles");
  archive("take", m.take, {}, "of the pair, taken at every step");
  archive("frames", m.frames, {}, "table with rows at every frame");
  archive("of", m.of, {}, "object whose rows count");
  archive("column", m.column, {}, "of the table");
  archive("across", m.across, {}, "rows of one frame");
  archive("reduce", m.reduce, {}, "frames of the run");
  const bool frames = archive.given("frames");
  if (frames || archive.given("take")) m.kind = frames ? Measure::Kind::Frames : Measure::Kind::Pair;
  const auto table = [&](FrameTableName name) { return frames && m.frames == name; };
  const auto need = [&archive](bool holds, const char* key, const char* expected, const char* found, const char* hint) { archive.check(holds, key, expected, found, hint); };
  const int ways = (archive.given("result") ? 1 : 0) + (archive.given("take") ? 1 : 0) + (frames ? 1 : 0);
  need(ways == 1, "", "expected one of result, take (with pair) and frames", ways == 0 ? "none" : "several",
       "for example {pair: [ball, floor], take: peak_force}, {frames: energies, column: total_j, reduce: max} or {result: audits.energy_error}");
  need(!archive.given("pair") || m.pair.size() == 2, "pair", "expected two names", "another number", "");
  need(!archive.given("take") || archive.given("pair"), "take", "expected a pair to take it of", "none", "add pair: [A, B]");
  need(!archive.given("pair") || archive.given("take") || table(FrameTableName::Contacts), "pair", "expected it with take, or with frames: contacts", "neither", "");
  need(!frames || (archive.given("column") && archive.given("reduce")), "frames", "expected column and reduce with it", "neither, or one",
       "reduce is one of min, max, mean, final, peak_time, integral");
  need(frames || !(archive.given("column") || archive.given("reduce") || archive.given("across") || archive.given("of")), "",
       "expected column, reduce, across and of with frames only", "one of them without", "");
  need(!archive.given("of") || table(FrameTableName::Objects) || table(FrameTableName::Particles), "of", "expected it with frames: objects or frames: particles", "another table",
       "rows of contacts are chosen by pair");
}

/// The measures of a file with what their faults need.
struct MeasureFile {
  SourceTexts texts;
  Tree tree;
  FaultList faults{texts};
  const Node* root = nullptr;
  std::vector<Measure> measures;

  MeasureFile(const std::string& text, const std::string& name) {
    const std::uint32_t source = texts.add(name, text, false);
    root = parse_yaml(texts.text(source), source, tree, faults);
    if (root == nullptr || root->kind != Node::Kind::Mapping) {
      const bool empty = root == nullptr;
      if (faults.count() == 0) {
        faults.add(empty ? Mark{source, 1, 1} : root->mark, "", "expected measures by name", empty ? "an empty file" : root->described(),
                   "write NAME: {pair: [A, B], take: peak_force}");
      }
      faults.raise();
    }
    const FileAccess no_files{};
    for (const Node::Entry& entry : root->entries) {
      Measure measure;
      measure.name = entry.key;
      if (entry.value->kind != Node::Kind::Mapping) {
        fault(measure, "", "expected a mapping", entry.value->described(), "write {pair: [A, B], take: peak_force}, {frames: TABLE, column: C, reduce: max} or {result: PATH}");
        continue;
      }
      ReadArchive archive(faults, *entry.value, entry.key, no_files);
      measure_fields(archive, measure);
      archive.finish();
      measures.push_back(std::move(measure));
    }
  }

  /// @param key  of the measure; "" for the measure itself
  void fault(const Measure& measure, const std::string& key, std::string expected, std::string found, std::string hint) {
    const std::string path = key.empty() ? measure.name : measure.name + '.' + key;
    const Node& node = *root->find(measure.name)->value;
    const Node::Entry* const entry = key.empty() ? nullptr : node.find(key);
    faults.add(entry == nullptr ? node.mark : entry->value->mark, path, std::move(expected), std::move(found), std::move(hint));
  }
};

/// A value of a report by its path; names in it may hold dots, so the longest one that fits is meant.
struct Found {
  const ordered_json* value = nullptr;
  bool open = false;                   ///< it lies in a list, whose items are known after the run only
  std::string missed;                  ///< the part of the path that is not there
  std::vector<std::string> known;      ///< the keys there
};

Found find_value(const ordered_json& report, std::string_view path) {
  const ordered_json* at = &report;
  while (!path.empty()) {
    if (at->is_array()) {
      const std::size_t open = path.starts_with('[') ? 1 : 0;
      const std::size_t end = path.find_first_of("].", open);
      const std::string index(path.substr(open, std::min(end, path.size()) - open));
      const bool number = !index.empty() && index.find_first_not_of("0123456789") == std::string::npos;
      if (!number) return {.missed = std::string(path), .known = {"an index from 0"}};
      const std::size_t i = index.size() > 6 ? at->size() : std::stoul(index);
      if (i >= at->size()) return {.open = true, .missed = std::string(path), .known = {}};
      at = &(*at)[i];
      path.remove_prefix(std::min(path.size(), open + index.size() + open));
    } else {
      const std::string* best = nullptr;
      std::vector<std::string> known;
      if (at->is_object()) {
        for (const auto& [key, value] : at->items()) {
          known.push_back(key);
          const bool fits = path.starts_with(key) && (path.size() == key.size() || path[key.size()] == '.' || path[key.size()] == '[');
          if (fits && (best == nullptr || key.size() > best->size())) best = &key;
        }
      }
      if (best == nullptr) return {.missed = std::string(path), .known = known};
      const std::size_t length = best->size();
      at = &(*at)[*best];
      path.remove_prefix(length);
    }
    if (path.starts_with('.')) path.remove_prefix(1);
  }
  return {.value = at, .missed = {}, .known = {}};
}

std::string hint_of(const std::string& word, const std::vector<std::string>& known) {
  const std::vector<std::string_view> views(known.begin(), known.end());
  return views.empty() ? std::string() : known_hint(word, views);
}

void check_members(MeasureFile& file, const Simulation& simulation, const Measure& measure) {
  std::vector<std::string> objects, all;
  for (const ObjectModel& object : simulation.model().objects) objects.push_back(object.name);
  all = objects;
  for (const FixedBody& fixed : simulation.model().fixed) all.push_back(fixed.name);
  for (const std::string& name : measure.pair) {
    if (std::find(all.begin(), all.end(), name) == all.end()) file.fault(measure, "pair", "expected objects or obstacles of the scene", '\'' + shown(name) + '\'', hint_of(name, all));
  }
  if (!measure.of.empty() && std::find(objects.begin(), objects.end(), measure.of) == objects.end()) {
    file.fault(measure, "of", "expected an object of the scene", '\'' + shown(measure.of) + '\'', hint_of(measure.of, objects));
  }
}

void check_column(MeasureFile& file, Simulation& simulation, const Measure& measure) {
  const std::vector<std::string> names = frame_columns(measure.frames, simulation).name;
  if (std::find(names.begin(), names.end(), measure.column) == names.end()) {
    file.fault(measure, "column", "expected a column of " + std::string(name_of(measure.frames)), '\'' + shown(measure.column) + '\'', hint_of(measure.column, names));
  }
}

void check_path(MeasureFile& file, const ordered_json& report, const Measure& measure) {
  const Found found = find_value(report, measure.result);
  if (found.value == nullptr && !found.open) {
    const std::string word = found.missed.substr(0, found.missed.find_first_of(".["));
    file.fault(measure, "result", "expected a value of result.json", '\'' + shown(measure.result) + '\'', hint_of(word, found.known));
  } else if (found.value != nullptr && found.value->is_structured()) {
    file.fault(measure, "result", "expected a single value of result.json", "several below '" + shown(measure.result) + '\'', "");
  }
}

/// The pair of a report; null where it never touched.
const ordered_json* pair_of(const ordered_json& report, const std::vector<std::string>& names) {
  for (const ordered_json& pair : report.at("pairs")) {
    const std::string a = pair.at("a"), b = pair.at("b");
    if ((a == names[0] && b == names[1]) || (a == names[1] && b == names[0])) return &pair;
  }
  return nullptr;
}

std::string key_of(TakeName take) {
  switch (take) {
    case TakeName::PeakForce: return "peak_force_n";
    case TakeName::PeakTime: return "peak_time_s";
    case TakeName::Impulse: return "impulse_ns";
    case TakeName::ContactTime: return "contact_time_s";
    case TakeName::FirstTouch: return "first_touch_s";
    case TakeName::FirstContactTime: return "first_contact_time_s";
    case TakeName::ApproachSpeed: return "approach_speed_m_s";
    case TakeName::ReboundSpeed: return "rebound_speed_m_s";
    case TakeName::Restitution: return "restitution";
    case TakeName::LargestDepth: return "largest_depth_m";
    case TakeName::DepthAtRest: return "depth_m";
    case TakeName::Touches: break;
  }
  return "touches";
}

/// What a pair has that never touched.
ordered_json untouched(TakeName take) {
  switch (take) {
    case TakeName::PeakForce:
    case TakeName::Impulse:
    case TakeName::ContactTime:
    case TakeName::LargestDepth: return 0.0;
    case TakeName::Touches: return 0;
    default: return nullptr;
  }
}

/// A finished run, whose states are read as measures need them.
class FinishedRun {
 public:
  FinishedRun(const SweepPlan& plan, const SweepPoint& point, const fs::path& folder) : folder_(folder), scene_(read_scene(plan.scene, point.set, plan.allowed)) {
    const std::vector<std::byte> bytes = io::read_file(folder / "result.json", io::kLargestInput);
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    report = ordered_json::parse(text, text + bytes.size());
    last_ = report.at("frames").get<int>();
  }

  ordered_json report;

  /// The depth of a pair at the end, where it is within 1 % of it for the last tenth of the run.
  [[nodiscard]] ordered_json depth_at_rest(const std::vector<std::string>& names) {
    const ordered_json* pair = pair_of(report, names);
    if (pair == nullptr || !pair->at("touching").get<bool>()) return nullptr;
    const double depth = pair->at("depth_m").get<double>();
    const auto member = [this](const std::string& name) {
      const Model& model = simulation().model();
      for (std::size_t i = 0; i < model.objects.size(); ++i) {
        if (model.objects[i].name == name) return static_cast<std::uint32_t>(i);
      }
      const auto fixed = std::find_if(model.fixed.begin(), model.fixed.end(), [&](const FixedBody& body) { return body.name == name; });
      return static_cast<std::uint32_t>(model.objects.size() + static_cast<std::size_t>(fixed - model.fixed.begin()));
    };
    const collision::BodyPair wanted{std::min(member(names[0]), member(names[1])), std::max(member(names[0]), member(names[1]))};
    for (int frame = last_ - std::max(1, last_ / 10); frame < last_; ++frame) {
      if (frame < 1) return nullptr;
      const State state = load_frame(folder_, scene_, frame);
      const auto& pairs = state.record.pair_contacts;
      const auto at = std::find_if(pairs.begin(), pairs.end(), [&](const RunRecord::PairContact& p) { return p.objects == wanted; });
      if (at == pairs.end() || !(std::abs(at->depth - depth) <= 0.01 * depth)) return nullptr;
    }
    return depth;
  }

  /// Values of a column at all frames, one each.
  std::vector<double> series(const Measure& measure) {
    std::vector<double> values;
    const std::vector<FrameColumns>& frames = table(measure.frames);
    for (const FrameColumns& frame : frames) values.push_back(value_at(frame, measure));
    return values;
  }
  [[nodiscard]] double frame_rate() const { return scene_.frame_rate; }

 private:
  Simulation& simulation() {
    if (!simulation_) simulation_ = std::make_unique<Simulation>(scene_, SimulationOptions{.questions = true});
    return *simulation_;
  }

  const std::vector<FrameColumns>& table(FrameTableName name) {
    const auto known = tables_.find(name);
    if (known != tables_.end()) return known->second;
    std::vector<FrameColumns> frames;
    for (int frame = 1; frame <= last_; ++frame) {
      simulation().restore(load_frame(folder_, scene_, frame));
      frames.push_back(frame_columns(name, simulation()));
    }
    return tables_[name] = std::move(frames);
  }

  static bool counts(const std::array<std::string, 2>& members, const Measure& measure) {
    if (!measure.of.empty()) return members[0] == measure.of;
    if (measure.pair.empty()) return true;
    return (members[0] == measure.pair[0] && members[1] == measure.pair[1]) || (members[0] == measure.pair[1] && members[1] == measure.pair[0]);
  }

  static double value_at(const FrameColumns& frame, const Measure& measure) {
    const auto column = static_cast<std::size_t>(std::find(frame.name.begin(), frame.name.end(), measure.column) - frame.name.begin());
    const AcrossName usual = measure.frames == FrameTableName::Contacts ? AcrossName::Sum : AcrossName::Mean;
    const AcrossName across = measure.across == AcrossName::Auto ? usual : measure.across;
    double sum = 0.0, least = kNoValue, most = kNoValue;
    int rows = 0;
    for (std::size_t i = 0; i < frame.members.size(); ++i) {
      if (!counts(frame.members[i], measure)) continue;
      const double value = frame.value.at(column)[i];
      sum += value;
      least = std::fmin(least, value);
      most = std::fmax(most, value);
      ++rows;
    }
    switch (across) {
      case AcrossName::Sum: return sum;
      case AcrossName::Mean: return rows > 0 ? sum / rows : kNoValue;
      case AcrossName::Min: return least;
      case AcrossName::Max:
      case AcrossName::Auto: break;
    }
    return most;
  }

  fs::path folder_;
  Scene scene_;
  int last_ = 0;
  std::unique_ptr<Simulation> simulation_;
  std::map<FrameTableName, std::vector<FrameColumns>> tables_;
};

/// @param values  at all frames; NaN where a frame has none
double reduced(const std::vector<double>& values, ReduceName reduce, double frame_rate) {
  if (reduce == ReduceName::Final) return values.empty() ? kNoValue : values.back();
  double sum = 0.0, integral = 0.0, least = kNoValue, most = kNoValue, when = kNoValue;
  int count = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) continue;
    if (!(values[i] <= most)) when = static_cast<double>(i) / frame_rate;
    least = std::fmin(least, values[i]);
    most = std::fmax(most, values[i]);
    sum += values[i];
    ++count;
    if (i > 0 && !std::isnan(values[i - 1])) integral += 0.5 * (values[i - 1] + values[i]) / frame_rate;
  }
  switch (reduce) {
    case ReduceName::Min: return least;
    case ReduceName::Max: return most;
    case ReduceName::Mean: return count > 0 ? sum / count : kNoValue;
    case ReduceName::PeakTime: return when;
    case ReduceName::Integral: return count > 0 ? integral : kNoValue;
    case ReduceName::Final: break;
  }
  return kNoValue;
}

ordered_json value_of(const Measure& measure, FinishedRun& run) {
  if (measure.kind == Measure::Kind::Result) {
    const Found found = find_value(run.report, measure.result);
    return found.value == nullptr || found.value->is_structured() ? ordered_json(nullptr) : *found.value;
  }
  if (measure.kind == Measure::Kind::Frames) {
    const double value = reduced(run.series(measure), measure.reduce, run.frame_rate());
    return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
  }
  if (measure.take == TakeName::DepthAtRest) return run.depth_at_rest(measure.pair);
  const ordered_json* pair = pair_of(run.report, measure.pair);
  if (pair == nullptr) return untouched(measure.take);
  const ordered_json& value = pair->at(key_of(measure.take));
  return value.is_array() ? ordered_json(Vec3(value[0], value[1], value[2]).norm()) : value;
}

/// Without measures: how the run went, and the contact of every pair.
ordered_json usual_values(const ordered_json& report) {
  ordered_json values = ordered_json::object();
  values["frames"] = report.at("frames");
  values["state_hash"] = report.at("state_hash");
  values["energy_error"] = report.at("audits").at("energy_error");
  for (const ordered_json& pair : report.at("pairs")) {
    const std::string name = pair.at("a").get<std::string>() + '-' + pair.at("b").get<std::string>() + '.';
    for (const char* key : {"touches", "contact_time_s", "peak_force_n", "largest_depth_m", "restitution"}) values[name + key] = pair.at(key);
  }
  return values;
}

}  // namespace

std::vector<Measure> read_measures(const std::string& text, const std::string& name) {
  MeasureFile file(text, name);
  file.faults.raise();
  return std::move(file.measures);
}

void check_measures(const SweepPlan& plan) {
  if (plan.measures_name.empty()) return;
  MeasureFile file(plan.measures, plan.measures_name);
  file.faults.raise();
  const Scene scene = read_scene(plan.scene, plan.points.front().set, plan.allowed);
  Simulation simulation(scene, {.questions = true});
  RunResult start;
  start.outcome = "done";
  const ordered_json report = report_of(scene, start, &simulation, {});
  for (const Measure& measure : file.measures) {
    check_members(file, simulation, measure);
    if (measure.kind == Measure::Kind::Frames) check_column(file, simulation, measure);
    if (measure.kind == Measure::Kind::Result) check_path(file, report, measure);
  }
  file.faults.raise();
}

ordered_json measure_run(const SweepPlan& plan, const SweepPoint& point, const fs::path& folder) {
  FinishedRun run(plan, point, folder);
  if (plan.measures_name.empty()) return usual_values(run.report);
  ordered_json values = ordered_json::object();
  for (const Measure& measure : read_measures(plan.measures, plan.measures_name)) values[measure.name] = value_of(measure, run);
  return values;
}

}  // namespace supple::scenes
