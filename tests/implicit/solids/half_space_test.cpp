#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "implicit/bodies.h"
#include "supple/implicit/field.h"

namespace supple::implicit {
namespace {

const HalfSpace kTilted{.point = {1, 2, 3}, .normal = Vec3(2, -1, 2) / 3.0, .slope = 4.0};

TEST(HalfSpace, FieldIsTheScaledDepth) {
  const FieldView field(kTilted);
  Vec3 gradient;
  EXPECT_NEAR(field.value(kTilted.point - 0.25 * kTilted.normal, gradient), 1.0, 1e-15);
  EXPECT_NEAR(field.value(kTilted.point + 0.25 * kTilted.normal), -1.0, 1e-15);
  EXPECT_EQ(field.value(kTilted.point), 0.0);
  EXPECT_LT((gradient + 4.0 * kTilted.normal).norm(), 1e-15);
}

TEST(HalfSpace, IsOnePartAtEveryPoint) {
  const std::vector<Vec3> points = testing::random_points(1, 5, 2.0);
  FieldParts parts;
  kTilted.evaluate_parts(points, parts);
  EXPECT_EQ(parts.offset, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(parts.part, (std::vector<std::uint32_t>(5, 0)));
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(parts.value[i], FieldView(kTilted).value(points[i]));
}

TEST(HalfSpace, BoundsHoldAndAreTight) {
  testing::Random random(2);
  for (int trial = 0; trial < 1000; ++trial) {
    const Vec3 centre = random.in_box(5);
    const Vec3 half = random.in_box(1).cwiseAbs();
    const Box box{centre - half, centre + half};
    const Interval bound = kTilted.bound(box);
    double low = 1e9, high = -1e9;
    for (int i = 0; i < 8; ++i) {
      const Vec3 corner(i & 1 ? box.upper.x() : box.lower.x(), i & 2 ? box.upper.y() : box.lower.y(),
                        i & 4 ? box.upper.z() : box.lower.z());
      const double value = FieldView(kTilted).value(corner);
      EXPECT_TRUE(bound.contains(value));
      low = std::min(low, value);
      high = std::max(high, value);
    }
    EXPECT_NEAR(bound.lower, low, 1e-12);  // sizes up to 4 * 10 in some ulp
    EXPECT_NEAR(bound.upper, high, 1e-12);
    EXPECT_GE(kTilted.gradient_bound(box), 4.0);
  }
}

TEST(HalfSpace, SurfaceBoxIsUnboundedButForAnAxis) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Box tilted = kTilted.surface_box();
  EXPECT_TRUE((tilted.lower.array() == -infinity).all() && (tilted.upper.array() == infinity).all());
  const Box ground = HalfSpace{.point = {0, 0, -0.6}, .normal = Vec3::UnitZ(), .slope = 2.0}.surface_box();
  EXPECT_EQ(ground.upper, Vec3(infinity, infinity, -0.6));
  EXPECT_EQ(ground.lower, Vec3::Constant(-infinity));
  const Box wall = HalfSpace{.point = {1, 0, 0}, .normal = -Vec3::UnitX(), .slope = 2.0}.surface_box();
  EXPECT_EQ(wall.lower.x(), 1.0);
}

TEST(HalfSpace, BoundsOnUnboundedBoxesHaveNoNaN) {
  const HalfSpace ground{};
  const Interval bound = ground.bound(ground.surface_box());
  EXPECT_EQ(bound.upper, std::numeric_limits<double>::infinity());
  EXPECT_LE(bound.lower, 0.0);
  EXPECT_FALSE(std::isnan(bound.lower));
}

}  // namespace
}  // namespace supple::implicit
