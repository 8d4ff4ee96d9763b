#include "supple/implicit/convolution.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "implicit/bodies.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::body_of;
using testing::Random;

const double kPi = std::acos(-1.0);

/// (1 + s^2 q)^-2 with a support so wide that nothing is cut off.
Kernel bare_cauchy(double s) {
  Kernel kernel = Kernel::cauchy(1e7, 2.0);
  kernel.shape = 1e7 * s;
  kernel.floor = kernel.tilt = 0.0;
  kernel.gain = 1.0;
  return kernel;
}

/// A polynomial of bare degree: (1 - q/R^2)^m.
Kernel polynomial(int m, double R) { return m == 2 ? Kernel::murakami(R) : Kernel::wyvill(R); }

const std::array<Vec3, 3> kTriangle{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};

TEST(Convolution, CauchyTakesTheValuesOfTheTheory) {
  // Segment from 0 to 1 seen from (0.5, 1, 0): from its middle, half length 0.5.
  EXPECT_NEAR(convolve_segment(bare_cauchy(1.0), 0.5, {0, 1, 0}).value, 0.231261602697, 5e-13);
  EXPECT_NEAR(convolve_segment(bare_cauchy(1.0), 1e6, {0, 1, 0}).value, kPi / (2.0 * std::pow(2.0, 1.5)), 1e-12);
  EXPECT_NEAR(convolve_polygon(bare_cauchy(1.0), kTriangle, {0.25, 0.25, 0.5}).value, 0.269586947096, 5e-13);
  EXPECT_NEAR(convolve_polygon(bare_cauchy(2.0), kTriangle, {0.25, 0.25, 0.5}).value, 0.086924212684, 5e-13);
  EXPECT_NEAR(convolve_polygon(bare_cauchy(2.0), kTriangle, {1, 1, 0}).value, 0.023404342402, 5e-13);
  EXPECT_NEAR(convolve_arc(bare_cauchy(1.0), 1.0, 0.5 * kPi, {0, 0, 1}).value, kPi / 9.0, 1e-15);
}

TEST(Convolution, CompactLinesTakeTheValuesOfTheTheory) {
  EXPECT_NEAR(convolve_line(polynomial(2, 1.0), 0.5), 0.519615242, 5e-10);  // 16/15 c^5
  EXPECT_NEAR(convolve_line(polynomial(3, 1.0), 0.5), 0.334038370, 5e-10);  // 32/35 c^7
  EXPECT_NEAR(convolve_plane(polynomial(3, 1.0), 0.5), kPi / 4.0 * std::pow(0.75, 4), 1e-15);
  EXPECT_EQ(convolve_line(polynomial(3, 1.0), 1.5), 0.0);
  EXPECT_EQ(convolve_plane(polynomial(2, 1.0), 1.0), 0.0);
}

class ConvolvedKernel : public ::testing::TestWithParam<Kernel> {};

/// Integral by the midpoint rule over n pieces.
template <class At>
double integral(int n, double length, const At& at) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += at((i + 0.5) / n);
  return sum * length / n;
}

TEST_P(ConvolvedKernel, AgreesWithQuadrature) {
  const Kernel& kernel = GetParam();  // R = 1
  const auto k = [&](const Vec3& d) { return evaluate(kernel, d.squaredNorm()).value; };
  Random random(3);
  for (int trial = 0; trial < 60; ++trial) {
    const Vec3 y = random.in_box(1.4);
    // |k''| <= 10, kernels are C^1 at least: the midpoint rule errs by h^2 / 24 times that over the length.
    const double segment = integral(4000, 1.6, [&](double t) { return k(y - Vec3(1.6 * t - 0.8, 0, 0)); });
    EXPECT_NEAR(convolve_segment(kernel, 0.8, y).value, segment, 2e-7);
    for (const double half : {0.4, 2.0, kPi}) {
      const double arc = integral(4000, 1.4 * half, [&](double t) {
        const double angle = (2.0 * t - 1.0) * half;
        return k(y - 0.7 * Vec3(std::cos(angle), std::sin(angle), 0));
      });
      EXPECT_NEAR(convolve_arc(kernel, 0.7, half, y).value, arc, 1e-6) << half;
    }
    const double square = integral(300, 1.2, [&](double u) {
      return integral(300, 0.8, [&](double v) { return k(y - Vec3(1.2 * u - 0.6, 0.1, 0.8 * v - 0.4)); });
    });
    const std::array<Vec3, 4> corners{Vec3(-0.6, 0.1, -0.4), Vec3(-0.6, 0.1, 0.4), Vec3(0.6, 0.1, 0.4), Vec3(0.6, 0.1, -0.4)};
    EXPECT_NEAR(convolve_polygon(kernel, corners, y).value, square, 1e-5);
  }
}

TEST_P(ConvolvedKernel, PiecesAddUpToTheWhole) {
  const Kernel& kernel = GetParam();
  Random random(4);
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3 y = random.in_box(1.4);
    // [-0.8, 0.8] cut at 0.3.
    const Convolution whole = convolve_segment(kernel, 0.8, y);
    const Convolution left = convolve_segment(kernel, 0.55, y + Vec3(0.25, 0, 0));
    const Convolution right = convolve_segment(kernel, 0.25, y - Vec3(0.55, 0, 0));
    EXPECT_NEAR(left.value + right.value, whole.value, 1e-14);
    EXPECT_LT((left.gradient + right.gradient - whole.gradient).norm(), 1e-13);
    // A triangle cut through a corner.
    const std::array<Vec3, 3> a{Vec3(-0.5, -0.4, 0.2), Vec3(0.7, -0.3, 0.1), Vec3(0.1, 0.8, -0.3)};
    const Vec3 cut = 0.4 * a[0] + 0.6 * a[1];
    const Convolution triangle = convolve_polygon(kernel, a, y);
    const Convolution one = convolve_polygon(kernel, std::array{a[0], cut, a[2]}, y);
    const Convolution two = convolve_polygon(kernel, std::array{cut, a[1], a[2]}, y);
    EXPECT_NEAR(one.value + two.value, triangle.value, 2e-14);
    EXPECT_LT((one.gradient + two.gradient - triangle.gradient).norm(), 1e-12);
    // A ring cut into two arcs.
    const Convolution ring = convolve_arc(kernel, 0.7, kPi, y);
    const Convolution front = convolve_arc(kernel, 0.7, 0.8, y);
    const Convolution back = convolve_arc(kernel, 0.7, kPi - 0.8, Vec3(-y.x(), -y.y(), y.z()));
    EXPECT_NEAR(front.value + back.value, ring.value, 2e-14);
  }
}

TEST_P(ConvolvedKernel, GradientsMatchCentralDifferences) {
  const Kernel& kernel = GetParam();
  const double h = 1e-5;
  Random random(5);
  const std::array<Vec3, 3> corners{Vec3(-0.5, -0.4, 0.2), Vec3(0.7, -0.3, 0.1), Vec3(0.1, 0.8, -0.3)};
  for (int trial = 0; trial < 300; ++trial) {
    Vec3 y = random.in_box(1.2);
    if (trial % 10 == 0) y.head<2>() *= 1e-7;  // next to the axis of the arc
    const auto check = [&](const auto& f, const char* what) {
      const Convolution here = f(y);
      for (int i = 0; i < 3; ++i) {
        const Vec3 step = h * Vec3::Unit(i);
        // Round-off 1e-15 / h and third derivatives (up to 100) times h^2 / 6; those of C^1 kernels jump.
        EXPECT_NEAR(here.gradient[i], (f(y + step).value - f(y - step).value) / (2 * h), 2e-8) << what << ' ' << y.transpose();
      }
    };
    check([&](const Vec3& x) { return convolve_segment(kernel, 0.6, x); }, "segment");
    check([&](const Vec3& x) { return convolve_polygon(kernel, corners, x); }, "triangle");
    check([&](const Vec3& x) { return convolve_arc(kernel, 0.7, 1.3, x); }, "arc");
    check([&](const Vec3& x) { return convolve_arc(kernel, 0.7, kPi, x); }, "ring");
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, ConvolvedKernel,
                         ::testing::Values(Kernel::wyvill(1.0), Kernel::murakami(1.0), Kernel::cauchy(1.0, 2.0)));

Primitive convolved(ShapeKind shape, const Vec3& size, const Kernel& kernel, std::vector<Vec3> control = {}) {
  Primitive p;
  p.shape = shape;
  p.size = size;
  p.kernel = kernel;
  p.control = std::move(control);
  p.convolved = true;
  return p;
}

TEST(ConvolvedPrimitives, LongLinesAndWidePlanesHaveTheRadiusOfTheirKernel) {
  for (const Kernel& kernel : {Kernel::wyvill(0.5), Kernel::murakami(0.5), Kernel::cauchy(0.5, 2.0)}) {
    const double distance = iso_distance(kernel, 0.5);
    EXPECT_NEAR(potential(convolved(ShapeKind::Segment, {3, 0, 0}, kernel), {0.3, distance, 0}).value, 0.5, 1e-14);
    const Primitive plane = convolved(ShapeKind::Triangle, Vec3::Zero(), kernel, {{-9, -9, 0}, {9, -9, 0}, {0, 9, 0}});
    EXPECT_NEAR(potential(plane, {0, 0, distance}).value, 0.5, 1e-13);
  }
}

TEST(ConvolvedPrimitives, SegmentsInARowHaveNoBulge) {
  const Kernel kernel = Kernel::wyvill(0.4);
  const Body row = body_of({{convolved(ShapeKind::Segment, {0.5, 0, 0}, kernel), Vec3(-0.5, 0, 0)},
                            {convolved(ShapeKind::Segment, {0.5, 0, 0}, kernel), Vec3(0.5, 0, 0)}});
  const double distance = iso_distance(kernel, 0.5);
  for (int i = -10; i <= 10; ++i) {
    EXPECT_NEAR(FieldView(row.field).value(Vec3(0.05 * i, distance, 0)), 0.0, 1e-14);
  }
  Primitive plain = convolved(ShapeKind::Segment, {0.5, 0, 0}, kernel);
  plain.convolved = false;
  const Body bulging = body_of({{plain, Vec3(-0.5, 0, 0)}, {plain, Vec3(0.5, 0, 0)}});
  EXPECT_GT(FieldView(bulging.field).value(Vec3(0, distance, 0)), 0.4);
}

Body mixed_body() {
  Body body;
  Random random(6);
  const std::vector<Vec3> corners{{-0.4, -0.3, 0.1}, {0.5, -0.2, 0.0}, {0.1, 0.6, -0.2}};
  for (int i = 0; i < 20; ++i) {
    const Kernel kernel = i % 3 == 0 ? Kernel::wyvill(0.4) : i % 3 == 1 ? Kernel::murakami(0.5) : Kernel::cauchy(0.5, 1.5);
    Primitive p;
    switch (i % 5) {
      case 0: p = convolved(ShapeKind::Segment, {0.4, 0, 0}, kernel); break;
      case 1: p = convolved(ShapeKind::Triangle, Vec3::Zero(), kernel, corners); break;
      case 2: p = convolved(ShapeKind::Arc, {0.5, 1.2, 0}, kernel); break;
      case 3: p = convolved(ShapeKind::Ring, {0.4, 0, 0}, kernel); break;
      default: p = testing::wyvill_point(0.5); break;
    }
    if (i % 4 == 0) p.stretch = {1.2, 0.8, 0.9};
    p.part = body.skeleton.part_count++;
    body.skeleton.primitive.push_back(p);
    body.parts.push_back({random.in_box(1.0), random.rotation()});
  }
  body.place();
  return body;
}

TEST(ConvolvedPrimitives, BatchesAgreeWithTheReference) {
  const Body body = mixed_body();
  for (const Vec3& x : testing::random_points(7, 800, 1.5)) {
    Vec3 gradient, expected;
    const double value = FieldView(body.field).value(x, gradient);
    EXPECT_NEAR(value, evaluate_reference(body.skeleton, body.placed, x, &expected), 1e-13);
    EXPECT_LT((gradient - expected).norm(), 1e-11);
  }
}

TEST(ConvolvedPrimitives, TrueRangeLiesInsideTheInterval) {
  const Body body = mixed_body();
  Random random(8);
  int violations = 0, decided = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const double size = 0.8 * std::pow(10.0, -4.0 * random.uniform(0, 1));
    const Vec3 centre = random.in_box(1.5);
    const Vec3 half = 0.5 * size * (Vec3::Ones() + 0.9 * random.in_box(1.0));
    const Box box{centre - half, centre + half};
    const Interval bound = body.field.bound(box);
    const double steepest = body.field.gradient_bound(box);
    for (int i = 0; i < 10; ++i) {
      const Vec3 x = (centre + random.in_box(1.0).cwiseProduct(half)).cwiseMax(box.lower).cwiseMin(box.upper);
      Vec3 gradient;
      violations += !bound.contains(FieldView(body.field).value(x, gradient));
      violations += gradient.norm() > steepest;
    }
    decided += bound.upper < 0.0 || bound.lower > 0.0;
  }
  EXPECT_EQ(violations, 0);
  EXPECT_GT(decided, 800);
}

// Small against the support, all of a shape counts fully: f is its measure times the gain, in its middle.
TEST(Convolution, PeakBoundsThePotentialClosely) {
  Random random(11);
  Primitive segment, triangle;
  segment.shape = ShapeKind::Segment;
  segment.size = {0.01, 0.0, 0.0};
  segment.kernel = Kernel::wyvill(1.0);
  triangle.shape = ShapeKind::Triangle;
  triangle.kernel = Kernel::murakami(1.0);
  triangle.control = {Vec3(0.01, 0, 0), Vec3(-0.01, 0.01, 0), Vec3(-0.01, -0.01, 0)};
  segment.convolved = triangle.convolved = true;
  for (const Primitive& small : {segment, triangle}) {
    const double middle = potential(small, Vec3::Zero()).value;
    EXPECT_LE(middle, peak(small));
    EXPECT_GT(middle, 0.999 * peak(small));  // f falls by at most 3 q / R^2 = 6e-4 over the shape
  }
  Primitive wide_segment = segment, wide_triangle = triangle, plain = segment;
  wide_segment.size.x() = 3.0;
  for (Vec3& corner : wide_triangle.control) corner *= 300.0;
  plain.convolved = false;
  EXPECT_EQ(peak(plain), 1.0);
  for (const Primitive& primitive : {segment, triangle, wide_segment, wide_triangle}) {
    for (int k = 0; k < 200; ++k) {
      const Vec3 y = random.in_box(0.5);
      EXPECT_LE(potential(primitive, y).value, peak(primitive));
    }
  }
}

// Beside the middle of a long segment the field is that of a line: nothing changes along it, and around it the slope turns with the angle.
TEST(Convolution, OfALongSegmentHasTheHessianOfALine) {
  Primitive segment;
  segment.shape = ShapeKind::Segment;
  segment.size = Vec3(2.0, 0.0, 0.0);
  segment.kernel = Kernel::wyvill(0.5);
  segment.convolved = true;
  const Body body = body_of({{segment, Vec3::Zero()}});
  for (int k = 1; k < 40; ++k) {
    const double r = 0.012 * k, angle = 0.7 * k;
    const Vec3 out(0.0, std::cos(angle), std::sin(angle)), around(0.0, -std::sin(angle), std::cos(angle));
    const Vec3 x = Vec3(0.3, 0.0, 0.0) + r * out;
    Vec3 slope;
    static_cast<void>(FieldView(body.field).value(x, slope));
    const Mat3 hessian = body.field.hessian(x);
    const double turn = slope.dot(out) / r, size = hessian.norm();
    EXPECT_LT((hessian * Vec3::UnitX()).norm(), 1e-8 * size) << r;
    EXPECT_LT((hessian * around - turn * around).norm(), 1e-8 * size) << r;
    const double mean = (slope.dot(hessian * slope) - slope.squaredNorm() * hessian.trace()) / (2.0 * std::pow(slope.norm(), 3));
    EXPECT_NEAR(mean, 0.5 / r, 1e-7 / r);
  }
}

}  // namespace
}  // namespace supple::implicit
