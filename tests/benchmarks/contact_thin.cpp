/// @file contact_thin.cpp
/// Contact queries of bodies that overlap by a thousandth of their rounding radius and less, by decades of that ratio; one JSON object per line. Bodies
/// with flat medial sets on a plane are compared with a closed form that is exact to that ratio; pairs of boxes, capsules and discs with face contact in
/// random poses with a query at a thousandth of the error; and three times as many bodies that lean on one another.
///   contact_thin [POSES] [SEED]
#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>
#include <string>
#include <string_view>

#include "programs.h"
#include "thin_cases.h"
#include "timed_query.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;

constexpr double kRound = 0.1, kE = 1e6;
constexpr std::array<double, 2> kErrors{1e-3, 1e-6};

struct Query : TimedQuery {
  collision::ContactSurface::Summary ask(const std::array<collision::ContactBody, 2>& bodies, double error, int repeats) {
    TimedQuery::ask(bodies, error, repeats);
    return surface.summary.empty() ? collision::ContactSurface::Summary{} : surface.summary.front();
  }
};

void measure_on_plane() {
  const double steep = 3.0 * kE / kRound, stiffness = 1.0 / (kRound / kE + 1.0 / steep);
  const Pose still, turned{Vec3(0.3, 0.2, 0.7), Quat(Eigen::AngleAxisd(0.4, Vec3::UnitZ()))};
  Query query;
  for (const FlatCore& core : kFlatCores) {
    Rigid body(linear_shape(core.shape, core.size, kRound), kLinearModulus * kE, 0.03);
    body.put(turned);
    for (const double error : kErrors) {
      for (int decade = -3; decade >= -11; --decade) {
        const implicit::HalfSpace plane{Vec3(0, 0, turned.position.z() - kRound + std::pow(10.0, decade) * kRound), Vec3::UnitZ(), 1.0};
        const double d = plane.point.z() - (turned.position.z() - kRound);
        const ForceAndArea exact = on_plane(core, kRound, stiffness, d);
        const collision::ContactSurface::Summary s = query.ask({body.body(), single_part(plane, steep, still)}, error, 10);
        std::printf("{\"name\": \"collision/thin/%s/depth=1e%d/error=%g\", \"cpu_us\": %.1f, \"points\": %zu, \"evaluations\": %zu, \"error\": %.2g, "
                    "\"bound\": %.2g}\n",
                    std::string(core.name).c_str(), decade, error, query.cpu_us, std::size_t(s.points), std::size_t(s.evaluations),
                    std::max(std::abs(s.force.norm() / exact.force - 1.0), std::abs(s.area / exact.area - 1.0)), s.error_estimate);
      }
    }
  }
}

void measure_pairs(int poses, std::uint64_t seed) {
  struct Line {
    std::vector<double> cpu;
    double worst_over_bound = 0.0;
    int by_other_rules = 0, unmet = 0, below_error = 0, checked = 0, missed = 0;
  };
  const std::vector<implicit::Skeleton> shapes = flat_shapes();
  std::map<std::pair<int, std::size_t>, Line> lines;  // by decade and error
  Query query;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    for (std::size_t j = i; j < shapes.size(); ++j) {
      Rigid a(shapes[i], 2.0 * kE, 0.03), b(shapes[j], 3.0 * kE, 0.03);
      Draw draw(seed);
      for (int pose = 0; pose < poses; ++pose) {
        const double depth = draw.logarithmic(1e-9, 1e-3);
        press(a, b, depth * kRound, draw);
        for (std::size_t e = 0; e < kErrors.size(); ++e) {
          Line& line = lines[{static_cast<int>(std::floor(std::log10(depth))), e}];
          const std::array<collision::ContactBody, 2> bodies{a.body(), b.body()};
          const collision::ContactSurface::Summary s = query.ask(bodies, kErrors[e], 2);
          line.cpu.push_back(query.cpu_us);
          line.missed += s.points == 0 ? 1 : 0;
          line.by_other_rules += s.rule != collision::ContactRule::Polar ? 1 : 0;
          line.unmet += s.error_estimate > 1.01 * kErrors[e] ? 1 : 0;
          const collision::ContactSurface::Summary fine = query.ask(bodies, 1e-3 * kErrors[e], 1);
          if (!(fine.error_estimate <= 0.1 * s.error_estimate)) continue;  // round-off leaves no better answer
          ++line.checked;
          const double off = std::max((s.force - fine.force).norm() / fine.force.norm(), std::abs(s.area / fine.area - 1.0)) - fine.error_estimate;
          line.worst_over_bound = std::max(line.worst_over_bound, off / s.error_estimate);
          line.below_error += off > s.error_estimate ? 1 : 0;
        }
      }
    }
  }
  for (auto& [key, line] : lines) {
    std::sort(line.cpu.begin(), line.cpu.end());
    std::printf("{\"name\": \"collision/thin/pairs/depth=1e%d/error=%g\", \"queries\": %zu, \"cpu_us_median\": %.1f, \"cpu_us_99_of_100\": %.1f, "
                "\"cpu_us_worst\": %.1f, \"missed\": %d, \"by_other_rules\": %d, \"unmet\": %d, \"checked\": %d, \"bound_below_error\": %d, "
                "\"worst_error_over_bound\": %.2g}\n",
                key.first, kErrors[key.second], line.cpu.size(), line.cpu[line.cpu.size() / 2], line.cpu[line.cpu.size() * 99 / 100], line.cpu.back(),
                line.missed, line.by_other_rules, line.unmet, line.checked, line.below_error, line.worst_over_bound);
  }
}

/// A disc, a capsule and a plate on a box, which lean by up to three times as much as they are pressed in.
void measure_leaning(int poses, std::uint64_t seed) {
  using implicit::ShapeKind;
  const implicit::Skeleton box = linear_shape(ShapeKind::Box, Vec3(0.15, 0.12, 0.08), 0.02);
  struct Upper {
    const char* name;
    ShapeKind shape;
    Vec3 size;
    double round;
  };
  Query query;
  for (const Upper& u : {Upper{"disc", ShapeKind::Disc, Vec3(0.1, 0, 0), 0.04}, Upper{"capsule", ShapeKind::Segment, Vec3(0.08, 0, 0), 0.05},
                         Upper{"plate", ShapeKind::Rectangle, Vec3(0.06, 0.05, 0), 0.02}}) {
    Rigid lower(box, kE, 0.03), upper(linear_shape(u.shape, u.size, u.round), kE, 0.03);
    lower.put({});
    for (const double error : {1e-3, 1e-4, 1e-6}) {
      Draw draw(seed);
      int by_other_rules = 0, below_error = 0, beyond = 0;
      double worst = 0.0, cpu_us = 0.0, evaluations = 0.0;
      for (int pose = 0; pose < poses; ++pose) {
        const double d = draw.logarithmic(1e-8, 1e-4), lean = draw.uniform(0.0, 3.0) * d / 0.1;
        const auto [s, c] = math::sin_cos(draw.uniform(0.0, 2.0 * kPi));
        const Quat tilt(Eigen::AngleAxisd(lean, Vec3(c, s, 0))), turn(Eigen::AngleAxisd(draw.uniform(0.0, kPi), Vec3::UnitZ()));
        upper.put({Vec3(0.01, 0.02, 0.1 + u.round - d), tilt * turn});
        const std::array<collision::ContactBody, 2> bodies{upper.body(), lower.body()};
        const collision::ContactSurface::Summary found = query.ask(bodies, error, 1);
        cpu_us += query.cpu_us / poses;
        evaluations += static_cast<double>(found.evaluations) / poses;
        by_other_rules += found.rule != collision::ContactRule::Polar ? 1 : 0;
        const collision::ContactSurface::Summary fine = query.ask(bodies, 1e-3 * error, 1);
        const double off = std::max((found.force - fine.force).norm() / fine.force.norm(), std::abs(found.area / fine.area - 1.0)) - fine.error_estimate;
        worst = std::max(worst, off / found.error_estimate);
        below_error += off > found.error_estimate ? 1 : 0;
        beyond += off > error ? 1 : 0;
      }
      std::printf("{\"name\": \"collision/thin/leaning/%s/error=%g\", \"queries\": %d, \"cpu_us_mean\": %.1f, \"evaluations_mean\": %.0f, \"by_other_rules\": %d, "
                  "\"bound_below_error\": %d, \"beyond_what_was_asked\": %d, \"worst_error_over_bound\": %.2g}\n",
                  u.name, error, poses, cpu_us, evaluations, by_other_rules, below_error, beyond, worst);
    }
  }
}

}  // namespace

int supple::benchmarks::programs::contact_thin(int argc, char** argv) {
  constexpr std::string_view kUsage = "contact_thin [POSES] [SEED]";
  answer_usage(argc, argv, kUsage, 2);
  const int poses = argc > 1 ? whole_number(kUsage, argv[1]) : 300;
  const std::uint64_t seed = argc > 2 ? whole_number<std::uint64_t>(kUsage, argv[2], 0) : 2026;
  measure_on_plane();
  measure_pairs(poses, seed);
  measure_leaning(3 * poses, seed);
  return 0;
}
