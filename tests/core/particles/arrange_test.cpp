#include "supple/core/arrange.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "supple/core/error.h"

namespace supple::core {
namespace {

constexpr double kPi = std::numbers::pi;

// Arc length of r = a + b theta between two angles by Simpson's rule with 20,000 panels (error far below 1e-12).
double arc_length(double inner, double slope, double from, double to) {
  const int n = 20000;
  const double h = (to - from) / n;
  double sum = 0.0;
  for (int i = 0; i <= n; ++i) {
    const double r = inner + slope * (from + h * i);
    sum += (i == 0 || i == n ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * std::sqrt(r * r + slope * slope);
  }
  return sum * h / 3.0;
}

TEST(Spiral, LiesOnTheArchimedeanCurveAtEqualArcLengths) {
  const double inner = 0.15, outer = 0.55, turns = 1.2;
  const Arrangement spiral = arrange_spiral(10, inner, outer, turns, NormalDirection::Radial);
  ASSERT_EQ(spiral.size(), 10u);
  const double slope = (outer - inner) / (2.0 * kPi * turns);
  std::vector<double> theta;
  for (const Vec3& p : spiral.position) {
    EXPECT_EQ(p.z(), 0.0);
    theta.push_back((p.norm() - inner) / slope);
    // Position rounds in the last bit; theta amplifies it by 1 / slope < 20.
    EXPECT_NEAR(std::remainder(std::atan2(p.y(), p.x()) - theta.back(), 2.0 * kPi), 0.0, 1e-13);
  }
  EXPECT_DOUBLE_EQ(spiral.position.front().norm(), inner);
  EXPECT_DOUBLE_EQ(spiral.position.back().norm(), outer);
  const double step = arc_length(inner, slope, theta[0], theta[9]) / 9.0;
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(arc_length(inner, slope, theta[i], theta[i + 1]), step, 1e-12) << i;
}

TEST(Spiral, CarriesPlatesAcrossTheRadiusWithTheNormalOutwards) {
  const Arrangement spiral = arrange_spiral(10, 0.15, 0.55, 1.2, NormalDirection::Radial);
  for (std::size_t i = 0; i < spiral.size(); ++i) {
    const Vec3 along = spiral.orientation[i] * Vec3::UnitX();
    const Vec3 normal = spiral.orientation[i] * Vec3::UnitZ();
    EXPECT_NEAR((spiral.orientation[i] * Vec3::UnitY() - Vec3::UnitZ()).norm(), 0.0, 1e-15);
    EXPECT_GT(normal.dot(spiral.position[i]), 0.0);
    EXPECT_NEAR(normal.z(), 0.0, 1e-15);
    if (i > 0) {
      EXPECT_GT(along.dot(spiral.position[i] - spiral.position[i - 1]), 0.0);
    }
    EXPECT_NEAR(spiral.orientation[i].norm(), 1.0, 1e-15);
  }
}

TEST(Spiral, PointsItsNormalsAlongTheAxisWhenAsked) {
  for (const Quat& q : arrange_spiral(5, 0.0, 1.0, 2.0, NormalDirection::Axis).orientation) {
    EXPECT_NEAR((q * Vec3::UnitZ() - Vec3::UnitZ()).norm(), 0.0, 1e-15);
  }
}

TEST(Ring, IsRegular) {
  const Arrangement ring = arrange_ring(8, 0.5, NormalDirection::Radial);
  const double chord = 2.0 * 0.5 * std::sin(kPi / 8.0);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_NEAR((ring.position[(i + 1) % 8] - ring.position[i]).norm(), chord, 1e-15);
    EXPECT_NEAR((ring.orientation[i] * Vec3::UnitZ() - ring.position[i] / 0.5).norm(), 0.0, 1e-15);
  }
}

TEST(Grid, IsCentredRowByRow) {
  const Arrangement grid = arrange_grid(3, 2, 0.1);
  ASSERT_EQ(grid.size(), 6u);
  Vec3 centre = Vec3::Zero();
  for (const Vec3& p : grid.position) centre += p / 6.0;
  EXPECT_NEAR(centre.norm(), 0.0, 1e-16);
  EXPECT_NEAR((grid.position[1] - grid.position[0] - Vec3(0.1, 0, 0)).norm(), 0.0, 1e-16);
  EXPECT_NEAR((grid.position[3] - grid.position[0] - Vec3(0, 0.1, 0)).norm(), 0.0, 1e-16);
  EXPECT_EQ(arrange_line(3, 0.1).position[2], Vec3(0.1, 0, 0));
  EXPECT_EQ(arrange_single().position[0], Vec3(0, 0, 0));
}

TEST(Arrangement, MovesAsARigidBody) {
  Arrangement ring = arrange_ring(5, 0.5, NormalDirection::Axis);
  const Arrangement before = ring;
  const Pose pose{Vec3(1, 2, 3), Quat(std::sqrt(0.5), std::sqrt(0.5), 0.0, 0.0)};  // a quarter turn about x
  place(ring, pose);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR((ring.position[i] - pose.to_world(before.position[i])).norm(), 0.0, 1e-15);
    EXPECT_NEAR((ring.orientation[i] * Vec3::UnitZ() - Vec3(0, -1, 0)).norm(), 0.0, 1e-15);
  }
}

TEST(Bonds, AlongAChainReachTheGivenNumberOfSteps) {
  const Bonds bonds = bonds_along(3, 7, 2);
  EXPECT_EQ(bonds.first, (std::vector<std::uint32_t>{3, 3, 4, 4, 5}));
  EXPECT_EQ(bonds.second, (std::vector<std::uint32_t>{4, 5, 5, 6, 6}));
}

TEST(Bonds, WithinADistanceAreThoseOfTheRange) {
  const std::vector<Vec3> line = arrange_line(5, 0.1).position;
  const Bonds bonds = bonds_within(line, 1, 5, 0.15);
  EXPECT_EQ(bonds.first, (std::vector<std::uint32_t>{1, 2, 3}));
  EXPECT_EQ(bonds.second, (std::vector<std::uint32_t>{2, 3, 4}));
}

TEST(Bonds, AreCountedWithoutBeingMade) {
  for (const std::uint32_t particles : {0U, 1U, 2U, 7U}) {
    for (const int steps : {1, 2, 5, 9}) EXPECT_EQ(count_bonds_along(particles, steps), bonds_along(0, particles, steps).first.size()) << particles << ' ' << steps;
  }
  EXPECT_EQ(count_bonds_along(1'000'000, 1000), 999'499'500U);  // n s - s (s + 1) / 2
  const std::vector<Vec3> grid = arrange_grid(12, 9, 0.1, 3).position;
  const auto all = static_cast<std::uint32_t>(grid.size());
  for (const double range : {0.05, 0.15, 0.31, 1e9}) {
    const BondCount count = count_bonds_within(grid, range);
    EXPECT_EQ(count.number, bonds_within(grid, 0, all, range).first.size()) << range;
    EXPECT_FALSE(count.estimated);
  }
  // Of 10,000 points, each with all later ones, one in 19 is looked at: of their sum over n (n - 1) / 2 a share of 19 / n is missing or too much at most.
  const std::vector<Vec3> many = arrange_grid(100, 100, 0.1).position;
  const BondCount count = count_bonds_within(many, 1e9);
  EXPECT_TRUE(count.estimated);
  EXPECT_NEAR(static_cast<double>(count.number), 10000.0 * 9999.0 / 2.0, 19.0 * 10000.0);
}

TEST(Spiral, RefusesWhatIsNoSpiral) {
  EXPECT_THROW((void)arrange_spiral(1, 0.1, 0.5, 1.0, NormalDirection::Axis), ContractViolation);
  EXPECT_THROW((void)arrange_spiral(5, 0.5, 0.5, 1.0, NormalDirection::Axis), ContractViolation);
}

TEST(Geodesic, CoversTheSphereWithTrianglesOfNearlyOneSize) {
  for (const int frequency : {1, 2, 5, 31}) {
    const Arrangement shell = arrange_geodesic(frequency, 0.5);
    ASSERT_EQ(shell.size(), static_cast<std::size_t>(10 * frequency * frequency + 2));
    for (std::size_t i = 0; i < shell.size(); ++i) {
      EXPECT_NEAR(shell.position[i].norm(), 0.5, 1e-15);
      EXPECT_LE((shell.orientation[i] * Vec3::UnitZ() - shell.position[i] / 0.5).norm(), 1e-14);
    }
    EXPECT_LE((shell.position[0] + shell.position[11]).norm(), 1e-15);
    // A closed triangulation has 3 (n - 2) edges: up to 1.323 radius / frequency at the middle of a face, where the second
    // neighbours are farther than the 1.549 of those at a corner.
    const auto n = static_cast<std::uint32_t>(shell.size());
    EXPECT_EQ(bonds_within(shell.position, 0, n, 1.42 * 0.5 / frequency).first.size(), 3u * (n - 2)) << frequency;
  }
}

}  // namespace
}  // namespace supple::core
