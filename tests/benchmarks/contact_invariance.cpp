/// @file contact_invariance.cpp
/// Invariance of contact when two bodies are swapped, rotated and moved together, or scaled by 1/1000 or 1000: the largest relative
/// change of force, area and centre of pressure over many random poses, for each case and given error, one JSON object per line.
/// Expected is round-off only, 1e-9.
///   contact_invariance [POSES] [CASE|all] [auto|polar|march|panels] [SEED]
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "contact_views.h"
#include "programs.h"
#include "usage.h"

int supple::benchmarks::programs::contact_invariance(int argc, char** argv) {
  using namespace supple;
  using namespace supple::benchmarks;
  constexpr std::array<double, 4> kErrors{1e-2, 1e-3, 1e-6, 1e-10};
  constexpr std::string_view kUsage = "contact_invariance [POSES] [CASE|all] [auto|polar|march|panels] [SEED]";
  answer_usage(argc, argv, kUsage, 4);
  const int poses = argc > 1 ? whole_number(kUsage, argv[1]) : 1000;
  const std::string_view only = argc > 2 ? argv[2] : "all", rule = argc > 3 ? argv[3] : "auto";
  expect_word(kUsage, only, case_names());
  expect_word(kUsage, rule, kRuleNames);
  const std::uint64_t seed = argc > 4 ? whole_number<std::uint64_t>(kUsage, argv[4], 0) : 2026;
  constexpr double kRoundOff = 1e-9;
  for_cases({}, [only](std::string_view name) { return names(only, name); }, [&](std::string_view name, const auto&) {
    const Answers rest = look({}, name, poses, kErrors, rule_named(rule), seed);
    for (const View& view : other_views()) {
      const Answers answers = look(view, name, poses, kErrors, rule_named(rule), seed);
      for (std::size_t k = 0; k < kErrors.size(); ++k) {
        double worst = 0.0;
        std::size_t asked = 0, changed = 0, worst_pose = 0, other_points = 0;
        for (std::size_t i = k; i < rest.size(); i += kErrors.size()) {
          if (!rest[i] && !answers[i]) continue;
          const double c = change(rest[i], answers[i]);
          ++asked;
          changed += c > kRoundOff ? 1 : 0;
          other_points += !rest[i] || !answers[i] || rest[i]->points != answers[i]->points ? 1 : 0;
          if (!(c > worst)) continue;
          worst = c;
          worst_pose = i / kErrors.size();
        }
        if (asked == 0) continue;
        std::printf("{\"name\": \"collision/invariance/%s/%s/error=%g\", \"poses\": %zu, \"largest_change\": %.2g, \"beyond_1e-9\": %zu, "
                    "\"other_points\": %zu, \"worst_pose\": %zu}\n",
                    std::string(name).c_str(), std::string(view.name).c_str(), kErrors[k], asked, worst, changed, other_points, worst_pose);
      }
      std::fflush(stdout);
    }
  });
  return 0;
}
