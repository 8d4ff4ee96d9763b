#include "supple/implicit/mesh_solid.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <thread>
#include <utility>
#include <vector>

#include "solids/exact_distance.h"
#include "supple/core/error.h"
#include "supple/core/math.h"
#include "supple/implicit/solids.h"
#include "support/closed_meshes.h"

namespace supple::implicit {
namespace {

using test::block, test::both, test::gear, test::octahedral_sphere, test::places;

const Quat kTurn(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));

double value(const MeshSolid& solid, const Vec3& x) { return FieldView(solid).value(x); }

/// Cells along the longest side.
constexpr double kCells = 128.0;

TEST(MeshSolid, IsNearTheExactDistance) {
  // Weights of a cubic B-spline have a mean square distance of a cell from the point of evaluation, and a distance changes by the way at most.
  for (const Mesh& mesh : {block(Vec3(0.5, 0.3, 0.2)), gear(24, 0.4, 0.5, 0.1), octahedral_sphere(0.5, 4),
                           both(block(Vec3(0.5, 0.02, 0.02)), block(Vec3(0.02, 0.5, 0.001)))}) {
    const MeshSolid solid(mesh, {.slope = 1.0});
    const ExactDistance exact(closed_surface(mesh));
    const double cell = solid.report().size / kCells;
    double most = 0.0;
    for (const Vec3& x : places({Vec3::Constant(-0.6), Vec3::Constant(0.6)}, 4000)) {
      const double distance = std::min(exact.at(x, nullptr), 6.0 * cell);
      EXPECT_LE(std::abs(value(solid, x) + distance), 1.0001 * cell) << x.transpose();
    }
    exact.each_place(3000, [&](const Vec3& x, const Vec3&) { most = std::max(most, std::abs(value(solid, x))); });
    EXPECT_LE(most, 1.1 * solid.report().deviation);  // of other places
    EXPECT_GE(most, 0.3 * solid.report().deviation);  // which may miss corners
    EXPECT_LE(solid.report().deviation, 0.75 * cell + exact.surface().deviation);  // where it would be more, the exact distance counts
  }
}

TEST(MeshSolid, IsTheSameInAnyUnitOfLength) {
  // Powers of two near 1e-50, 1e-18, 1e-9, 1e18 and 1e50: nothing is rounded otherwise.
  const MeshSolid solid(octahedral_sphere(1.0, 3), {.slope = 1.0});
  for (const int power : {-166, -60, -30, 60, 166}) {
    const double scale = std::ldexp(1.0, power);
    const MeshSolid scaled(octahedral_sphere(scale, 3), {.slope = 1.0});
    for (const Vec3& u : places({Vec3::Constant(-1.02), Vec3::Constant(1.02)}, 40)) {
      EXPECT_EQ(value(scaled, scale * u), scale * value(solid, u)) << power;
    }
  }
}

TEST(MeshSolid, IsTheSameInAnyOrderOfQuestionsByAnyThreads) {
  const Mesh mesh = gear(24, 0.4, 0.5, 0.1);
  const std::vector<Vec3> asked = places({Vec3::Constant(-0.6), Vec3::Constant(0.6)}, 2000);
  std::vector<double> expected;
  {
    const MeshSolid solid(mesh, {.slope = 1.0});
    for (const Vec3& x : asked) expected.push_back(value(solid, x));
  }
  const MeshSolid other(mesh, {.slope = 1.0});  // with a distance of its own, as the other one is gone
  std::vector<std::vector<double>> found(4, std::vector<double>(asked.size()));
  std::vector<std::thread> threads;
  for (std::vector<double>& own : found) {
    threads.emplace_back([&] {
      for (std::size_t k = asked.size(); k-- > 0;) own[k] = value(other, asked[k]);
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const std::vector<double>& own : found) EXPECT_EQ(own, expected);
}

TEST(MeshSolid, SharesTheDistanceOfEqualMeshes) {
  const Mesh mesh = gear(24, 0.4, 0.5, 0.1);
  const MeshSolid solid(mesh, {.slope = 1.0}), moved(mesh, {.slope = 2.0, .pose = {Vec3(1, 2, 3), kTurn}}), other(gear(25, 0.4, 0.5, 0.1), {.slope = 1.0});
  EXPECT_TRUE(share_distance(solid, moved));
  EXPECT_FALSE(share_distance(solid, other));
}

TEST(MeshSolid, IsExactBesideFlatFaces) {
  const Vec3 half(0.5, 0.4, 0.3), at(0.3, -0.2, 0.1);
  const MeshSolid solid(block(half), {.slope = 3.0, .pose = {at, kTurn}});
  const double cell = 1.0 / kCells;
  // The spline mixes nodes of two cells around; they are kept in single precision.
  for (const Vec3& local : places({-Vec3(0.4, 0.3, 0.3 + 3.9 * cell), Vec3(0.4, 0.3, -0.3 + 10.0 * cell)}, 500)) {
    EXPECT_NEAR(value(solid, at + kTurn * local), 3.0 * (local.z() + 0.3), 3.0 * 1e-8) << local.transpose();
  }
}

TEST(MeshSolid, IsExactWhereItIsThin) {
  for (const double thickness : {0.008, 1e-3, 1e-5}) {
    for (const bool turned : {false, true}) {
      const Vec3 half(0.5, 0.4, 0.5 * thickness);
      const MeshSolid solid(block(half, Vec3::Zero(), turned), {.slope = 3.0, .pose = {Vec3::Zero(), kTurn}});
      const SolidBox box({Vec3::Zero(), kTurn}, half, 0.0, 3.0);
      EXPECT_NEAR(solid.feature_size(), thickness, 1e-9);
      for (const Vec3& local : places({-1.0 * half, half}, 1000)) {
        EXPECT_NEAR(value(solid, kTurn * local), FieldView(box).value(kTurn * local), 1e-14) << local.transpose();
      }
    }
  }
  // A gap of half a millimetre between blocks.
  const MeshSolid pair(both(block(Vec3(0.2, 0.2, 0.2)), block(Vec3(0.2, 0.2, 0.2), Vec3(0.4005, 0, 0))), {.slope = 1.0});
  for (const Vec3& x : places({Vec3(0.2, -0.19, -0.19), Vec3(0.2005, 0.19, 0.19)}, 200)) {
    EXPECT_NEAR(value(pair, x), -std::min(x.x() - 0.2, 0.2005 - x.x()), 1e-14);
  }
}

TEST(MeshSolid, HasAnInsideBehindAllFacesOfAShelf) {
  // A block with a shelf of 10 mm, in a mesh of 1.3 m.
  const MeshSolid solid(both(block(Vec3(0.5, 0.5, 0.5)), block(Vec3(0.2, 0.5, 0.005), Vec3(0.6, 0, 0.1))), {.slope = 1.0});
  for (const Vec3& x : places({Vec3(0.51, -0.49, 0.096), Vec3(0.79, 0.49, 0.104)}, 500)) EXPECT_GT(value(solid, x), 0.0009) << x.transpose();
}

TEST(MeshSolid, HasTheGradientAndTheBoundsOfItsValues) {
  const MeshSolid solid(gear(12, 0.3, 0.5, 0.2), {.slope = 2.0, .pose = {Vec3(0.1, 0, 0), kTurn}});
  const double h = 1e-6;
  int compared = 0;
  for (const Vec3& x : places({Vec3::Constant(-0.6), Vec3::Constant(0.6)}, 400)) {
    Vec3 slope;
    const double f = FieldView(solid).value(x, slope);
    Vec3 forward, backward;
    for (int axis = 0; axis < 3; ++axis) {
      forward[axis] = value(solid, x + h * Vec3::Unit(axis)) - f;
      backward[axis] = f - value(solid, x - h * Vec3::Unit(axis));
    }
    // Off the places where the gradient of the exact distance jumps both differences are alike.
    if ((forward - backward).norm() <= 0.1 * h) {
      EXPECT_LT(((forward + backward) / (2.0 * h) - slope).norm(), 1e-4) << x.transpose();
      ++compared;
    }
    EXPECT_LE(slope.norm(), solid.gradient_bound({x, x}));
    const Box box{x - Vec3::Constant(0.04), x + Vec3(0.02, 0.05, 0.03)};
    const Interval bound = solid.bound(box);
    for (const Vec3& y : places(box, 30)) EXPECT_TRUE(bound.contains(value(solid, y)));
    EXPECT_TRUE(f < 0.0 || solid.surface_box().contains(x));
  }
  EXPECT_GT(compared, 350);
  const Interval everywhere = solid.bound({Vec3::Constant(-std::numeric_limits<double>::infinity()), Vec3::Constant(std::numeric_limits<double>::infinity())});
  EXPECT_GE(everywhere.upper, 0.2);  // 2 times half of its height
  EXPECT_LT(everywhere.upper, 0.21);
}

TEST(MeshSolid, DoesNotCountVerticesWithoutATriangle) {
  const Vec3 half(0.5, 0.5, 0.2);
  const MeshSolid solid(block(half), {.slope = 1.0});
  Mesh mesh = block(half);
  mesh.position.insert(mesh.position.begin(), Vec3(100, 100, 100));
  mesh.position.emplace_back(5, 0, 0);
  for (auto& t : mesh.triangle) {
    for (std::uint32_t& v : t) ++v;
  }
  const MeshSolid with_more(mesh, {.slope = 1.0});
  EXPECT_EQ(with_more.report().size, 1.0);
  EXPECT_EQ(with_more.feature_size(), solid.feature_size());
  EXPECT_EQ(with_more.surface_box().upper, solid.surface_box().upper);
  const Box box{Vec3(-0.6, -0.6, -0.3), Vec3(0.6, 0.6, 0.3)};
  EXPECT_EQ(with_more.bound(box).upper, solid.bound(box).upper);
  for (const Vec3& x : places(box, 500)) EXPECT_EQ(value(with_more, x), value(solid, x));
}

void expect_refused(const Mesh& mesh, const std::string& text) {
  try {
    const MeshSolid solid(mesh, {});
    FAIL() << text;
  } catch (const Error& error) {
    EXPECT_EQ(error.faults().at(0).key, "mesh");
    EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
  }
}

TEST(MeshSolid, RefusesWhatEnclosesNothingAndNamesAnEdge) {
  Mesh open = block(Vec3(0.5, 0.5, 0.25));
  open.triangle.erase(open.triangle.begin() + 2);  // {4, 5, 7}
  expect_refused(open, "expected a closed surface, every edge between two triangles, found one triangle at the edge between vertices 5 and 8, counted "
                       "from 1, at (-0.5, -0.5, 0.25) and (0.5, 0.5, 0.25); 2 other edges are open, too; close its holes");
  Mesh wall = block(Vec3(0.5, 0.5, 0.25));  // and one more on an edge
  wall.position.emplace_back(0, 0, 2);
  wall.triangle.push_back({0, 1, 8});
  expect_refused(wall, "found 3 triangles at the edge between vertices 1 and 2, counted from 1");
  expect_refused(Mesh{}, "no triangle");
  Mesh flat;  // a triangle seen from both sides
  flat.position = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
  flat.triangle = {{0, 1, 2}, {0, 2, 1}};
  expect_refused(flat, "expected a closed surface with an inside, found one that encloses nothing");
  // Around an edge of four triangles two must run each way. Of blocks that share it, one may be inside out; one face of a block may not.
  for (const bool inside_out : {false, true}) {
    Mesh twice = both(block(Vec3(0.5, 0.5, 0.5)), block(Vec3(0.5, 0.5, 0.5), Vec3(1.0, 1.0, 0.0), inside_out));
    EXPECT_EQ(MeshSolid(twice, {}).mesh().triangle.size(), 24u);
  }
}

TEST(MeshSolid, RefusesASurfaceWithOneSide) {
  // A Klein bottle: a tube of rings of four, joined to itself with the last ring mirrored.
  constexpr std::uint32_t kRings = 5, kAround = 4;
  Mesh bottle;
  for (std::uint32_t i = 0; i < kRings; ++i) {
    const auto [s, c] = math::sin_cos(2.0 * std::numbers::pi * i / kRings);
    for (std::uint32_t j = 0; j < kAround; ++j) {
      const auto [t, d] = math::sin_cos(2.0 * std::numbers::pi * j / kAround);
      bottle.position.push_back(Vec3((2.0 + 0.5 * d) * c, (2.0 + 0.5 * d) * s, 0.5 * t));
    }
  }
  for (std::uint32_t i = 0; i < kRings; ++i) {
    for (std::uint32_t j = 0; j < kAround; ++j) {
      const std::uint32_t k = (j + 1) % kAround;
      const auto next = [&](std::uint32_t at) { return i + 1 < kRings ? (i + 1) * kAround + at : (kAround - at) % kAround; };
      bottle.triangle.insert(bottle.triangle.end(), {{i * kAround + j, next(j), next(k)}, {i * kAround + j, next(k), i * kAround + k}});
    }
  }
  ASSERT_TRUE(inspect(bottle).closed);
  expect_refused(bottle, "expected a surface with two sides, found a one-sided one, like a Klein bottle: its orientation reverses at the edge");
}

}  // namespace
}  // namespace supple::implicit
