/// Scenes whose surfaces are meshed by the optional component.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include "model/warnings.h"
#include "output/meshes/search_files.h"
#include "supple/cgal/surface_meshes.h"
#include "supple/core/error.h"
#include "supple/scenes/plan.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

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

TEST(DelaunayScene, NamesTheObjectThatCellsDoNotResolve) {
  Simulation simulation(parse_scene(R"(
schema: 1
duration: 1 s
objects:
  - name: ball
    particles: {arrange: single, at: [1, 0, 0], mass: 1}
    skeleton: [{shape: point, kernel: {radius: 0.3}}]
  - name: sheet
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: disc, radius: 0.3, turn_axis: [0, 1, 1], turn_deg: 33, kernel: {type: gascuel, radius: 0.004, thickness: 0.002, slope: 8}}]
output: {mesh: ply, cell: 0.015, meshing: {method: delaunay}}
)",
                                    "test.yaml", "."),
                        {.delaunay = cgal::delaunay_mesh});
  try {
    (void)simulation.meshes();
    FAIL() << "no error";
  } catch (const Error& error) {
    const Fault& fault = error.faults().front();
    EXPECT_EQ(fault.key, "output.cell");
    EXPECT_EQ(fault.found, "a part without a seed at cells of 0.015 m on 'sheet'");
    EXPECT_EQ(fault.hint, "use smaller cells, for this object alone in objects.sheet.meshing.cell");
  }
}

constexpr const char* kTwoBalls = R"(
schema: 1
duration: 0.2 s
frame_rate: 25
objects:
  - name: left
    particles: {arrange: single, at: [0, 0, 0], mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    contact: {modulus: 6 kPa}
  - name: right
    particles: {arrange: single, at: [0.6, 0.03, 0.02], mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    contact: {modulus: 6 kPa}
)";

TEST(DelaunayScene, RefusesATinyDistanceAloneAndInContact) {
  const std::string lone = "schema: 1\nduration: 1 s\nobjects:\n  - name: a\n    particles: {arrange: single, mass: 1}\n"
                           "    skeleton: [{shape: point, kernel: {radius: 1}}]\n";
  for (const std::string& bodies : {lone, std::string(kTwoBalls)}) {
    Simulation simulation(parse_scene(bodies + "output: {mesh: ply, meshing: {method: delaunay, distance: 1e-9}}\n", "test.yaml", "."),
                          {.delaunay = cgal::delaunay_mesh});
    try {
      (void)simulation.meshes();
      FAIL() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Limit);
      const Fault& fault = error.faults().front();
      EXPECT_EQ(fault.key, "output.meshing.distance");
      EXPECT_EQ(fault.expected, "expected bounds of triangles that need at most 2000000 vertices");
      EXPECT_TRUE(fault.found.starts_with("at least ")) << fault.found;
      EXPECT_TRUE(fault.hint.starts_with("use a distance of at least ")) << fault.hint;
    }
  }
}

// A signal does not wait for a mesh; what was saved is continued to the same files.
TEST(DelaunayScene, ASignalEndsAMesh) {
  namespace fs = std::filesystem;
  const fs::path folder = temp_folder() / "delaunay_signal";
  fs::remove_all(folder);
  const Scene scene = parse_scene(std::string(kTwoBalls) + "output: {mesh: ply, cell: 0.1, meshing: {method: delaunay}}\n", "balls.yaml", ".");
  RunOptions options{.folder = folder / "whole", .threads = 1, .delaunay = cgal::delaunay_mesh};
  ASSERT_EQ(run_scene(scene, options).outcome, "done");
  std::atomic<int> signal{0};
  options.folder = folder / "stopped";
  options.interrupt = &signal;
  options.progress = [&](const Progress& p) {
    if (p.stage == "surface" && p.frame == 3) signal = 15;
  };
  const RunResult stopped = run_scene(scene, options);
  EXPECT_EQ(stopped.outcome, "interrupted");
  EXPECT_EQ(stopped.reason, "interrupted by signal 15");
  EXPECT_EQ(stopped.exit_code, 143);
  EXPECT_EQ(stopped.frames, 2);
  options.interrupt = nullptr;
  options.progress = nullptr;
  options.resume = true;
  ASSERT_EQ(run_scene(scene, options).outcome, "done");
  const auto text = [](const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  int files = 0;
  for (const auto& entry : fs::directory_iterator(folder / "whole/meshes")) {
    EXPECT_EQ(text(entry.path()), text(folder / "stopped/meshes" / entry.path().filename())) << entry.path();
    ++files;
  }
  EXPECT_GE(files, scene.frame_count());
  fs::remove_all(folder);
}

TEST(DelaunayScene, TellsOfTrianglesThatCrossInAllFrames) {
  const std::filesystem::path folder = temp_folder() / "delaunay_crossings";
  for (const int frame : {1, 2}) {
    SearchCounts counts;
    counts.crossings = static_cast<std::uint64_t>(frame);
    write_searches(folder, "balls", frame, counts);
  }
  const SearchCounts all = read_searches(folder, "balls", {}, 2);
  EXPECT_EQ(all.crossings, 3u);
  std::vector<std::string> warnings;
  for (int i = 0; i < 2; ++i) set_missed(MeshingDesc{}, all, warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], "output.meshing.distance: pairs of triangles that intersect where bodies touch: 3; a smaller distance may separate them");
  set_missed(MeshingDesc{}, {}, warnings);
  EXPECT_TRUE(warnings.empty());
}

// Objects that touch share their contact bit for bit, within the angle, the given size and distance.
TEST(DelaunayScene, DividesObjectsThatTouchWithinAngleSizeAndDistance) {
  const auto meshes_of = [](const std::string& meshing) {
    const std::string text = std::string(kTwoBalls) + "output: {mesh: ply, cell: 0.1, meshing: " + meshing + "}\n";
    Simulation simulation(parse_scene(text, "test.yaml", "."), {.delaunay = cgal::delaunay_mesh});
    return simulation.meshes();
  };
  const auto shared = [](const std::vector<Mesh>& mesh) {
    std::size_t count = 0;
    for (const Vec3& p : mesh[0].position) {
      count += static_cast<std::size_t>(std::count(mesh[1].position.begin(), mesh[1].position.end(), p));
    }
    return count;
  };
  const std::vector<Mesh> coarse = meshes_of("{method: delaunay, size: 0.15, distance: 0.03}");
  ASSERT_EQ(coarse.size(), 2u);
  for (const Mesh& mesh : coarse) {
    const MeshReport report = inspect(mesh);
    EXPECT_TRUE(report.closed && report.oriented);
    EXPECT_GE(least_angle(mesh), std::numbers::pi / 6.0 - 1e-9);
    for (const auto& t : mesh.triangle) {  // chords of circles with the given radius
      for (std::size_t k = 0; k < 3; ++k) EXPECT_LE((mesh.position[t[k]] - mesh.position[t[(k + 1) % 3]]).norm(), std::sqrt(3.0) * 0.15);
    }
  }
  EXPECT_GT(shared(coarse), 10u);
  const std::vector<Mesh> fine = meshes_of("{method: delaunay, size: 0.15, distance: 0.005}");
  EXPECT_GT(fine[0].triangle_count(), 3 * coarse[0].triangle_count());
  EXPECT_GE(least_angle(fine[0]), std::numbers::pi / 6.0 - 1e-9);
  EXPECT_GT(shared(fine), shared(coarse));
  const std::vector<Mesh> cubes = meshes_of("{error: 0.005}"), plain = meshes_of("{method: cubes}");
  EXPECT_GT(cubes[0].triangle_count(), plain[0].triangle_count());
}

TEST(DelaunayScene, IsNamedInThePlan) {
  const Simulation simulation = make("{method: delaunay}");
  const StepPlan plan = plan_step(simulation.scene(), simulation.model(), requested_outputs(simulation.scene()));
  const auto& reason = plan.stages[static_cast<std::size_t>(Stage::Polygonise)].reason;
  EXPECT_NE(reason.find("Delaunay refinement by CGAL"), std::string::npos) << reason;
}

}  // namespace
}  // namespace supple::scenes
