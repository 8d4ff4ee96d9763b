/// Scenes whose surfaces are meshed by the optional component.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "supple/cgal/surface_meshes.h"
#include "supple/core/error.h"
#include "supple/scenes/plan.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {
namespace {

Simulation make(const std::string& meshing) {
  const std::string text = R"(
schema: 1
duration: 1 s
objects:
  - name: pair
    particles: {arrange: line, count: 2, spacing: 0.4, mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
output: {mesh: ply, cell: 0.05, meshing: )" + meshing + "}\n";
  return Simulation(parse_scene(text, "test.yaml", "."), {.delaunay = cgal::delaunay_mesh});
}

double least_angle(const Mesh& mesh) {
  double least = std::numbers::pi;
  for (const auto& t : mesh.triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& a = mesh.position[t[k]];
      const Vec3 u = (mesh.position[t[(k + 1) % 3]] - a).normalized(), v = (mesh.position[t[(k + 2) % 3]] - a).normalized();
      least = std::min(least, std::acos(std::clamp(u.dot(v), -1.0, 1.0)));
    }
  }
  return least;
}

TEST(DelaunayScene, HoldsTheAngleAskedForWhichCubesDoNot) {
  const double degree = std::numbers::pi / 180.0;
  Simulation cubes = make("{method: cubes}");
  EXPECT_LT(least_angle(cubes.meshes().front()), 15.0 * degree);
  Simulation delaunay = make("{method: delaunay, angle_deg: 28, size: 0.1, distance: 0.01, motion: true}");
  const Mesh& mesh = delaunay.meshes().front();
  EXPECT_GE(least_angle(mesh), 28.0 * degree - 1e-9);
  const MeshReport report = inspect(mesh);
  EXPECT_TRUE(report.closed && report.oriented);
  EXPECT_EQ(report.components, 1u);
  EXPECT_GT(report.volume, 0.0);
  EXPECT_EQ(mesh.columns.size(), 4u);
}

TEST(DelaunayScene, RefinesWithSizeAndDistance) {
  const auto triangles = [](const std::string& meshing) { return make(meshing).meshes().front().triangle_count(); };
  const std::size_t plain = triangles("{method: delaunay}");  // size 0.1, distance 0.01
  EXPECT_EQ(triangles("{method: delaunay, size: 0.1, distance: 0.01}"), plain);
  EXPECT_GT(triangles("{method: delaunay, size: 0.05}"), 2 * plain);
  EXPECT_GT(triangles("{method: delaunay, distance: 0.0005}"), 2 * plain);
}

TEST(DelaunayScene, NamesTheKeyWhenTheBoundsTakeTooMuch) {
  Simulation simulation = make("{method: delaunay, size: 0.0001}");
  try {
    (void)simulation.meshes();
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    EXPECT_EQ(error.faults().front().key, "output.meshing.size");
  }
}

TEST(DelaunayScene, IsNamedInThePlan) {
  const Simulation simulation = make("{method: delaunay}");
  const StepPlan plan = plan_step(simulation.scene(), simulation.model(), requested_outputs(simulation.scene()));
  const auto& reason = plan.stages[static_cast<std::size_t>(Stage::Polygonise)].reason;
  EXPECT_NE(reason.find("Delaunay refinement by CGAL"), std::string::npos) << reason;
}

}  // namespace
}  // namespace supple::scenes
