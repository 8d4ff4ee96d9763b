// Particles that fill a solid, and their bonds.
#include "fit/packing.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "fit/shapes.h"

namespace supple::fit {
namespace {

Packing pack(const Mesh& mesh, double step, std::size_t count, Surroundings& around) {
  const SurfaceTree tree(mesh);
  around = sample_surroundings(mesh, tree, step, Executor(2));
  return pack_inside(around, count, Executor(2));
}

TEST(SurfaceTree, KnowsDistanceAndSide) {
  const SurfaceTree tree(test::block(Vec3(1.0, 2.0, 3.0)));
  EXPECT_DOUBLE_EQ(tree.signed_distance(Vec3(0.0, 0.0, 0.0)), -1.0);
  EXPECT_DOUBLE_EQ(tree.signed_distance(Vec3(0.0, 4.0, 0.0)), 2.0);
  EXPECT_DOUBLE_EQ(tree.distance(Vec3(1.5, 0.0, 0.0)), 0.5);
}

TEST(PackInside, FillsABallWithEqualShares) {
  Surroundings around;
  const Packing packing = pack(test::octahedral_sphere(0.5, 4), 0.025, 60, around);
  ASSERT_EQ(packing.particle.size(), 60U);
  std::vector<double> share(60, 0.0);
  for (const std::uint32_t k : packing.share) share[k] += 60.0 / static_cast<double>(packing.share.size());
  for (const double s : share) EXPECT_NEAR(s, 1.0, 0.35);
  for (const Vec3& p : packing.particle) EXPECT_LT(p.norm(), 0.45);
  EXPECT_TRUE(packing.connected);
  // Cells of a packing have about 14 neighbours inside and half of them at the surface.
  EXPECT_GT(packing.bond.size(), 60U * 4U);
  EXPECT_LT(packing.bond.size(), 60U * 7U);
}

TEST(PackInside, JoinsNothingAcrossAGap) {
  // A horseshoe: two legs, 0.1 apart, and a bow.
  const Mesh legs = test::both(test::block(Vec3(0.1, 0.5, 0.1), Vec3(-0.15, 0.0, 0.0)), test::block(Vec3(0.1, 0.5, 0.1), Vec3(0.15, 0.0, 0.0)));
  Surroundings around;
  const Packing packing = pack(legs, 0.02, 40, around);
  std::size_t across = 0;
  for (const auto& [a, b] : packing.bond) across += packing.particle[a].x() * packing.particle[b].x() < 0.0 ? 1 : 0;
  EXPECT_EQ(across, 1U);  // the one that joins what the lattice leaves apart
  EXPECT_TRUE(packing.connected);
  EXPECT_TRUE(std::is_sorted(packing.bond.begin(), packing.bond.end()));
}

}  // namespace
}  // namespace supple::fit
