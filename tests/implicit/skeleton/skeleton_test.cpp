#include "supple/implicit/skeleton.h"

#include <gtest/gtest.h>

#include <cmath>

#include "implicit/bodies.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

using testing::Random;

Primitive shape_of(ShapeKind kind, const Vec3& size, std::vector<Vec3> control = {}) {
  Primitive p;
  p.shape = kind;
  p.size = size;
  p.control = std::move(control);
  p.kernel = Kernel::wyvill(1.0);
  return p;
}
double distance(const Primitive& p, const Vec3& y) { return std::sqrt(evaluate(p, y).q); }
double distance(ShapeKind shape, const Vec3& size, const Vec3& y) { return distance(shape_of(shape, size), y); }

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
    EXPECT_DOUBLE_EQ(distance(ShapeKind::Ellipsoid, size, size[k] * Vec3::Unit(k)), 1.0);
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

TEST(Shapes, TrianglesHaveTheDistancesOfTheWorkedExamples) {
  const std::vector<Vec3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (const ShapeKind kind : {ShapeKind::Triangle, ShapeKind::Polygon}) {
    const Primitive p = shape_of(kind, Vec3::Zero(), corners);
    EXPECT_DOUBLE_EQ(distance(p, {1, 1, 0}), std::sqrt(0.5));
    EXPECT_DOUBLE_EQ(distance(p, {0.2, 0.2, -3}), 3.0);
    EXPECT_DOUBLE_EQ(distance(p, {-1, -1, 1}), std::sqrt(3.0));
  }
}

TEST(Shapes, RingsArcsAndCurvesHaveTheDistancesOfTheWorkedExamples) {
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Ring, {1, 0, 0}, {0, 0, 1}), std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(distance(ShapeKind::Ring, {1, 0, 0}, {3, 4, 3}), 5.0);
  const Primitive half = shape_of(ShapeKind::Arc, {1, std::acos(0.0), 0});  // |angle| <= pi / 2
  EXPECT_DOUBLE_EQ(distance(half, {3, 4, 3}), 5.0);
  EXPECT_NEAR(distance(half, {-1, 1, 0}), 1.0, 1e-15);  // its end (0, 1, 0)
  EXPECT_NEAR(distance(half, {-1, -1, 1}), std::sqrt(2.0), 1e-15);
  const Primitive quadratic = shape_of(ShapeKind::Curve, Vec3::Zero(), {{0, 0, 0}, {1, 2, 0}, {2, 0, 0}});
  EXPECT_NEAR(distance(quadratic, {1, 2, 0}), 1.0, 1e-12);
  EXPECT_NEAR(distance(quadratic, {1, 0, 1}), 1.32287566, 5e-9);
  // The same parabola as a cubic.
  const Primitive cubic = shape_of(ShapeKind::Curve, Vec3::Zero(), {{0, 0, 0}, {2.0 / 3, 4.0 / 3, 0}, {4.0 / 3, 4.0 / 3, 0}, {2, 0, 0}});
  Random random(4);
  for (int i = 0; i < 200; ++i) {
    const Vec3 y = random.in_box(3.0);
    EXPECT_NEAR(distance(cubic, y), distance(quadratic, y), 1e-13);
  }
  // Two control points are a segment.
  const Primitive line = shape_of(ShapeKind::Curve, Vec3::Zero(), {{-1, 0, 0}, {1, 0, 0}});
  for (int i = 0; i < 200; ++i) {
    const Vec3 y = random.in_box(3.0);
    EXPECT_NEAR(distance(line, y), distance(ShapeKind::Segment, {1, 0, 0}, y), 1e-14);
  }
}

TEST(Shapes, AFullArcIsARing) {
  Random random(6);
  const double pi = std::acos(-1.0);
  for (int i = 0; i < 200; ++i) {
    const Vec3 y = random.in_box(2.0);
    EXPECT_NEAR(distance(ShapeKind::Arc, {0.8, pi, 0}, y), distance(ShapeKind::Ring, {0.8, 0, 0}, y), 1e-14);
  }
}

/// The kernel's distance by brute force: the least |y - point| / scale over many points of the shape.
double brute_force(const std::vector<std::pair<Vec3, double>>& points, const Vec3& y) {
  double least = 1e9;
  for (const auto& [point, scale] : points) least = std::min(least, (y - point).norm() / scale);
  return least;
}

TEST(Shapes, ArcsAgreeWithBruteForce) {
  Random random(9);
  constexpr int n = 20000;
  for (const double half_angle : {0.4, 1.3, 2.2, 3.0}) {
    std::vector<std::pair<Vec3, double>> points;
    for (int i = 0; i <= n; ++i) {
      const double angle = half_angle * (2.0 * i / n - 1.0);
      points.emplace_back(0.8 * Vec3(std::cos(angle), std::sin(angle), 0.0), 1.0);
    }
    for (int trial = 0; trial < 100; ++trial) {
      const Vec3 y = random.in_box(1.5);
      // Between two points the arc is half a step of theirs away at most.
      EXPECT_NEAR(distance(ShapeKind::Arc, {0.8, half_angle, 0}, y), brute_force(points, y), 0.8 * half_angle / n);
    }
  }
}

TEST(Shapes, ArcsOfLessThanHalfACirclePullTowardsTheirMiddleFromTheirAxis) {
  for (const double half_angle : {0.4, 1.3, 2.2}) {
    for (const double z : {-0.3, 0.0, 0.5}) {
      const Primitive p = shape_of(ShapeKind::Arc, {0.8, half_angle, 0});
      const ShapeSample at = evaluate(p, {0.0, 0.0, z});
      EXPECT_NEAR(at.q, 0.64 + z * z, 1e-15);
      // Of three quarters of a circle none is nearer to one side than to the other.
      const Vec3 expected(half_angle < 1.5 ? -1.6 : 0.0, 0.0, 2.0 * z);
      EXPECT_LE((at.gradient - expected).norm(), 1e-15) << at.gradient.transpose();
      // (0.8 - x)^2 + z^2 from there on.
      if (half_angle < 1.5) {
        EXPECT_NEAR((evaluate(p, {1e-6, 0.0, z}).q - at.q) / 1e-6, at.gradient.x(), 2e-6);
      }
    }
  }
}

TEST(Shapes, SupportOfRadiiByDirectionReachesAsFarAsItsBoxWhereOneRadiusIsSmall) {
  // Along x the support bulges beyond its radius 0.2 there: the largest n_x r(n) is 0.43.
  Primitive p = shape_of(ShapeKind::Directed, {0.2, 1.0, 1.0}, {{0.2, 1.0, 1.0}});
  p.kernel = Kernel::wyvill(1.0);
  double reach = 0.0;
  for (int i = 0; i <= 10000; ++i) {
    const double n = i / 10000.0;
    reach = std::max(reach, n * (0.2 * n * n + 1.0 - n * n));
  }
  EXPECT_NEAR(support_box(p).upper.x(), reach, 1e-6);
  EXPECT_NEAR(support_box(p).lower.x(), -reach, 1e-6);
}

TEST(Shapes, CurvesOfVaryingRadiusAgreeWithBruteForce) {
  Random random(7);
  const int n = 20000;
  for (int shape = 0; shape < 24; ++shape) {
    Primitive p = shape_of(ShapeKind::Curve, Vec3::Zero());
    const std::size_t count = 2 + shape % 3;
    for (std::size_t i = 0; i < count; ++i) p.control.push_back(random.in_box(1.0));
    p.taper = shape < 6 ? 1.0 : random.uniform(0.2, 3.0);
    std::vector<std::pair<Vec3, double>> points;
    double fastest = 0.0;
    for (int i = 0; i <= n; ++i) {
      const double t = static_cast<double>(i) / n;
      std::vector<Vec3> c = p.control;  // de Casteljau
      for (std::size_t m = c.size() - 1; m > 0; --m) {
        for (std::size_t k = 0; k < m; ++k) c[k] = (1 - t) * c[k] + t * c[k + 1];
      }
      points.push_back({c[0], 1.0 + (p.taper - 1.0) * t});
      if (i > 0) fastest = std::max(fastest, (points[static_cast<std::size_t>(i)].first - points[static_cast<std::size_t>(i) - 1].first).norm());
    }
    for (int trial = 0; trial < 40; ++trial) {
      const Vec3 y = random.in_box(1.6);
      const double nearest = brute_force(points, y);
      const double d = distance(p, y);
      EXPECT_LE(d, nearest + 1e-12) << shape;
      // Half a step along the curve and of the radius, over the least radius squared (d <= 6 here).
      EXPECT_GE(d, nearest - 30.0 * (fastest + 2.0 / n)) << shape;
    }
  }
}

TEST(Shapes, TaperedSegmentsAreTaperedCurvesOfTwoPoints) {
  Random random(8);
  for (int shape = 0; shape < 20; ++shape) {
    Primitive segment = shape_of(ShapeKind::Segment, {random.uniform(0.05, 1.0), 0, 0});
    segment.taper = random.uniform(0.1, 6.0);
    Primitive curve = shape_of(ShapeKind::Curve, Vec3::Zero(), {{-segment.size.x(), 0, 0}, {segment.size.x(), 0, 0}});
    curve.taper = segment.taper;
    for (int trial = 0; trial < 100; ++trial) {
      const Vec3 y = random.in_box(2.0);
      EXPECT_NEAR(distance(segment, y), distance(curve, y), 1e-12 * distance(segment, y)) << shape;
    }
  }
}

TEST(Shapes, PolygonsAgreeWithTheTrianglesOfTheirFan) {
  Random random(9);
  const Quat turn = random.rotation();
  std::vector<Vec3> corners;
  for (const double angle : {0.1, 1.0, 1.9, 3.3, 5.0}) corners.push_back(turn * Vec3(std::cos(angle), 0.7 * std::sin(angle), 0.0));
  const Primitive polygon = shape_of(ShapeKind::Polygon, Vec3::Zero(), corners);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 y = random.in_box(1.5);
    double nearest = 1e9;
    for (std::size_t k = 1; k + 1 < corners.size(); ++k) {
      nearest = std::min(nearest, distance(shape_of(ShapeKind::Triangle, Vec3::Zero(), {corners[0], corners[k], corners[k + 1]}), y));
    }
    EXPECT_NEAR(distance(polygon, y), nearest, 1e-14);
  }
}

TEST(Shapes, SuperquadricsRunFromEllipsoidsToBoxes) {
  const Vec3 size(0.5, 0.8, 1.2);
  Primitive p = shape_of(ShapeKind::Superquadric, size);
  Random random(10);
  for (int i = 0; i < 200; ++i) {
    const Vec3 y = random.in_box(1.5);
    EXPECT_NEAR(distance(p, y), distance(ShapeKind::Ellipsoid, size, y), 1e-14);
  }
  p.exponent = {0.2, 0.2};  // ten-norm of the scaled coordinates
  for (int i = 0; i < 200; ++i) {
    const Vec3 y = random.in_box(1.5);
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) sum += std::pow(std::abs(y[k] / size[k]), 10.0);
    EXPECT_NEAR(distance(p, y), std::pow(sum, 0.1), 1e-13);
  }
  p.exponent = {1.0, 0.4};  // a rounded cylinder about z: circles seen from the side
  EXPECT_NEAR(distance(p, {0.3, 0.0, 0.0}), 0.6, 1e-15);
  EXPECT_NEAR(distance(p, {0.3, 0.0, 0.96}), 1.0, 1e-15);
}

TEST(Shapes, DirectedRadiiEndTheSupportOnTheAxes) {
  const Primitive p = shape_of(ShapeKind::Directed, {0.5, 0.8, 1.2}, {{0.3, 0.8, 0.4}});
  for (int k = 0; k < 3; ++k) {
    EXPECT_DOUBLE_EQ(distance(p, p.size[k] * Vec3::Unit(k)), 1.0);
    EXPECT_DOUBLE_EQ(distance(p, -p.control[0][k] * Vec3::Unit(k)), 1.0);
  }
  const Vec3 n = Vec3(-1, 2, 2) / 3.0;  // radius (0.3 + 4 * 0.8 + 4 * 1.2) / 9
  EXPECT_DOUBLE_EQ(distance(p, n), 9.0 / 8.3);
}

std::vector<Primitive> every_shape() {
  std::vector<Primitive> shapes;
  const Vec3 size(0.8, 0.5, 0.3);
  for (const ShapeKind kind : {ShapeKind::Point, ShapeKind::Segment, ShapeKind::Rectangle, ShapeKind::Disc, ShapeKind::Box,
                               ShapeKind::Ellipsoid, ShapeKind::Ring, ShapeKind::Arc, ShapeKind::Superquadric}) {
    shapes.push_back(shape_of(kind, size));
  }
  shapes.back().exponent = {0.4, 0.7};
  shapes.push_back(shape_of(ShapeKind::Directed, size, {{0.4, 0.6, 0.5}}));
  shapes.push_back(shape_of(ShapeKind::Segment, size));
  shapes.back().taper = 0.4;
  shapes.push_back(shape_of(ShapeKind::Triangle, size, {{-0.3, 0.1, 0.2}, {0.6, -0.4, 0.1}, {0.2, 0.7, -0.5}}));
  shapes.push_back(shape_of(ShapeKind::Polygon, size, {{-0.5, -0.4, 0.1}, {0.6, -0.3, 0.1}, {0.5, 0.6, 0.1}, {-0.3, 0.5, 0.1}}));
  shapes.push_back(shape_of(ShapeKind::Curve, size, {{-0.6, 0.1, 0.2}, {0.1, 0.9, 0.1}, {0.7, -0.2, -0.4}}));
  shapes.push_back(shape_of(ShapeKind::Curve, size, {{-0.6, 0.1, 0.2}, {0.1, 1.5, 0.1}, {0.2, -1.2, 0.4}, {0.7, 0.4, -0.4}}));
  shapes.push_back(shapes.back());
  shapes.back().taper = 1.8;
  for (std::size_t i = 0, n = shapes.size(); i < n; ++i) {
    shapes.push_back(shapes[i]);
    shapes.back().stretch = {1.3, 0.6, 0.9};
  }
  return shapes;
}

class EveryShape : public ::testing::TestWithParam<int> {
 protected:
  Primitive shape_ = every_shape()[static_cast<std::size_t>(GetParam())];
};

TEST_P(EveryShape, GradientAndSecondDerivativeMatchCentralDifferences) {
  const double h = 1e-6;
  Random random(5);
  int precise = 0, count = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const Vec3 y = random.in_box(1.5);
    const ShapeSample sample = evaluate(shape_, y);
    const Mat3 second = second_derivative(shape_, y);
    Vec3 slope;
    Mat3 curvature;
    for (int k = 0; k < 3; ++k) {
      const ShapeSample plus = evaluate(shape_, y + h * Vec3::Unit(k)), minus = evaluate(shape_, y - h * Vec3::Unit(k));
      slope[k] = (plus.q - minus.q) / (2 * h);
      curvature.col(k) = (plus.gradient - minus.gradient) / (2 * h);
    }
    // Round-off q eps / h and third derivatives h^2; where the foot point jumps or changes its piece within h, only the
    // value is smooth, which happens at a few points.
    ++count;
    precise += (sample.gradient - slope).norm() < 1e-7 * (1.0 + sample.q) &&
               (second - curvature).norm() < 1e-5 * (1.0 + second.norm());
  }
  EXPECT_GE(precise, count - 4);
}

TEST_P(EveryShape, DistanceScaleBoundsItsSlope) {
  Random random(11);
  double steepest = 0.0;
  for (int trial = 0; trial < 4000; ++trial) {
    const Vec3 y = random.in_box(1.5);
    const ShapeSample sample = evaluate(shape_, y);
    if (sample.q > 1e-12) steepest = std::max(steepest, sample.gradient.norm() / (2.0 * std::sqrt(sample.q)));
  }
  EXPECT_LE(steepest, distance_scale(shape_) * (1.0 + 1e-12));
  EXPECT_GE(steepest, 0.35 * distance_scale(shape_));  // of use
}

TEST_P(EveryShape, SupportBoxHoldsTheSupportAndIsClose) {
  Random random(12);
  shape_.kernel = Kernel::wyvill(shape_.shape == ShapeKind::Directed || shape_.shape == ShapeKind::Superquadric ? 1.0 : 0.3);
  Skeleton skeleton;
  skeleton.part_count = 1;
  skeleton.primitive = {shape_};
  Box hull;
  const std::vector<Pose> parts{{random.in_box(1.0), random.rotation()}};
  PlacedSkeleton placed;
  place_skeleton(skeleton, parts, placed);
  const Box& box = placed.support[0];
  for (int trial = 0; trial < 200000; ++trial) {
    const Vec3 x = box.centre() + 0.6 * random.in_box(1.0).cwiseProduct(box.extent());
    if (evaluate(shape_, parts[0].to_body(x)).q >= shape_.kernel.radius * shape_.kernel.radius) continue;
    EXPECT_TRUE(box.contains(x));
    hull.include(x);
  }
  // Flat and round shapes are met exactly, hulls of control points and boxes of boxes within a factor.
  EXPECT_LE((box.extent() - hull.extent()).maxCoeff(), 0.45 * box.extent().maxCoeff());
}

INSTANTIATE_TEST_SUITE_P(Shapes, EveryShape, ::testing::Range(0, 32));

TEST(Shapes, EveryShapeIsTested) { EXPECT_EQ(every_shape().size(), 32u); }

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
  const testing::Body body = testing::random_body({.seed = 11, .parts = 80, .every_shape = true});
  for (std::size_t i = 0; i < body.skeleton.primitive.size(); ++i) {
    const Primitive& p = body.skeleton.primitive[i];
    const Box& box = body.placed.support[i];
    Random random(i + 1);
    for (int trial = 0; trial < 2000; ++trial) {
      const Vec3 x = box.centre() + 0.75 * random.in_box(1.0).cwiseProduct(box.extent());
      const Vec3 y = body.placed.rotation[i].transpose() * (x - body.placed.position[i]);
      const double f = evaluate(p.kernel, evaluate(p, y).q).value;
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

TEST(SkeletonContent, HasEveryMember) {
  testing::Body body = testing::random_body({.seed = 4, .parts = 2, .every_shape = true});
  body.skeleton.primitive[0].control = {Vec3(0.1, 0.2, 0.3)};
  body.skeleton.blend.node = {0, 1};
  body.skeleton.blend.edge = {{0, 1, 0.5}};
  body.placed.radius = {0.5};
  body.placed.part = {1};
  const auto content = [&] {
    ContentWords words;
    add_content(body.skeleton, body.placed, words);
    return std::vector<std::uint64_t>(words.view().begin(), words.view().end());
  };
  std::vector<std::uint64_t> last = content();
  EXPECT_EQ(content(), last);
  int changes = 0;
  const auto changed = [&] {
    const std::vector<std::uint64_t> now = content();
    EXPECT_NE(now, last) << "change " << changes;
    ++changes;
    last = now;
  };
  const auto change = [&](auto& member) {
    member = static_cast<std::remove_reference_t<decltype(member)>>(static_cast<int>(member) + 1);
    changed();
  };
  Primitive& p = body.skeleton.primitive[0];
  change(p.part);
  change(p.shape);
  change(p.kernel.kind);
  for (double* x : {&p.size[2], &p.offset.position[1], &p.offset.orientation.z(), &p.control[0][2], &p.taper, &p.exponent[0], &p.exponent[1],
                    &p.stretch[0], &p.kernel.radius, &p.kernel.thickness, &p.kernel.slope, &p.kernel.iso, &p.kernel.shape, &p.kernel.floor,
                    &p.kernel.tilt, &p.kernel.gain, &p.kernel.steepest, &body.skeleton.iso, &body.skeleton.blend.edge[0].weight,
                    &body.skeleton.blend.exponent, &body.skeleton.blend.opening, &body.placed.position[1][0], &body.placed.rotation[1](2, 2),
                    &body.placed.support[1].lower[0], &body.placed.support[1].upper[2], &body.placed.radius[0]}) {
    *x = std::nextafter(*x, 10.0);
    changed();
  }
  p.convolved = !p.convolved;
  changed();
  change(body.skeleton.part_count);
  change(body.skeleton.blend.rule);
  change(body.skeleton.blend.node[1]);
  change(body.skeleton.blend.edge[0].a);
  change(body.skeleton.blend.edge[0].b);
  change(body.placed.part[0]);
}

}  // namespace
}  // namespace supple::implicit
