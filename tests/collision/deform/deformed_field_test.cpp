#include "supple/collision/deformed_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <random>

#include "collision/bodies.h"

namespace supple::collision {
namespace {

using testing::Blobs;
using testing::LinearSphere;
using testing::Stage;

TEST(BulgeProfile, TakesTheValuesOfTheTheoryAndIsSmooth) {
  // Gascuel 1993; k = 2, a0 = .5, w = 1.
  const BulgeProfile h{2.0, 0.5, 1.0};
  EXPECT_DOUBLE_EQ(h.value(0.1), 0.18);
  EXPECT_DOUBLE_EQ(h.value(0.25), 0.375);
  EXPECT_DOUBLE_EQ(h.value(0.5), 0.5);
  EXPECT_DOUBLE_EQ(h.value(0.75), 0.25);
  EXPECT_NEAR(h.value(0.9), 0.052, 1e-15);
  EXPECT_EQ(h.value(0.0), 0.0);
  EXPECT_EQ(h.value(1.0), 0.0);
  EXPECT_DOUBLE_EQ(h.slope(0.0), 2.0);
  EXPECT_EQ(h.slope(1.0), 0.0);
  const double d = 1e-9;
  for (const double x : {0.5, 1.0}) {  // C^1 where the pieces meet: |h''| <= 40 on both sides
    EXPECT_NEAR(h.value(x + d), h.value(x - d), 1e-12);
    EXPECT_NEAR(h.slope(x + d), h.slope(x - d), 1e-7);
  }
  for (double x = 0.05; x < 1.0; x += 0.1) {  // h^2/6 h''' of a central difference
    EXPECT_NEAR(h.slope(x), (h.value(x + 1e-5) - h.value(x - 1e-5)) / 2e-5, 1e-8);
  }
}

TEST(BulgeProfile, DoesNotPopAtFirstTouch) {
  const double k = 1.0, width = 0.3;
  const auto peak = [](const BulgeProfile& h) {
    double largest = 0.0;
    for (int i = 0; i <= 1000; ++i) largest = std::max(largest, h.value(h.width * i / 1000.0));
    return largest;
  };
  for (const double height : {1e-2, 1e-4, 1e-8}) {
    const double w = effective_width(width, height, k);
    EXPECT_LE(w, width);
    EXPECT_NEAR(peak({k, height, w}), height, 1e-12 * height);  // the profile vanishes with its height
  }
  EXPECT_NEAR(peak({k, 0.0, width}), 2.0 * width * k / 27.0, 1e-6);  // the plain width leaves 2 w k / 27
}

TEST(BulgeProfile, HoldsTheVolumeOfASphereOnAPlane) {
  // a = 1, delta = .1, k = k_i = 1: V = .030369 and a0 = .035901 by the circumference of the rim of a sphere on a plane,
  // a0^2 = 24 k k_i V / (pi a lambda (24 + lambda)); |grad(p_A - p_B)| = k + k_i. There pi b^2 and the load of
  // p = delta / 2 (1 - r^2 / b^2) on it have area^2 / (2 load) = 2 pi b^2 / delta, b^2 = 2 a delta.
  const double delta = 0.1, b2 = 2.0 * delta, area = std::numbers::pi * b2, load = 0.25 * delta * area;
  EXPECT_NEAR(volume_keeping_height(0.030369, area, load, 2.0, 1.0), 0.035901, 1e-6);
  // A zone narrower than 6 a0 takes a lower, steeper bulge of the same volume.
  const double width = 0.1, height = volume_keeping_height(0.030369, area, load, 2.0, width);
  EXPECT_NEAR(width * (24.0 * height + width), 6.0 * 30.0 * 0.035901 * 0.035901, 1e-5);
  EXPECT_EQ(volume_keeping_height(0.0, area, load, 2.0, 1.0), 0.0);
}

/// Two touching bodies of blobs of different stiffness, and points around them.
struct Touching {
  Blobs left{{Vec3(-0.4, 0, 0), Vec3(0, 0.1, 0), Vec3(-0.2, 0.3, 0.1)}, 1.0};
  Blobs right{{Vec3(0.62, 0.15, 0.1), Vec3(0.85, -0.1, 0.3)}, 1.0};
  Stage stage;
  Touching() {
    stage.add(left.field, left.centre, 1e4);
    stage.add(right.field, right.centre, 3e4);
    stage.solve({.error = 1e-4});
  }
};

std::vector<Vec3> random_points(std::uint64_t seed, int count) {
  std::mt19937_64 engine(seed);
  const auto uniform = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i) points.push_back(Vec3(0.2, 0.1, 0.1) + 1.1 * Vec3(uniform(), uniform(), uniform()));
  return points;
}

TEST(DeformedField, IsZeroOnTheContactSurfaceForBothBodies) {
  Touching scene;
  ASSERT_FALSE(scene.stage.surface.point.empty());
  for (const std::uint32_t i : {0u, 1u}) {
    const DeformedField field(scene.stage.bodies(), i, scene.stage.surface, {});
    std::vector<double> values(scene.stage.surface.point.size());
    field.evaluate(scene.stage.surface.point, values);
    for (const double v : values) EXPECT_LE(std::abs(v), 1e-10);
  }
}

// Two balls of radius 1 whose pressures fall like distances meet in the plane x = 0; their undeformed surfaces end 0.3 beyond it.
TEST(DeformedDepth, IsThatBehindTheContactSurfaceAlsoWhereTheOtherBodyHasNoPressure) {
  const LinearSphere left{Vec3(-0.7, 0, 0), {}}, right{Vec3(0.7, 0, 0), {}};
  Stage stage;
  stage.add(left, {left.centre}, 1e4);
  stage.add(right, {right.centre}, 1e4);
  stage.solve({.error = 1e-4});
  const auto pressure = [&](std::uint32_t body) { return DeformedPressure(stage.bodies(), body, stage.surface, {.attenuation = 0.0}); };
  const DeformedDepth depth(pressure(0), {pressure(1)});
  const implicit::FieldView view(depth);
  Vec3 slope;
  for (const double x : {-0.6, -0.301, -0.299, -0.1, -1e-9, 1e-9, 0.1, 0.2}) {  // first order is exact on the axis
    EXPECT_NEAR(view.value(Vec3(x, 0, 0), slope), -x, 1e-12);
    EXPECT_NEAR((slope + Vec3::UnitX()).norm(), 0.0, 1e-12);
  }
  EXPECT_NEAR(view.value(Vec3(-0.9, 0, 0), slope), 0.8, 1e-12);
  EXPECT_NEAR(view.value(Vec3(-2.0, 0, 0), slope), -0.3, 1e-12);
  // Elsewhere the surface is a plane, a ball and their rim, whose true depth is none larger.
  const std::vector<Vec3> points = random_points(3, 20000);
  std::vector<double> value(points.size());
  depth.evaluate(points, value);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double out = (points[i] - left.centre).norm() - 1.0, exact = -std::max(out, points[i].x());
    if (std::abs(exact) > 0.15) continue;
    ASSERT_EQ(value[i] > 0.0, exact > 0.0);
    ASSERT_NEAR(value[i], exact, 0.5 * exact * exact + 1e-12) << points[i].transpose();
  }
  std::mt19937_64 engine(11);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  for (std::size_t k = 0; k < 200; ++k) {
    const double half = std::ldexp(0.4, -static_cast<int>(6.0 * uniform()));
    const Box box{points[k] - Vec3::Constant(half), points[k] + Vec3::Constant(half)};
    const Interval bound = depth.bound(box);
    for (int n = 0; n < 20; ++n) {
      const double at = view.value(box.lower + 2.0 * half * Vec3(uniform(), uniform(), uniform()));
      ASSERT_TRUE(bound.lower <= at && at <= bound.upper);
    }
  }
}

class ApartBulge : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(DeformedField, ApartBulge, ::testing::Bool());

TEST_P(ApartBulge, NeverGivesOnePointToTwoBodies) {
  // Positive in both would be an overlap; inside the overlap of the bodies one must be positive or both zero.
  Touching scene;
  const DeformedField a(scene.stage.bodies(), 0, scene.stage.surface, {.keep_volume = GetParam()});
  const DeformedField b(scene.stage.bodies(), 1, scene.stage.surface, {.keep_volume = GetParam()});
  const std::vector<Vec3> points = random_points(5, 4000);
  std::vector<double> va(points.size()), vb(points.size());
  a.evaluate(points, va);
  b.evaluate(points, vb);
  int in_both = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_FALSE(va[i] > 1e-12 && vb[i] > 1e-12);
    const double pa = scene.stage.bodies()[0].field.value(points[i]), pb = scene.stage.bodies()[1].field.value(points[i]);
    if (pa <= 0.0 || pb <= 0.0) continue;
    ++in_both;
    EXPECT_NEAR(va[i] * 1e4, -vb[i] * 3e4, 1e-8);
  }
  EXPECT_GT(in_both, 20);
}

/// As the default, as published, and with the volume kept.
class EitherBulge : public ::testing::TestWithParam<BulgeSettings> {
 protected:
  BulgeSettings settings = GetParam();
};
INSTANTIATE_TEST_SUITE_P(DeformedField, EitherBulge, ::testing::Values(BulgeSettings{}, BulgeSettings{.literal = true}, BulgeSettings{.keep_volume = true}));

TEST_P(EitherBulge, JoinsTheCompressionWithOneSlope) {
  // At p_j = 0 inside body i, both sides have the gradient grad(p_i - p_j) / P_i.
  Touching scene;
  // Bulges that keep volumes have a crease beside stiffer bodies.
  const std::uint32_t body = settings.keep_volume ? 1 : 0, other = 1 - body;
  const std::span<const ContactBody> bodies = scene.stage.bodies();
  const double ratio = bodies[other].material.modulus / bodies[body].material.modulus;
  const DeformedField field(bodies, body, scene.stage.surface, settings);
  int tried = 0;
  for (const Vec3& start : random_points(6, 3000)) {
    Vec3 x = start, gb;
    for (int k = 0; k < 20; ++k) {
      const double f = bodies[other].field.value(x, gb);
      if (gb.squaredNorm() < 1e-6) break;
      x -= f / gb.squaredNorm() * gb;
    }
    Vec3 ga;
    if (gb.squaredNorm() < 1e-6 || bodies[body].field.value(x, ga) < 1e-3) continue;
    ++tried;
    const Vec3 expected = ga - ratio * gb;
    for (const double side : {-1e-7, 1e-7}) {
      const Vec3 y = x + side * gb.normalized();
      double value;
      Vec3 gradient;
      field.evaluate({&y, 1}, {&value, 1}, {&gradient, 1});
      EXPECT_LT((gradient - expected).norm(), 1e-4 * expected.norm());
    }
  }
  EXPECT_GT(tried, 10);
}

TEST_P(EitherBulge, HasTheGradientOfItsValues) {
  Touching scene;
  const DeformedField field(scene.stage.bodies(), 0, scene.stage.surface, settings);
  const double h = 1e-6;
  int rough = 0;
  const std::vector<Vec3> points = random_points(7, 400);
  for (const Vec3& x : points) {
    double value;
    Vec3 gradient, difference;
    field.evaluate({&x, 1}, {&value, 1}, {&gradient, 1});
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 up = x + h * Vec3::Unit(axis), down = x - h * Vec3::Unit(axis);
      difference[axis] = (implicit::FieldView(field).value(up) - implicit::FieldView(field).value(down)) / (2.0 * h);
    }
    rough += (difference - gradient).norm() > 1e-4 ? 1 : 0;
  }
  EXPECT_LE(rough, 2);  // a point may lie on a crease
}

TEST_P(EitherBulge, LiesWithinItsBounds) {
  Touching scene;
  for (const std::uint32_t body : {0u, 1u}) {
    const DeformedField field(scene.stage.bodies(), body, scene.stage.surface, settings);
    const DeformedPressure pressure(scene.stage.bodies(), body, scene.stage.surface, settings);
    std::mt19937_64 engine(9);
    for (const Vec3& corner : random_points(10 + body, 300)) {
      const double size = 0.3 * static_cast<double>(engine() >> 11) * 0x1p-53;
      const Box box{corner, corner + Vec3::Constant(size)};
      std::vector<Vec3> inside;
      for (int k = 0; k < 27; ++k) inside.push_back(corner + 0.5 * size * Vec3(k % 3, k / 3 % 3, k / 9));
      std::vector<double> v(inside.size()), c(inside.size());
      std::vector<Vec3> g(inside.size());
      field.evaluate(inside, v, g);
      pressure.evaluate(inside, c);
      const Interval bound = field.bound(box), pressure_bound = pressure.bound(box);
      const double slope = field.gradient_bound(box);
      for (std::size_t k = 0; k < inside.size(); ++k) {
        EXPECT_GE(v[k], bound.lower - 1e-12);
        EXPECT_LE(v[k], bound.upper + 1e-12);
        EXPECT_GE(c[k], pressure_bound.lower - 1e-8);
        EXPECT_LE(c[k], pressure_bound.upper + 1e-8);
        EXPECT_LE(g[k].norm(), slope * (1.0 + 1e-12));
        if (v[k] > 0.0) {
          EXPECT_TRUE(field.surface_box().contains(inside[k]));
        }
      }
    }
  }
}

/// Two spheres p = P (1 - rho) whose surfaces overlap by `overlap`; the second lies along +x.
struct LinearPair {
  LinearSphere left{Vec3::Zero(), {1.0, 1.0}}, right;
  Stage stage;
  implicit::SurfaceSamples samples[2];
  LinearPair(double overlap, double modulus) : right{Vec3(2.0 - overlap, 0, 0), {1.0, 1.0}} {
    samples[0] = testing::sphere_samples(left.centre, 1.0, 4000);
    samples[1] = testing::sphere_samples(right.centre, 1.0, 4000);
    stage.add(left).samples = &samples[0];
    stage.add(right, {right.centre}, modulus).samples = &samples[1];
    stage.solve();
  }
  /// What the left deformed pressure has beyond its pressure at the distance x outside the right sphere, in a direction off the contact.
  [[nodiscard]] double lift(double x, const BulgeSettings& settings) {
    const DeformedPressure pressure(stage.bodies(), 0, stage.surface, settings);
    const Vec3 at = right.centre + (1.0 + x) * Vec3(-0.6, 0.8, 0.0);
    const double value = implicit::FieldView(pressure).value(at);
    EXPECT_LE(value, pressure.bound(Box{at, at}).upper + 1e-12);
    return value - stage.bodies()[0].field.value(at);
  }
};

TEST(LiteralBulge, PopsUpAtFirstTouch) {
  // An overlap of 1e-9 has a0 = 0 within 1e-9: h = k x (1 - 2 x / w)^2 has 2 k w / 27 at w / 6. The default has nothing.
  LinearPair pair(1e-9, 1.0);
  ASSERT_EQ(pair.stage.surface.summary.size(), 1u);
  const double w = 0.3;
  EXPECT_NEAR(pair.lift(w / 6.0, {.width = w, .literal = true}), 2.0 * w / 27.0, 1e-8);
  EXPECT_NEAR(pair.lift(w / 3.0, {.width = w, .literal = true}), w / 27.0, 1e-8);
  EXPECT_EQ(pair.lift(1.001 * w, {.width = w, .literal = true}), 0.0);
  for (const double share : {1.0 / 6.0, 1.0 / 3.0}) EXPECT_LE(pair.lift(share * w, {.width = w}), 1e-9);
}

TEST(LiteralBulge, OvershootsAndGrowsWithTheStiffnessOfTheOther) {
  // a0 = .5 p with p = delta k / (1 + k), and k w > 6 a0: h rises above a0 before w / 2, the more the stiffer the other body.
  const double delta = 0.1, w = 0.4;
  double before = 0.0;
  for (const double k : {1.0, 10.0, 100.0}) {
    LinearPair pair(delta, k);
    const BulgeSettings literal{.attenuation = 0.5, .width = w, .literal = true};
    const double a0 = 0.5 * delta * k / (1.0 + k), u = 0.2;
    const double expected = k * w * u * (1.0 - 2.0 * u) * (1.0 - 2.0 * u) + a0 * u * u * (12.0 - 16.0 * u);
    EXPECT_NEAR(pair.lift(u * w, literal), expected, 1e-9 * k);
    EXPECT_NEAR(pair.lift(0.5 * w, literal), a0, 1e-9 * k);
    EXPECT_GT(expected, a0);
    EXPECT_GT(expected, 2.0 * before);
    before = expected;
    EXPECT_LE(pair.lift(u * w, {.attenuation = 0.5, .width = w}), a0 * (1.0 + 1e-9));
  }
}

TEST(LiteralBulge, EndsBelowHalfOfWhatWouldFillTheSpaceAround) {
  // A partner a thousand times as stiff would lift space far from the body; compact kernels have -c there.
  const Blobs left({Vec3(-0.42, 0, 0)}, 1.0), right({Vec3(0.42, 0, 0)}, 1.0);
  Stage stage;
  stage.add(left.field, left.centre, 1e4);
  stage.add(right.field, right.centre, 1e7);
  stage.solve();
  ASSERT_EQ(stage.surface.summary.size(), 1u);
  const DeformedPressure pressure(stage.bodies(), 0, stage.surface, {.width = 1.0, .literal = true});
  const Vec3 behind(0.42 + 0.454202019 + 0.05, 0, 0);
  EXPECT_NEAR(implicit::FieldView(pressure).value(behind), -0.25 * 1e4, 1e-9 * 1e4);
}

TEST(LiteralBulge, MayHoldAPointForTwoBodies) {
  // Between equal spheres both pressures are -x where both deformed pressures are h(x) - x, which is positive near 0 for a0 > w / 3.
  LinearPair pair(0.4, 1.0);
  const auto both = [&](const BulgeSettings& settings) {
    const double x = 0.01, y = std::sqrt((1.0 + x) * (1.0 + x) - 0.8 * 0.8);
    const Vec3 at(0.8, y, 0.0);
    double least = 1.0;
    for (const std::uint32_t i : {0u, 1u}) {
      const DeformedPressure pressure(pair.stage.bodies(), i, pair.stage.surface, settings);
      least = std::min(least, implicit::FieldView(pressure).value(at));
    }
    return least;
  };
  EXPECT_GT(both({.attenuation = 0.8, .width = 0.1, .literal = true}), 0.0);
  EXPECT_LE(both({.attenuation = 0.8, .width = 0.1}), 1e-12);
}

// A deformed pressure is the same as long as its body, the bodies that it bulges around or gives way to, and the bulges are.
TEST(DeformedPressure, HasTheContentOfAllThatItDependsOn) {
  Touching t;
  Blobs far{{Vec3(9, 0, 0)}, 1.0};
  t.stage.add(far.field, far.centre, 1e4);
  std::vector<std::uint64_t> field{10, 11, 12};
  const auto content = [&](double attenuation) {
    ContentWords words;
    DeformedPressure(t.stage.bodies(), 0, t.stage.surface, {.attenuation = attenuation}).add_content([&](std::uint32_t body) { return field[body]; }, words);
    return std::vector<std::uint64_t>(words.view().begin(), words.view().end());
  };
  const std::vector<std::uint64_t> bulging = content(0.01), plain = content(0.0);
  EXPECT_EQ(content(0.01), bulging);
  EXPECT_NE(content(0.02), bulging);
  field[2] = 13;
  EXPECT_EQ(content(0.01), bulging);
  field[1] = 14;
  EXPECT_NE(content(0.01), bulging);
  EXPECT_EQ(content(0.0), plain);
  field[0] = 15;
  EXPECT_NE(content(0.0), plain);
  field = {10, 11, 12};
  t.stage.bodies()[0].material.modulus *= 2.0;
  EXPECT_NE(content(0.0), plain);
  t.stage.bodies()[0].material.modulus *= 0.5;
  t.stage.surface.summary[0].largest_pressure *= 0.5;
  EXPECT_NE(content(0.01), bulging);
  EXPECT_EQ(content(0.0), plain);
}

TEST(DeformedPressure, IsContinuousWhereBulgesOfSeveralBodiesMeet) {
  // Steps of 1e-5 change a deformed pressure by at most its slope times the step: no jump at any surface.
  const Blobs centre({Vec3::Zero()}, 1.0), right({Vec3(0.8, 0, 0)}, 1.0), top({Vec3(0.35, 0.78, 0)}, 1.0);
  Stage stage;
  stage.add(centre.field, centre.centre, 1e4);
  stage.add(right.field, right.centre, 1e4);
  stage.add(top.field, top.centre, 2e4);
  stage.solve({.error = 1e-3});
  ASSERT_EQ(stage.surface.summary.size(), 3u);
  const DeformedPressure pressure(stage.bodies(), 0, stage.surface, {.attenuation = 0.8, .width = 0.5});
  const double limit = pressure.gradient_bound(Box{Vec3::Constant(-2), Vec3::Constant(2)});
  std::mt19937_64 engine(11);
  const auto uniform = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
  for (int line = 0; line < 20; ++line) {
    const Vec3 from(0.4 + 0.5 * uniform(), 0.3 + 0.5 * uniform(), 0.3 * uniform());
    const Vec3 to(0.4 + 0.5 * uniform(), 0.3 + 0.5 * uniform(), 0.3 * uniform());
    std::vector<Vec3> points;
    for (int i = 0; i <= 2000; ++i) points.push_back(from + i / 2000.0 * (to - from));
    std::vector<double> values(points.size());
    pressure.evaluate(points, values);
    const double step = (to - from).norm() / 2000.0;
    for (std::size_t i = 1; i < values.size(); ++i) EXPECT_LE(std::abs(values[i] - values[i - 1]), limit * step * 1.0001);
  }
}

}  // namespace
}  // namespace supple::collision
