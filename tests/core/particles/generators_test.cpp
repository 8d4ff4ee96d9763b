/// Balls, tubes, curves and scattered particles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "supple/core/arrange.h"
#include "supple/core/interactions.h"

namespace supple::core {
namespace {

TEST(ArrangeBall, HoldsTheLatticePointsWithin) {
  EXPECT_EQ(arrange_ball(1.0, 1.0).size(), 7u);   // the middle and its neighbours
  EXPECT_EQ(arrange_ball(0.99, 1.0).size(), 1u);
  const Arrangement ball = arrange_ball(1.0, 0.1);
  EXPECT_NEAR(static_cast<double>(ball.size()) * 1e-3, 4.0 / 3.0 * std::numbers::pi, 0.05);
  for (const Vec3& x : ball.position) EXPECT_LE(x.norm(), 1.0 + 1e-8);
}

TEST(ArrangeTube, HasRingsWithNormalsOutward) {
  const Arrangement tube = arrange_tube(0.5, 2.0, 0.1);
  EXPECT_EQ(tube.size(), 21u * 31u);
  for (std::size_t i = 0; i < tube.size(); ++i) {
    const Vec3 out(tube.position[i].x(), tube.position[i].y(), 0.0);
    EXPECT_NEAR(out.norm(), 0.5, 1e-15);
    EXPECT_LT((tube.orientation[i] * Vec3::UnitZ() - out.normalized()).norm(), 1e-15);
  }
  EXPECT_EQ(tube.position.front().z(), -1.0);
  EXPECT_EQ(tube.position.back().z(), 1.0);
}

TEST(ArrangeCurve, PassesItsPointsAtEqualDistances) {
  std::vector<Vec3> points;  // a helix
  for (int k = 0; k <= 24; ++k) points.emplace_back(std::cos(0.3 * k), std::sin(0.3 * k), 0.05 * k);
  const Arrangement curve = arrange_curve(points, 200);
  EXPECT_LT((curve.position.front() - points.front()).norm(), 1e-12);
  EXPECT_LT((curve.position.back() - points.back()).norm(), 1e-9);
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (std::size_t i = 1; i < curve.size(); ++i) {
    const Vec3 way = curve.position[i] - curve.position[i - 1];
    least = std::min(least, way.norm());
    most = std::max(most, way.norm());
    EXPECT_GT((curve.orientation[i] * Vec3::UnitX()).dot(way.normalized()), 0.999);
  }
  EXPECT_LT(most / least, 1.001);
  const double turn = std::sqrt(0.3 * 0.3 + 0.05 * 0.05);
  EXPECT_NEAR(most * 199, 24 * turn, 2e-2 * 24 * turn);
}

TEST(ArrangeCurve, TurnsItsFramesNoMoreThanNeeded) {
  // In a plane the normal to it stays.
  std::vector<Vec3> points;
  for (int k = 0; k <= 12; ++k) points.emplace_back(std::cos(0.4 * k), std::sin(0.4 * k), 0.0);
  const Arrangement curve = arrange_curve(points, 50);
  for (const Quat& q : curve.orientation) EXPECT_LT((q * Vec3::UnitZ() - Vec3::UnitZ()).norm(), 1e-9);
}

TEST(ArrangeScatter, KeepsParticlesApartAndRepeats) {
  const Vec3 size(1.0, 2.0, 0.5);
  const Arrangement one = arrange_scatter(size, 200, 0.08, 1), same = arrange_scatter(size, 200, 0.08, 1), other = arrange_scatter(size, 200, 0.08, 2);
  ASSERT_EQ(one.size(), 200u);
  EXPECT_EQ(one.position, same.position);
  EXPECT_NE(one.position, other.position);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_TRUE((one.position[i].cwiseAbs().array() <= 0.5 * size.array()).all());
    for (std::size_t j = 0; j < i; ++j) EXPECT_GE((one.position[i] - one.position[j]).norm(), 0.08);
  }
  EXPECT_LT(arrange_scatter(size, 10000, 0.3, 1).size(), 10000u);  // no room
}

TEST(Course, IsLinearBetweenItsTimesAndHasItsMean) {
  const auto course = std::make_shared<const Course>(Course{{0.0, 1.0, 3.0}, {1.0, 2.0, -2.0}});
  EXPECT_EQ(course->at(-1.0), 1.0);
  EXPECT_EQ(course->at(2.0), 0.0);
  EXPECT_EQ(course->at(9.0), -2.0);
  EXPECT_EQ(course->largest(), 2.0);
  ExternalLoad load{.particle = 0, .begin = 0.5, .end = 2.5, .ramp = 0.5};
  load.course = course;
  EXPECT_EQ(load.factor(0.75), 0.5 * 1.75);
  // Against a fine sum over the same span.
  double sum = 0.0;
  constexpr int kParts = 200000;
  for (int k = 0; k < kParts; ++k) sum += load.factor(0.2 + 2.6 * (k + 0.5) / kParts) / kParts;
  EXPECT_NEAR(load.mean(0.2, 2.8), sum, 1e-9);
  EXPECT_TRUE(load.changes(1.2, 1.3));
}

}  // namespace
}  // namespace supple::core
