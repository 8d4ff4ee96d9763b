#include "supple/implicit/skeleton.h"

#include <gtest/gtest.h>

#include <cmath>

#include "bodies.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

using testing::Random;

double distance(ShapeKind shape, const Vec3& size, const Vec3& y) { return std::sqrt(evaluate(shape, size, 1.0, y).q); }

TEST(Shapes, HaveTheDistancesOfTheWorkedExamples) {  // relative 1e-12, values exact or to nine digits
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Segment, {1, 0, 0}, {0, 1, 0}), 1.0);
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Segment, {1, 0, 0}, {2, 1, 0}), std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Rectangle, {1, 0.5, 0}, {2, 1.5, 1}), std::sqrt(3.0));
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Box, {1, 1, 1}, {2, 3, 1}), std::sqrt(5.0));
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Disc, {1, 0, 0}, {2, 0, 1}), std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Point, {0, 0, 0}, {2, -1, 2}), 3.0);
  EXPECT_EQ(distance(ShapeKind::Box, {1, 1, 1}, {0.5, -0.9, 1.0}), 0.0);
  EXPECT_EQ(distance(ShapeKind::Disc, {1, 0, 0}, {0.6, 0.6, 0.0}), 0.0);
}

TEST(Shapes, EllipsoidReachesItsSupportOnItsSemiAxes) {
  const Vec3 size(0.5, 1.0, 2.0);
  for (int k = 0; k < 3; ++k) {
    EXPECT_DOUBLE_EQ(evaluate(ShapeKind::Ellipsoid, size, 0.7, size[k] * Vec3::Unit(k)).q, 0.7 * 0.7);
  }
}

TEST(Shapes, AgreeWithTheNearestOfManyPointsOnTheShape) {
  // A shape sampled with spacing s bounds the distance from above and misses it by at most s.
  const Vec3 size(0.8, 0.5, 0.3);
  const int n = 60;
  Random random(3);
  for (const ShapeKind shape : {ShapeKind::Segment, ShapeKind::Rectangle, ShapeKind::Disc, ShapeKind::Box}) {
    for (int trial = 0; trial < 5; ++trial) {
      const Vec3 y = random.in_box(2.0);
      double nearest = 1e9;
      for (int i = 0; i <= n; ++i) {
        for (int j = 0; j <= n; ++j) {
          for (int k = 0; k <= n; ++k) {
            Vec3 s = Vec3(2.0 * i / n - 1, 2.0 * j / n - 1, 2.0 * k / n - 1).cwiseProduct(size);
            if (shape != ShapeKind::Box) s.z() = 0;
            if (shape == ShapeKind::Segment) s.y() = 0;
            if (shape == ShapeKind::Disc) {
              s.y() *= size.x() / size.y();
              if (s.head<2>().norm() > size.x()) continue;
            }
            nearest = std::min(nearest, (y - s).norm());
          }
        }
      }
      const double d = distance(shape, size, y);
      EXPECT_LE(d, nearest + 1e-12);
      EXPECT_GE(d, nearest - 2.0 * 0.8 * std::sqrt(3.0) / n);
    }
  }
}

class EveryShape : public ::testing::TestWithParam<ShapeKind> {};

TEST_P(EveryShape, GradientMatchesCentralDifferences) {
  const Vec3 size(0.8, 0.5, 0.3);
  const double h = 1e-6;
  Random random(5);
  for (int trial = 0; trial < 400; ++trial) {
    const Vec3 y = random.in_box(2.0);
    bool at_edge = false;  // second derivatives jump where a face or the rim begins
    for (int k = 0; k < 3; ++k) at_edge = at_edge || std::abs(std::abs(y[k]) - size[k]) < 2 * h;
    if (at_edge || std::abs(y.head<2>().norm() - size.x()) < 2 * h) continue;
    const ShapeSample sample = evaluate(GetParam(), size, 1.0, y);
    for (int k = 0; k < 3; ++k) {
      const Vec3 step = h * Vec3::Unit(k);
      const double difference =
          (evaluate(GetParam(), size, 1.0, y + step).q - evaluate(GetParam(), size, 1.0, y - step).q) / (2 * h);
      // q is a quadratic there (a disc's rim: third derivatives < 20), so what remains is round-off: q eps / h.
      EXPECT_NEAR(sample.gradient[k], difference, 1e-8 * (1.0 + sample.q)) << y.transpose();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, EveryShape,
                         ::testing::Values(ShapeKind::Point, ShapeKind::Segment, ShapeKind::Rectangle, ShapeKind::Disc,
                                           ShapeKind::Box, ShapeKind::Ellipsoid));

TEST(PlaceSkeleton, ComposesThePoseOfThePartWithTheOffset) {
  Skeleton skeleton;
  skeleton.part_count = 2;
  Primitive p = testing::wyvill_point(0.5);
  p.part = 1;
  p.offset.position = {1, 2, 3};
  p.offset.orientation = Quat(Eigen::AngleAxisd(0.3, Vec3::UnitX()));
  skeleton.primitive = {p};
  std::vector<Pose> parts(2);
  parts[1].position = {10, 20, 30};
  parts[1].orientation = Quat(Eigen::AngleAxisd(1.1, Vec3(1, 2, 2) / 3.0));
  PlacedSkeleton placed;
  place_skeleton(skeleton, parts, placed);
  ASSERT_EQ(placed.position.size(), 1u);
  const Vec3 y(0.1, -0.2, 0.3);
  const Vec3 expected = parts[1].to_world(p.offset.to_world(y));
  EXPECT_LT((placed.rotation[0] * y + placed.position[0] - expected).norm(), 1e-14);
}

TEST(PlaceSkeleton, SupportBoxesHoldAllOfTheSupport) {
  const testing::Body body = testing::random_body({.seed = 11, .parts = 60});
  for (std::size_t i = 0; i < body.skeleton.primitive.size(); ++i) {
    const Primitive& p = body.skeleton.primitive[i];
    const Box& box = body.placed.support[i];
    Random random(i + 1);
    for (int trial = 0; trial < 2000; ++trial) {
      const Vec3 x = box.centre() + 0.75 * random.in_box(1.0).cwiseProduct(box.extent());
      const Vec3 y = body.placed.rotation[i].transpose() * (x - body.placed.position[i]);
      const double f = evaluate(p.kernel, evaluate(p.shape, p.size, p.kernel.radius, y).q).value;
      EXPECT_TRUE(f == 0.0 || box.contains(x));
    }
  }
}

TEST(PlaceSkeleton, SupportOfATurnedPlateIsTheRoundedPlatesBox) {
  Primitive p = testing::wyvill_point(0.25);
  p.shape = ShapeKind::Rectangle;
  p.size = {1.0, 1.0, 0.0};
  Skeleton skeleton;
  skeleton.part_count = 1;
  skeleton.primitive = {p};
  std::vector<Pose> parts(1);
  parts[0].orientation = Quat(Eigen::AngleAxisd(std::acos(-1.0) / 4, Vec3::UnitZ()));
  PlacedSkeleton placed;
  place_skeleton(skeleton, parts, placed);
  EXPECT_NEAR(placed.support[0].upper.x(), std::sqrt(2.0) + 0.25, 1e-11);
  EXPECT_NEAR(placed.support[0].upper.z(), 0.25, 1e-11);
}

TEST(PlaceSkeleton, RefusesPosesThatDoNotFitTheParts) {
  Skeleton skeleton;
  skeleton.part_count = 2;
  std::vector<Pose> parts(1);
  PlacedSkeleton placed;
  EXPECT_THROW(place_skeleton(skeleton, parts, placed), ContractViolation);
}

}  // namespace
}  // namespace supple::implicit
