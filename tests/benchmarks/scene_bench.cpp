/// @file scene_bench.cpp
/// Whole scenes at one accuracy, one JSON object a line: CPU time of a simulated second, its shares by stage, and what positions are off by, over the size of
/// their objects. The reference has steps 16 times as short and a 16th of the error of contact. Errors are told up to the first frame at which a second
/// reference, with factors of 8, is away from it by more than a tenth of the accuracy: what follows is chaos.
///   scene_bench [NAME ...] [--accuracy A ...] [--set path.to.key=value ...] [--skips]
/// All scenes where none is named; --accuracy 0.01 by default; of several, all are compared with the references of the finest. Keys are set in runs and
/// references alike. Scenes are simulated for as long as keeps each one to minutes. With --skips there is no reference: CPU times with all skips and
/// without any, and whether the states are equal to the bit; the exit code is 1 where they are not.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "programs.h"
#include "supple/core/cpu_time.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/scenes/accuracy.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::scenes;
namespace fs = std::filesystem;

struct Case {
  std::string_view name;
  std::string_view file;  ///< of the library; without a folder: of the benchmarks
  double seconds;         ///< simulated of it
};

constexpr Case kCases[] = {
    {"jelly", "jelly_stairs.yaml", 2.0},
    {"letter", "letter_s.yaml", 1.0},
    {"chain", "chain_hit.yaml", 1.0},
    {"ball_hits_spiral", "figures/ball_hits_spiral.yaml", 2.0},
    {"spiral_uncoils", "figures/spiral_uncoils.yaml", 4.0},
    {"pile_rests", "contacts/pile_rests.yaml", 0.5},
    {"hand_closes", "objects/hand_closes.yaml", 0.25},
    {"shell_dents", "objects/shell_dents.yaml", 1.0},
    {"plate_breaks", "objects/plate_breaks.yaml", 1.0},
    {"slide", "contacts/slide_on_incline.yaml", 1.0},
    {"cradle", "contacts/newtons_cradle.yaml", 2.0},
    {"ball_in_ring", "contacts/ball_in_ring.yaml", 0.4},
};

struct Settings {
  std::vector<double> accuracy;  ///< coarsest first
  std::vector<std::string> overrides;
  bool skips = false;            ///< measure what these save
};

/// One run.
struct Motion {
  std::vector<std::vector<Vec3>> positions;  ///< by frame
  std::vector<Vec3> impulse;                 ///< from outside, by frame [N s]
  double cpu_s = 0.0;
  double contact_share = 0.0;                ///< of CPU time, that finding and solving contacts takes
  std::uint64_t steps = 0;
  double seconds = 0.0;
  std::string method;
  std::string hash;                          ///< of the last state
};

/// From the place of the program: installed, in the Python package, or in the source tree. @throws Error{Io} where it is in none
fs::path source_file(const Case& c) {
  const fs::path program = fs::read_symlink("/proc/self/exe"), above = program.parent_path().parent_path(), root = above.parent_path();
  const bool own = !fs::path(c.file).has_parent_path();
  const fs::path shipped = own ? "scenes/benchmarks" : "scenes/library";
  for (const fs::path& folder : {root / "share/supple" / shipped, above / shipped, root.parent_path() / (own ? "tests/benchmarks/scenes" : shipped)}) {
    if (fs::exists(folder / c.file)) return folder / c.file;
  }
  throw Error(ErrorKind::Io, Fault{.place = program.string(),
                                   .key = {},
                                   .expected = "expected " + (shipped / c.file).string() + " in share/supple of the installation, or in the source tree of the build",
                                   .found = "none",
                                   .hint = {}});
}

Scene scene_of(const Case& c, const Settings& settings, double accuracy) {
  std::vector<std::string> set{"accuracy=" + std::to_string(accuracy)};
  set.insert(set.end(), settings.overrides.begin(), settings.overrides.end());
  Scene scene = read_scene(source_file(c), set);
  scene.output = {};
  return scene;
}

/// @param finer  halvings of every step; the error of contact is divided by as much
Motion run(const Case& c, const Settings& settings, double accuracy, int finer, bool skip = true) {
  Scene scene = scene_of(c, settings, accuracy);
  scene.contact.error = std::max(1e-10, std::ldexp(contact_error(scene), -finer));
  scene.time_step.max_substeps = 1048576;
  const int frames = std::min(scene.frame_count(), 1 + static_cast<int>(std::lround(c.seconds * scene.frame_rate)));
  Simulation simulation(std::move(scene), {.threads = 1, .skip = skip, .profile = false, .finer = finer});
  Motion motion;
  motion.method = simulation.integrator().reason;
  motion.positions.push_back(simulation.state().particles.position);
  motion.impulse.push_back(simulation.state().ledger.external_impulse);
  const double begin = process_cpu_seconds();
  while (simulation.frame() < frames) {
    simulation.step_frame();
    motion.positions.push_back(simulation.state().particles.position);
    motion.impulse.push_back(simulation.state().ledger.external_impulse);
  }
  motion.cpu_s = process_cpu_seconds() - begin;
  motion.steps = simulation.state().steps;
  motion.seconds = simulation.time();
  motion.hash = to_hex(simulation.state_hash());
  const Profile profile = simulation.profile();
  double contact = 0.0, all = 0.0;
  for (const StageInfo& stage : stage_table()) {
    const double cpu = profile[static_cast<std::size_t>(stage.stage)].cpu_s;
    all += cpu;
    const bool of_contact = stage.stage >= Stage::PlaceSkeleton && stage.stage <= Stage::React;
    if (of_contact) contact += cpu;
  }
  motion.contact_share = all > 0.0 ? contact / all : 0.0;
  return motion;
}

struct Difference {
  double largest = 0.0, square = 0.0;  ///< over sizes, of one frame [1], [1]
};

Difference difference(const Model& model, const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  Difference out;
  for (const ObjectModel& object : model.objects) {
    for (std::uint32_t i = object.first; i < object.last; ++i) {
      const double apart = (a[i] - b[i]).norm() / size_of(object);
      out.largest = std::max(out.largest, apart);
      out.square += apart * apart / static_cast<double>(a.size());
    }
  }
  return out;
}

/// Motions of 16 and of 8 times finer stages.
struct References {
  Motion finest, second;
};

/// One line: a run against the references, up to where these part.
void report(const Case& c, const Settings& settings, const Model& model, double accuracy, const References& references) {
  const Motion motion = run(c, settings, accuracy, 0);
  const Motion& reference = references.finest;
  double largest = 0.0, square = 0.0;
  std::size_t compared = 0;
  for (std::size_t f = 0; f < motion.positions.size(); ++f) {
    if (difference(model, references.second.positions[f], reference.positions[f]).largest > 0.1 * accuracy) break;
    const Difference d = difference(model, motion.positions[f], reference.positions[f]);
    largest = std::max(largest, d.largest);
    square += d.square;
    compared = f + 1;
  }
  const std::size_t last = std::max<std::size_t>(compared, 1) - 1;
  double scale = 0.0;
  for (const Vec3& impulse : reference.impulse) scale = std::max(scale, impulse.norm());
  double weight = 0.0;  // what an impulse is compared with at least [N s]: a millionth of all masses at a speed of 1 m/s
  for (const double mass : model.particles.mass) weight += mass;
  scale = std::max(scale, 1e-6 * weight);
  const double impulse = scale > 0.0 ? (motion.impulse[last] - reference.impulse[last]).norm() / scale : 0.0;
  std::printf("{\"scene\": \"%.*s\", \"accuracy\": %g, \"cpu_s_per_s\": %.4g, \"steps\": %llu, \"largest_error\": %.3g, \"rms_error\": %.3g, "
              "\"impulse_error\": %.3g, \"compared_s\": %.4g, \"of_s\": %.4g, \"contact_share\": %.3g, \"method\": \"%s\"}\n",
              static_cast<int>(c.name.size()), c.name.data(), accuracy, motion.cpu_s / motion.seconds, static_cast<unsigned long long>(motion.steps),
              largest, std::sqrt(square / static_cast<double>(std::max<std::size_t>(compared, 1))), impulse,
              static_cast<double>(last) * motion.seconds / static_cast<double>(motion.positions.size() - 1), motion.seconds, motion.contact_share,
              motion.method.c_str());
  std::fflush(stdout);
}

/// One line for each accuracy; whether all states are equal.
bool compare_skips(const Case& c, const Settings& settings) {
  bool same = true;
  for (const double accuracy : settings.accuracy) {
    const Motion with = run(c, settings, accuracy, 0), without = run(c, settings, accuracy, 0, false);
    same = same && with.hash == without.hash;
    std::printf("{\"scene\": \"%.*s\", \"accuracy\": %g, \"cpu_s_per_s\": %.4g, \"cpu_s_per_s_without_skips\": %.4g, \"states_equal\": %s, \"hash\": \"%s\"}\n",
                static_cast<int>(c.name.size()), c.name.data(), accuracy, with.cpu_s / with.seconds, without.cpu_s / without.seconds,
                with.hash == without.hash ? "true" : "false", with.hash.c_str());
    std::fflush(stdout);
  }
  return same;
}

void bench(const Case& c, const Settings& settings) {
  const double finest = settings.accuracy.back();
  const Model model = build_model(scene_of(c, settings, finest));
  const References references{run(c, settings, finest, 4), run(c, settings, finest, 3)};
  for (const double accuracy : settings.accuracy) report(c, settings, model, accuracy, references);
}

}  // namespace

int supple::benchmarks::programs::scene_bench(int argc, char** argv) try {
  constexpr std::string_view kUsage = "scene_bench [NAME ...] [--accuracy A ...] [--set path.to.key=value ...] [--skips]    all scenes where none is named";
  supple::benchmarks::answer_usage(argc, argv, kUsage, std::numeric_limits<std::size_t>::max(), {{"--accuracy", 1}, {"--set", 1}, {"--skips"}});
  Settings settings;
  std::vector<std::string_view> names;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if ((word == "--accuracy" || word == "--set") && i + 1 < argc) {
      const char* value = argv[++i];
      if (word == "--set") settings.overrides.emplace_back(value);
      if (word == "--accuracy") settings.accuracy.push_back(supple::benchmarks::positive_number(kUsage, value));
    } else if (word == "--skips") {
      settings.skips = true;
    } else {
      names.push_back(word);
    }
  }
  if (settings.accuracy.empty()) settings.accuracy.push_back(kDefaultAccuracy);
  std::sort(settings.accuracy.begin(), settings.accuracy.end(), std::greater<>());
  for (const std::string_view name : names) {
    if (std::any_of(std::begin(kCases), std::end(kCases), [&](const Case& c) { return c.name == name; })) continue;
    std::string known;
    for (const Case& c : kCases) known.append(known.empty() ? "" : ", ").append(c.name);
    std::fprintf(stderr, "scene_bench: expected one of %s, found '%.*s'\n", known.c_str(), static_cast<int>(name.size()), name.data());
    return 2;
  }
  bool good = true;
  for (const Case& c : kCases) {
    if (!names.empty() && std::find(names.begin(), names.end(), c.name) == names.end()) continue;
    try {
      if (settings.skips) {
        good = compare_skips(c, settings) && good;
      } else {
        bench(c, settings);
      }
    } catch (const Error& error) {
      std::printf("{\"scene\": \"%.*s\", \"failed\": \"%s\"}\n", static_cast<int>(c.name.size()), c.name.data(), error.what());
      good = false;
    }
  }
  return good ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "scene_bench: %s\n", error.what());
  return 1;
}
