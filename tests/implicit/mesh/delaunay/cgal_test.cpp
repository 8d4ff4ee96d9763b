#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <numbers>
#include <string>

#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "supple/cgal/surface_meshes.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
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

// Four vertices of a flat side, as of a disc or a box, lie so nearly in a plane that their circumcentre is out of all proportion.
TEST(DelaunayMesh, OfFlatSidesHasItsVerticesOnTheSurface) {
  for (const ShapeKind shape : {ShapeKind::Disc, ShapeKind::Box, ShapeKind::Rectangle, ShapeKind::Segment}) {
    Random random(7);
    for (int i = 0; i < 4; ++i) {
      Primitive primitive = wyvill_point(0.5);
      primitive.shape = shape;
      primitive.size = Vec3(random.uniform(0.3, 0.6), random.uniform(0.3, 0.6), random.uniform(0.1, 0.3));
      Body body = body_of({{primitive, random.in_box(1.0)}});
      if (i > 0) body.parts[0].orientation = random.rotation();
      body.place();
      const Mesh mesh = delaunay_mesh(body.field, {.angle = 22 * kDegree, .size = 0.08, .distance = 0.004, .cell = 0.05});
      ASSERT_GT(mesh.vertex_count(), 300u);
      std::vector<double> values(mesh.vertex_count());
      body.field.evaluate(mesh.position, values);
      for (const double f : values) ASSERT_LE(std::abs(f), 1e-13 * 20.0) << static_cast<int>(shape) << ", " << i;
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

Mesh coarse(const FieldView& field) { return march_cubes(field, {.lattice = {.cell = 0.05}}, Executor(1)); }

Primitive segment(double half_length, double radius) {
  Primitive primitive = wyvill_point(radius);
  primitive.shape = ShapeKind::Segment;
  primitive.size.x() = half_length;
  return primitive;
}

/// Closed, with the parts of marching cubes, and all of them: within the given distance, twice for the cubes' own.
void expect_whole(const Body& body, const DelaunayOptions& options, const std::string& what) {
  DelaunayReport report;
  const Mesh mesh = delaunay_mesh(body.field, options, &report);
  const MeshReport found = inspect(mesh), cubes = inspect(coarse(body.field));
  ASSERT_GT(cubes.components, 0u) << what;
  EXPECT_TRUE(found.closed && found.oriented) << what;
  EXPECT_EQ(found.components, cubes.components) << what;
  EXPECT_EQ(found.euler_characteristic, cubes.euler_characteristic) << what;
  EXPECT_LE(report.largest_distance, options.distance) << what;
  EXPECT_NEAR(found.volume, cubes.volume, 2.0 * options.distance * cubes.area) << what;
}

TEST(DelaunayMesh, OfASegmentThinnerThanTheSizeIsWhole) {
  expect_whole(body_of({{segment(1.0, 0.8), Vec3::Zero()}}), {.size = 1.0, .distance = 0.01, .cell = 0.05}, "short");
  expect_whole(body_of({{segment(2.0, 0.8), Vec3::Zero()}}), {.size = 1.0, .distance = 0.01, .cell = 0.05}, "long");
}

TEST(DelaunayMesh, OfRandomThinBodiesAndPartsHasThePartsOfCubes) {
  Random random(21);
  for (int i = 0; i < 12; ++i) {
    // A segment of a radius from three cells on, up to thirty times as long, or a ring, turned at random; a small ball and a large one apart from it.
    const double radius = random.uniform(0.33, 0.9);
    Body body = body_of({{segment(random.uniform(0.5, 2.5), radius), random.in_box(0.2)},
                         {wyvill_point(random.uniform(0.35, 0.6)), Vec3(0, 0, 4.3)},
                         {wyvill_point(random.uniform(1.0, 2.0)), Vec3(0, 0, -6.0)}});
    body.parts[0].orientation = random.rotation();
    if (i % 3 == 0) body.skeleton.primitive[0].shape = ShapeKind::Ring;
    body.place();
    const double size = random.uniform(0.4, 2.0);
    expect_whole(body, {.size = size, .distance = random.uniform(0.01, 0.05), .cell = 0.05}, std::to_string(i));
  }
}

TEST(DelaunayMesh, OfNoSurfaceIsEmpty) {
  Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  body.skeleton.iso = 1.5;
  body.place();
  DelaunayReport report;
  EXPECT_EQ(delaunay_mesh(body.field, {.size = 0.1, .distance = 0.1, .cell = 0.1}, &report).triangle_count(), 0u);
  EXPECT_EQ(report.seeds, 0u);
}

TEST(DelaunayMesh, TakesMoreVerticesThanTheEstimateAndNotMuchMore) {
  const Body body = random_blobs(), capsule = body_of({{segment(2.0, 0.8), Vec3::Zero()}});
  const FunctionField ball = sphere({0.01, 0.02, 0.03}, 0.5), ring = torus(0.4, 0.15);
  for (const FieldView& field : {FieldView(ball), FieldView(ring), FieldView(body.field), FieldView(capsule.field)}) {
    for (const auto& [size, distance] : {std::pair{0.3, 0.01}, std::pair{0.3, 3e-3}, std::pair{0.1, 0.1}, std::pair{0.1, 2e-3}}) {
      const DelaunayOptions options{.size = size, .distance = distance, .cell = 0.05};
      const Mesh seen = coarse(field);
      const double estimate = estimate_delaunay({&seen, 1}, options).vertices;
      const auto found = static_cast<double>(delaunay_mesh(field, options).vertex_count());
      EXPECT_GE(found, estimate) << size << ' ' << distance;
      EXPECT_LE(found, 3.0 * estimate) << size << ' ' << distance;
    }
  }
}

Fault fault_of(const FieldView& field, const DelaunayOptions& options) {
  try {
    (void)delaunay_mesh(field, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    return error.faults().front();
  }
  ADD_FAILURE() << "no error";
  return {};
}

// A billion and more: refused before they are made, and with the values that the hint names there is a mesh.
TEST(DelaunayMesh, RefusesBoundsThatTakeTooManyVerticesBeforeItBegins) {
  const Body body = random_blobs();
  for (const std::string key : {"size", "distance"}) {
    DelaunayOptions options{.size = 1.0, .distance = 0.1, .cell = 0.05, .most_vertices = 2000};
    double& bound = key == "size" ? options.size : options.distance;
    bound = key == "size" ? 1e-6 : 1e-9;
    const Fault fault = fault_of(body.field, options);
    EXPECT_EQ(fault.key, "mesh." + key);
    EXPECT_EQ(fault.expected, "expected bounds of triangles that need at most 2000 vertices");
    EXPECT_TRUE(fault.found.starts_with("at least ")) << fault.found;
    EXPECT_TRUE(fault.found.ends_with(" by the area and curvature of the surface")) << fault.found;
    EXPECT_GT(std::stod(fault.found.substr(9)), 1e9);
    const std::string lead = "use a " + key + " of at least ";
    ASSERT_TRUE(fault.hint.starts_with(lead) && fault.hint.ends_with(" m")) << fault.hint;
    bound = std::stod(fault.hint.substr(lead.size()));
    const std::size_t found = delaunay_mesh(body.field, options).vertex_count();
    EXPECT_LE(found, 2000u);
    EXPECT_GE(found, 450u);  // 2000 over four, with 5 % more of the bound, by the estimate
  }
  const Fault both = fault_of(body.field, {.size = 1e-6, .distance = 1e-9, .cell = 0.05, .most_vertices = 2000});
  EXPECT_NE(both.hint.find("a size of at least "), std::string::npos) << both.hint;
  EXPECT_NE(both.hint.find(" m and a distance of at least "), std::string::npos) << both.hint;
}

TEST(DelaunayMesh, NamesWhatTookTooManyVerticesWhereItStops) {
  const Body body = random_blobs();
  DelaunayOptions options{.size = 1.0, .distance = 1e-3, .cell = 0.05};
  const Mesh seen = coarse(body.field);
  options.most_vertices = static_cast<std::uint64_t>(1.2 * estimate_delaunay({&seen, 1}, options).vertices);
  const Fault fault = fault_of(body.field, options);
  EXPECT_EQ(fault.key, "mesh.distance");
  EXPECT_EQ(fault.found, "more");
  EXPECT_TRUE(fault.hint.starts_with("use a distance of at least 0.00")) << fault.hint;
  // What two balls share has an edge, where triangles become small.
  const FunctionField a = sphere({-0.4, 0.01, 0.02}, 0.5), b = sphere({0.4, 0.01, 0.02}, 0.5);
  const FunctionField lens{.function =
                               [=](const Vec3& p, Vec3& gradient) {
                                 Vec3 other;
                                 const double f = a.function(p, gradient), g = b.function(p, other);
                                 if (g < f) gradient = other;
                                 return std::min(f, g);
                               },
                           .lipschitz = 1.0,
                           .box = {Vec3(-0.11, -0.31, -0.3), Vec3(0.11, 0.33, 0.34)}};
  const Fault edge = fault_of(lens, {.size = 0.3, .distance = 0.002, .cell = 0.02, .most_vertices = 1000});
  EXPECT_EQ(edge.key, "mesh.angle");
  EXPECT_TRUE(edge.found.starts_with("more, where size and distance alone need less than ")) << edge.found;
}

// By evaluations of the field, not by a clock.
TEST(DelaunayMesh, EndsSoonAfterAnInterrupt) {
  const FunctionField ball = sphere({0.01, 0.02, 0.03}, 0.5);
  std::atomic<int> interrupt{0};
  std::uint64_t calls = 0, at = 0;
  FunctionField counted = ball;
  counted.function = [&](const Vec3& p, Vec3& gradient) {
    if (++calls == at) interrupt = 15;
    return ball.function(p, gradient);
  };
  const DelaunayOptions options{.size = 0.3, .distance = 1e-3, .cell = 0.1, .interrupt = &interrupt};
  (void)delaunay_mesh(counted, options);
  const std::uint64_t all = calls;
  for (const double share : {0.2, 0.5, 0.99}) {
    interrupt = 0;
    calls = 0;
    at = static_cast<std::uint64_t>(share * static_cast<double>(all));
    EXPECT_THROW((void)delaunay_mesh(counted, options), Interrupted) << share;
    EXPECT_LT(calls - at, 2000u) << share;  // a vertex makes some dozens of triangles, a root takes some dozens of evaluations
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

// A segment in three orders of its corners, and a point, above a triangle.
TEST(HausdorffDistance, OfTrianglesWithoutAreaIsThatOfSegmentsAndPoints) {
  constexpr double kError = 1e-4;
  Mesh flat;
  flat.position = {{-10, -10, 0}, {10, -10, 0}, {0, 20, 0}};
  flat.triangle = {{0, 1, 2}};
  Mesh thin;
  thin.position = {{0, 0, 1}, {1, 0, 2}, {2, 0, 3}};
  for (const std::array<std::uint32_t, 3>& t : {std::array<std::uint32_t, 3>{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {2, 2, 0}}) {
    thin.triangle = {t};
    EXPECT_NEAR(one_sided_hausdorff_distance(thin, flat, kError), 3.0, kError);
    Mesh end;
    end.position = {{2, 0, 3}, {0, 0, 1}};
    end.triangle = {{0, 0, 0}};
    EXPECT_NEAR(one_sided_hausdorff_distance(end, thin, kError), 0.0, kError);
    EXPECT_NEAR(one_sided_hausdorff_distance(thin, end, kError), std::sqrt(8.0), kError);
    EXPECT_NEAR(one_sided_hausdorff_distance(end, flat, kError), 3.0, kError);
  }
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
