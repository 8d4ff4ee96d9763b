// Middles of edges that are moved far: what crosses is put back, and nothing else.
#include "mesh/cut_crossings.h"

#include <gtest/gtest.h>

#include <map>

#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"

namespace supple::implicit {
namespace {

using testing::Random;
using testing::self_intersections;

/// A sheet of 2 n^2 triangles over squares of unit sides, as rough as `rough`.
Mesh sheet(std::uint32_t n, double rough, Random& random) {
  Mesh mesh;
  for (std::uint32_t j = 0; j <= n; ++j) {
    for (std::uint32_t i = 0; i <= n; ++i) mesh.position.push_back(Vec3(i, j, random.uniform(-rough, rough)));
  }
  for (std::uint32_t j = 0; j < n; ++j) {
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = i + (n + 1) * j, b = a + 1, c = b + n + 1, d = a + n + 1;
      mesh.triangle.push_back({a, b, c});
      mesh.triangle.push_back({a, c, d});
    }
  }
  mesh.normal.assign(mesh.position.size(), Vec3::UnitZ());
  return mesh;
}

struct CutSheet {
  Mesh flat, moved;
  CutSheet(std::uint32_t n, double rough, double amplitude, Random& random) : flat(sheet(n, rough, random)), moved(flat) {
    moved.triangle.clear();
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> number;
    for (const auto& t : flat.triangle) {
      std::array<std::uint32_t, 3> middle{};
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = t[k], b = t[(k + 1) % 3];
        const auto [at, fresh] = number.try_emplace({std::min(a, b), std::max(a, b)}, static_cast<std::uint32_t>(moved.position.size()));
        if (fresh) {
          moved.position.push_back(0.5 * (flat.position[a] + flat.position[b]) + random.in_box(amplitude));
          moved.normal.push_back(Vec3::UnitZ());
        }
        middle[k] = at->second;
      }
      moved.triangle.push_back({t[0], middle[0], middle[2]});
      moved.triangle.push_back({middle[0], t[1], middle[1]});
      moved.triangle.push_back({middle[2], middle[1], t[2]});
      moved.triangle.push_back(middle);
    }
  }
};

TEST(CutCrossings, AreTakenBackHoweverFarMiddlesMove) {
  CutCrossings crossings;
  std::size_t crossed = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    Random random(seed);
    const double amplitude = 0.05 * static_cast<double>(1 + seed / 4 % 16);
    CutSheet cut(4, std::array{0.1, 1.0, 2.0, 4.0}[seed % 4], amplitude, random);
    const Mesh before = cut.moved;
    const std::size_t crossing = self_intersections(before, 0.5);
    std::vector<StraightEdge> straight;
    crossings.take_back(cut.flat, Executor(1), cut.moved, straight);
    ASSERT_EQ(self_intersections(cut.moved, 0.5), 0u) << seed;
    EXPECT_EQ(straight.empty(), crossing == 0) << seed;
    crossed += crossing;
    // Only what it names is elsewhere.
    std::vector<Vec3> position = cut.moved.position;
    for (std::size_t i = 0; i < straight.size(); ++i) {
      EXPECT_TRUE(i == 0 || straight[i - 1].vertex < straight[i].vertex);
      EXPECT_GE(straight[i].vertex, cut.flat.vertex_count());
      position[straight[i].vertex] = straight[i].position;
    }
    EXPECT_EQ(position, before.position);
  }
  EXPECT_GT(crossed, 5000u);
}

TEST(CutCrossings, HaveTheSameBitsForAnyNumberOfThreads) {
  std::vector<Vec3> expected;
  for (const int threads : {1, 2, 8}) {
    Random random(7);
    CutSheet cut(40, 1.0, 0.3, random);
    std::vector<StraightEdge> straight;
    CutCrossings().take_back(cut.flat, Executor(threads), cut.moved, straight);
    EXPECT_GT(straight.size(), 20u);
    if (threads == 1) expected = cut.moved.position;
    EXPECT_EQ(cut.moved.position, expected);
  }
}

}  // namespace
}  // namespace supple::implicit
