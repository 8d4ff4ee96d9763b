/// @file contact_bodies.cpp
/// Contact of bodies of many primitives, one per part, with obstacles and with each other: cost of a query and of the reactions by the number of
/// primitives, and the true error for each given error. One JSON object per line: median and largest over random poses.
///   contact_bodies [POSES] [CASE|all] [auto|polar|march|panels] [SEED] [--reference RULE]
/// The reference is a rule at an error of 1e-7, march unless another one is named.
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "contact_shapes.h"
#include "many_parts.h"
#include "programs.h"
#include "supple/collision/react.h"
#include "supple/implicit/solids.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;

constexpr double kObstacleModulus = 1e6;

/// A jelly of columns x columns x layers points, a little out of their places, with the middle of the lowest layer in the origin.
Parts jelly(int columns, int layers) {
  constexpr double kSpacing = 0.05, kSupport = 0.08;
  implicit::Skeleton skeleton;
  skeleton.part_count = static_cast<std::uint32_t>(columns * columns * layers);
  for (std::uint32_t k = 0; k < skeleton.part_count; ++k) {
    implicit::Primitive& p = skeleton.primitive.emplace_back();
    p.part = k;
    p.kernel = implicit::Kernel::wyvill(kSupport);
  }
  Parts parts(std::move(skeleton), 0.012);
  std::size_t at = 0;
  for (int k = 0; k < layers; ++k) {
    for (int j = 0; j < columns; ++j) {
      for (int i = 0; i < columns; ++i) parts.pose[at++].position = kSpacing * Vec3(i - 0.5 * (columns - 1), j - 0.5 * (columns - 1), k);
    }
  }
  return parts;
}

struct Line {
  std::vector<double> cpu, forces, error, estimate, points, evaluations;
  int missed = 0, over = 0;
};

double middle(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0.0 : values[values.size() / 2];
}
double largest(const std::vector<double>& values) { return values.empty() ? 0.0 : *std::max_element(values.begin(), values.end()); }

struct Query {
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  double cpu_us = 0.0, forces_us = 0.0;

  const collision::ContactSurface::Summary* ask(std::span<const collision::ContactBody> bodies, double error, collision::ContactRule rule, int repeats, bool energy) {
    const Executor executor(1);
    cpu_us = forces_us = std::numeric_limits<double>::infinity();
    find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
    std::vector<collision::PartLoads> loads(bodies.size());
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      loads[i].force.assign(bodies[i].pose.size(), Vec3::Zero());
      loads[i].torque.assign(bodies[i].pose.size(), Vec3::Zero());
    }
    for (int i = 0; i < repeats; ++i) {
      const double start = cpu_microseconds();
      solve_contact_surface(bodies, candidates, {.error = error, .energy = energy, .only = rule}, executor, surface);
      const double solved = cpu_microseconds();
      collision::react({bodies, {}, surface}, executor, {loads});
      cpu_us = std::min(cpu_us, solved - start);
      forces_us = std::min(forces_us, cpu_microseconds() - solved);
    }
    return surface.summary.empty() ? nullptr : &surface.summary.front();
  }
};

template <class MakePose>
void measure(std::string_view name, int poses, collision::ContactRule rule, std::uint64_t seed, collision::ContactRule reference, const MakePose& make_pose) {
  constexpr std::array<double, 4> kErrors{1e-1, 1e-2, 1e-3, 1e-4};
  constexpr double kReference = 1e-7;
  constexpr int kRepeats = 5;
  std::array<Line, kErrors.size()> lines;
  Draw draw(seed);
  for (int pose = 0; pose < poses; ++pose) {
    const std::array<collision::ContactBody, 2> bodies = make_pose(draw);
    Query query;
    const auto* exact = query.ask(bodies, kReference, reference, 1, false);
    const Answer answer = exact == nullptr ? Answer{} : Answer{exact->force.norm(), exact->area, exact->centre_of_pressure};
    const bool touches = exact != nullptr;
    if (!touches) continue;
    const double floor = exact->error_estimate;
    for (std::size_t k = 0; k < kErrors.size(); ++k) {
      Line& line = lines[k];
      const auto* s = query.ask(bodies, kErrors[k], rule, kRepeats, false);
      if (s == nullptr) {
        ++line.missed;
        continue;
      }
      line.cpu.push_back(query.cpu_us);
      line.forces.push_back(query.forces_us);
      line.error.push_back(difference(*s, answer));
      line.estimate.push_back(s->error_estimate);
      line.points.push_back(static_cast<double>(s->points));
      line.evaluations.push_back(static_cast<double>(s->evaluations));
      line.over += line.error.back() > s->error_estimate + floor ? 1 : 0;
    }
  }
  for (std::size_t k = 0; k < kErrors.size(); ++k) {
    const Line& line = lines[k];
    std::printf("{\"name\": \"collision/bodies/%s/error=%g\", \"poses\": %zu, \"cpu_us_median\": %.0f, \"cpu_us_max\": %.0f, \"forces_us_median\": %.0f, "
                "\"points_median\": %.0f, \"points_max\": %.0f, \"evaluations_median\": %.0f, \"evaluations_max\": %.0f, \"error_median\": %.2g, \"error\": %.2g, "
                "\"estimate_median\": %.2g, \"estimate_max\": %.2g, \"missed\": %d, \"estimates_broken\": %d}\n",
                std::string(name).c_str(), kErrors[k], line.cpu.size(), middle(line.cpu), largest(line.cpu), middle(line.forces), middle(line.points), largest(line.points),
                middle(line.evaluations), largest(line.evaluations), middle(line.error), largest(line.error), middle(line.estimate), largest(line.estimate), line.missed,
                line.over);
  }
  std::fflush(stdout);
}

}  // namespace

int supple::benchmarks::programs::contact_bodies(int argc, char** argv) {
  constexpr std::string_view kUsage = "contact_bodies [POSES] [CASE|all] [auto|polar|march|panels] [SEED] [--reference RULE]";
  answer_usage(argc, argv, kUsage, 6, {{"--reference", 1}});
  std::vector<std::string_view> words;
  std::string_view reference_name = "march";
  for (int i = 1; i < argc; ++i) {
    if (std::string_view(argv[i]) == "--reference" && i + 1 < argc) {
      reference_name = argv[++i];
    } else {
      words.push_back(argv[i]);
    }
  }
  const auto word = [&words](std::size_t i, std::string_view otherwise) { return i < words.size() ? words[i] : otherwise; };
  const int poses = whole_number(kUsage, word(0, "20"));
  const std::string_view only = word(1, "all");
  const collision::ContactRule rule = rule_named(word(2, "auto")), reference = rule_named(reference_name);
  const auto seed = whole_number<std::uint64_t>(kUsage, word(3, "2026"), 0);
  expect_word(kUsage, word(2, "auto"), kRuleNames);
  expect_word(kUsage, reference_name, kRuleNames);
  const auto wanted = [only](std::string_view name) { return only == "all" || only == name; };
  const Pose origin;
  const std::vector<Vec3> still(1, Vec3::Zero());
  const auto obstacle = [&](const implicit::FieldView& field) {
    collision::ContactBody b;
    b.field = field;
    b.material.modulus = kObstacleModulus;
    b.pose = {&origin, 1};
    b.velocity = still;
    b.angular_velocity = still;
    b.fixed = true;
    return b;
  };
  const double of_support = implicit::iso_distance(implicit::Kernel::wyvill(1.0), 0.5), radius = 0.08 * of_support;
  /// A jelly put on what has its top at z = 0 near the origin, up to `deep` of a blob's radius, tilted and moved a little.
  const auto laid = [&](Parts& parts, const std::vector<Pose>& rest, Draw& draw, double lift) {
    const Quat turn(Eigen::AngleAxisd(draw.uniform(0.0, 0.03), draw.direction()) * Eigen::AngleAxisd(draw.uniform(0.0, 2.0 * kPi), Vec3::UnitZ()));
    const double depth = draw.logarithmic(0.05, 0.5) * radius;
    const Vec3 aside(draw.uniform(-0.02, 0.02), draw.uniform(-0.02, 0.02), radius - depth + lift);
    for (std::size_t k = 0; k < rest.size(); ++k) {
      parts.pose[k].position = turn * (rest[k].position + 0.003 * draw.direction()) + aside;
      parts.pose[k].orientation = draw.rotation();
    }
    parts.index();
  };
  const auto support = [](std::string_view under) {
    const double aside = under == "edge" ? -0.4 : 0.0;
    return implicit::SolidBox(Pose{Vec3(aside, 0.0, -0.2), Quat::Identity()}, Vec3(0.4, 0.4, 0.2), 0.01, 1.0);
  };
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
  for (const int columns : {2, 4, 8}) {
    const std::string count = std::to_string(columns * columns * 4);
    for (const std::string_view under : {"box", "plane", "edge"}) {
      const std::string name = "jelly_" + count + "_on_" + std::string(under);
      if (!wanted(name)) continue;
      Parts parts = jelly(columns, 4);
      const std::vector<Pose> rest = parts.pose;
      const implicit::SolidBox box = support(under);
      measure(name, poses, rule, seed, reference, [&](Draw& draw) {
        laid(parts, rest, draw, 0.0);
        return std::array<collision::ContactBody, 2>{parts.body(), under == "plane" ? obstacle(plane) : obstacle(box)};
      });
    }
    const std::string name = "jelly_" + count + "_on_jelly";
    if (!wanted(name)) continue;
    Parts upper = jelly(columns, 4), lower = jelly(columns, 4);
    const std::vector<Pose> rest = upper.pose;
    measure(name, poses, rule, seed, reference, [&](Draw& draw) {
      for (std::size_t k = 0; k < rest.size(); ++k) lower.pose[k] = {rest[k].position + Vec3(0.0, 0.0, -0.15 - radius) + 0.003 * draw.direction(), draw.rotation()};
      lower.index();
      laid(upper, rest, draw, 0.0);
      return std::array<collision::ContactBody, 2>{upper.body(), lower.body()};
    });
  }
  for (const auto& [kind, shape] : {std::pair{"limbs", implicit::ShapeKind::Ellipsoid}, {"balls", implicit::ShapeKind::Point}}) {
    for (const std::string_view under : {"box", "plane", "edge"}) {
      const std::string name = std::string(kind) + "_32_on_" + std::string(under);
      if (!wanted(name)) continue;
      Parts parts = limbs(32, shape);
      const std::vector<Pose> rest = parts.pose;
      const implicit::SolidBox box = support(under);
      measure(name, poses, rule, seed, reference, [&](Draw& draw) {
        lay(parts, rest, draw);
        return std::array<collision::ContactBody, 2>{parts.body(), under == "plane" ? obstacle(plane) : obstacle(box)};
      });
    }
  }
  return 0;
}
