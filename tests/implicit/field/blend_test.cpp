#include "supple/implicit/blend.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "field/blend.h"
#include "implicit/bodies.h"
#include "supple/core/error.h"
#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/polygonise.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::body_of;
using testing::random_body;
using testing::Random;
using testing::random_points;
using testing::wyvill_point;

TEST(ArcBlend, TakesTheValuesOfTheTheory) {
  EXPECT_DOUBLE_EQ(arc_blend(0.3, 0.4, 0.0).value, 0.5);
  EXPECT_NEAR(arc_blend(0.5, 0.5, 0.0).value, 0.707106781, 5e-10);
  EXPECT_NEAR(arc_blend(0.5, 0.5, 0.5).value, 0.585786438, 5e-10);
  EXPECT_NEAR(arc_blend(0.4, 0.5, 0.5).value, 0.535088936, 5e-10);
  EXPECT_DOUBLE_EQ(arc_blend(0.5, 0.2, 0.5).value, 0.5);
  EXPECT_NEAR(arc_blend(0.5, 0.5, std::sqrt(2.0) - 1.0).value, 0.603553391, 5e-10);
  EXPECT_DOUBLE_EQ(arc_blend(0.3, 0.4, 1.0).value, 0.4);
}

TEST(ArcBlend, HasLevelSetsThatAreArcsOfCircles) {
  // On G = 1 the points lie on the circle of radius 1 - t about (t, t).
  for (const double t : {0.0, 0.2, 0.7}) {
    for (double angle = 0.05; angle < 1.5; angle += 0.1) {
      const double a = t + (1.0 - t) * std::cos(angle), b = t + (1.0 - t) * std::sin(angle);
      EXPECT_NEAR(arc_blend(a, b, t).value, 1.0, 1e-14);
      EXPECT_NEAR(arc_blend(2.5 * a, 2.5 * b, t).value, 2.5, 1e-14);  // homogeneous
    }
  }
}

TEST(ArcBlend, SlopesMatchCentralDifferences) {
  Random random(3);
  const double h = 1e-6;
  for (int i = 0; i < 2000; ++i) {
    const double a = random.uniform(0.05, 1.0), b = random.uniform(0.05, 1.0), t = random.uniform(0.02, 0.95);
    if (std::abs(std::min(a, b) - t * std::max(a, b)) < 1e-3 || 1.0 - t < 0.05) continue;  // the second slope jumps
    const ArcBlend g = arc_blend(a, b, t);
    // Round-off eps / h and third derivatives, which grow as (1 - t)^-2, times h^2.
    EXPECT_NEAR(g.by_a, (arc_blend(a + h, b, t).value - arc_blend(a - h, b, t).value) / (2 * h), 1e-8);
    EXPECT_NEAR(g.by_b, (arc_blend(a, b + h, t).value - arc_blend(a, b - h, t).value) / (2 * h), 1e-8);
    EXPECT_NEAR(g.by_t, (arc_blend(a, b, t + h).value - arc_blend(a, b, t - h).value) / (2 * h), 1e-8);
    EXPECT_NEAR(a * g.by_a + b * g.by_b, g.value, 1e-14);
    const Opening opening = opening_of(0.3, t);
    EXPECT_NEAR(opening.slope, (opening_of(0.3, t + h).t - opening_of(0.3, t - h).t) / (2 * h), 1e-9);
  }
  EXPECT_EQ(opening_of(0.3, 0.0).t, 0.3);
  EXPECT_DOUBLE_EQ(opening_of(0.3, 1.0).t, 1.0);
  EXPECT_DOUBLE_EQ(opening_of(0.3, -1.0).t, 1.0);
}

TEST(Fading, RunsFromOneToZeroWithoutAKink) {
  EXPECT_EQ(fading(0.0, 0.5), 1.0);
  EXPECT_EQ(fading(0.25, 0.5), 0.5);
  EXPECT_EQ(fading(0.5, 0.5), 0.0);
  EXPECT_EQ(fading(7.0, 0.5), 0.0);
  EXPECT_EQ(fading(0.1, 0.0), 0.0);
  const double h = 1e-6;  // slopes at the ends: 6 s (1 - s) / time, of second order in h
  EXPECT_NEAR((fading(h, 0.5) - fading(0.0, 0.5)) / h, 0.0, 2e-5);
  EXPECT_NEAR((fading(0.5, 0.5) - fading(0.5 - h, 0.5)) / h, 0.0, 2e-5);
}

/// Two Wyvill points of radius 1, D apart on the x axis.
Body two_points(double D, const Blend& blend) {
  Body body = body_of({{wyvill_point(1.0), Vec3(-D / 2, 0, 0)}, {wyvill_point(1.0), Vec3(D / 2, 0, 0)}});
  body.skeleton.blend = blend;
  body.place();
  return body;
}

TEST(Blend, TwoNodesOfAGraphGiveTheLargerAndAShareOfTheSmaller) {
  for (const double w : {0.0, 0.4, 1.0}) {
    const Body body = two_points(0.9, {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, w}}});
    for (const Vec3& x : random_points(4, 300, 1.0)) {
      const double f1 = evaluate(Kernel::wyvill(1.0), (x - body.parts[0].position).squaredNorm()).value;
      const double f2 = evaluate(Kernel::wyvill(1.0), (x - body.parts[1].position).squaredNorm()).value;
      EXPECT_NEAR(FieldView(body.field).value(x), std::max(f1, f2) + w * std::min(f1, f2) - 0.5, 1e-15);
    }
  }
}

TEST(Blend, WhollyOfNodesHasTheSlopeOfTheirSumWhereTheyAreAlike) {
  const Vec3 axis(0.8, 0.36, 0.48), u = axis.unitOrthogonal(), v = axis.cross(u);
  for (const auto& [along, sideways, upwards] : {std::array{Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}, std::array{axis, u, v}}) {
    const std::vector<std::pair<Primitive, Vec3>> points{{wyvill_point(1.0), -0.3 * along}, {wyvill_point(1.0), 0.3 * along}};
    const Body sum = body_of(points);
    Body graph = body_of(points);
    graph.skeleton.blend = {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, 1.0}}};
    graph.place();
    for (const Vec3& x : random_points(5, 300, 0.6)) {
      const Vec3 between = x.y() * sideways + x.z() * upwards;  // as far from either, along the first axis to the last bit
      Vec3 slope, expected;
      (void)FieldView(graph.field).value(between, slope);
      (void)FieldView(sum.field).value(between, expected);
      EXPECT_LT((slope - expected).norm(), 1e-13);
    }
  }
}

TEST(Blend, OfPointsInOnePlaceHasTheirHessianByItsFactor) {
  const Body one = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  const Body power = two_points(0.0, {.rule = BlendRule::Ricci, .node = {}, .edge = {}, .exponent = 3.0});
  const Body graph = two_points(0.0, {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, 0.4}}});
  for (const Vec3& x : random_points(4, 100, 0.55)) {
    const Mat3 expected = one.field.hessian(x);
    EXPECT_LT((power.field.hessian(x) - std::cbrt(2.0) * expected).norm(), 1e-8 * expected.norm());
    EXPECT_LT((graph.field.hessian(x) - 1.4 * expected).norm(), 1e-8 * expected.norm());
  }
}

TEST(Blend, WithoutEdgesPointsDoNotBlendAtADistance) {
  // Summed, two points 1.2 apart are one piece; united, they are two balls of the radius of a lone one.
  const Body united = two_points(1.2, {.rule = BlendRule::Graph});
  const double radius = iso_distance(Kernel::wyvill(1.0), 0.5);
  EXPECT_NEAR(root_on_segment(united.field, Vec3(-0.6, 0, 0), Vec3::Zero()).x(), radius - 0.6, 1e-14);
  const auto components = [](const Body& body) {
    return inspect(polygonise(body.field, Lattice{Vec3::Zero(), 0.03}, Executor(1))).components;
  };
  EXPECT_EQ(components(united), 2u);
  EXPECT_EQ(components(two_points(1.2, {})), 1u);
  EXPECT_EQ(components(two_points(1.2, {.rule = BlendRule::Graph, .node = {0, 0}})), 1u);  // one node: a sum
}

TEST(Blend, RicciRunsFromTheSumToTheUnion) {
  const Body sum = two_points(0.8, {});
  const Body one = two_points(0.8, {.rule = BlendRule::Ricci, .exponent = 1.0});
  const Body many = two_points(0.8, {.rule = BlendRule::Ricci, .exponent = 60.0});
  const Body united = two_points(0.8, {.rule = BlendRule::Graph});
  const Body two = two_points(0.8, {.rule = BlendRule::Ricci, .exponent = 2.0});
  for (const Vec3& x : random_points(5, 300, 1.0)) {
    EXPECT_NEAR(FieldView(one.field).value(x), FieldView(sum.field).value(x), 1e-14);
    EXPECT_NEAR(FieldView(many.field).value(x), FieldView(united.field).value(x), 0.012);  // 2^(1/60) - 1
  }
  const double f = evaluate(Kernel::wyvill(1.0), 0.16).value;
  EXPECT_NEAR(FieldView(two.field).value(Vec3::Zero()), std::sqrt(2.0) * f - 0.5, 1e-15);
}

// Gradients anywhere in balls, values known exactly: what is left is how far the angle turns.
TEST(Blend, BoundsOfArcsHoldForAllGradientsInTheirBalls) {
  BlendIndex blend;
  blend.assign({.rule = BlendRule::Gradient, .opening = 0.3}, 2);
  Random random(8);
  double narrowest = 1.0;
  for (int trial = 0; trial < 3000; ++trial) {
    BlendIndex::NodeBound nodes[2];
    const double reach = std::pow(10.0, random.uniform(-4.0, 0.2)), value = random.uniform(0.2, 1.0);
    for (std::uint32_t k = 0; k < 2; ++k) {
      const double f = value * random.uniform(0.8, 1.0);
      nodes[k] = {.node = k, .value = {f, f}, .gradient = random.in_box(1.0), .turn = reach * random.uniform(0.1, 1.0)};
    }
    const Interval bound = blend.bound(nodes);
    narrowest = std::min(narrowest, bound.upper - bound.lower);
    for (int i = 0; i < 40; ++i) {
      NodeSample samples[2];
      double share[2];
      for (std::uint32_t k = 0; k < 2; ++k) {
        samples[k] = {.node = k, .value = nodes[k].value.lower, .gradient = nodes[k].gradient + nodes[k].turn * random.direction()};
      }
      const double f = blend.combine(samples, share).value;
      ASSERT_GE(f, bound.lower - 1e-15) << trial;
      ASSERT_LE(f, bound.upper + 1e-15) << trial;
    }
  }
  EXPECT_LT(narrowest, 1e-3);
}

TEST(Blend, GradientsThatFaceEachOtherUniteAndThoseThatCrossBlend) {
  const Body body = two_points(0.8, {.rule = BlendRule::Gradient, .opening = 0.2});
  // On the axis between the points the gradients are opposite.
  const double f = evaluate(Kernel::wyvill(1.0), 0.16).value;
  EXPECT_NEAR(FieldView(body.field).value(Vec3::Zero()), f - 0.5, 1e-15);
  // Where they are perpendicular, on the symmetry plane at height D / 2, the arc with t = opening.
  const double g = evaluate(Kernel::wyvill(1.0), 0.32).value;
  EXPECT_NEAR(FieldView(body.field).value(Vec3(0, 0.4, 0)), arc_blend(g, g, 0.2).value - 0.5, 1e-15);
}

TEST(Blend, BondsFadeFromTheSumToTheUnion) {
  // The surface of two points that overlap moves without a jump as their bond fades, and ends as two united balls.
  const double radius = iso_distance(Kernel::wyvill(1.0), 0.5);
  double last = 0.0, last_step = 0.0;
  for (int i = 0; i <= 200; ++i) {
    const double w = fading(0.005 * i, 1.0);
    const Body body = two_points(0.7, {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 1, w}}});
    const double waist = root_on_segment(body.field, Vec3::Zero(), Vec3(0, 1, 0)).y();
    if (i > 0) {
      const double step = waist - last;
      EXPECT_LE(step, 1e-15);
      EXPECT_GE(step, -0.005);
      // No jump of the speed: second differences of order 0.005^2.
      if (i > 1) {
        EXPECT_NEAR(step, last_step, 3e-4);
      }
      last_step = step;
    }
    last = waist;
  }
  EXPECT_NEAR(last, std::sqrt(radius * radius - 0.35 * 0.35), 1e-14);
}

/// A random body under each rule.
struct Case {
  const char* name;
  BlendRule rule;
  bool grouped;
};

class BlendedBody : public ::testing::TestWithParam<Case> {
 protected:
  BlendedBody() {
    Random random(17);
    Blend& blend = body_.skeleton.blend;
    blend.rule = GetParam().rule;
    blend.exponent = 3.0;
    const std::uint32_t parts = body_.skeleton.part_count;
    std::uint32_t nodes = parts;
    if (GetParam().grouped) {
      nodes = 7;
      for (std::uint32_t i = 0; i < parts; ++i) blend.node.push_back(random.below(nodes));
    }
    for (std::uint32_t a = 0; a < nodes; ++a) {
      for (std::uint32_t b = a + 1; b < nodes; ++b) {
        if (random.below(2) == 0) blend.edge.push_back({a, b, random.uniform(0.0, 1.0)});
      }
    }
    body_.place();
  }
  Body body_ = random_body({.seed = 23, .parts = 24, .primitives_per_part = 2});
};

TEST_P(BlendedBody, AgreesWithTheReference) {
  for (const Vec3& x : random_points(2, 800, 1.5)) {
    const double value = evaluate_reference(body_.skeleton, body_.placed, x);
    EXPECT_NEAR(FieldView(body_.field).value(x), value, 1e-13) << x.transpose();  // angles are off by eps over slopes
  }
}

TEST_P(BlendedBody, GradientMatchesCentralDifferences) {
  // The rules have creases, and primitives kinks: a few points lie within the step of one.
  int precise = 0, count = 0;
  for (const Vec3& x : random_points(3, 400, 1.2)) {
    Vec3 gradient, difference;
    static_cast<void>(FieldView(body_.field).value(x, gradient));
    static_cast<void>(evaluate_reference(body_.skeleton, body_.placed, x, &difference));
    ++count;
    precise += (gradient - difference).norm() < 1e-6 * (1.0 + gradient.norm());
  }
  EXPECT_GE(precise, count - 4);
}

TEST_P(BlendedBody, PartsSumToTheField) {
  const std::vector<Vec3> points = random_points(4, 500, 1.4);
  std::vector<double> values(points.size());
  std::vector<Vec3> gradients(points.size());
  body_.field.evaluate(points, values, gradients);
  std::vector<double> alone(points.size());
  body_.field.evaluate(points, alone);
  EXPECT_EQ(alone, values);
  FieldParts parts;
  body_.field.evaluate_parts(points, parts);
  ASSERT_EQ(parts.offset.back(), parts.part.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    double sum = -body_.skeleton.iso;
    Vec3 gradient = Vec3::Zero();
    for (std::uint32_t r = parts.offset[i]; r < parts.offset[i + 1]; ++r) {
      EXPECT_TRUE(r == parts.offset[i] || parts.part[r - 1] < parts.part[r]);
      sum += parts.value[r];
      gradient += parts.gradient[r];
    }
    EXPECT_NEAR(sum, values[i], 1e-13);
    EXPECT_LT((gradient - gradients[i]).norm(), 1e-11 * (1.0 + gradients[i].norm()));
  }
}

TEST_P(BlendedBody, CullingAndBatchesChangeNoBit) {
  const std::vector<Vec3> points = random_points(5, 500, 1.4);
  std::vector<double> culled(points.size()), whole(points.size());
  std::vector<Vec3> culled_gradients(points.size()), whole_gradients(points.size());
  for (std::size_t i = 0; i < points.size(); i += 7) {
    const std::size_t n = std::min<std::size_t>(7, points.size() - i);
    body_.field.evaluate(std::span(points).subspan(i, n), std::span(culled).subspan(i, n), std::span(culled_gradients).subspan(i, n));
  }
  body_.field.set_culling(false);
  body_.field.evaluate(points, whole, whole_gradients);
  EXPECT_EQ(culled, whole);
  EXPECT_EQ(culled_gradients, whole_gradients);
}

TEST_P(BlendedBody, TrueRangeLiesInsideTheInterval) {
  Random random(77);
  std::vector<Vec3> points(24);
  std::vector<double> values(24);
  std::vector<Vec3> gradients(24);
  int violations = 0, decided = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const double size = 0.8 * std::pow(10.0, -4.0 * random.uniform(0, 1));
    const Vec3 centre = random.in_box(1.5);
    const Vec3 half = 0.5 * size * (Vec3::Ones() + 0.9 * random.in_box(1.0));
    const Box box{centre - half, centre + half};
    for (std::size_t i = 0; i < 24; ++i) {
      const auto bit = [i](std::size_t k) { return static_cast<double>(i >> k & 1); };
      const Vec3 t = i < 8 ? Vec3(bit(0), bit(1), bit(2))
                           : Vec3(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1));
      points[i] = (box.lower + t.cwiseProduct(box.extent())).cwiseMax(box.lower).cwiseMin(box.upper);
    }
    body_.field.evaluate(points, values, gradients);
    const Interval bound = body_.field.bound(box);
    const double steepest = body_.field.gradient_bound(box);
    for (std::size_t i = 0; i < 24; ++i) {
      violations += !bound.contains(values[i]);
      violations += gradients[i].norm() > steepest;
    }
    decided += bound.upper < 0.0 || bound.lower > 0.0;
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GT(decided, 1500);
}

TEST_P(BlendedBody, IsContinuousAlongLines) {
  // Steps of 1e-7 change F by at most the slope times the step, whatever switches in between.
  Random random(78);
  for (int line = 0; line < 200; ++line) {
    const Vec3 a = random.in_box(1.2);
    const Vec3 along = 1e-7 * random.direction();
    double last = FieldView(body_.field).value(a);
    for (int i = 1; i < 50; ++i) {
      const double now = FieldView(body_.field).value(a + i * along);
      EXPECT_LT(std::abs(now - last), 1e-4);
      last = now;
    }
  }
}

TEST_P(BlendedBody, MeshesClosed) {
  const MeshReport report = inspect(polygonise(body_.field, Lattice{Vec3::Zero(), 0.06}, Executor(2)));
  EXPECT_TRUE(report.closed && report.oriented);
  EXPECT_GT(report.volume, 0.0);
}

INSTANTIATE_TEST_SUITE_P(Rules, BlendedBody,
                         ::testing::Values(Case{"graph", BlendRule::Graph, false}, Case{"groups", BlendRule::Graph, true},
                                           Case{"ricci", BlendRule::Ricci, false}, Case{"ricci_groups", BlendRule::Ricci, true},
                                           Case{"gradient", BlendRule::Gradient, false},
                                           Case{"gradient_groups", BlendRule::Gradient, true}),
                         [](const auto& one) { return one.param.name; });

TEST(Blend, RefusesEdgesOfNoNode) {
  Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}, {wyvill_point(1.0), Vec3(1, 0, 0)}});
  body.skeleton.blend = {.rule = BlendRule::Graph, .node = {}, .edge = {{0, 2, 1.0}}};
  EXPECT_THROW(body.place(), ContractViolation);
  body.skeleton.blend = {.rule = BlendRule::Graph, .node = {0}, .edge = {}};
  EXPECT_THROW(body.place(), ContractViolation);
}

}  // namespace
}  // namespace supple::implicit
