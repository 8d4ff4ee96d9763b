// Grids of bodies as thin as their cells: nodes on the skeleton, where grad F is 0, have neighbours beyond the support.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <vector>

#include "implicit/bodies.h"
#include "supple/core/mesh.h"
#include "supple/implicit/surface_grid.h"

namespace supple::implicit {
namespace {

using namespace testing;

constexpr double kCell = 1.0 / 64.0, kHalf = 0.25;

/// A square plate, rounded by `thickness`, of a field linear inside and with a parabola for its tail, as wide.
/// @param x, z  of its middle [cells]
Body plate(double thickness, double x, double z) {
  Primitive square;
  square.shape = ShapeKind::Rectangle;
  square.size = {kHalf, kHalf, 0.0};
  square.kernel = Kernel::gascuel(thickness, 2.0 * thickness, 1.0 / thickness);
  return body_of({{square, kCell * Vec3(x, 0.0, z)}});
}

double volume_of(double t) {
  return 8.0 * kHalf * kHalf * t + 4.0 * std::numbers::pi * kHalf * t * t + 4.0 / 3.0 * std::numbers::pi * t * t * t;
}

TEST(ThinGrids, HaveTheSideOfEveryNodeAndItsDistanceAlongTheLattice) {
  for (const double thickness : {0.3, 0.5, 0.52, 0.75, 1.0, 1.4}) {
    for (const double z : {0.0, 0.1, 0.5, 0.8}) {
      const Body body = plate(thickness * kCell, 0.0, z);
      const SurfaceGrid grid = make_surface_grid(body.field, {.lattice = {.cell = kCell}}, Executor(1));
      const FieldView field(body.field);
      const auto inside = [&](int i, int j, int k) { return field.value(kCell * Vec3(i, j, k)) > 0.0; };
      for (int k = -6; k <= 6; ++k) {
        for (int j = -20; j <= 20; ++j) {
          for (int i = -20; i <= 20; ++i) {
            const double value = grid.value(i, j, k);
            ASSERT_EQ(value < 0.0, inside(i, j, k)) << i << ' ' << j << ' ' << k;
            // On the flat part the nearest point of the surface lies on the edge that crosses it.
            const bool flat = std::max(std::abs(i), std::abs(j)) <= 16;
            if (!flat || (inside(i, j, k - 1) == inside(i, j, k) && inside(i, j, k + 1) == inside(i, j, k))) continue;
            const double distance = kCell * (std::abs(k - z) - thickness);
            // The kernel is linear inside; in its tail, ever flatter, first order takes the surface for farther than it is, but no farther than a cell.
            if (distance < 0.0) {
              ASSERT_NEAR(value, distance, 1e-5 * kCell) << thickness << ' ' << z << ' ' << k;
            } else {
              ASSERT_LE(value, kCell) << thickness << ' ' << z << ' ' << k;
              ASSERT_GE(value, (1.0 - 1e-5) * distance) << thickness << ' ' << z << ' ' << k;
            }
          }
        }
      }
      if (std::min(z, 1.0 - z) < thickness) {
        EXPECT_GT(grid.active_voxels(), 1000u) << thickness << ' ' << z;
      }
    }
  }
}

TEST(ThinGrids, BecomeMeshesOfTheBodysVolume) {
  for (const double thickness : {0.5, 0.52, 0.545, 0.75, 1.0, 1.4}) {
    for (const double x : {0.0, 0.37}) {
      for (const double z : {0.0, 0.1, 0.25, 0.45}) {
        const Body body = plate(thickness * kCell, x, z);
        const SurfaceGrid grid = make_surface_grid(body.field, {.lattice = {.cell = kCell}}, Executor(1));
        const Mesh mesh = mesh_of(grid, body.field, Executor(1));
        const MeshReport report = inspect(mesh);
        EXPECT_TRUE(report.closed && report.oriented) << thickness << ' ' << x << ' ' << z;
        EXPECT_EQ(report.components, 1u) << thickness << ' ' << x << ' ' << z;
        // Flat faces are exact; the rim, as high as the plate, lies in the cells beyond the last nodes inside.
        EXPECT_NEAR(report.volume, volume_of(thickness * kCell), 8.0 * kHalf * 2.0 * thickness * kCell * kCell) << thickness << ' ' << x << ' ' << z;
      }
    }
  }
}

/// Of each closed piece of a mesh.
std::vector<double> piece_volumes(const Mesh& mesh) {
  std::vector<std::uint32_t> root(mesh.vertex_count());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const auto& t : mesh.triangle) root[find(t[1])] = root[find(t[2])] = find(t[0]);
  std::map<std::uint32_t, double> volume;
  for (const auto& t : mesh.triangle) {
    const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]];
    const Vec3& o = mesh.position[find(t[0])];
    volume[find(t[0])] += (a - o).dot((b - o).cross(c - o)) / 6.0;
  }
  std::vector<double> all;
  for (const auto& [piece, v] : volume) all.push_back(v);
  return all;
}

TEST(ThinGrids, LeavePiecesOfADiscBetweenTheNodesButNoneInsideOut) {
  for (const double thickness : {0.13, 0.2, 0.3, 0.4, 0.5}) {
    for (const double turn : {0.2, 0.58, 1.1}) {
      Primitive disc;
      disc.shape = ShapeKind::Disc;
      disc.size = {0.3, 0.0, 0.0};
      disc.offset.orientation = Quat(Eigen::AngleAxisd(turn, Vec3(0, 1, 1).normalized()));
      disc.kernel = Kernel::gascuel(thickness * kCell, 2.0 * thickness * kCell, 1.0 / (thickness * kCell));
      const Body body = body_of({{disc, Vec3::Zero()}});
      const Mesh mesh = mesh_of(make_surface_grid(body.field, {.lattice = {.cell = kCell}}, Executor(1)), body.field, Executor(1));
      const std::vector<double> volumes = piece_volumes(mesh);
      ASSERT_FALSE(volumes.empty()) << thickness << ' ' << turn;
      EXPECT_TRUE(inspect(mesh).closed) << thickness << ' ' << turn;
      EXPECT_GT(*std::min_element(volumes.begin(), volumes.end()), 0.0) << thickness << ' ' << turn;
    }
  }
}

}  // namespace
}  // namespace supple::implicit
