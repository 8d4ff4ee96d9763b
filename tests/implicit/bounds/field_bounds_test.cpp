#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "implicit/bodies.h"
#include "supple/implicit/field.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::random_body;
using testing::Random;

class BoundedBody : public ::testing::TestWithParam<testing::BodyOptions> {
 protected:
  Body body_ = random_body(GetParam());
};

TEST_P(BoundedBody, TrueRangeLiesInsideTheInterval) {
  // 25,000 boxes of all sizes for each body, values and gradients at the corners and inside.
  Random random(77);
  std::vector<Vec3> points(24);
  std::vector<double> values(24);
  std::vector<Vec3> gradients(24);
  int violations = 0, decided = 0;
  for (int trial = 0; trial < 25000; ++trial) {
    const double size = 0.8 * std::pow(10.0, -4.0 * random.uniform(0, 1));
    const Vec3 centre = random.in_box(1.5);
    const Vec3 half = 0.5 * size * (Vec3::Ones() + 0.9 * random.in_box(1.0));
    const Box box{centre - half, centre + half};
    for (int i = 0; i < 24; ++i) {
      const Vec3 t = i < 8 ? Vec3(i & 1, (i >> 1) & 1, i >> 2)
                           : Vec3(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1));
      points[i] = (box.lower + t.cwiseProduct(box.extent())).cwiseMax(box.lower).cwiseMin(box.upper);
    }
    body_.field.evaluate(points, values, gradients);
    const Interval bound = body_.field.bound(box);
    const double steepest = body_.field.gradient_bound(box);
    for (int i = 0; i < 24; ++i) {
      violations += !bound.contains(values[i]);
      violations += gradients[i].norm() > steepest;
    }
    decided += bound.upper < 0.0 || bound.lower > 0.0;
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GT(decided, 10000);  // bounds are of use
}

TEST_P(BoundedBody, TightIntervalHoldsTheRangeAndIsNeverWider) {
  Random random(87);
  std::vector<Vec3> points(24);
  std::vector<double> values(24);
  std::vector<Vec3> gradients(24);
  int violations = 0, decided = 0, plainly = 0, steep = 0;
  for (int trial = 0; trial < 8000; ++trial) {
    const double size = 0.4 * std::pow(10.0, -2.0 * random.uniform(0, 1));
    const Vec3 centre = random.in_box(1.5);
    const Vec3 half = 0.5 * size * (Vec3::Ones() + 0.9 * random.in_box(1.0));
    const Box box{centre - half, centre + half};
    for (std::size_t i = 0; i < 24; ++i) {
      const auto bit = [i](std::size_t k) { return static_cast<double>(i >> k & 1); };
      const Vec3 t = i < 8 ? Vec3(bit(0), bit(1), bit(2)) : Vec3(0.5 * (Vec3::Ones() + random.in_box(1.0)));
      points[i] = (box.lower + t.cwiseProduct(box.extent())).cwiseMax(box.lower).cwiseMin(box.upper);
    }
    body_.field.evaluate(points, values, gradients);
    const Interval plain = body_.field.bound(box);
    const Interval tight = body_.field.tight_bound(box);
    for (const double value : values) violations += !tight.contains(value);
    const double least_slope = body_.field.box_bounds(box).least_slope;
    for (const Vec3& gradient : gradients) violations += gradient.norm() < least_slope;
    steep += least_slope > 0.0;
    EXPECT_GE(tight.lower, plain.lower);
    EXPECT_LE(tight.upper, plain.upper);
    decided += tight.upper < 0.0 || tight.lower > 0.0;
    plainly += plain.upper < 0.0 || plain.lower > 0.0;
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GE(decided, plainly);
  EXPECT_GT(steep, 0);
}

TEST_P(BoundedBody, IntervalShrinksToTheValueOnAPoint) {
  Random random(78);
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3 x = random.in_box(1.2);
    const double value = FieldView(body_.field).value(x);
    const Interval bound = body_.field.bound({x, x});
    EXPECT_TRUE(bound.contains(value));
    EXPECT_LT(bound.upper - bound.lower, 1e-10);  // round-off of up to some hundred terms of size 1
  }
}

TEST_P(BoundedBody, SurfaceBoxHoldsTheBodyAndIsClose) {
  const Box box = body_.field.surface_box();
  Box hull;
  Random random(79);
  std::vector<Vec3> points(1000);
  std::vector<double> values(1000);
  for (int batch = 0; batch < 400; ++batch) {
    for (Vec3& x : points) x = random.in_box(2.2);
    body_.field.evaluate(points, values);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (values[i] >= 0.0) hull.include(points[i]);
    }
  }
  ASSERT_FALSE(hull.empty());
  EXPECT_TRUE(box.contains(hull.lower) && box.contains(hull.upper));
  // 5 % of the size for the search, and 0.1 because a sampled hull misses the outermost tips.
  EXPECT_LT((box.extent() - hull.extent()).maxCoeff(), 2 * (0.05 * hull.extent().maxCoeff() + 0.1));
}

INSTANTIATE_TEST_SUITE_P(
    Bodies, BoundedBody,
    ::testing::Values(testing::BodyOptions{.seed = 1, .parts = 3}, testing::BodyOptions{.seed = 2, .parts = 12},
                      testing::BodyOptions{.seed = 7, .parts = 40, .half_width = 1.3, .every_shape = true},
                      testing::BodyOptions{
                          .seed = 5, .parts = 300, .half_width = 1.2, .least_radius = 0.2, .largest_radius = 0.3},
                      testing::BodyOptions{.seed = 6,
                                           .parts = 2000,
                                           .half_width = 1.2,
                                           .least_radius = 0.1,
                                           .largest_radius = 0.2,
                                           .only_points = true}));

TEST(FieldBounds, SurfaceBoxOfOnePointIsItsSpheresBox) {
  const Body body = testing::body_of({{testing::wyvill_point(1.0), Vec3(1, 2, 3)}});
  const Box box = body.field.surface_box();
  const double radius = std::sqrt(1.0 - std::cbrt(0.5));  // (1 - r^2)^3 = 1/2
  for (int k = 0; k < 3; ++k) {
    for (const double beyond : {box.upper[k] - (k + 1) - radius, (k + 1) - box.lower[k] - radius}) {
      EXPECT_GT(beyond, 0.0);
      EXPECT_LT(beyond, 1e-8);
    }
  }
}

TEST(FieldBounds, SurfaceBoxFollowsTheBody) {
  Body body = testing::body_of({{testing::wyvill_point(1.0), Vec3::Zero()}});
  const Box before = body.field.surface_box();
  EXPECT_EQ(body.field.surface_box().lower, before.lower);
  body.parts[0].position.x() = 10.0;
  body.place();
  EXPECT_NEAR(body.field.surface_box().lower.x(), before.lower.x() + 10.0, 1e-9);
}

TEST(FieldBounds, SurfaceBoxOfUnequalPrimitivesIsFound) {
  // A speck a ten-thousandth of its neighbour: the search must not refine to the speck's size.
  const Body body = testing::body_of(
      {{testing::wyvill_point(1.0), Vec3::Zero()}, {testing::wyvill_point(1e-4), Vec3(3.0, 0.0, 0.0)}});
  const Box box = body.field.surface_box();
  EXPECT_TRUE(box.contains(Vec3(3.0 + 0.45e-4, 0.0, 0.0)));
  EXPECT_LT(box.upper.x(), 3.001);
}

TEST(FieldBounds, ABodyTooThinForItsIsoValueHasNoSurface) {
  Primitive p = testing::wyvill_point(1.0);
  Body body;
  body.skeleton.iso = 1.5;  // above the peak of a lone kernel
  body.skeleton.part_count = 1;
  body.skeleton.primitive = {p};
  body.parts.resize(1);
  body.place();
  EXPECT_TRUE(body.field.surface_box().empty());
}

TEST(FieldBounds, TightIntervalsOfOverlappingBlobsErrByTheSquareOfTheBox) {
  // Some sixty supports overlap. Summed intervals are off by the sum of all slopes times the box, the tight ones by second
  // derivatives times its square: halving the box quarters what they exceed the true range by.
  const Body body = random_body({.seed = 9, .parts = 600, .half_width = 0.8, .least_radius = 0.3, .largest_radius = 0.4, .only_points = true});
  Random random(88);
  double excess[2] = {0.0, 0.0}, plain_excess[2] = {0.0, 0.0};
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 centre = random.in_box(0.6);
    for (const int k : {0, 1}) {
      const double h = k == 0 ? 0.02 : 0.01;
      const Box box = Box{centre, centre}.inflated(h);
      Interval range{1e9, -1e9};
      for (int i = 0; i < 125; ++i) {
        const Vec3 x = centre + 0.5 * h * Vec3(i % 5 - 2, i / 5 % 5 - 2, i / 25 - 2);
        const double f = FieldView(body.field).value(x);
        range = {std::min(range.lower, f), std::max(range.upper, f)};
      }
      const Interval tight = body.field.tight_bound(box), plain = body.field.bound(box);
      excess[k] += (tight.upper - tight.lower) - (range.upper - range.lower);
      plain_excess[k] += (plain.upper - plain.lower) - (range.upper - range.lower);
    }
  }
  EXPECT_LT(excess[1], 0.27 * excess[0]);
  EXPECT_GT(plain_excess[1], 0.45 * plain_excess[0]);
  EXPECT_LT(excess[1], 0.15 * plain_excess[1]);
}

TEST(FieldBounds, UnboundedBoxesAreBounded) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Body body = random_body({.seed = 3, .parts = 100});
  const Box all{Vec3::Constant(-infinity), Vec3::Constant(infinity)};
  const Interval bound = body.field.bound(all);
  EXPECT_EQ(bound.lower, -0.5);
  EXPECT_TRUE(std::isfinite(bound.upper));
  EXPECT_TRUE(std::isfinite(body.field.gradient_bound(all)));
  const Box half{Vec3(0, -infinity, -infinity), Vec3::Constant(infinity)};
  EXPECT_LE(body.field.bound(half).upper, bound.upper);
}

TEST(FieldBounds, AwayFromEverySupportTheyAreExact) {
  const Body body = random_body({.seed = 3, .parts = 100});
  const Box far{Vec3::Constant(20), Vec3::Constant(21)};
  EXPECT_EQ(body.field.bound(far).lower, -0.5);
  EXPECT_EQ(body.field.bound(far).upper, -0.5);
  EXPECT_EQ(body.field.gradient_bound(far), 0.0);
}

}  // namespace
}  // namespace supple::implicit
