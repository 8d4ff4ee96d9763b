#include "mesh/local_division.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "mesh/error_search.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit {
namespace {

using namespace testing;

constexpr std::size_t kAnyNumber = std::numeric_limits<std::size_t>::max();  // of triangles

Vec3 centroid(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) { return (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0; }

double smallest_angle(const Mesh& mesh) {
  double least = std::numbers::pi;
  for (const auto& t : mesh.triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &p = mesh.position[t[k]], a = mesh.position[t[(k + 1) % 3]] - p, b = mesh.position[t[(k + 2) % 3]] - p;
      least = std::min(least, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
  }
  return least;
}

// At an error that the large ball meets with the triangles it has, those of the small one alone are divided.
TEST(LocalDivision, DividesWhatIsTooFarFromTheSurfaceAlone) {
  const double large = 1.0, small = 0.1;
  const Vec3 beside(1.3, 0.0, 0.0);
  const FunctionField balls = either(sphere(Vec3::Zero(), large), sphere(beside, small));
  const Mesh from = march_cubes(balls, {.lattice = lattice_of(0.08)}, Executor(2));
  const auto error_of = [&](const Mesh& mesh) {
    std::array<double, 2> largest{};
    for (const auto& t : mesh.triangle) {
      const Vec3 c = centroid(mesh, t);
      const bool of_small = (c - beside).norm() < 2.0 * small;
      largest[of_small ? 1 : 0] = std::max(largest[of_small ? 1 : 0], std::abs(of_small ? (c - beside).norm() - small : c.norm() - large));
    }
    return largest;
  };
  const std::array<double, 2> first = error_of(from);
  ASSERT_LT(4.0 * first[0], first[1]);
  const double goal = 1.01 * first[0];
  LocalDivision division;
  const Mesh* mesh = division.divide(balls, from, goal, kAnyNumber, Executor(2));
  ASSERT_NE(mesh, nullptr);
  expect_closed(*mesh);
  EXPECT_LE(error_of(*mesh)[1], goal);
  EXPECT_NEAR(division.error(), std::max(error_of(*mesh)[0], error_of(*mesh)[1]), 1e-12);
  EXPECT_EQ(self_intersections(*mesh, 0.08), 0u);
  EXPECT_GE(smallest_angle(*mesh), 0.5 * smallest_angle(from) - 0.02);  // which is proved of flat triangles; these bend with the surface
  std::size_t added = 0;
  for (std::size_t v = 0; v < mesh->vertex_count(); ++v) {
    const Vec3& p = mesh->position[v];
    EXPECT_NEAR(FieldView(balls).value(p), 0.0, 1e-12);
    if (v < from.vertex_count()) {
      EXPECT_EQ(p, from.position[v]);
    } else {
      ++added;
      EXPECT_LT((p - beside).norm(), 1.5 * small);
    }
  }
  EXPECT_GT(added, 0u);
  const std::size_t count = mesh->triangle_count();
  EXPECT_NE(division.divide(balls, from, goal, count, Executor(1)), nullptr);
  EXPECT_EQ(division.divide(balls, from, goal, count - 1, Executor(1)), nullptr);
}

TEST(LocalDivision, DoesNotDependOnThreads) {
  const Body body = random_body({.seed = 3, .parts = 25});
  const Mesh from = march_cubes(body.field, {.lattice = lattice_of(first_cell(body.field, 0.0))}, Executor(2));
  const double goal = 0.3 * centroid_error(body.field, from, Executor(2));
  LocalDivision division;
  const Mesh* mesh = division.divide(body.field, from, goal, kAnyNumber, Executor(1));
  ASSERT_NE(mesh, nullptr);
  const std::uint64_t expected = hash_of(*mesh);
  EXPECT_GT(mesh->triangle_count(), from.triangle_count());
  for (const int threads : {2, 5}) EXPECT_EQ(hash_of(*division.divide(body.field, from, goal, kAnyNumber, Executor(threads))), expected);
}

// Where a neck is narrow for the triangles, new vertices could pass those around them.
TEST(LocalDivision, InvertsNoTriangle) {
  int divided = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Body body = random_body({.seed = seed, .parts = 25});
    const Mesh from = march_cubes(body.field, {.lattice = lattice_of(first_cell(body.field, 0.0))}, Executor(2));
    LocalDivision division;
    const Mesh* mesh = division.divide(body.field, from, 0.1 * centroid_error(body.field, from, Executor(2)), kAnyNumber, Executor(2));
    if (mesh == nullptr) continue;
    ++divided;
    for (const auto& t : mesh->triangle) {
      if (std::any_of(t.begin(), t.end(), [&](std::uint32_t v) { return v >= from.vertex_count(); })) {
        const Vec3 area = (mesh->position[t[1]] - mesh->position[t[0]]).cross(mesh->position[t[2]] - mesh->position[t[0]]);
        EXPECT_GT(area.dot(mesh->normal[t[0]] + mesh->normal[t[1]] + mesh->normal[t[2]]), 0.0) << seed;
      }
    }
  }
  EXPECT_GT(divided, 2);
}

// Bridges over a valley that no vertex reaches without intersections: it ends all the same, without a mesh.
TEST(LocalDivision, EndsWhereVerticesDoNotReachTheSurface) {
  const FunctionField field = noise(3, 0.5);
  const Mesh from = march_cubes(field, {.lattice = lattice_of(0.2)}, Executor(2));
  LocalDivision division;
  EXPECT_EQ(division.divide(field, from, 0.25 * centroid_error(field, from, Executor(2)), 10 * from.triangle_count(), Executor(2)), nullptr);
}

// Across a crease triangles are off by their width, not by its square, and get more in each round. They end on the crease instead.
TEST(LocalDivision, MeetsCreases) {
  const double radius = 0.5, apart = 0.35, cell = 0.06;
  const Vec3 axis = Vec3(0.8, 0.36, 0.48);
  const FunctionField balls = either(sphere(apart * axis, radius), sphere(-apart * axis, radius));
  const double rim = std::sqrt(radius * radius - apart * apart);
  const auto to_rim = [&](const Vec3& p) { return std::hypot(p.dot(axis), (p - p.dot(axis) * axis).norm() - rim); };
  const auto off = [&](const Vec3& p) {
    const double along = p.dot(axis);
    const Vec3 from = p - std::copysign(apart, along) * axis;
    // The foot on the ball of this side is on the surface where it stays on this side of the middle plane.
    const double foot = std::copysign(apart, along) + radius * from.dot(axis) / from.norm();
    return (foot > 0.0) == (along > 0.0) ? std::min(to_rim(p), std::abs(from.norm() - radius)) : to_rim(p);
  };
  const Mesh from = march_cubes(balls, {.lattice = lattice_of(cell)}, Executor(2));
  const auto largest = [&](const Mesh& mesh) {
    double most = 0.0;
    for (const auto& t : mesh.triangle) most = std::max(most, off(centroid(mesh, t)));
    return most;
  };
  LocalDivision division;
  std::size_t last = from.triangle_count();
  for (const double goal : {1e-3, 2.5e-4}) {
    ASSERT_GT(largest(from), 4.0 * goal);
    const Mesh* mesh = division.divide(balls, from, goal, kAnyNumber, Executor(2));
    ASSERT_NE(mesh, nullptr);
    expect_closed(*mesh);
    EXPECT_LE(largest(*mesh), goal);
    EXPECT_EQ(self_intersections(*mesh, cell), 0u);
    std::size_t on_rim = 0;
    for (const Vec3& p : mesh->position) on_rim += to_rim(p) < 1e-3 * cell ? 1 : 0;
    // Chords as long as their sagittas allow at least, and not even four times as many: edges are halved.
    const double chord = std::sqrt(8.0 * rim * goal), fewest = 2.0 * std::numbers::pi * rim / chord;
    EXPECT_GT(static_cast<double>(on_rim), 0.7 * fewest);
    // A sphere at that error alone takes 4 pi R^2 / (sqrt(3) / 4 e^2) triangles with edges e^2 / 6 = R goal; halving takes up to four times as many.
    const double area = 2.0 * 2.0 * std::numbers::pi * radius * (radius + apart), edge2 = 6.0 * radius * goal;
    EXPECT_LT(static_cast<double>(mesh->triangle_count()), 4.0 * area / (0.25 * std::numbers::sqrt3 * edge2) + static_cast<double>(from.triangle_count()));
    EXPECT_GT(mesh->triangle_count(), last);
    last = mesh->triangle_count();
    const std::uint64_t expected = hash_of(*mesh);
    EXPECT_EQ(hash_of(*division.divide(balls, from, goal, kAnyNumber, Executor(5))), expected);
  }
}

// The inside of a bend that is tight for its thickness is a crease, whose ends are smooth. Even triangles take 4.3 million at the second error.
TEST(LocalDivision, LetsTheCellsOfACurveWithCreasesStayLarge) {
  Primitive curve = wyvill_point(0.28);
  curve.shape = ShapeKind::Curve;
  curve.control = {Vec3(-0.25, -0.1, 0.0), Vec3(-0.1, 0.55, 0.0), Vec3(0.1, -0.55, 0.0), Vec3(0.25, 0.1, 0.0)};
  curve.taper = 0.08 / 0.28;
  for (const double shift : {0.0, 0.004}) {
    const Body body = body_of({{curve, Vec3::Constant(shift)}});
    for (const auto& [error, most] : {std::pair{2e-3, 8000u}, std::pair{6e-4, 32000u}, std::pair{2e-4, 64000u}}) {
      MarchCounts counts;
      const Mesh mesh = march_cubes(body.field, {.lattice = {}, .error = error}, Executor(2), &counts);
      expect_closed(mesh);
      EXPECT_LE(centroid_error(body.field, mesh, Executor(2)), error);
      EXPECT_LT(mesh.triangle_count(), most) << error << ' ' << shift;
      EXPECT_EQ(self_intersections(mesh, 0.02), 0u) << error << ' ' << shift;
    }
  }
}

// Even triangles would be as small everywhere as the smallest feature needs them.
TEST(LocalDivision, LetsTheCellsOfALargeBodyWithSmallFeaturesStayLarge) {
  const std::vector<std::pair<Primitive, Vec3>> parts{{wyvill_point(1.0), Vec3::Zero()}, {wyvill_point(0.12), Vec3(0.5, 0.0, 0.1)}, {wyvill_point(0.08), Vec3(0.48, 0.1, 0.1)}};
  const Body body = body_of(parts);
  constexpr double kError = 1e-3;
  for (const double shift : {0.0, 0.02}) {
    const Vec3 origin = Vec3::Constant(shift);
    MarchCounts counts;
    const Mesh mesh = march_cubes(body.field, {.lattice = {.origin = origin}, .error = kError}, Executor(2), &counts);
    const MeshReport report = expect_closed(mesh);
    EXPECT_LE(centroid_error(body.field, mesh, Executor(2)), kError);
    EXPECT_LE(counts.error, kError);
    EXPECT_EQ(self_intersections(mesh, 0.03), 0u);
    double cell = first_cell(body.field, 0.0);
    Mesh even = march_cubes(body.field, {.lattice = {.origin = origin, .cell = cell}}, Executor(2));
    while (centroid_error(body.field, even, Executor(2)) > kError) {
      cell *= 0.5 * std::numbers::sqrt2;
      even = march_cubes(body.field, {.lattice = {.origin = origin, .cell = cell}}, Executor(2));
    }
    EXPECT_LT(5 * mesh.triangle_count(), even.triangle_count());
    EXPECT_NEAR(report.volume, inspect(even).volume, kError * report.area);
    // An animation gives the meshes of fresh meshers.
    CubeMesher kept;
    Body moved = body_of(parts);
    for (int frame = 0; frame < 3; ++frame) {
      moved.parts[1].position.z() += 0.01;
      moved.place();
      const MarchOptions options{.lattice = {.origin = origin}, .error = kError};
      EXPECT_EQ(hash_of(kept.make(moved.field, options, Executor(1))), hash_of(march_cubes(moved.field, options, Executor(2))));
    }
  }
}

}  // namespace
}  // namespace supple::implicit
