#include "supple/implicit/creases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "mesh/creases/crease_crossings.h"
#include "mesh/creases/crease_nodes.h"
#include "mesh/error_search.h"
#include "supple/core/error.h"
#include "supple/implicit/march_cubes.h"
#include "support/mesh_distance.h"

namespace supple::implicit {
namespace {

using namespace testing;

constexpr double kRadius = 0.454202019;  // of a lone Wyvill point with R = 1
constexpr double kApart = 0.3;           // of each of two centres from their middle

/// Two balls along a tilted axis.
const Vec3 kAxis = Vec3(0.8, 0.36, 0.48);
Body two_balls(double weight, double apart = kApart) {
  Body body = body_of({{wyvill_point(1.0), apart * kAxis}, {wyvill_point(1.0), -apart * kAxis}});
  body.skeleton.blend = {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, weight}}};
  body.place();
  return body;
}

Lattice lattice_of(double cell) { return {.origin = Vec3(0.013, -0.007, 0.004), .cell = cell}; }

/// Distances from the circle where the two balls meet to a mesh: RMS and largest.
struct CreaseError {
  double rms = 0.0, largest = 0.0;
};
CreaseError crease_error(const Mesh& mesh, double cell) {
  const supple::testing::MeshDistance distance(mesh, cell);
  const Vec3 u = kAxis.unitOrthogonal(), v = kAxis.cross(u);
  const double radius = std::sqrt(kRadius * kRadius - kApart * kApart);
  CreaseError error;
  for (int i = 0; i < 1000; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 1000.0;
    const double d = distance(radius * (std::cos(angle) * u + std::sin(angle) * v));
    error.rms += d * d / 1000.0;
    error.largest = std::max(error.largest, d);
  }
  error.rms = std::sqrt(error.rms);
  return error;
}

TEST(Creases, LieOnTheCircleWhereTwoBallsMeet) {
  const Body body = two_balls(0.0);
  for (const double cell : {0.08, 0.04}) {
    const Mesh mesh = march_creases(body.field, {.lattice = lattice_of(cell)}, Executor(2));
    const MeshReport report = inspect(mesh);
    EXPECT_TRUE(report.closed && report.oriented);
    EXPECT_EQ(report.components, 1u);
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_EQ(self_intersections(mesh, cell), 0u);
    const CreaseError sharp = crease_error(mesh, cell);
    const CreaseError cut = crease_error(march_cubes(body.field, {.lattice = lattice_of(cell)}, Executor(2)), cell);
    EXPECT_LT(4.0 * sharp.rms, cut.rms);
    EXPECT_LT(sharp.rms, 0.06 * cell);
    EXPECT_LT(sharp.largest, 0.3 * cell);  // where the crease only grazes a cell
    // One vertex in each cell that the circle passes, at most sqrt(3) a cell of its length, where edges are turned onto it; with one more in each
    // edge where they are cut instead, which few are.
    const auto on_circle = static_cast<double>(std::count_if(mesh.position.begin(), mesh.position.end(), [](const Vec3& p) { return std::abs(p.dot(kAxis)) < 1e-9; }));
    const double rim = std::sqrt(kRadius * kRadius - kApart * kApart);
    EXPECT_LT(on_circle, 1.5 * std::sqrt(3.0) * 2.0 * std::numbers::pi * rim / cell);
    // Two caps of height kRadius + kApart, less at most the sagitta of a cell's diagonal all over.
    const double cap = kRadius + kApart, exact = 2.0 * std::numbers::pi * cap * cap * (3.0 * kRadius - cap) / 3.0;
    EXPECT_LT(report.volume, exact);
    EXPECT_GT(report.volume, exact - report.area * 3.0 * cell * cell / (8.0 * kRadius));
    std::vector<double> values(mesh.vertex_count());
    body.field.evaluate(mesh.position, values);
    for (const double f : values) ASSERT_NEAR(f, 0.0, 1e-9);
    for (const Vec3& n : mesh.normal) ASSERT_NEAR(n.norm(), 1.0, 1e-12);
  }
}

// Cells on both sides of such a plane see the same points of the crease, and vertices of the lattice lie on it.
TEST(Creases, AlongAPlaneOfTheLatticeHaveNoVerticesInOnePlace) {
  struct Row {
    int count;
    double support, apart;  // half of the distance
  };
  for (const auto& [count, support, apart] : {Row{2, 1.0, kApart}, Row{4, 1.0, kApart}, Row{4, 0.4, 0.1}}) {
    const double radius = kRadius * support;
    std::vector<std::pair<Primitive, Vec3>> balls;
    for (int i = 0; i < count; ++i) balls.emplace_back(wyvill_point(support), Vec3(2.0 * apart * i - apart * (count - 1), 3.0, 0.0));
    Body body = body_of(balls);
    body.skeleton.blend = {.rule = BlendRule::Graph};
    body.place();
    for (const double cell : {0.05, 0.03125, 0.015}) {
      const Mesh mesh = march_creases(body.field, {.lattice = {.origin = Vec3::Zero(), .cell = cell}}, Executor(2));
      const MeshReport report = inspect(mesh);
      EXPECT_TRUE(report.closed && report.oriented) << cell;
      EXPECT_EQ(report.euler_characteristic, 2) << cell;
      EXPECT_EQ(self_intersections(mesh, cell), 0u) << cell;
      double least = cell * cell;
      for (const auto& t : mesh.triangle) {
        const Vec3& p = mesh.position[t[0]];
        least = std::min(least, 0.5 * (mesh.position[t[1]] - p).cross(mesh.position[t[2]] - p).norm());
      }
      EXPECT_GT(least, 0x1p-20 * 1e-2 * cell * cell) << cell;  // two edges of 2^-17 of a cell and of a hundredth of it may meet
      // Caps of a ball at both ends and slices between, less at most the sagitta of a cell's diagonal all over.
      const double cap = radius + apart, slice = 2.0 * apart;
      const double exact = 2.0 * std::numbers::pi * cap * cap * (3.0 * radius - cap) / 3.0 +
                           (count - 2) * std::numbers::pi * slice * (radius * radius - slice * slice / 12.0);
      EXPECT_LT(report.volume, exact);
      EXPECT_GT(report.volume, exact - report.area * 3.0 * cell * cell / (8.0 * radius));
    }
  }
}

/// Distance to the surface of two balls of a radius, `apart` from their middle along an axis, united.
double distance_to_two_balls(const Vec3& p, const Vec3& axis, double radius, double apart) {
  const double along = p.dot(axis), rim = std::sqrt(radius * radius - apart * apart);
  const double to_boundary = std::hypot(along, (p - along * axis).norm() - rim);
  const Vec3 from = p - std::copysign(apart, along) * axis;
  // The foot on the ball of this side is on the surface where it stays on this side of the middle plane.
  const double foot = std::copysign(apart, along) + radius * from.dot(axis) / from.norm();
  return (foot > 0.0) == (along > 0.0) ? std::min(to_boundary, std::abs(from.norm() - radius)) : to_boundary;
}
double distance_to_two_balls(const Vec3& p, double apart) { return distance_to_two_balls(p, kAxis, kRadius, apart); }

// Beside the crease as elsewhere, the error falls with the square of the cell: no edge crosses the crease without a vertex there.
TEST(Creases, AreMetToSecondOrder) {
  for (const double apart : {0.1, 0.3}) {
    const Body body = two_balls(0.0, apart);
    for (const double cell : {0.04, 0.02, 0.01}) {
      const Mesh mesh = march_creases(body.field, {.lattice = lattice_of(cell)}, Executor(2));
      const MeshReport report = inspect(mesh);
      EXPECT_TRUE(report.closed && report.oriented);
      EXPECT_EQ(report.euler_characteristic, 2);
      EXPECT_EQ(self_intersections(mesh, cell), 0u) << cell;
      double largest = 0.0;
      for (const auto& t : mesh.triangle) {
        largest = std::max(largest, distance_to_two_balls((mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0, apart));
      }
      // A triangle with corners on a ball lies within r^2 / (2 R) of it, r its circumradius: below sqrt(3) / 2 cells in a cell.
      EXPECT_LT(largest, 0.75 * cell * cell / (2.0 * kRadius)) << apart << ' ' << cell;
    }
  }
}

/// Edges between vertices on either side of a plane through the origin.
std::size_t edges_across(const Mesh& mesh, const Vec3& normal, double on_plane) {
  std::size_t count = 0;
  for (const auto& t : mesh.triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      count += mesh.position[t[k]].dot(normal) > on_plane && mesh.position[t[(k + 1) % 3]].dot(normal) < -on_plane ? 1 : 0;
    }
  }
  return count;
}

// Two balls that meet at the bottom of a valley with walls that lean this little from the vertical: cells bridge it a cell and more above.
TEST(Creases, AreMetInSteepValleys) {
  constexpr double kBoundary = 1.0, kCell = 0.125;
  Random random(5);
  for (const double degrees : {26.0, 22.0, 18.0, 26.0, 22.0, 18.0, 22.0, 18.0}) {
    const double lean = degrees * std::numbers::pi / 180.0, ball = kBoundary / std::sin(lean), apart = kBoundary / std::tan(lean);
    const Vec3 axis = random.direction(), u = axis.unitOrthogonal(), v = axis.cross(u);
    Body body = body_of({{wyvill_point(ball / kRadius), apart * axis}, {wyvill_point(ball / kRadius), -apart * axis}});
    body.skeleton.blend = {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, 0.0}}};
    body.place();
    const Mesh mesh = march_creases(body.field, {.lattice = {.origin = random.in_box(kCell), .cell = kCell}}, Executor(2));
    const MeshReport report = inspect(mesh);
    EXPECT_TRUE(report.closed && report.oriented);
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_EQ(self_intersections(mesh, kCell), 0u) << degrees;
    EXPECT_EQ(edges_across(mesh, axis, 1e-6 * kCell), 0u) << degrees;
    EXPECT_EQ(2 * mesh.vertex_count(), mesh.triangle_count() + 4);  // none is left over
    const supple::testing::MeshDistance distance(mesh, kCell);
    double largest = 0.0;
    for (int i = 0; i < 1000; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / 1000.0;
      largest = std::max(largest, distance(kBoundary * (std::cos(angle) * u + std::sin(angle) * v)));
    }
    EXPECT_LT(largest, 9.0 * kCell * kCell / (8.0 * kBoundary)) << degrees;  // the sagitta of a chord of three cells
  }
}

// Two capsules that cross, one a little above the other, so that their creases do not: the valley is steep at the sharp angle.
TEST(Creases, AreMetWhereCapsulesCross) {
  constexpr double kCell = 0.04;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed);
    const double angle = 0.15 + 0.02 * static_cast<double>(seed);
    const Quat turn = random.rotation();
    Primitive one = wyvill_point(0.8);
    one.shape = ShapeKind::Segment;
    one.size = Vec3(1.5, 0.0, 0.0);
    Primitive other = one;
    one.offset.orientation = turn * Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ()));
    other.offset.orientation = turn * Quat(Eigen::AngleAxisd(-angle, Vec3::UnitZ()));
    Body body = body_of({{one, Vec3::Zero()}, {other, turn * Vec3(0.0, 0.0, 0.1)}});
    body.skeleton.blend = {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, 0.0}}};
    body.place();
    const Mesh mesh = march_creases(body.field, {.lattice = {.origin = random.in_box(kCell), .cell = kCell}}, Executor(2));
    const MeshReport report = inspect(mesh);
    EXPECT_TRUE(report.closed && report.oriented);
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_EQ(self_intersections(mesh, kCell), 0u) << seed;
  }
}

/// Closed, oriented, of the topology of marching cubes, and nothing crosses. @return cells whose crease stays cut off
std::uint64_t expect_apart(Body& body, const Lattice& lattice) {
  MarchCounts counts;
  const Mesh mesh = march_creases(body.field, {.lattice = lattice}, Executor(1), &counts);
  const MeshReport report = inspect(mesh), cut_off = inspect(march_cubes(body.field, {.lattice = lattice}, Executor(1)));
  EXPECT_TRUE(report.closed && report.oriented);
  EXPECT_EQ(report.components, cut_off.components);
  EXPECT_EQ(report.euler_characteristic, cut_off.euler_characteristic);
  EXPECT_EQ(static_cast<long>(mesh.vertex_count()) - static_cast<long>(mesh.triangle_count() / 2), report.euler_characteristic);  // none is left over
  EXPECT_EQ(self_intersections(mesh, lattice.cell), 0u);
  if (counts.blunt_cells > 0) {  // what is kept, and on other threads
    EXPECT_EQ(hash_of(march_creases(body.field, {.lattice = lattice}, Executor(3))), hash_of(mesh));
    CreaseMesher mesher;
    (void)mesher.make(body.field, {.lattice = lattice}, Executor(1));
    const Vec3 place = body.parts[0].position;
    body.parts[0].position += Vec3::Constant(0.1 * lattice.cell);
    body.place();
    const std::uint64_t kept = hash_of(mesher.make(body.field, {.lattice = lattice}, Executor(2)));
    EXPECT_EQ(kept, hash_of(march_creases(body.field, {.lattice = lattice}, Executor(1))));
    body.parts[0].position = place;
    body.place();
    EXPECT_EQ(hash_of(mesher.make(body.field, {.lattice = lattice}, Executor(2))), hash_of(mesh));
  }
  return counts.blunt_cells;
}

/// Two balls that meet in a circle of radius 1, their surfaces at twice an angle there.
Body valley(double degrees, const Vec3& axis) {
  const double lean = degrees * std::numbers::pi / 180.0, ball = 1.0 / std::sin(lean), apart = 1.0 / std::tan(lean);
  Body body = body_of({{wyvill_point(ball / kRadius), apart * axis}, {wyvill_point(ball / kRadius), -apart * axis}});
  body.skeleton.blend = {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, 0.0}}};
  body.place();
  return body;
}

TEST(CreasesNeverCross, InValleys) {
  std::uint64_t blunt = 0;
  for (const double degrees : {3.0, 5.0, 8.0, 11.0, 14.0, 20.0}) {
    for (std::uint64_t pose = 0; pose < (degrees < 6.0 ? 2u : 4u); ++pose) {
      SCOPED_TRACE(::testing::Message() << degrees << ' ' << pose);
      Random random(pose + static_cast<std::uint64_t>(100.0 * degrees));
      const double cell = degrees < 6.0 ? 0.25 : std::array{0.11, 0.125, 0.15, 0.2}[pose];
      Body body = valley(degrees, random.direction());
      blunt += expect_apart(body, {.origin = random.in_box(cell), .cell = cell});
    }
  }
  EXPECT_GT(blunt, 0u);
}

TEST(CreasesNeverCross, WhereThreeBallsMeetInACell) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    SCOPED_TRACE(seed);
    Random random(77 + seed);
    const Quat turn = random.rotation();
    std::vector<std::pair<Primitive, Vec3>> balls;
    for (int k = 0; k < 3; ++k) {
      const Quat third(Eigen::AngleAxisd(2.0 * std::numbers::pi * k / 3.0, Vec3::UnitZ()));
      balls.emplace_back(wyvill_point(1.0), turn * (third * Vec3(random.uniform(0.25, 0.3), 0.0, 0.0)));
    }
    Body body = body_of(balls);
    body.skeleton.blend.rule = BlendRule::Graph;
    body.place();
    for (const double cell : {0.03, 0.06, 0.1}) (void)expect_apart(body, {.origin = random.in_box(cell), .cell = cell});
  }
}

// Each pair of three capsules about the same place has a crease of its own, and these cross.
TEST(CreasesNeverCross, WhereThreeCapsulesDo) {
  std::uint64_t blunt = 0;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    Random random(177 + seed);
    const Quat turn = random.rotation();
    const double angle = random.uniform(0.1, 1.2);
    std::vector<std::pair<Primitive, Vec3>> capsules;
    for (const auto& [by, axis] : {std::pair{0.0, Vec3(Vec3::UnitZ())}, std::pair{angle, Vec3(Vec3::UnitZ())}, std::pair{-angle, Vec3(Vec3::UnitY())}}) {
      Primitive one = wyvill_point(0.8);
      one.shape = ShapeKind::Segment;
      one.size = Vec3(1.5, 0.0, 0.0);
      one.offset.orientation = turn * Quat(Eigen::AngleAxisd(by, axis));
      capsules.emplace_back(one, random.in_box(0.02));
    }
    Body body = body_of(capsules);
    body.skeleton.blend.rule = BlendRule::Graph;
    body.place();
    for (const double cell : {0.04, 0.08}) blunt += expect_apart(body, {.origin = random.in_box(cell), .cell = cell});
  }
  EXPECT_GT(blunt, 0u);
}

TEST(CreasesNeverCross, WhateverTheBody) {
  std::uint64_t blunt = 0;
  for (std::uint64_t seed = 1; seed <= 120; ++seed) {
    for (const bool points : {true, false}) {
      SCOPED_TRACE(::testing::Message() << seed << ' ' << points);
      const std::uint32_t parts = points ? 8 : 10;
      Body body = random_body({.seed = seed, .parts = parts, .half_width = points ? 0.5 : 0.6, .only_points = points});
      Random random(seed);
      body.skeleton.blend.rule = BlendRule::Graph;
      for (std::uint32_t a = 0; a < parts; ++a) {
        for (std::uint32_t b = a + 1; b < parts; ++b) {
          if (random.below(3) == 0) body.skeleton.blend.edge.push_back({a, b, random.below(2) == 0 ? 1.0 : 0.4});
        }
      }
      body.place();
      const double cell = std::array{0.05, 0.07, 0.12}[seed % 3];
      blunt += expect_apart(body, {.origin = random.in_box(cell), .cell = cell});
    }
  }
  EXPECT_GT(blunt, 0u);
}

// A step after the other is taken back where what it had replaced crosses, too, and with a step all that came to replace what it made.
TEST(CreasesNeverCross, TakesBackWhatCrossesStepByStep) {
  using Triangle = TriangleSteps::Triangle;
  // Level triangles one above the other, with corners 3 k, 3 k + 1, 3 k + 2 at height k, and upright ones through some of them.
  std::vector<Vec3> position;
  for (int k = 0; k < 6; ++k) {
    for (const Vec3& corner : {Vec3(0, 0, k), Vec3(3, 0, k), Vec3(0, 3, k)}) position.push_back(corner);
  }
  const auto upright = [&](double x, double low, double high) {
    const auto first = static_cast<std::uint32_t>(position.size());
    for (const Vec3& corner : {Vec3(x, 0.3, low), Vec3(x, 0.3, high), Vec3(x, 0.5, high)}) position.push_back(corner);
    return Triangle{first, first + 1, first + 2};
  };
  const auto level = [](std::uint32_t k) { return Triangle{3 * k, 3 * k + 1, 3 * k + 2}; };
  const Triangle apart = upright(0.3, 2.2, 2.8), through = upright(0.3, 1.5, 2.5), sibling = upright(0.5, 5.5, 5.8), through_too = upright(0.7, 0.5, 1.5),
                 far = upright(0.9, 5.5, 5.8), later = upright(1.1, 5.5, 5.8);
  TriangleSteps steps({level(1), level(2), apart, far});
  const std::uint32_t a = steps.replace(std::array{2u}, std::vector{through, sibling});
  const std::uint32_t b = steps.replace(std::array{a}, std::vector{through_too});
  const std::uint32_t c = steps.replace(std::array{a + 1}, std::vector{later});
  const std::uint32_t d = steps.replace(std::array{3u}, std::vector{upright(1.3, 3.2, 3.8)});
  ASSERT_TRUE(steps.is_there(b) && steps.is_there(c) && steps.is_there(d) && !steps.is_there(a) && !steps.is_there(2));
  CrossingMemory memory;
  const Mesh mesh{.position = position, .normal = position, .triangle = {}, .columns = {}};
  EXPECT_EQ(take_back_crossings(mesh, std::vector<bool>(4, true), 1.0, memory, steps), (std::vector<std::uint32_t>{2}));
  EXPECT_EQ(steps.numbers(), (std::vector<std::uint32_t>{0, 1, 2, d}));
}

// Where steps are taken back, the error is that of the remaining mesh; a smaller given error leads to finer cells.
TEST(CreasesNeverCross, ToAnErrorEither) {
  constexpr double kDegrees = 8.0, kCell = 0.125;
  const double apart = 1.0 / std::tan(kDegrees * std::numbers::pi / 180.0), ball = std::hypot(1.0, apart);
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 12 && found < 2; ++seed) {
    Random random(seed);
    const Vec3 axis = random.direction();
    const Body body = valley(kDegrees, axis);
    const MarchOptions coarse{.lattice = {.origin = random.in_box(kCell), .cell = kCell}};
    MarchCounts counts;
    const auto error_of = [&](const Mesh& mesh) {
      double largest = 0.0;
      for (const auto& t : mesh.triangle) {
        largest = std::max(largest, distance_to_two_balls((mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0, axis, ball, apart));
      }
      return largest;
    };
    const double reached = error_of(march_creases(body.field, coarse, Executor(2), &counts));
    if (counts.blunt_cells == 0) continue;
    ++found;
    const double error = 0.9 * reached;
    const Mesh finer = march_creases(body.field, {.lattice = coarse.lattice, .error = error}, Executor(2), &counts);
    EXPECT_LT(counts.cell, kCell);
    EXPECT_LE(error_of(finer), error);
    EXPECT_EQ(self_intersections(finer, counts.cell), 0u);
  }
  EXPECT_EQ(found, 2);
}

// A chain whose neighbours blend and whose other particles are too far apart to: its field is the plain sum, smooth where the largest node
// changes, and so are the normals there.
TEST(Creases, BendNoNormalsWhereNodesBlendWholly) {
  std::vector<std::pair<Primitive, Vec3>> chain;
  for (int k = 0; k < 6; ++k) chain.push_back({wyvill_point(1.0), 0.45 * k * kAxis});
  const Body sum = body_of(chain);
  Body body = body_of(chain);
  body.skeleton.blend.rule = BlendRule::Graph;
  for (std::uint32_t i = 0; i < 6; ++i) {
    for (std::uint32_t j = i + 1; j < std::min(i + 3, 6u); ++j) body.skeleton.blend.edge.push_back({i, j, 1.0});
  }
  body.place();
  const Mesh mesh = march_creases(body.field, {.lattice = lattice_of(0.1)}, Executor(2));
  std::vector<double> value(mesh.position.size());
  std::vector<Vec3> gradient(mesh.position.size());
  sum.field.evaluate(mesh.position, value, gradient);
  for (std::size_t v = 0; v < mesh.position.size(); ++v) {
    EXPECT_NEAR(value[v], 0.0, 1e-9);
    EXPECT_LT((mesh.normal[v] + gradient[v].normalized()).norm(), 1e-6) << v;
  }
}

// Both ways, though only the centroids are promised: a chord's middle lies 9/8 times as far as its triangle's centroid, and at the crease the
// circle bends by kRadius / rim times as much as the balls.
TEST(Creases, ReachTheErrorThatIsAskedFor) {
  const Body body = two_balls(0.0);
  const Vec3 u = kAxis.unitOrthogonal(), v = kAxis.cross(u);
  const double rim = std::sqrt(kRadius * kRadius - kApart * kApart);
  std::size_t last = 0;
  for (const double error : {1e-2, 1e-3, 1e-4}) {
    MarchCounts counts;
    const Mesh mesh = march_creases(body.field, {.lattice = lattice_of(0.0), .error = error}, Executor(2), &counts);
    const MeshReport report = inspect(mesh);
    EXPECT_TRUE(report.closed && report.oriented);
    double there = 0.0, back = 0.0;
    for (const auto& t : mesh.triangle) {
      there = std::max(there, distance_to_two_balls((mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0, kApart));
    }
    EXPECT_LE(there, error);
    EXPECT_NEAR(there, counts.error, 0.1 * there);
    EXPECT_GT(there, 0.25 * error);
    const supple::testing::MeshDistance distance(mesh, counts.cell);
    for (int i = 0; i < 4000; ++i) {
      const double angle = 2.399963 * i, z = (kApart + kRadius) * (2.0 * (i + 0.5) / 4000.0 - 1.0);
      const double across = std::sqrt(std::max(kRadius * kRadius - std::pow(std::abs(z) - kApart, 2), 0.0));
      const Vec3 turn = std::cos(angle) * u + std::sin(angle) * v;
      back = std::max({back, distance(z * kAxis + across * turn), distance(rim * turn)});
    }
    EXPECT_LE(back, 2.0 * kRadius / rim * error) << error;
    EXPECT_GT(mesh.triangle_count(), 2 * last);
    last = mesh.triangle_count();
  }
  // A stated cell is the coarsest.
  const Mesh stated = march_creases(body.field, {.lattice = lattice_of(0.03), .error = 0.1}, Executor(1));
  EXPECT_EQ(hash_of(stated), hash_of(march_creases(body.field, {.lattice = lattice_of(0.03)}, Executor(1))));
}

// Two small balls in a large one, which meets the error with the triangles that it has: the small ones alone are divided, and the creases around them.
TEST(Creases, LetTheCellsOfALargeBodyWithSmallFeaturesStayLarge) {
  constexpr double kError = 1e-3;
  Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}, {wyvill_point(0.16), Vec3(0.46, 0.0, 0.02)}, {wyvill_point(0.12), Vec3(-0.3, 0.36, 0.0)}});
  body.skeleton.blend.rule = BlendRule::Graph;
  body.place();
  MarchCounts counts;
  const Mesh mesh = march_creases(body.field, {.lattice = {}, .error = kError}, Executor(2), &counts);
  const MeshReport report = expect_closed(mesh);
  EXPECT_LE(centroid_error(body.field, mesh, Executor(2)), kError);
  EXPECT_LE(counts.error, kError);
  EXPECT_EQ(self_intersections(mesh, 0.03), 0u);
  double cell = first_cell(body.field, 0.0);
  const auto even_on = [&] { return march_creases(body.field, {.lattice = {.origin = Vec3::Zero(), .cell = cell}}, Executor(2)); };
  Mesh even = even_on();
  for (; centroid_error(body.field, even, Executor(2)) > kError; even = even_on()) cell *= 0.5 * std::numbers::sqrt2;
  EXPECT_LT(3 * mesh.triangle_count(), even.triangle_count());
  EXPECT_NEAR(report.volume, inspect(even).volume, kError * report.area);
  std::vector<double> value(mesh.vertex_count());
  body.field.evaluate(mesh.position, value);
  for (const double f : value) ASSERT_NEAR(f, 0.0, 1e-9);
  EXPECT_EQ(hash_of(march_creases(body.field, {.lattice = {}, .error = kError}, Executor(5))), hash_of(mesh));
}

TEST(Creases, AreTheSurfaceOfOtherMeshersForAnyGraph) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Body body = random_body({.seed = seed, .parts = 8, .half_width = 0.5, .only_points = true});
    Random random(seed);
    body.skeleton.blend.rule = BlendRule::Graph;
    for (std::uint32_t a = 0; a < 8; ++a) {
      for (std::uint32_t b = a + 1; b < 8; ++b) {
        if (random.below(3) > 0) body.skeleton.blend.edge.push_back({a, b, random.below(2) == 0 ? 1.0 : 0.4});
      }
    }
    body.place();
    const double cell = 0.03;
    const Mesh mesh = march_creases(body.field, {.lattice = lattice_of(cell)}, Executor(1));
    const MeshReport report = inspect(mesh);
    EXPECT_TRUE(report.closed && report.oriented) << seed;
    const Mesh plain = polygonise(body.field, lattice_of(cell), Executor(1));
    const MeshReport expected = inspect(plain);
    EXPECT_EQ(report.components, expected.components) << seed;
    EXPECT_NEAR(report.volume, expected.volume, 0.1 * cell * expected.area) << seed;
    std::vector<double> values(mesh.vertex_count());
    std::vector<Vec3> gradients(mesh.vertex_count());
    body.field.evaluate(mesh.position, values, gradients);
    const supple::testing::MeshDistance distance(plain, cell);
    for (std::size_t v = 0; v < values.size(); ++v) {
      ASSERT_LT(distance(mesh.position[v]), 2.0 * cell) << seed;
      ASSERT_LT(std::abs(values[v]), 1e-4 * cell * gradients[v].norm()) << seed;
    }
  }
}

// By sums of all nodes at a point or by the field of each node alone; of nodes with the same value the first.
TEST(Creases, HaveTheNodeWhoseFieldIsTheLargest) {
  std::uint64_t ties = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    Body body = random_body({.seed = seed, .parts = 24, .half_width = 0.5});
    Random random(seed);
    body.skeleton.blend.rule = BlendRule::Graph;
    for (std::uint32_t k = 0; k < 22; ++k) body.skeleton.blend.node.push_back(2 * ((7 * k) % 9));  // none of odd numbers
    body.skeleton.blend.node.insert(body.skeleton.blend.node.end(), {30, 28});
    body.skeleton.primitive[23] = body.skeleton.primitive[22];
    body.skeleton.primitive[23].part = 23;
    body.parts[23] = body.parts[22];
    for (std::uint32_t a = 0; a < 18; a += 2) {
      for (std::uint32_t b = a + 2; b < 18; b += 2) {
        if (random.below(3) == 0) body.skeleton.blend.edge.push_back({a, b, random.below(2) == 0 ? 1.0 : 0.4});
      }
    }
    body.place();
    const Mesh mesh = march_cubes(body.field, {.lattice = lattice_of(0.06)}, Executor(1));
    const std::vector<Box> supports = node_supports(body.field.index());
    std::vector<std::uint32_t> nodes, expected(mesh.vertex_count());
    std::vector<double> best(mesh.vertex_count(), -1e300), value(mesh.vertex_count());
    for (std::uint32_t k = 0; k < supports.size(); ++k) {
      if (supports[k].empty()) continue;
      NodeField(body.field, k, supports[k]).evaluate(mesh.position, value);
      for (std::size_t v = 0; v < value.size(); ++v) {
        if (value[v] == best[v] && value[v] > -0.1) ++ties;
        if (value[v] > best[v]) {
          best[v] = value[v];
          expected[v] = static_cast<std::uint32_t>(nodes.size());
        }
      }
      nodes.push_back(k);
    }
    EXPECT_EQ(largest_nodes(body.field, nodes, mesh.position, Executor(2)), expected) << seed;
    body.field.evaluate(mesh.position, value);
    for (std::size_t v = 0; v < value.size(); ++v) EXPECT_NEAR(best[v], value[v], 1e-14 * 24);
  }
  EXPECT_GT(ties, 0u);
}

// Balls so dense that most edges across a crease cannot be mended, and that others next to them are in a later pass.
TEST(Creases, AreTheSameWhereAttemptsThatWouldFailAgainAreMade) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Body body = random_body({.seed = seed, .parts = 150, .half_width = 0.6, .least_radius = 0.3, .largest_radius = 0.45, .only_points = true});
    body.skeleton.blend.rule = BlendRule::Graph;
    body.place();
    for (const double cell : {0.03, 0.05}) {
      const MarchOptions options{.lattice = lattice_of(cell)}, all{.lattice = options.lattice, .skip = false};
      EXPECT_EQ(hash_of(march_creases(body.field, options, Executor(2))), hash_of(march_creases(body.field, all, Executor(2)))) << seed << ' ' << cell;
    }
  }
}

TEST(Creases, DoNotDependOnThreads) {
  const Body body = two_balls(0.5);
  const std::uint64_t expected = hash_of(march_creases(body.field, {.lattice = lattice_of(0.05)}, Executor(1)));
  for (const int threads : {2, 8}) {
    EXPECT_EQ(hash_of(march_creases(body.field, {.lattice = lattice_of(0.05)}, Executor(threads))), expected);
  }
}

TEST(Creases, AreWhereNodesMeetWithoutBlending) {
  EXPECT_TRUE(has_creases(two_balls(0.0).field));
  EXPECT_TRUE(has_creases(two_balls(0.9).field));
  EXPECT_FALSE(has_creases(two_balls(1.0).field));
  Body body = two_balls(0.0);
  body.skeleton.blend.node = {0, 0};
  body.skeleton.blend.edge.clear();
  body.place();
  EXPECT_FALSE(has_creases(body.field));  // one node
  body = two_balls(0.0);
  body.skeleton.blend = {};
  body.place();
  EXPECT_FALSE(has_creases(body.field));  // a sum
  EXPECT_THROW((void)march_creases(body.field, {.lattice = lattice_of(0.1)}, Executor(1)), ContractViolation);
  const Body apart = [] {
    Body far = body_of({{wyvill_point(1.0), Vec3::Zero()}, {wyvill_point(1.0), Vec3(2.5, 0, 0)}});
    far.skeleton.blend = {.rule = BlendRule::Graph};
    far.place();
    return far;
  }();
  EXPECT_FALSE(has_creases(apart.field));
}

}  // namespace
}  // namespace supple::implicit
