#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "supple/cgal/surface_meshes.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/polygonise.h"

namespace supple::cgal {
namespace {

using namespace implicit;
using namespace implicit::testing;

constexpr double kDegree = std::numbers::pi / 180.0;

Body random_blobs() { return random_body({.seed = 5, .parts = 12, .half_width = 0.5, .only_points = true}); }

/// Least angle of all triangles and largest circumradius, by the cosine rule.
struct Quality {
  double least_angle = std::numbers::pi, largest_radius = 0.0;
};
Quality quality_of(const Mesh& mesh) {
  Quality q;
  for (const auto& t : mesh.triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &a = mesh.position[t[k]], &b = mesh.position[t[(k + 1) % 3]], &c = mesh.position[t[(k + 2) % 3]];
      const double angle = std::acos(std::clamp((b - a).normalized().dot((c - a).normalized()), -1.0, 1.0));
      q.least_angle = std::min(q.least_angle, angle);
      q.largest_radius = std::max(q.largest_radius, (c - b).norm() / (2.0 * std::sin(angle)));
    }
  }
  return q;
}

TEST(DelaunayMesh, HoldsItsBoundsAndIsClosedOrientedAndFreeOfSelfIntersection) {
  const Body body = random_blobs();
  for (const DelaunayOptions& options :
       {DelaunayOptions{.angle = 30 * kDegree, .size = 0.08, .distance = 0.01, .cell = 0.05},
        DelaunayOptions{.angle = 20 * kDegree, .size = 0.3, .distance = 0.002, .cell = 0.05}}) {
    DelaunayReport report;
    const Mesh mesh = delaunay_mesh(body.field, options, &report);
    const Quality quality = quality_of(mesh);
    EXPECT_GE(quality.least_angle, options.angle - 1e-9);
    EXPECT_LE(quality.largest_radius, options.size);
    EXPECT_LE(report.largest_distance, options.distance);
    EXPECT_NEAR(report.least_angle, quality.least_angle, 1e-9);
    EXPECT_NEAR(report.largest_radius, quality.largest_radius, 1e-9);
    const MeshReport checks = inspect(mesh);
    EXPECT_TRUE(checks.closed && checks.oriented);
    EXPECT_EQ(self_intersections(mesh, 0.1), 0u);
    const MeshReport exact = inspect(march_cubes(body.field, {.lattice = {.cell = 0.01}}, Executor(2)));
    EXPECT_EQ(checks.components, exact.components);
    EXPECT_EQ(checks.euler_characteristic, exact.euler_characteristic);
    EXPECT_NEAR(checks.volume, exact.volume, options.distance * exact.area);
    std::vector<double> values(mesh.vertex_count());
    std::vector<Vec3> gradients(mesh.vertex_count());
    body.field.evaluate(mesh.position, values, gradients);
    for (std::size_t v = 0; v < values.size(); ++v) {
      ASSERT_LE(std::abs(values[v]), 1e-13 * 20.0);
      ASSERT_NEAR(mesh.normal[v].dot(gradients[v]), -gradients[v].norm(), 1e-12 * gradients[v].norm());
    }
  }
}

TEST(DelaunayMesh, FindsEveryPartHoweverSmall) {
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()},
                             {wyvill_point(0.1), Vec3(0, 1.2, 0)},
                             {wyvill_point(0.3), Vec3(0, 0, 1.5)}});
  const Mesh mesh = delaunay_mesh(body.field, {.size = 0.5, .distance = 0.1, .cell = 0.02});
  const MeshReport report = inspect(mesh);
  EXPECT_TRUE(report.closed && report.oriented);
  EXPECT_EQ(report.components, 3u);
  EXPECT_EQ(report.euler_characteristic, 6);
}

TEST(DelaunayMesh, OfNoSurfaceIsEmpty) {
  Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  body.skeleton.iso = 1.5;
  body.place();
  DelaunayReport report;
  EXPECT_EQ(delaunay_mesh(body.field, {.size = 0.1, .distance = 0.1, .cell = 0.1}, &report).triangle_count(), 0u);
  EXPECT_EQ(report.seeds, 0u);
}

TEST(DelaunayMesh, RefusesBoundsThatTakeTooManyVertices) {
  const Body body = random_blobs();
  try {
    (void)delaunay_mesh(body.field, {.size = 1.0, .distance = 1e-5, .cell = 0.05, .most_vertices = 1000});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    EXPECT_EQ(error.faults().front().found, "more");
  }
  try {  // a trillion: refused before they are made
    (void)delaunay_mesh(body.field, {.size = 1e-6, .distance = 1.0, .cell = 0.05});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.faults().front().key, "mesh.size");
    EXPECT_NE(error.faults().front().found.find("by the area"), std::string::npos);
  }
}

TEST(DelaunayMesh, RepeatsBitByBit) {
  const Body body = random_blobs();
  const DelaunayOptions options{.size = 0.1, .distance = 0.005, .cell = 0.05};
  const std::uint64_t once = hash_of(delaunay_mesh(body.field, options));
  const std::vector<std::vector<char>> elsewhere(1000, std::vector<char>(777));  // memory lies differently
  EXPECT_EQ(hash_of(delaunay_mesh(body.field, options)), once);
}

/// A square of side 1 in two triangles at height z.
Mesh square(double z, double side = 1.0) {
  Mesh mesh;
  add_quadrangle(mesh, {0, 0, z}, {side, 0, z}, {side, side, z}, {0, side, z});
  return mesh;
}

TEST(HausdorffDistance, IsThatOfPlaneFigures) {
  EXPECT_NEAR(one_sided_hausdorff_distance(square(0), square(0.25), 1e-6), 0.25, 1e-6);
  // The farther corner of the larger square lies sqrt 2 from the smaller one's; the way back is 0.
  EXPECT_NEAR(one_sided_hausdorff_distance(square(0, 2.0), square(0), 1e-6), std::numbers::sqrt2, 1e-6);
  EXPECT_NEAR(one_sided_hausdorff_distance(square(0), square(0, 2.0), 1e-6), 0.0, 1e-6);
  EXPECT_EQ(one_sided_hausdorff_distance(Mesh{}, square(0), 1e-6), 0.0);
  EXPECT_TRUE(std::isinf(one_sided_hausdorff_distance(square(0), Mesh{}, 1e-6)));
}

TEST(HausdorffDistance, ShowsAMissedPart) {
  const Body whole = body_of({{wyvill_point(1.0), Vec3::Zero()}, {wyvill_point(0.2), Vec3(0, 1.2, 0)}});
  const Body part = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  const MarchOptions options{.lattice = {.cell = 0.05}};
  const Mesh a = march_cubes(whole.field, options, Executor(1)), b = march_cubes(part.field, options, Executor(1));
  EXPECT_LT(one_sided_hausdorff_distance(b, a, 1e-4), 1e-3);
  EXPECT_GT(one_sided_hausdorff_distance(a, b, 1e-4), 0.7);
}

TEST(HausdorffDistance, OfMeshesToTheExactSurfaceFallsWithTheSquareOfTheCell) {
  const Body body = body_of({{wyvill_point(1.0), Vec3(0.03, 0.01, 0)},
                             {wyvill_point(1.0), Vec3(0.5, 0, 0.1)},
                             {wyvill_point(0.8), Vec3(0, 0.4, 0)}});
  DelaunayReport report;
  const Mesh exact = delaunay_mesh(body.field, {.size = 0.2, .distance = 1e-3, .cell = 0.05}, &report);
  ASSERT_LE(report.largest_distance, 1e-3);
  constexpr double kError = 1e-3;
  double last = 0.0;
  for (const double cell : {0.3, 0.15}) {
    for (const bool tetrahedra : {false, true}) {
      const Lattice lattice{.cell = cell};
      const Mesh mesh = tetrahedra ? polygonise(body.field, lattice, Executor(1))
                                   : march_cubes(body.field, {.lattice = lattice}, Executor(1));
      const double there = one_sided_hausdorff_distance(mesh, exact, kError);
      const double back = one_sided_hausdorff_distance(exact, mesh, kError);
      // Sagitta of a chord of sqrt 3 cells over the least radius of curvature, that of the smaller ball (0.36), and the
      // errors of the reference and of the distance.
      const double sagitta = 3.0 * cell * cell / (8.0 * 0.36);
      EXPECT_LT(std::max(there, back), sagitta + 2.0 * kError);
      if (!tetrahedra) {
        if (last > 0.0) {
          EXPECT_LT(std::max(there, back), last / 3.0);
        }
        last = std::max(there, back);
      }
    }
  }
}

}  // namespace
}  // namespace supple::cgal
