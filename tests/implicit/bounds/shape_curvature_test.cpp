#include "bounds/shape_curvature.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "implicit/bodies.h"

namespace supple::implicit {
namespace {

using testing::Random;

struct Case {
  const char* name;
  ShapeKind shape;
  double taper = 1.0;
  double widest = 0.0;  ///< that bounds of small balls may be in the mean, over what is there
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

/// Eigenvalues of the second derivatives of f = g(sqrt q), in rising order.
Vec3 curvature_at(const Primitive& p, const Vec3& y) {
  const ShapeSample q = evaluate(p, y);
  const Mat3 H = evaluate(p.kernel, q.q).slope * second_derivative(p, y) + second_slope(p.kernel, q.q) * q.gradient * q.gradient.transpose();
  return Eigen::SelfAdjointEigenSolver<Mat3>(H, Eigen::EigenvaluesOnly).eigenvalues();
}

class ShapeCurvature : public ::testing::TestWithParam<Case> {};

TEST_P(ShapeCurvature, IsBoundedOnBalls) {
  const Case& c = GetParam();
  Random random(7);
  int violations = 0, known = 0, small = 0;
  double width = 0.0;  // of the bounds of small balls over that of what is there
  for (int trial = 0; trial < 3000; ++trial) {
    Primitive p;
    p.shape = c.shape;
    p.kernel = Kernel::wyvill(1.0);
    p.size = Vec3(random.uniform(0.3, 1), random.uniform(0.3, 1), random.uniform(0.3, 1));
    testing::set_details(p, random, 1.5);
    p.taper = c.taper;
    p.stretch = Vec3::Ones();
    const Vec3 centre = random.in_box(1.2);
    const double reach = 0.2 * std::pow(10.0, -4.0 * random.uniform(0, 1)), here = std::sqrt(evaluate(p, centre).q);
    const double near = std::max(here - distance_scale(p) * reach, 0.0), far = std::min(here + distance_scale(p) * reach, 1.0);
    if (near >= 1.0) continue;
    const CurvatureRange kernel = curvature_range(p.kernel, near, far);
    const CurvatureRange bound = shape_curvature(view_of(p), {.centre = centre, .reach = reach, .far = far}, kernel);
    if (!std::isfinite(bound.upper)) continue;
    ++known;
    Vec3 lowest = Vec3::Constant(1e300), highest = -lowest;
    for (int i = 0; i < 20; ++i) {
      const Vec3 y = centre + std::cbrt(random.uniform(0, 1)) * reach * random.direction();
      if (evaluate(p, y).q >= 1.0) continue;
      const Vec3 eigenvalues = curvature_at(p, y);
      const double round_off = 1e-9 * (1.0 + eigenvalues.cwiseAbs().maxCoeff());
      violations += eigenvalues[0] < bound.lower - round_off || eigenvalues[2] > bound.upper + round_off;
      lowest = lowest.cwiseMin(eigenvalues);
      highest = highest.cwiseMax(eigenvalues);
    }
    if (reach > 1e-3 || lowest[0] > highest[2]) continue;
    ++small;
    width += (bound.upper - bound.lower) / (highest[2] - lowest[0]);
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GT(known, 300);
  EXPECT_LT(width / small, c.widest);
  RecordProperty("known", known);
  RecordProperty("width", std::to_string(width / small));
}

INSTANTIATE_TEST_SUITE_P(Kinds, ShapeCurvature,
                         ::testing::Values(Case{"rings", ShapeKind::Ring, 1.0, 1.5}, Case{"arcs", ShapeKind::Arc, 1.0, 1.5},
                                           Case{"tapered_segments", ShapeKind::Segment, 1.5, 1.5},
                                           Case{"thinning_segments", ShapeKind::Segment, 0.6, 1.5}, Case{"curves", ShapeKind::Curve, 1.0, 1.5},
                                           Case{"tapered_curves", ShapeKind::Curve, 0.7, 1.5},
                                           Case{"superquadrics", ShapeKind::Superquadric, 1.0, 8.0},
                                           Case{"directed", ShapeKind::Directed, 1.0, 4.0}),
                         [](const auto& case_of) { return std::string(case_of.param.name); });

}  // namespace
}  // namespace supple::implicit
