/// @file contact_poses.cpp
/// Contact queries in many random poses: sixteen cases (`all`: those that seldom need the rule march), largest and median CPU time and error over the
/// poses, one JSON object per line. A query is broad phase, candidates and contact surface of two bodies, without state from another pose; its time
/// is the least of three rounds over all poses. The time of distributing the forces to the parts of the bodies is given too.
/// Spheres of linear pressure have closed forms: the isobar at pressure p is a circle. The
/// other cases are compared with the finest rule for the same bodies in another frame, which has other nodes; the error of that
/// reference is added to the estimates. Poses whose patch is crossed by a kink of a field are listed separately.
///   contact_poses [POSES] [CASE|all] [auto|polar|march|panels] [SEED] [--all-rays] [--marched] [--depths LEAST LARGEST]
/// --marched: where there is no closed form the reference is the rule march, which has neither rays nor panels.
/// --all-rays: bodies of revolution get all rays, as other bodies do, instead of a single one.
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "contact_cases.h"
#include "programs.h"
#include "supple/collision/react.h"
#include "supple/core/hash.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;

collision::ContactRule only_rule = collision::ContactRule::None;  // None: the cheapest that fits
std::uint64_t seed = 2026;
bool symmetry = true, marched = false;

struct Query {
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  double cpu_us = 0.0;

  void once(std::span<const collision::ContactBody> bodies, double error, collision::ContactRule rule, const Executor& executor) {
    find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
    solve_contact_surface(bodies, candidates, {.error = error, .only = rule, .symmetry = symmetry}, executor, surface);
  }

  /// The least time of `repeats` measurements, or the first of a long query. Reading the clock takes about a microsecond, so short queries are timed
  /// four in a row.
  const collision::ContactSurface::Summary* ask(std::span<const collision::ContactBody> bodies, double error,
                                                int repeats, collision::ContactRule rule = collision::ContactRule::None) {
    constexpr double kShort = 200.0, kLong = 2e4;  // [us]
    const Executor executor(1);
    cpu_us = std::numeric_limits<double>::infinity();
    for (int i = 0; i < repeats && (i == 0 || cpu_us < kLong); ++i) {
      const int in_a_row = cpu_us < kShort ? 4 : 1;
      const double start = cpu_microseconds();
      for (int n = 0; n < in_a_row; ++n) once(bodies, error, rule, executor);
      cpu_us = std::min(cpu_us, (cpu_microseconds() - start) / in_a_row);
    }
    return surface.summary.empty() ? nullptr : &surface.summary.front();
  }

  /// Time of the forces on the parts of both bodies, of the last answer [us].
  [[nodiscard]] double time_forces(std::span<const collision::ContactBody> bodies, int repeats) const {
    const Executor executor(1);
    std::array<collision::PartLoads, 2> loads;
    for (std::size_t i = 0; i < 2; ++i) {
      loads[i].force.assign(bodies[i].pose.size(), Vec3::Zero());
      loads[i].torque.assign(bodies[i].pose.size(), Vec3::Zero());
    }
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < repeats; ++i) {
      constexpr int kInARow = 4;
      const double start = cpu_microseconds();
      for (int n = 0; n < kInARow; ++n) collision::react({bodies, {}, surface}, executor, {loads});
      least = std::min(least, (cpu_microseconds() - start) / kInARow);
    }
    return least;
  }
};

template <class MakePose>
void measure(std::string_view name, int poses, const MakePose& make_pose) {
  constexpr std::array<double, 4> kErrors{1e-2, 1e-3, 1e-6, 1e-10};
  constexpr int kRepeats = 10, kRounds = 3;
  struct Line {
    std::vector<double> cpu, forces, error, ratio;  // ratio: estimate over error, where the reference can tell
    int missed = 0, march = 0, unmet = 0, exceeded = 0;
  };
  std::array<std::array<Line, kErrors.size()>, 2> classes;  // smooth, crossed by kinks
  struct Timed {
    int pose;
    std::size_t error, crossed, place;  // in Line::cpu
  };
  std::vector<Timed> timed;
  Hasher hasher;
  Draw draw(seed);
  for (int pose = 0; pose < poses; ++pose) {
    const Pair pair = make_pose(draw);
    Query query;
    Answer exact = pair.exact;
    double floor = 0.0;  // what the reference itself may be off by
    if (!pair.known) {
      const auto* s = marched ? query.ask(pair.bodies, 1e-10, 1, collision::ContactRule::March) : query.ask(seen_otherwise(pair.bodies), 1e-10, 1);
      if (s == nullptr) continue;  // apart: another pose
      exact = {s->force.norm(), s->area, s->centre_of_pressure};
      floor = s->error_estimate;
    }
    const auto* finest = query.ask(pair.bodies, 1e-10, 1);
    // What no polar rule reaches has kinks that were not counted.
    const bool crossed = finest != nullptr && (finest->kinks > 0 || finest->rule != collision::ContactRule::Polar);
    for (std::size_t k = 0; k < kErrors.size(); ++k) {
      const auto* s = query.ask(pair.bodies, kErrors[k], kRepeats, only_rule);
      if (s == nullptr) {
        ++classes[0][k].missed;
        continue;
      }
      Line& line = classes[crossed ? 1 : 0][k];
      hasher.add(std::span<const Vec3>(&s->force, 1));
      const double error = difference(*s, exact);
      timed.push_back({pose, k, crossed ? 1u : 0u, line.cpu.size()});
      line.cpu.push_back(query.cpu_us);
      line.forces.push_back(query.time_forces(pair.bodies, kRepeats));
      line.error.push_back(error);
      line.march += s->rule == collision::ContactRule::March ? 1 : 0;
      line.unmet += s->error_estimate > kErrors[k] ? 1 : 0;
      if (error > 10.0 * floor) line.ratio.push_back(s->error_estimate / error);
      line.exceeded += error > s->error_estimate + floor ? 1 : 0;
    }
  }
  // What slows the machine down for a while would be the worst of a thousand poses: short queries are timed again when it is over.
  constexpr double kShort = 1000.0;  // [us]
  for (int round = 1; round < kRounds; ++round) {
    Draw again(seed);
    auto next = timed.begin();
    for (int pose = 0; pose < poses; ++pose) {
      const Pair pair = make_pose(again);
      for (; next != timed.end() && next->pose == pose; ++next) {
        double& least = classes[next->crossed][next->error].cpu[next->place];
        if (least > kShort) continue;
        Query query;
        (void)query.ask(pair.bodies, kErrors[next->error], kRepeats, only_rule);
        least = std::min(least, query.cpu_us);
      }
    }
  }
  for (std::size_t i = 0; i < 2 * kErrors.size(); ++i) {
    const std::size_t k = i / 2;
    Line& line = classes[i % 2][k];
    std::sort(line.cpu.begin(), line.cpu.end());
    std::sort(line.forces.begin(), line.forces.end());
    std::sort(line.error.begin(), line.error.end());
    std::sort(line.ratio.begin(), line.ratio.end());
    const std::size_t n = line.cpu.size(), r = line.ratio.size();
    if (n == 0) continue;
    std::printf("{\"name\": \"collision/poses/%s%s/error=%g\", \"poses\": %zu, \"cpu_us_median\": %.1f, \"cpu_us_max\": %.1f, \"forces_us_median\": %.1f, "
                "\"error\": %.2g, \"error_median\": %.2g, \"error_kind\": \"%s\", \"marched\": %d, \"missed\": %d, "
                "\"estimates_over\": %d, \"estimates_exceeded\": %d, \"estimate_over_error\": %.3g, \"least_estimate_over_error\": %.3g, \"hash\": \"%s\"}\n",
                std::string(name).c_str(), i % 2 == 0 ? "" : "/kinks", kErrors[k], n, line.cpu[n / 2], line.cpu.back(), line.forces[n / 2],
                line.error.back(), line.error[n / 2], "largest of force, area, centre", line.march, line.missed,
                line.unmet, line.exceeded, r == 0 ? 0.0 : line.ratio[r / 2], r == 0 ? 0.0 : line.ratio.front(), to_hex(hasher.value()).c_str());
  }
  std::fflush(stdout);
}

}  // namespace

int supple::benchmarks::programs::contact_poses(int argc, char** argv) {
  constexpr std::string_view kUsage = "contact_poses [POSES] [CASE|all] [auto|polar|march|panels] [SEED] [--all-rays] [--marched] [--depths LEAST LARGEST]";
  answer_usage(argc, argv, kUsage, 9, {{"--all-rays"}, {"--marched"}, {"--depths", 2}});
  std::vector<std::string_view> words;
  std::optional<std::array<double, 2>> depths;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--all-rays") {
      symmetry = false;
    } else if (word == "--marched") {
      marched = true;
    } else if (word == "--depths") {
      depths = {positive_number(kUsage, argv[i + 1]), positive_number(kUsage, argv[i + 2])};
      i += 2;
    } else {
      words.push_back(word);
    }
  }
  const auto word = [&words](std::size_t i, std::string_view otherwise) { return i < words.size() ? words[i] : otherwise; };
  const int poses = whole_number(kUsage, word(0, "1000"));
  const std::string_view only = word(1, "all"), rule = word(2, "auto");
  expect_word(kUsage, only, case_names());
  expect_word(kUsage, rule, kRuleNames);
  only_rule = rule_named(rule);
  seed = whole_number<std::uint64_t>(kUsage, word(3, "2026"), 0);
  const auto wanted = [only](std::string_view name) { return names(only, name); };
  for_cases({}, wanted, [poses](std::string_view name, const auto& make_pose) { measure(name, poses, make_pose); }, depths);
  return 0;
}
