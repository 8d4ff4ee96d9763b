#include "supple/implicit/volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bodies.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::body_of;
using testing::wyvill_point;

TEST(Volume, OfALonePointIsThatOfItsBall) {
  const double exact = 4.0 / 3.0 * std::acos(-1.0) * std::pow(1.0 - std::cbrt(0.5), 1.5);
  EXPECT_NEAR(exact, 0.392496502, 5e-10);
  double error[2];
  for (const int k : {0, 1}) {
    error[k] = 0.0;
    for (int i = 0; i < 10; ++i) {  // where the cells lie makes little difference
      const Body body = body_of({{wyvill_point(1.0), Vec3(3 + 0.0123 * i, -2 + 0.0345 * i, 1)}});
      error[k] = std::max(error[k], std::abs(enclosed_volume(body.field, k == 0 ? 0.1 : 0.05) / exact - 1.0));
    }
  }
  // The tangent plane misses the cap of a cell by cell^2 / (24 radius^2) of the ball's volume per unit, some times over: the
  // width of a cell at a slant exceeds its edge. 4.5 cells a radius: 1/20; order two.
  EXPECT_LT(error[0], 0.05);
  EXPECT_LT(error[1], 0.3 * error[0]);
}

TEST(Volume, OfARoundedBoxIsThatOfSteinersFormula) {
  Primitive box = wyvill_point(1.0);
  box.shape = ShapeKind::Box;
  box.size = {0.9, 0.6, 0.4};
  const Body body = body_of({{box, Vec3(1, 2, 3)}});
  const double a = 1.8, b = 1.2, c = 0.8, r = iso_distance(Kernel::wyvill(1.0), 0.5), pi = std::acos(-1.0);
  const double exact = a * b * c + 2 * r * (a * b + b * c + c * a) + pi * r * r * (a + b + c) + 4.0 / 3.0 * pi * r * r * r;
  EXPECT_NEAR(enclosed_volume(body.field, 0.05), exact, 2e-3 * exact);
}

TEST(Volume, WithoutASurfaceIsZero) {
  Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  body.skeleton.iso = 1.5;
  body.place();
  EXPECT_EQ(enclosed_volume(body.field, 0.1), 0.0);
}

TEST(Volume, ScaledKernelsKeepTheirValuesAtScaledDistances) {
  const double s = 1.3;
  for (const Kernel& kernel : {Kernel::wyvill(0.5), Kernel::gascuel(0.2, 0.5, 4.0), Kernel::blinn(0.5, 2.0),
                               Kernel::cauchy(0.5, 3.0), Kernel::blanc_schlick(0.5, 0.4), Kernel::nishimura(0.5)}) {
    Primitive p;
    p.kernel = kernel;
    const Kernel grown = scaled(p, s).kernel;
    for (double d = 0.01; d < 0.6; d += 0.03) {
      EXPECT_NEAR(evaluate(grown, s * s * d * d).value, evaluate(kernel, d * d).value, 1e-14);
    }
    EXPECT_NEAR(lipschitz(grown), lipschitz(kernel) / s, 1e-13);
    EXPECT_NEAR(iso_distance(grown, 0.5), s * iso_distance(kernel, 0.5), 1e-15);
  }
  Primitive egg;
  egg.shape = ShapeKind::Ellipsoid;
  egg.size = {0.5, 0.3, 0.2};
  egg.kernel = Kernel::wyvill(0.2);
  const Vec3 y(0.1, 0.05, -0.08);
  EXPECT_NEAR(potential(scaled(egg, s), s * y).value, potential(egg, y).value, 1e-15);
  EXPECT_THROW(static_cast<void>(scaled(egg, 0.0)), ContractViolation);
}

TEST(Volume, IsHeldWhileTwoPointsMerge) {
  // Two points approach from apart until they lie on each other: summed kernels swell by a fifth; the
  // controller keeps the volume of the two balls.
  const double radius = iso_distance(Kernel::wyvill(1.0), 0.5);
  const double ball = 4.0 / 3.0 * std::acos(-1.0) * radius * radius * radius;
  const VolumeControl control{.target = 2.0 * ball, .rate = 4.0, .damping = 0.05};
  VolumeState state;
  Body body = body_of({{wyvill_point(1.0), Vec3(-0.7, 0, 0)}, {wyvill_point(1.0), Vec3(0.7, 0, 0)}});
  const std::vector<Primitive> rest = body.skeleton.primitive;
  double worst = 0.0, uncontrolled = 0.0;
  const int steps = 400;  // 8 s in steps of 20 ms; the points meet after 6 s
  for (int i = 0; i <= steps; ++i) {
    const double x = 0.7 * std::max(0.0, 1.0 - i / 300.0);
    body.parts[0].position.x() = -x;
    body.parts[1].position.x() = x;
    for (std::size_t k = 0; k < 2; ++k) body.skeleton.primitive[k] = scaled(rest[k], state.scale);
    body.place();
    const double volume = enclosed_volume(body.field, 0.08);
    worst = std::max(worst, std::abs(volume / control.target - 1.0));
    if (i % 20 == 0) {
      const Body free = body_of({{rest[0], Vec3(-x, 0, 0)}, {rest[1], Vec3(x, 0, 0)}});
      uncontrolled = std::max(uncontrolled, std::abs(enclosed_volume(free.field, 0.08) / control.target - 1.0));
    }
    control_volume(control, volume, 0.02, state);
  }
  EXPECT_GT(uncontrolled, 0.15);
  // Lags by the drift, 0.2 / s at most, over 3 alpha = 12 / s; cells err by half a percent.
  EXPECT_LT(worst, 0.03);
  EXPECT_NEAR(state.volume / control.target, 1.0, 1e-3);  // settled: 2 s are 24 time constants
}

TEST(Volume, ControlFollowsItsLaw) {
  const VolumeControl control{.target = 2.0, .rate = 0.5, .damping = 0.1};
  VolumeState state{.scale = 1.5, .volume = 1.99};
  control_volume(control, 1.98, 0.1, state);
  EXPECT_DOUBLE_EQ(state.scale, 1.5 * (1.0 + (0.5 * 0.02 * 0.1 + 0.1 * 0.01) / 2.0));
  EXPECT_EQ(state.volume, 1.98);
  VolumeState fresh;
  control_volume(control, 1.0, 100.0, fresh);  // limited
  EXPECT_DOUBLE_EQ(fresh.scale, 1.02);
}

TEST(PartVolumes, AddUpAndFollowTheTerritories) {
  const double cell = 0.03;
  // Two equal balls share alike by symmetry; a third one apart has what a lone ball has.
  const testing::Body body = testing::body_of({{testing::wyvill_point(1.0), Vec3(-0.3, 0, 0)},
                                               {testing::wyvill_point(1.0), Vec3(0.3, 0, 0)},
                                               {testing::wyvill_point(0.6), Vec3(0, 3, 0)}});
  const std::vector<double> parts = part_volumes(body.field, cell, 3);
  EXPECT_NEAR(parts[0] + parts[1] + parts[2], enclosed_volume(body.field, cell), 1e-12);
  EXPECT_NEAR(parts[0], parts[1], 1e-12);
  // The tangent planes err by the square of the cell over the radius, 0.273.
  EXPECT_NEAR(parts[2], 0.392496505 * 0.6 * 0.6 * 0.6, cell * cell / (0.273 * 0.273) * parts[2]);
  EXPECT_GT(parts[0], parts[2]);
}

TEST(PartVolumes, ByPrimitiveSplitWhatAPartHas) {
  // Two primitives on the first part of three, the last part with none; by every rule of blending.
  testing::Body body = testing::body_of({{testing::wyvill_point(1.0), Vec3(-0.3, 0, 0)},
                                         {testing::wyvill_point(1.0), Vec3(0.4, 0.1, 0)},
                                         {testing::wyvill_point(1.0), Vec3(3, 0, 0)}});
  body.skeleton.primitive.pop_back();
  Primitive second = testing::wyvill_point(0.7);
  second.offset.position = Vec3(0, 0.5, 0);
  body.skeleton.primitive.insert(body.skeleton.primitive.begin() + 1, second);
  for (const BlendRule rule : {BlendRule::Sum, BlendRule::Graph, BlendRule::Ricci, BlendRule::Gradient}) {
    body.skeleton.blend = {.rule = rule};
    if (rule == BlendRule::Graph) body.skeleton.blend.edge = {{0, 1, 0.5}, {1, 2, 1.0}};
    body.place();
    const std::vector<double> parts = part_volumes(body.field, 0.04, 3);
    testing::Body apart;
    apart.skeleton = by_primitive(body.skeleton);
    apart.parts = {body.parts[0], body.parts[0], body.parts[1]};
    apart.place();
    testing::Random random(5);
    for (int i = 0; i < 100; ++i) {
      const Vec3 x = random.in_box(1.2);
      EXPECT_NEAR(FieldView(apart.field).value(x), FieldView(body.field).value(x), 1e-14);
    }
    const std::vector<double> primitives = part_volumes(apart.field, 0.04, 3);
    EXPECT_GT(primitives[1], 0.0);
    EXPECT_NEAR(primitives[0] + primitives[1] + primitives[2], parts[0] + parts[1] + parts[2], 1e-12);
    // Where a part's primitives together outweigh the other part but neither does alone, territory changes hands.
    EXPECT_LE(primitives[0] + primitives[1], parts[0] + 1e-12);
  }
}

}  // namespace
}  // namespace supple::implicit
