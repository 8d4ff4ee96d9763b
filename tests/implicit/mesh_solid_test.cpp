#include "supple/implicit/mesh_solid.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <utility>

#include "supple/core/error.h"

namespace supple::implicit {
namespace {

/// An octahedron whose triangles are cut in four `levels` times, with vertices on the unit sphere times `radius`.
Mesh sphere(double radius, int levels) {
  Mesh mesh;
  mesh.position = {Vec3::UnitX(), -Vec3::UnitX(), Vec3::UnitY(), -Vec3::UnitY(), Vec3::UnitZ(), -Vec3::UnitZ()};
  mesh.triangle = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle;
    const auto between = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, fresh] = middle.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.position.size()));
      if (fresh) mesh.position.push_back((mesh.position[a] + mesh.position[b]).normalized());
      return at->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& [a, b, c] : mesh.triangle) {
      const std::uint32_t ab = between(a, b), bc = between(b, c), ca = between(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    mesh.triangle = std::move(finer);
  }
  for (Vec3& x : mesh.position) x *= radius;
  return mesh;
}

std::vector<Vec3> directions(int count) {
  std::vector<Vec3> out;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count, turn = 2.399963229728653 * i, r = std::sqrt(1.0 - z * z);
    out.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
  }
  return out;
}

double value(const MeshSolid& solid, const Vec3& x) { return FieldView(solid).value(x); }

Vec3 gradient(const MeshSolid& solid, const Vec3& x) {
  double unused = 0.0;
  Vec3 found;
  solid.evaluate({&x, 1}, {&unused, 1}, {&found, 1});
  return found;
}

TEST(MeshSolid, IsTheSameInAnyUnitOfLength) {
  // Powers of two: 1e-45, where floats end, 1e-30 and 1e45. Nothing is rounded otherwise.
  const MeshSolid solid(sphere(1.0, 3), {});
  for (const int power : {-150, -98, 150}) {
    const double scale = std::ldexp(1.0, power);
    const MeshSolid scaled(sphere(scale, 3), {});
    for (const Vec3& u : directions(40)) {
      for (const double radius : {0.8, 1.0, 1.02}) EXPECT_EQ(value(scaled, scale * radius * u), scale * value(solid, radius * u)) << power;
      EXPECT_EQ(gradient(scaled, scale * u), gradient(solid, u)) << power;
    }
  }
}

TEST(MeshSolid, ComesNearASphereWithTheSquareOfTheVoxel) {
  // The spline adds h^2 / 6 times the Laplacian 2 / R of the distance; the triangles take less than 1e-4 of the radius.
  constexpr double kRadius = 0.8, kSlope = 3.0;
  const Mesh mesh = sphere(kRadius, 6);
  double error[2];
  for (const int i : {0, 1}) {
    const double voxel = kRadius / (8 << i);
    const MeshSolid solid(mesh, {.voxel = voxel, .slope = kSlope});
    double mean = 0.0;
    for (const Vec3& u : directions(200)) mean -= value(solid, kRadius * u) / kSlope / 200.0;
    EXPECT_NEAR(mean, voxel * voxel / (3.0 * kRadius), 0.1 * voxel * voxel / (3.0 * kRadius) + 1e-4 * kRadius);
    error[i] = mean;
    for (const Vec3& u : directions(50)) {
      EXPECT_NEAR(value(solid, 0.7 * kRadius * u), kSlope * 0.3 * kRadius, kSlope * voxel * voxel / kRadius);
      Vec3 slope;
      (void)FieldView(solid).value(0.8 * kRadius * u, slope);
      EXPECT_LT((slope + kSlope * u).norm(), 2.0 * kSlope * voxel / kRadius);
    }
  }
  EXPECT_NEAR(error[0] / error[1], 4.0, 0.4);
}

TEST(MeshSolid, HasTheGradientAndTheBoundsOfItsValues) {
  const MeshSolid solid(sphere(0.5, 4), {.voxel = 0.05, .slope = 2.0});
  const double h = 1e-6;
  for (const Vec3& u : directions(60)) {
    for (const double r : {0.1, 0.3, 0.5, 0.62}) {
      const Vec3 x = r * u;
      Vec3 slope;
      const double f = FieldView(solid).value(x, slope);
      for (int axis = 0; axis < 3; ++axis) {
        const Vec3 step = h * Vec3::Unit(axis);
        // Third derivatives of the spline are at most about its coefficients' jumps over h^3.
        EXPECT_NEAR(slope[axis], (value(solid, x + step) - value(solid, x - step)) / (2.0 * h), 1e-6);
      }
      EXPECT_LE(slope.norm(), solid.gradient_bound({}));
      const Box box{x - Vec3::Constant(0.04), x + Vec3(0.02, 0.05, 0.03)};
      const Interval bound = solid.bound(box);
      for (const double s : {0.0, 0.5, 1.0}) {
        for (const double t : {0.0, 0.5, 1.0}) {
          const double inner = value(solid, box.lower + box.extent().cwiseProduct(Vec3(s, t, 1.0 - s)));
          EXPECT_LE(inner, bound.upper);
          EXPECT_GE(inner, bound.lower);
        }
      }
      EXPECT_TRUE(f < 0.0 || solid.surface_box().contains(x));
    }
  }
  const double far = value(solid, Vec3(3, 0, 0));
  EXPECT_LT(far, 0.0);
  EXPECT_EQ(far, value(solid, Vec3(9, 0, 0)));
}

void expect_refused(const Mesh& mesh, const MeshSolidOptions& options, const std::string& key, const std::string& text) {
  try {
    const MeshSolid solid(mesh, options);
    FAIL() << text;
  } catch (const Error& error) {
    EXPECT_EQ(error.faults().at(0).key, key);
    EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
  }
}

TEST(MeshSolid, RefusesWhatHasNoInsideOrTooManyCells) {
  Mesh open = sphere(1.0, 2);
  open.triangle.pop_back();
  expect_refused(open, {}, "mesh", "expected a closed surface");
  expect_refused(Mesh{}, {}, "mesh", "no triangle");
  expect_refused(sphere(1.0, 2), {.voxel = 1e-3}, "voxel", "expected at most 64000000 cells");
}

/// A plate of 1 x 0.8 m, turned out of the lattice; with its faces the wrong way round if `inside_out`.
Mesh plate(double thickness, bool inside_out = false) {
  Mesh mesh;
  const Quat turn(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));
  for (int corner = 0; corner < 8; ++corner) {
    const auto side = [&](int axis) { return (corner >> axis & 1) == 1 ? 0.5 : -0.5; };
    mesh.position.push_back(turn * Vec3(side(0), 0.8 * side(1), thickness * side(2)));
  }
  mesh.triangle = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4}, {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  if (inside_out) {
    for (auto& t : mesh.triangle) std::swap(t[1], t[2]);
  }
  return mesh;
}

TEST(MeshSolid, RefusesPartsThinnerThanACellAndNamesAVoxelThatDoes) {
  // A plate of two thirds of a cell has nowhere an inside, one of one and a quarter not as much of it as there should be, one of two and a half has.
  const std::string text = "expected cells small enough for an inside behind the whole mesh, found none behind 100 % of its area with a voxel of ";
  expect_refused(plate(0.02), {.voxel = 0.032}, "voxel", text + "0.032 m; a voxel of 0.008 m would do");
  expect_refused(plate(0.02), {.voxel = 3.0}, "voxel", text + "3 m; a voxel of 0.00");
  expect_refused(plate(1e-4), {}, "voxel", "make them thicker, or try finer ones");
  for (const bool inside_out : {false, true}) EXPECT_EQ(MeshSolid(plate(0.02, inside_out), {.voxel = 0.009}).voxel(), 0.009);
}

TEST(MeshSolid, ChoosesFinerCellsForThinParts) {
  const MeshSolid thick(plate(0.1), {}), thin(plate(0.02), {});
  EXPECT_LT(thin.voxel(), thick.voxel());
  // Spline and plate differ by less than half a cell in the middle, so it is inside all over.
  const Quat turn(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));
  for (int i = -20; i <= 20; ++i) EXPECT_GT(value(thin, turn * Vec3(0.02 * i, 0.013 * i, 0.0)), 0.0) << i;
}

}  // namespace
}  // namespace supple::implicit
