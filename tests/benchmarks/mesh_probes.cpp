/// @file mesh_probes.cpp
/// Small balls are pressed into the faces of mesh solids by a hundredth of their size, at points spread evenly over the area; one JSON object per mesh and
/// error. Without files: a box, a gear and an anchor of intersecting shells. A ball without contact, or a point at that depth behind a face
/// that is outside ("hollow") although the mesh is thicker there, shows that the surface is misplaced.
///   mesh_probes [PROBES] [FILE.obj|.ply ...]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "contact_shapes.h"
#include "programs.h"
#include "support/closed_meshes.h"
#include "supple/core/io/read_mesh.h"
#include "supple/implicit/mesh_solid.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::benchmarks;

struct Named {
  std::string name;
  Mesh mesh;
};

/// A shank, a stock and two flukes.
Mesh anchor() {
  Mesh mesh = test::block(Vec3(0.04, 0.04, 0.5));
  append(mesh, test::block(Vec3(0.25, 0.03, 0.03), Vec3(0, 0, 0.4)));
  append(mesh, test::block(Vec3(0.35, 0.05, 0.04), Vec3(0, 0, -0.48)));
  for (const double side : {-1.0, 1.0}) append(mesh, test::block(Vec3(0.01, 0.12, 0.08), Vec3(side * 0.33, 0, -0.4)));
  return mesh;
}

/// Places on the faces and the normals there, as many on each as its area has a part in all of it.
std::vector<std::pair<Vec3, Vec3>> spread(const Mesh& mesh, int count) {
  const auto corner = [&](std::size_t t, std::size_t k) -> const Vec3& { return mesh.position[mesh.triangle[t][k]]; };
  const auto across = [&](std::size_t t) -> Vec3 { return (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)); };
  double whole = 0.0, sum = 0.0;
  for (std::size_t t = 0; t < mesh.triangle.size(); ++t) whole += across(t).norm();
  std::vector<std::pair<Vec3, Vec3>> places;
  Draw draw(2026);
  for (std::size_t t = 0; t < mesh.triangle.size(); ++t) {
    sum += across(t).norm();
    while (static_cast<int>(places.size()) < count && (static_cast<double>(places.size()) + 0.5) * whole <= sum * count) {
      double u = draw.uniform(0.0, 1.0), v = draw.uniform(0.0, 1.0);
      if (u + v > 1.0) {
        u = 1.0 - u;
        v = 1.0 - v;
      }
      places.emplace_back(corner(t, 0) + u * (corner(t, 1) - corner(t, 0)) + v * (corner(t, 2) - corner(t, 0)), across(t).normalized());
    }
  }
  return places;
}

void probe(const Named& named, int count) {
  constexpr double kDepth = 0.01, kRadius = 0.015;  // of the size
  const double begin = cpu_microseconds();
  const implicit::MeshSolid solid(named.mesh, {.slope = 1.0});
  const double built_ms = 1e-3 * (cpu_microseconds() - begin);
  const double size = solid.surface_box().extent().maxCoeff();
  const std::vector<std::pair<Vec3, Vec3>> places = spread(solid.mesh(), count);
  std::vector<Vec3> near;  // about the places, as a query asks for them
  Draw draw(7);
  for (const auto& [x, n] : places) {
    for (int k = 0; k < 100; ++k) near.push_back(x + kDepth * size * draw.uniform(-1.0, 1.0) * draw.direction());
  }
  std::vector<double> value(near.size());
  std::vector<Vec3> slope(near.size());
  const double asked = cpu_microseconds();
  implicit::FieldView(solid).evaluate(near, value, slope);
  const double evaluation_ns = 1e3 * (cpu_microseconds() - asked) / static_cast<double>(near.size());

  int hollow = 0;  // places that far behind a face that are outside
  for (const auto& [x, n] : places) hollow += implicit::FieldView(solid).value(x - kDepth * size * n) > 0.0 ? 0 : 1;
  Rigid ball(linear_sphere(kRadius * size), kLinearModulus * 1e5, 0.2 * kRadius * size);
  const Pose still;
  const Executor executor(1);
  for (const double error : {1e-2, 1e-3, 1e-4}) {
    std::vector<double> cpu;
    double evaluations = 0.0;
    int missed = 0, unmet = 0, by_polar = 0;
    collision::ContactCandidates candidates;
    collision::ContactSurface surface;
    for (const auto& [x, n] : places) {
      ball.put({x + (kRadius - kDepth) * size * n, Quat::Identity()});
      const std::array<collision::ContactBody, 2> bodies{ball.body(), single_part(solid, 1e6 / size, still)};
      double least = std::numeric_limits<double>::infinity();
      for (int time = 0; time < 2; ++time) {
        const double start = cpu_microseconds();
        find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
        solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
        least = std::min(least, cpu_microseconds() - start);
      }
      cpu.push_back(least);
      const collision::ContactSurface::Summary s = surface.summary.empty() ? collision::ContactSurface::Summary{} : surface.summary.front();
      missed += s.points == 0 ? 1 : 0;
      unmet += s.error_estimate > 1.01 * error ? 1 : 0;
      by_polar += s.rule == collision::ContactRule::Polar ? 1 : 0;
      evaluations += static_cast<double>(s.evaluations) / count;
    }
    std::sort(cpu.begin(), cpu.end());
    std::printf("{\"name\": \"collision/mesh_probes/%s/error=%g\", \"triangles\": %zu, \"built_ms\": %.1f, "
                "\"evaluation_ns\": %.0f, \"probes\": %d, \"hollow\": %d, \"missed\": %d, "
                "\"unmet\": %d, \"by_polar\": %d, \"cpu_us_median\": %.0f, \"cpu_us_90_of_100\": %.0f, \"cpu_us_worst\": %.0f, \"evaluations_mean\": %.0f}\n",
                named.name.c_str(), error, solid.mesh().triangle.size(), built_ms, evaluation_ns, count, hollow, missed, unmet, by_polar, cpu[cpu.size() / 2],
                cpu[cpu.size() * 9 / 10], cpu.back(), evaluations);
    std::fflush(stdout);
  }
}

}  // namespace

int supple::benchmarks::programs::mesh_probes(int argc, char** argv) {
  constexpr std::string_view kUsage = "mesh_probes [PROBES] [FILE.obj|.ply ...]";
  answer_usage(argc, argv, kUsage, 1000);
  const int count = argc > 1 ? whole_number(kUsage, argv[1]) : 200;
  std::vector<Named> meshes;
  for (int i = 2; i < argc; ++i) meshes.push_back({std::filesystem::path(argv[i]).stem().string(), io::read_mesh(argv[i])});
  if (meshes.empty()) meshes = {{"box", test::block(Vec3(0.5, 0.4, 0.3))}, {"gear", test::gear(24, 0.8, 1.0, 0.3)}, {"anchor", anchor()}};
  for (const Named& named : meshes) probe(named, count);
  return 0;
}
