/// @file contact_bench.cpp
/// Time and error of contact queries, one JSON object per line: broad phase, candidates and contact surface with its error
/// estimate, on indexed fields with their samples, without state from another pose. The error of the force against the closed
/// form is given too (for the plane it is limited by the plane's stiffness, 1e9).
///   contact_bench [FILE.svg]
/// With a file name contact_rules runs as well and plots time against error of all rules of the contact surface there.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "programs.h"
#include "supple/collision/contact_surface.h"
#include "supple/core/hash.h"
#include "supple/core/math.h"
#include "supple/implicit/field.h"
#include "usage.h"

namespace {

using namespace supple;

constexpr double kPi = std::numbers::pi;

/// A Wyvill point of support radius R at `centre`, with samples on its surface.
struct Ball {
  implicit::Field field;
  implicit::SurfaceSamples samples;
  Pose pose;
  Vec3 still = Vec3::Zero();

  Ball(const Vec3& centre, double R) {
    pose.position = centre;
    implicit::Skeleton skeleton;
    implicit::Primitive point;
    point.kernel = implicit::Kernel::wyvill(R);
    skeleton.primitive.push_back(point);
    skeleton.part_count = 1;
    implicit::PlacedSkeleton placed;
    implicit::place_skeleton(skeleton, {&pose, 1}, placed);
    implicit::index_field(skeleton, placed, field);
    constexpr int kSamples = 200;
    const double radius = implicit::iso_distance(point.kernel, 0.5);
    for (int i = 0; i < kSamples; ++i) {
      const double z = 1.0 - (2.0 * i + 1.0) / kSamples, r = std::sqrt(1.0 - z * z);
      const auto [s, c] = math::sin_cos(2.399963229728653 * i);
      samples.point.push_back(centre + radius * Vec3(r * c, r * s, z));
      samples.normal.push_back(Vec3(r * c, r * s, z));
      samples.area.push_back(4.0 * kPi * radius * radius / kSamples);
      samples.valid.push_back(1);
    }
  }
  [[nodiscard]] collision::ContactBody body() const {
    collision::ContactBody b;
    b.field = field;
    b.material.modulus = 1.0;
    b.pose = {&pose, 1};
    b.velocity = {&still, 1};
    b.angular_velocity = {&still, 1};
    b.samples = &samples;
    return b;
  }
};

/// F = pi R^2 [((1 - q0)^4 - c^(4/3)) / 4 - c (q_i - q0)] of a Wyvill point at height h over a plane.
double wyvill_force(double R, double h) {
  const double c = 0.5, q0 = h * h / (R * R), qi = 1.0 - std::cbrt(c);
  return kPi * R * R * ((std::pow(1.0 - q0, 4) - std::pow(c, 4.0 / 3.0)) / 4.0 - c * (qi - q0));
}

double cpu_microseconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

void measure(const std::string& name, const std::vector<collision::ContactBody>& bodies, double error, double exact) {
  const Executor executor(1);
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  double best = std::numeric_limits<double>::infinity();
  constexpr int kRepeats = 200, kInner = 5;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    const double start = cpu_microseconds();
    for (int i = 0; i < kInner; ++i) {
      find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
      solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
    }
    best = std::min(best, (cpu_microseconds() - start) / kInner);
  }
  if (surface.summary.empty()) return;
  const collision::ContactSurface::Summary& s = surface.summary.front();
  Hasher hasher;
  hasher.add(std::span<const Vec3>(surface.point));
  hasher.add(std::span<const double>(surface.area));
  const std::string true_error =
      std::isnan(exact) ? "null" : std::to_string(std::log10(std::abs(s.force.norm() / exact - 1.0) + 1e-17));
  std::printf("{\"name\": \"collision/%s/error=%g\", \"cpu_us_min\": %.2f, \"points\": %llu, \"evaluations\": %llu, "
              "\"error\": %.3g, \"error_kind\": \"estimate\", \"log10_force_error\": %s, \"hash\": \"%s\"}\n",
              name.c_str(), error, best, static_cast<unsigned long long>(s.points),
              static_cast<unsigned long long>(s.evaluations), s.error_estimate, true_error.c_str(),
              to_hex(hasher.value()).c_str());
}

}  // namespace

int supple::benchmarks::programs::contact_bench(int argc, char** argv) {
  supple::benchmarks::answer_usage(argc, argv, "contact_bench [FILE.svg]    FILE.svg: plot of time against error of all rules, by contact_rules", 1);
  namespace fs = std::filesystem;
  const fs::path plot = argc > 1 ? argv[1] : "";
  if (argc > 1 && plot.extension() != ".svg") {
    std::fprintf(stderr, "error: contact_bench: expected nothing, or the name of a plot FILE.svg; found '%s'\n", argv[1]);
    return 2;
  }
  const double none = std::numeric_limits<double>::quiet_NaN();
  const Ball ball(Vec3(0.013, 0.021, 0.40), 1.0), equal(Vec3(0.013, 0.021, -0.40), 1.0);
  const Ball small(Vec3(0.3, 0.2, -0.16), 0.5);
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
  const Pose origin;
  const Vec3 still = Vec3::Zero();
  collision::ContactBody ground;
  ground.field = plane;
  ground.material.modulus = 1.0;
  ground.pose = {&origin, 1};
  ground.velocity = {&still, 1};
  ground.angular_velocity = {&still, 1};
  ground.fixed = true;
  for (const double error : {1e-2, 1e-3, 1e-4, 1e-6, 1e-8}) {
    measure("sphere_plane", {ball.body(), ground}, error, wyvill_force(1.0, 0.40));
    measure("sphere_sphere_equal", {ball.body(), equal.body()}, error, wyvill_force(1.0, 0.40));
    measure("sphere_sphere_unequal", {ball.body(), small.body()}, error, none);
  }
  if (plot.empty()) {
    std::fprintf(stderr, "plot of time against error, all rules: supple bench collision FILE.svg\n");
    return 0;
  }
  return supple::benchmarks::programs::contact_rules(argc, argv);
}
