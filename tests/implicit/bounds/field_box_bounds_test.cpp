#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "bounds/field_box_bounds.h"
#include "implicit/bodies.h"
#include "supple/implicit/field.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::Random;

/// Primitives of one kind under one rule.
struct Case {
  const char* name;
  ShapeKind shape = ShapeKind::Point;
  Kernel kernel = Kernel::wyvill(0.5);
  bool convolved = false;
  BlendRule rule = BlendRule::Sum;
  std::uint32_t group = 1;  ///< parts in a node
  double taper = 1.0;
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

Body body_of_case(const Case& c) {
  using testing::kPartsOfAKind;
  Body body = testing::body_of_kind({.seed = 31, .shape = c.shape, .kernel = c.kernel, .taper = c.taper, .convolved = c.convolved});
  Blend& blend = body.skeleton.blend;
  blend.rule = c.rule;
  for (std::uint32_t i = 0; i < kPartsOfAKind; ++i) blend.node.push_back(i / c.group);
  for (std::uint32_t a = 0; a < kPartsOfAKind / c.group; ++a) {
    for (std::uint32_t b = a + 1; b < kPartsOfAKind / c.group; ++b) {
      if ((a + b) % 3 != 0) blend.edge.push_back({a, b, a % 2 == 0 ? 1.0 : 0.4});
    }
  }
  body.place();
  return body;
}

/// Length of the shortest vector in the convex hull, from above: the Frank-Wolfe method.
double least_in_hull(std::span<const Vec3> vectors) {
  Vec3 at = vectors[0];
  for (int i = 0; i < 50; ++i) {
    const Vec3* best = &vectors[0];
    for (const Vec3& v : vectors) best = v.dot(at) < best->dot(at) ? &v : best;
    const Vec3 step = *best - at;
    const double length2 = step.squaredNorm();
    if (length2 == 0.0) break;
    at += std::clamp(-at.dot(step) / length2, 0.0, 1.0) * step;
  }
  return at.norm();
}

const Kernel kGascuel = Kernel::gascuel(0.25, 0.5, 3.0);

class BoundsOnBoxes : public ::testing::TestWithParam<Case> {};

TEST_P(BoundsOnBoxes, HoldValuesAndGradientsAndAreOfUse) {
  const Body body = body_of_case(GetParam());
  Random random(5);
  std::vector<Vec3> points(32), gradients(32);
  std::vector<double> values(32);
  int violations = 0, crossed = 0, steep = 0;
  for (int trial = 0; trial < 6000; ++trial) {
    const double size = 0.3 * std::pow(10.0, -2.5 * random.uniform(0, 1));
    const Vec3 half = 0.5 * size * (Vec3::Ones() + 0.9 * random.in_box(1.0));
    Vec3 centre = random.in_box(1.1);
    const Vec3 other = random.in_box(1.1);
    if ((FieldView(body.field).value(centre) > 0.0) != (FieldView(body.field).value(other) > 0.0)) {
      centre = root_on_segment(body.field, centre, other);
    }
    const Box box{centre - half, centre + half};
    for (Vec3& x : points) x = centre + half.cwiseProduct(random.in_box(1.0));
    body.field.evaluate(points, values, gradients);
    const Field::BoxBounds bounds = body.field.box_bounds(box);
    for (const double v : values) violations += !bounds.value.contains(v);
    violations += least_in_hull(gradients) < bounds.least_slope;
    if (size > 0.005 || bounds.value.lower > 0.0 || bounds.value.upper < 0.0) continue;
    ++crossed;
    steep += bounds.least_slope > 0.0;
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GT(crossed, 100);
  // Where the rule blends by angles nothing is known, elsewhere little is left.
  EXPECT_GT(steep, (GetParam().rule == BlendRule::Gradient ? 0.3 : 0.8) * crossed);
  RecordProperty("crossed", crossed);
  RecordProperty("steep", steep);
}

// Along random directions and that of the gradient in the middle, in which the search for missed pieces takes them.
TEST_P(BoundsOnBoxes, HoldSlopesAlongDirections) {
  const Body body = body_of_case(GetParam());
  Random random(6);
  std::vector<Vec3> points(32), gradients(32);
  std::vector<double> values(32);
  int violations = 0, known = 0;
  for (int trial = 0; trial < 6000; ++trial) {
    const double size = 0.6 * std::pow(10.0, -2.0 * random.uniform(0, 1));
    const Vec3 half = 0.5 * size * (Vec3::Ones() + 0.9 * random.in_box(1.0)), centre = random.in_box(1.1);
    const Box box{centre - half, centre + half};
    const GradientBounds bounds = bounds_with_gradient(body.field, box);
    if (bounds.hull.empty()) continue;
    for (Vec3& x : points) x = centre + half.cwiseProduct(random.in_box(1.0));
    for (unsigned c = 0; c < 8; ++c) {
      for (unsigned k = 0; k < 3; ++k) points[c][k] = (c >> k & 1u) != 0 ? box.upper[k] : box.lower[k];
    }
    points[8] = centre;
    body.field.evaluate(points, values, gradients);
    for (const Vec3& direction : {random.direction(), Vec3(gradients[8].normalized())}) {
      if (!(direction.norm() > 0.5)) continue;
      ++known;
      const Interval slope = slope_along(bounds, direction);
      for (const Vec3& g : gradients) violations += !slope.contains(g.dot(direction));
    }
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GT(known, 1000);
}

// Blends by gradients: the angle between two gradients is bounded too, so that values are to first order.
TEST(BoxBounds, OfBlendsByGradientsShrinkWithTheBox) {
  const Body body = body_of_case({.name = "gradient", .rule = BlendRule::Gradient});
  Random random(7);
  int wide = 0, boxes = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const Vec3 centre = random.in_box(1.0);
    if (FieldView(body.field).value(centre) <= -body.skeleton.iso) continue;
    ++boxes;
    const Interval value = body.field.tight_bound(Box{centre, centre}.inflated(1e-6));
    wide += value.upper - value.lower > 1e-4;
  }
  EXPECT_GT(boxes, 2000);
  EXPECT_LT(wide, boxes / 200);  // where the gradient of a node vanishes the angle has no limit
}

// All balls whose supports reach a box lie to one side, beyond its corners: F rises towards them however their supports end in the box.
TEST(BoxBounds, KnowThatSumsRiseTowardsAllTheirPrimitives) {
  for (const Kernel& kernel : {Kernel::wyvill(1.0), kGascuel, Kernel::murakami(1.0), Kernel::nishimura(1.0), Kernel::soft_object(1.0)}) {
    const double R = kernel.radius;
    Primitive p = testing::wyvill_point(R);
    p.kernel = kernel;
    const Body body = testing::body_of({{p, R * Vec3(0.5, 0.3, 0.0)}, {p, R * Vec3(0.6, -0.3, 0.1)}, {p, R * Vec3(0.95, 0.0, -0.2)},
                                        {p, R * Vec3(0.9, 0.4, 0.5)}});
    const Vec3 half = Vec3::Constant(0.2 * R);
    const GradientBounds bounds = bounds_with_gradient(body.field, {-half, half});
    EXPECT_EQ(bounds.least_slope, 0.0);  // second derivatives alone do not tell
    EXPECT_GT(slope_along(bounds, Vec3::UnitX()).lower, 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, BoundsOnBoxes,
    ::testing::Values(Case{.name = "points"}, Case{.name = "gascuel", .kernel = kGascuel},
                      Case{.name = "gascuel_boxes", .shape = ShapeKind::Box, .kernel = kGascuel},
                      Case{.name = "blanc_schlick", .kernel = Kernel::blanc_schlick(0.5, 0.3)},
                      Case{.name = "blanc_schlick_hard", .kernel = Kernel::blanc_schlick(0.5, 1.0)},
                      Case{.name = "rings", .shape = ShapeKind::Ring}, Case{.name = "arcs", .shape = ShapeKind::Arc},
                      Case{.name = "arcs_gascuel", .shape = ShapeKind::Arc, .kernel = kGascuel},
                      Case{.name = "triangles", .shape = ShapeKind::Triangle},
                      Case{.name = "tapered_segments", .shape = ShapeKind::Segment, .taper = 1.5},
                      Case{.name = "tapered_gascuel", .shape = ShapeKind::Segment, .kernel = kGascuel, .taper = 0.6},
                      Case{.name = "curves", .shape = ShapeKind::Curve}, Case{.name = "tapered_curves", .shape = ShapeKind::Curve, .taper = 0.7},
                      Case{.name = "superquadrics", .shape = ShapeKind::Superquadric},
                      Case{.name = "directed", .shape = ShapeKind::Directed},
                      Case{.name = "directed_gascuel", .shape = ShapeKind::Directed, .kernel = kGascuel},
                      Case{.name = "convolved_segments", .shape = ShapeKind::Segment, .convolved = true},
                      Case{.name = "convolved_arcs", .shape = ShapeKind::Arc, .kernel = Kernel::cauchy(0.5, 2.0), .convolved = true},
                      Case{.name = "convolved_triangles", .shape = ShapeKind::Triangle, .kernel = Kernel::murakami(0.5), .convolved = true},
                      Case{.name = "graph", .rule = BlendRule::Graph}, Case{.name = "graph_of_groups", .rule = BlendRule::Graph, .group = 4},
                      Case{.name = "graph_gascuel", .kernel = kGascuel, .rule = BlendRule::Graph},
                      Case{.name = "ricci", .rule = BlendRule::Ricci}, Case{.name = "gradient", .rule = BlendRule::Gradient}),
    [](const auto& case_of) { return std::string(case_of.param.name); });

// Near the axis of a ring F rises to both sides around it, by (f' / d) (1 - r / rho).
TEST(BoxBounds, KnowHowRingsBend) {
  Primitive p = testing::wyvill_point(1.2);
  p.shape = ShapeKind::Ring;
  p.size.x() = 1.0;
  const Body body = testing::body_of({{p, Vec3::Zero()}});
  for (const double rho : {0.1, 0.2, 0.4}) {
    const Vec3 centre(rho, 0.0, 0.0), half(1e-4, 0.3 * rho, 1e-4);
    const Box box{centre - half, centre + half};
    const Interval bound = body.field.tight_bound(box);
    const double middle = FieldView(body.field).value(centre), end = FieldView(body.field).value(centre + 0.99 * half.y() * Vec3::UnitY());
    EXPECT_LE(end, bound.upper) << rho;
    EXPECT_LT(bound.upper - middle, 4.0 * (end - middle)) << rho;
  }
}

}  // namespace
}  // namespace supple::implicit
