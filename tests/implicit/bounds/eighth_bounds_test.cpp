#include "bounds/eighth_bounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "bounds/field_box_bounds.h"
#include "implicit/bodies.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::Random;

struct Case {
  const char* name;
  ShapeKind shape;
  Kernel kernel;
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

Box eighth_of(const Box& box, unsigned c) {
  Box part = box;
  for (int k = 0; k < 3; ++k) ((c >> k & 1) != 0 ? part.lower : part.upper)[k] = box.centre()[k];
  return part;
}

class EighthsOfBoxes : public ::testing::TestWithParam<Case> {};

// All points of an eighth that is settled have its sign, or F rises there along the gradient of its middle; and where the bounds of single
// boxes settle it by the same steps, so do these.
TEST_P(EighthsOfBoxes, AreSettledAsTheyAreOneByOne) {
  const Body body = testing::body_of_kind({.seed = 41, .shape = GetParam().shape, .kernel = GetParam().kernel});
  ASSERT_TRUE(EighthBounds::know(body.field));
  Random random(6);
  EighthBounds bounds;
  std::vector<std::uint32_t> all, left;
  std::vector<Vec3> points(24), gradients(24);
  std::vector<double> values(24);
  GradientBounds one;
  int one_sign = 0, sloped = 0, violations = 0, less = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    const double size = 0.8 * std::pow(10.0, -2.0 * random.uniform(0, 1));
    Vec3 centre = random.in_box(1.1);
    const Vec3 other = random.in_box(1.1);
    if ((FieldView(body.field).value(centre) > 0.0) != (FieldView(body.field).value(other) > 0.0)) centre = root_on_segment(body.field, centre, other);
    const Vec3 half = 0.5 * size * (Vec3::Ones() + 0.9 * random.in_box(1.0));
    const Box box{centre - half, centre + half};
    all.clear();
    find_primitives(body.field, box, all);
    const EighthBounds::Verdict verdict = bounds(body.field, box, all);
    EXPECT_EQ(verdict.one_sign & verdict.sloped, 0u);
    for (unsigned c = 0; c < 8; ++c) {
      const Box part = eighth_of(box, c);
      for (Vec3& x : points) x = part.centre() + 0.5 * part.extent().cwiseProduct(random.in_box(1.0));
      for (unsigned corner = 0; corner < 8; ++corner) {
        for (int k = 0; k < 3; ++k) points[corner][k] = ((corner >> k & 1u) != 0 ? part.upper : part.lower)[k];
      }
      points[8] = part.centre();
      body.field.evaluate(points, values, gradients);
      const auto [least, largest] = std::minmax_element(values.begin(), values.end());
      if ((verdict.one_sign >> c & 1u) != 0) {
        ++one_sign;
        violations += !(*least > 0.0 || *largest < 0.0);
      } else if ((verdict.sloped >> c & 1u) != 0) {
        ++sloped;
        for (const Vec3& g : gradients) violations += !(g.dot(gradients[8]) > 0.0);
      }
      bounds.narrow(c, left);
      FieldParts parts;
      body.field.evaluate_parts(points, parts);
      for (std::size_t i = 0; i < parts.part.size(); ++i) violations += parts.value[i] > 0.0 && !std::binary_search(left.begin(), left.end(), parts.part[i]);
      start_bounds(body.field, part, all, one);
      const bool certain = one.value.lower > 0.0 || one.value.upper < 0.0;
      add_slopes(body.field, part, one);
      const bool rises = slope_along(one, gradients[8].normalized()).lower > 0.0;
      less += (certain || rises) && (verdict.settled() >> c & 1u) == 0;
    }
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GT(one_sign, 1000);
  EXPECT_GT(sloped, 300);
  EXPECT_LT(less, 0.02 * (one_sign + sloped));  // boxes that the support of a shape ends in know a little more
  RecordProperty("one_sign", one_sign);
  RecordProperty("sloped", sloped);
  RecordProperty("less", less);
}

const Kernel kWyvill = Kernel::wyvill(0.5), kGascuel = Kernel::gascuel(0.25, 0.5, 3.0), kSteep = Kernel::gascuel(0.3, 0.5, 1.0);

INSTANTIATE_TEST_SUITE_P(Kinds, EighthsOfBoxes,
                         ::testing::Values(Case{"points", ShapeKind::Point, kWyvill}, Case{"segments", ShapeKind::Segment, kWyvill},
                                           Case{"rectangles", ShapeKind::Rectangle, kWyvill}, Case{"boxes", ShapeKind::Box, kWyvill},
                                           Case{"discs", ShapeKind::Disc, kWyvill}, Case{"ellipsoids", ShapeKind::Ellipsoid, kWyvill},
                                           Case{"points_gascuel", ShapeKind::Point, kGascuel}, Case{"boxes_gascuel", ShapeKind::Box, kGascuel},
                                           Case{"discs_gascuel", ShapeKind::Disc, kGascuel}, Case{"points_steep", ShapeKind::Point, kSteep}),
                         [](const auto& case_of) { return std::string(case_of.param.name); });

}  // namespace
}  // namespace supple::implicit
