// Pictures without dimples: waves of the given width go, wider ones and the volume stay.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <tuple>

#include "output/pictures/even_surface.h"
#include "render/shapes.h"

namespace supple::scenes {
namespace {

double volume_of(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& t : mesh.triangle) sum += mesh.position[t[0]].dot(mesh.position[t[1]].cross(mesh.position[t[2]])) / 6.0;
  return sum;
}

/// A closed ball of radius 1: faces of the cube that it comes from share their vertices.
Mesh ball(int cells) {
  const Mesh apart = render::test::sphere(Vec3::Zero(), 1.0, cells);
  Mesh mesh;
  std::map<std::array<long, 3>, std::uint32_t> known;
  std::vector<std::uint32_t> number;
  for (const Vec3& p : apart.position) {
    const std::array<long, 3> place = {std::lround(1e6 * p.x()), std::lround(1e6 * p.y()), std::lround(1e6 * p.z())};
    const auto [at, is_new] = known.try_emplace(place, static_cast<std::uint32_t>(mesh.position.size()));
    if (is_new) {
      mesh.position.push_back(p);
      mesh.normal.push_back(p);
    }
    number.push_back(at->second);
  }
  for (const auto& t : apart.triangle) mesh.triangle.push_back({number[t[0]], number[t[1]], number[t[2]]});
  return mesh;
}

/// The ball with `waves` along its equator, of a hundredth of the radius.
Mesh wavy(int waves, int cells = 32) {
  Mesh mesh = ball(cells);
  for (Vec3& p : mesh.position) {
    const double across = 1.0 - p.z() * p.z();
    p *= 1.0 + 0.01 * across * std::cos(waves * std::atan2(p.y(), p.x()));
  }
  return mesh;
}

/// Height of so many waves near the equator: the share of their cosine in the radii.
double height_of(int waves, const Mesh& mesh) {
  double sum = 0.0, squares = 0.0;
  for (const Vec3& p : mesh.position) {
    if (std::abs(p.z()) > 0.1 * p.norm()) continue;
    const double wave = std::cos(waves * std::atan2(p.y(), p.x()));
    sum += (p.norm() - 1.0) * wave;
    squares += wave * wave;
  }
  return sum / squares;
}

TEST(EvenSurface, TakesAwayDimplesAndKeepsWiderWavesAndTheVolume) {
  constexpr int kNarrow = 16, kWide = 3;  // not the four of the cube that the mesh comes from
  const double width = 2.0 * std::numbers::pi / kNarrow;
  for (const auto& [waves, least, most] : {std::tuple{kNarrow, -0.05, 0.2}, std::tuple{kWide, 0.6, 1.0}}) {
    Mesh mesh = wavy(waves);
    const double volume = volume_of(mesh), height = height_of(waves, mesh);
    even_surface(width, std::vector<bool>(mesh.vertex_count(), false), mesh);
    EXPECT_NEAR(volume_of(mesh), volume, 1e-3 * volume);
    EXPECT_GE(height_of(waves, mesh), least * height) << waves;
    EXPECT_LE(height_of(waves, mesh), most * height) << waves;
    for (const Vec3& n : mesh.normal) ASSERT_NEAR(n.norm(), 1.0, 1e-12);
  }
}

TEST(EvenSurface, TakesAwayDimplesOfManyEdges) {
  constexpr int kWaves = 6;
  Mesh mesh = wavy(kWaves, 128);  // 90 edges in a wave
  const double height = height_of(kWaves, mesh);
  even_surface(2.0 * std::numbers::pi / kWaves, std::vector<bool>(mesh.vertex_count(), false), mesh);
  EXPECT_LE(std::abs(height_of(kWaves, mesh)), 0.2 * height);
}

TEST(EvenSurface, LeavesWhatIsSharedWithOtherMeshes) {
  const Mesh before = wavy(16);
  std::array meshes = {before, Mesh()};
  for (std::size_t v = 0; v < before.vertex_count(); ++v)
    if (before.position[v].x() > 0.5) meshes[1].position.push_back(before.position[v]);
  const std::vector<bool> shared = shared_vertices(meshes, 0);
  even_surface(0.4, shared, meshes[0]);
  for (std::size_t v = 0; v < before.vertex_count(); ++v) {
    EXPECT_EQ(shared[v], before.position[v].x() > 0.5);
    EXPECT_TRUE(!shared[v] || meshes[0].position[v] == before.position[v]);
  }
}

}  // namespace
}  // namespace supple::scenes
