/// @file contact_calibration.cpp
/// Calibration of contact error estimates: over random poses of each case and each given error, the share of answers whose true error exceeds their
/// estimate, the largest ratio of the two, estimates above the given error, and contacts that are missed. References are closed forms, or the same
/// bodies in another frame at a finer error; a pose whose reference is no better than a tenth of the estimate in question does not count. One JSON object per line.
/// Asked of every case at 1e-2 to 1e-6: at most 1 in 1,000 exceeds its estimate, none by more than three times, none is missed.
///   contact_calibration [POSES] [CASE|all] [SEED]
#include <array>
#include <cstdio>
#include <string>
#include <string_view>

#include "contact_cases.h"
#include "programs.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;
using Summary = collision::ContactSurface::Summary;

constexpr std::array<double, 5> kErrors{1e-2, 1e-3, 1e-4, 1e-5, 1e-6};
constexpr double kOfReference = 1e-8;  // error

/// The contact of a pair of bodies; nothing where they are apart.
class Query {
 public:
  const Summary* ask(std::span<const collision::ContactBody> bodies, double error) {
    find_contacts(bodies, collision::broad_phase(bodies, {}, executor_), executor_, candidates_);
    solve_contact_surface(bodies, candidates_, {.error = error, .energy = false}, executor_, surface_);
    return surface_.summary.empty() ? nullptr : &surface_.summary.front();
  }

 private:
  Executor executor_{1};
  collision::ContactCandidates candidates_;
  collision::ContactSurface surface_;
};

struct Count {
  int answers = 0, unknown = 0, exceeded = 0, unmet = 0, missed = 0, worst_pose = -1;
  double worst = 0.0;  // true error over estimate
};

/// @param floor  what the reference may be off by
void judge(const Summary* s, const Answer& exact, double floor, double error, int pose, Count& count) {
  constexpr double kFiner = 0.1;
  if (s == nullptr || s->points == 0) {
    ++count.missed;
    return;
  }
  if (s->error_estimate > 1.01 * error) ++count.unmet;
  if (floor > kFiner * s->error_estimate) {
    ++count.unknown;
    return;
  }
  ++count.answers;
  const double ratio = difference(*s, exact) / (s->error_estimate + floor);
  if (ratio > 1.0) ++count.exceeded;
  if (ratio <= count.worst) return;
  count.worst = ratio;
  count.worst_pose = pose;
}

template <class MakePose>
void calibrate(std::string_view name, int poses, std::uint64_t seed, const MakePose& make_pose) {
  std::array<Count, kErrors.size()> counts;
  Draw draw(seed);
  Query reference, query;
  for (int pose = 0; pose < poses; ++pose) {
    const Pair pair = make_pose(draw);
    Answer exact = pair.exact;
    double floor = 0.0;
    if (!pair.known) {
      const Summary* const s = reference.ask(seen_otherwise(pair.bodies), kOfReference);
      if (s == nullptr || s->points == 0) continue;  // apart
      exact = {s->force.norm(), s->area, s->centre_of_pressure};
      floor = s->error_estimate;
    }
    for (std::size_t k = 0; k < kErrors.size(); ++k) judge(query.ask(pair.bodies, kErrors[k]), exact, floor, kErrors[k], pose, counts[k]);
  }
  for (std::size_t k = 0; k < kErrors.size(); ++k) {
    const Count& c = counts[k];
    std::printf("{\"name\": \"collision/calibration/%s/error=%g\", \"answers\": %d, \"reference_too_coarse\": %d, \"exceeded\": %d, \"exceeded_share\": %.2g, "
                "\"largest_ratio\": %.3g, \"worst_pose\": %d, \"unmet\": %d, \"missed\": %d}\n",
                std::string(name).c_str(), kErrors[k], c.answers, c.unknown, c.exceeded, c.answers > 0 ? static_cast<double>(c.exceeded) / c.answers : 0.0,
                c.worst, c.worst_pose, c.unmet, c.missed);
  }
  std::fflush(stdout);
}

}  // namespace

int supple::benchmarks::programs::contact_calibration(int argc, char** argv) {
  constexpr std::string_view kUsage = "contact_calibration [POSES] [CASE|all] [SEED]";
  answer_usage(argc, argv, kUsage, 3);
  const int poses = argc > 1 ? whole_number(kUsage, argv[1]) : 1000;
  const std::string_view only = argc > 2 ? argv[2] : "all";
  expect_word(kUsage, only, case_names());
  const std::uint64_t seed = argc > 3 ? whole_number<std::uint64_t>(kUsage, argv[3], 0) : 46;
  for_cases({}, [only](std::string_view name) { return names(only, name); },
            [&](std::string_view name, const auto& make_pose) { calibrate(name, poses, seed, make_pose); });
  return 0;
}
