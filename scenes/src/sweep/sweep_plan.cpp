#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>

#include <nlohmann/json.hpp>

#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/sweep.h"
#include "sweep/measures.h"
#include "sweep/sweep_values.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kPlanFile = "sweep.json";
constexpr int kPlanVersion = 1;
constexpr std::size_t kLargestPlan = std::size_t{1} << 30;  // [byte]

[[noreturn]] void refuse_use(std::string place, std::string expected, std::string found, std::string hint) {
  throw Error(ErrorKind::Usage, Fault{.place = std::move(place), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
}

/// Uniform in [0, 1), by seed, parameter and draw alone.
double share_of(std::uint64_t seed, std::uint64_t parameter, std::uint64_t draw) {
  Hasher hasher;
  hasher.add(seed);
  hasher.add(parameter);
  hasher.add(draw);
  return static_cast<double>(hasher.value() >> 11) * 0x1p-53;
}

struct Sampling {
  bool latin = false;
  std::size_t count = 0;
};

Sampling read_sampling(const std::string& text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::string way = text.substr(0, colon), rest = text.substr(std::min(colon + 1, text.size()));
  Sampling sampling{.latin = way == "lhs"};
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), sampling.count);
  const bool number = error == std::errc() && end == rest.data() + rest.size() && sampling.count >= 1 && sampling.count <= kMostSweepPoints;
  if ((way != "random" && way != "lhs") || !number) {
    refuse_use("--sample", "expected random:N or lhs:N with N from 1 to " + std::to_string(kMostSweepPoints), '\'' + text + '\'', "lhs is a Latin hypercube: each key's range is used evenly");
  }
  return sampling;
}

/// Shares of a key for all samples. Of a Latin hypercube one lies in each of `count` equal parts, in an order by chance.
std::vector<double> shares_of(const Sampling& sampling, std::uint64_t seed, std::uint64_t parameter) {
  std::vector<double> shares(sampling.count);
  for (std::size_t i = 0; i < shares.size(); ++i) shares[i] = share_of(seed, parameter, i);
  if (!sampling.latin) return shares;
  const auto n = static_cast<double>(sampling.count);
  for (std::size_t i = 0; i < shares.size(); ++i) shares[i] = (static_cast<double>(i) + shares[i]) / n;
  for (std::size_t i = shares.size() - 1; i > 0; --i) {
    const auto other = static_cast<std::size_t>(share_of(seed, parameter, sampling.count + i) * static_cast<double>(i + 1));
    std::swap(shares[i], shares[other]);
  }
  return shares;
}

std::string folder_name(int number) {
  char text[32];
  std::snprintf(text, sizeof text, "point_%04d", number);
  return text;
}

SweepPoint point_of(std::size_t index) {
  const int number = static_cast<int>(index) + 1;
  return {.number = number, .folder = folder_name(number), .set = {}};
}

/// All combinations, the last key fastest.
std::vector<SweepPoint> grid_of(const std::vector<SweepValues>& all) {
  std::size_t count = 1;
  for (const SweepValues& values : all) {
    if (values.kind == SweepValues::Kind::Range) {
      refuse_use("--set " + values.key, "expected a number of values, as in a:b:N or a:b:logN", "a range", "--sample random:N or --sample lhs:N draws values from ranges");
    }
    count *= values.list.size();
    if (count > kMostSweepPoints) refuse_use("--set", "expected at most " + std::to_string(kMostSweepPoints) + " points", "more", "draw some of them: --sample lhs:N with ranges a:b");
  }
  std::vector<SweepPoint> points;
  for (std::size_t i = 0; i < count; ++i) {
    SweepPoint point = point_of(i);
    std::size_t block = count, rest = i;
    for (const SweepValues& values : all) {
      block /= values.list.size();
      point.set.push_back(values.key + '=' + values.list[rest / block]);
      rest %= block;
    }
    points.push_back(std::move(point));
  }
  return points;
}

std::vector<SweepPoint> samples_of(const std::vector<SweepValues>& all, const Sampling& sampling, std::uint64_t seed) {
  std::vector<SweepPoint> points;
  for (std::size_t i = 0; i < sampling.count; ++i) points.push_back(point_of(i));
  for (std::size_t k = 0; k < all.size(); ++k) {
    const SweepValues& values = all[k];
    if (values.stepped) {
      refuse_use("--set " + values.key, "expected a range a:b or a:b:log, or a list, for samples", "a number of values", "leave out the number, or --sample for the grid of all values");
    }
    const std::vector<double> shares = shares_of(sampling, seed, k);
    for (std::size_t i = 0; i < points.size(); ++i) {
      points[i].set.push_back(values.key + '=' + (values.kind == SweepValues::Kind::Fixed ? values.list.front() : values.at(shares[i])));
    }
  }
  return points;
}

/// Reads the scene with every value of every key once, the other keys as at the first point, so that no run is begun with a key that there is not.
/// @throws Error as read_scene
void check_values(const SweepPlan& plan) {
  std::set<std::vector<std::string>> tried;
  const std::vector<std::string>& first = plan.points.front().set;
  const auto try_one = [&](const std::vector<std::string>& set) {
    if (tried.insert(set).second) (void)read_scene(plan.scene, set, plan.allowed);
  };
  for (std::size_t k = 0; k < first.size(); ++k) {
    for (const SweepPoint& point : plan.points) {
      std::vector<std::string> set = first;
      set[k] = point.set[k];
      try_one(set);
    }
  }
}

std::string text_of_file(const fs::path& path) {
  const std::vector<std::byte> bytes = io::read_file(path, io::kLargestInput);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string plan_text(const SweepPlan& plan) {
  ordered_json json;
  json["sweep"] = kPlanVersion;
  json["scene_file"] = plan.scene.string();
  json["allow_path"] = ordered_json::array();
  for (const fs::path& path : plan.allowed) json["allow_path"].push_back(path.string());
  json["parameters"] = plan.parameters;
  json["asked"] = plan.asked;
  json["sample"] = plan.sample;
  json["seed"] = plan.seed;
  json["outputs"] = plan.outputs;
  json["measures_file"] = plan.measures_name;
  json["measures"] = plan.measures;
  json["points"] = ordered_json::array();
  for (const SweepPoint& point : plan.points) json["points"].push_back({{"number", point.number}, {"folder", point.folder}, {"set", point.set}});
  return json.dump(1, ' ', false, ordered_json::error_handler_t::replace) + '\n';
}

SweepPlan plan_of(const ordered_json& json) {
  SweepPlan plan;
  plan.scene = json.at("scene_file").get<std::string>();
  for (const auto& path : json.at("allow_path")) plan.allowed.emplace_back(path.get<std::string>());
  plan.parameters = json.at("parameters").get<std::vector<std::string>>();
  plan.asked = json.at("asked").get<std::vector<std::string>>();
  plan.sample = json.at("sample").get<std::string>();
  plan.seed = json.at("seed").get<std::uint64_t>();
  plan.outputs = json.at("outputs").get<bool>();
  plan.measures_name = json.at("measures_file").get<std::string>();
  plan.measures = json.at("measures").get<std::string>();
  for (const auto& point : json.at("points")) {
    plan.points.push_back({point.at("number").get<int>(), point.at("folder").get<std::string>(), point.at("set").get<std::vector<std::string>>()});
  }
  return plan;
}

}  // namespace

SweepPlan plan_sweep(const SweepRequest& request) {
  SweepPlan plan;
  plan.scene = fs::absolute(request.scene).lexically_normal();
  for (const fs::path& path : request.allowed) plan.allowed.push_back(fs::absolute(path).lexically_normal());
  plan.asked = request.set;
  plan.sample = request.sample;
  plan.seed = request.seed;
  plan.outputs = request.outputs;
  std::vector<SweepValues> all;
  std::set<std::string> keys;
  for (const std::string& setting : request.set) {
    all.push_back(read_sweep_values(setting));
    if (!keys.insert(all.back().key).second) refuse_use("--set " + all.back().key, "expected each key once", "it twice", "a list has all values: " + all.back().key + "=[x, y]");
    if (all.back().kind != SweepValues::Kind::Fixed) plan.parameters.push_back(all.back().key);
  }
  if (plan.parameters.empty()) {
    refuse_use("--set", "expected a key with several values", "none", "for example --set objects.ball.contact.modulus=1e3:1e6:log9 or --set objects.ball.contact.friction=[0, 0.3]");
  }
  plan.points = request.sample.empty() ? grid_of(all) : samples_of(all, read_sampling(request.sample), request.seed);
  if (!request.measures.empty()) {
    plan.measures_name = request.measures.string();
    plan.measures = text_of_file(request.measures);
  }
  check_values(plan);
  check_measures(plan);
  return plan;
}

void write_plan(const fs::path& folder, const SweepPlan& plan, bool replace) {
  const std::string text = plan_text(plan);
  const fs::path path = folder / kPlanFile;
  io::make_writable_folder(folder);
  if (fs::exists(path)) {
    if (text_of_file(path) == text) return;
    if (!replace) {
      throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                       .key = {},
                                       .expected = "expected the plan of this sweep",
                                       .found = "another one",
                                       .hint = "choose another --out, or --overwrite to replace it; points of the same scene and values are kept"});
    }
  }
  io::write_atomically(path, std::string_view(text));
}

SweepPlan read_plan(const fs::path& folder) {
  const fs::path path = folder / kPlanFile;
  const auto refuse = [&](std::string found) {
    throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                     .key = {},
                                     .expected = "expected the plan of a sweep",
                                     .found = std::move(found),
                                     .hint = "supple sweep SCENE --set KEY=VALUES --out DIR --plan-only writes it"});
  };
  if (!fs::exists(path)) refuse("no such file");
  const std::vector<std::byte> bytes = io::read_file(path, kLargestPlan);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  try {
    const ordered_json json = ordered_json::parse(text, text + bytes.size());
    if (json.at("sweep").get<int>() != kPlanVersion) refuse("one of another version of supple");
    return plan_of(json);
  } catch (const nlohmann::json::exception&) {
    refuse("another text");
  }
  return {};
}

}  // namespace supple::scenes
