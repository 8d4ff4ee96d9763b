// Balls of the medial axis, and the tree that finds their neighbours.
#include "fit/balls.h"

#include <gtest/gtest.h>

#include "fit/shapes.h"

namespace supple::fit {
namespace {

SurfaceSamples samples_of_sphere() { return sample_surface(test::octahedral_sphere(0.3, 5), 4000); }

TEST(PointTree, FindsWhatASearchOfAllFinds) {
  const SurfaceSamples surface = samples_of_sphere();
  const PointTree tree(surface.position);
  for (const Vec3& place : {Vec3(0.0, 0.0, 0.0), Vec3(0.3, 0.01, 0.0), Vec3(0.5, 0.5, -0.7), Vec3(-9.0, 0.0, 0.0)}) {
    std::uint32_t best = 0;
    std::vector<std::uint32_t> near, expected;
    for (std::uint32_t k = 0; k < surface.position.size(); ++k) {
      if ((surface.position[k] - place).squaredNorm() < (surface.position[best] - place).squaredNorm()) best = k;
      if ((surface.position[k] - place).norm() <= 0.2) expected.push_back(k);
    }
    EXPECT_EQ(tree.nearest(place), best);
    const double least = (surface.position[best] - place).norm();
    EXPECT_EQ(tree.nearest(place, 1.001 * least), best);
    EXPECT_EQ(tree.nearest(place, 0.999 * least), PointTree::kNone);
    tree.within(place, 0.2, near);
    std::sort(near.begin(), near.end());
    EXPECT_EQ(near, expected);
  }
}

TEST(SampleSurface, IsEvenInArea) {
  const SurfaceSamples surface = samples_of_sphere();
  ASSERT_EQ(surface.position.size(), 4000U);
  Vec3 mean = Vec3::Zero();
  double upper = 0.0;
  for (std::size_t k = 0; k < surface.position.size(); ++k) {
    mean += surface.position[k] / 4000.0;
    upper += surface.position[k].z() > 0.15 ? 1.0 : 0.0;
    EXPECT_GT(surface.normal[k].dot(surface.position[k].normalized()), 0.99);
  }
  EXPECT_LT(mean.norm(), 0.003);
  EXPECT_NEAR(upper / 4000.0, 0.25, 0.01);  // the area of a cap is proportional to its height
}

TEST(TouchingRadii, AreThoseOfTheSphereInsideAndUnboundedOutside) {
  const SurfaceSamples surface = samples_of_sphere();
  const PointTree tree(surface.position);
  for (const double radius : touching_radii(surface, tree, -1.0, 1.0, 0.01, Executor(2))) EXPECT_NEAR(radius, 0.3, 0.02);
  for (const double radius : touching_radii(surface, tree, 1.0, 1.0, 0.002, Executor(2))) EXPECT_EQ(radius, 1.0);
}

TEST(CoverSurface, ReachesEverySampleWithFewBalls) {
  const Mesh mesh = test::torus(0.3, 0.1, 96, 32);
  const SurfaceSamples surface = sample_surface(mesh, 6000);
  const PointTree tree(surface.position);
  const std::vector<double> radius = touching_radii(surface, tree, -1.0, 1.0, 0.001, Executor(1));
  std::vector<std::uint32_t> all(surface.position.size());
  for (std::uint32_t k = 0; k < all.size(); ++k) all[k] = k;
  constexpr double kReach = 0.01;
  const std::vector<Ball> balls = cover_surface(surface, tree, radius, all, kReach);
  // A ball covers a torus of tube 0.1 within 0.01 along 2 sqrt(0.11^2 - 0.1^2) = 0.09 of 1.9.
  EXPECT_GE(balls.size(), 20U);
  EXPECT_LE(balls.size(), 80U);
  for (const Vec3& p : surface.position) {
    const auto reaches = [&](const Ball& ball) { return (p - ball.centre).norm() <= ball.radius + kReach; };
    EXPECT_TRUE(std::any_of(balls.begin(), balls.end(), reaches));
  }
}

}  // namespace
}  // namespace supple::fit
