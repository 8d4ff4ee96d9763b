#include "supple/implicit/volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "implicit/bodies.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

using testing::Body;
using testing::body_of;
using testing::wyvill_point;

const double kPi = std::acos(-1.0);

/// What volume.h promises of bodies whose least radius of curvature is `radius`: half the fourth power of the ratio.
double promised(double cell, double radius) { return 0.5 * std::pow(cell / radius, 4); }

struct RoundShape {
  const char* name;
  ShapeKind kind;
  Vec3 size;
};

/// Steiner's formula for what lies within r of a point, a segment or a box.
double parallel_volume(const RoundShape& shape, double r) {
  const double ball = 4.0 / 3.0 * kPi * r * r * r;
  const Vec3 edges = 2.0 * shape.size;
  if (shape.kind == ShapeKind::Point) return ball;
  if (shape.kind == ShapeKind::Segment) return ball + kPi * r * r * edges.x();
  return ball + kPi * r * r * edges.sum() + edges.prod() + 2.0 * r * (edges.x() * edges.y() + edges.y() * edges.z() + edges.z() * edges.x());
}

const std::array kRoundShapes{RoundShape{"ball", ShapeKind::Point, Vec3::Zero()}, RoundShape{"capsule", ShapeKind::Segment, Vec3(0.7, 0, 0)},
                              RoundShape{"rounded box", ShapeKind::Box, Vec3(0.6, 0.4, 0.3)}};

struct NamedKernel {
  const char* name;
  Kernel kernel;
  double iso;
};

TEST(Volume, OfRoundShapesIsThatOfSteinersFormulaForEveryKernel) {
  // Steep and flat ones, surfaces deep in the support and near its end.
  const std::array kernels{NamedKernel{"wyvill", Kernel::wyvill(1.0), 0.5},          NamedKernel{"wyvill, wide", Kernel::wyvill(1.0), 0.02},
                           NamedKernel{"wyvill, narrow", Kernel::wyvill(1.0), 0.9},  NamedKernel{"gascuel", Kernel::gascuel(0.4, 0.5, 10.0), 0.5},
                           NamedKernel{"soft_object", Kernel::soft_object(1.0), 0.5}, NamedKernel{"murakami", Kernel::murakami(1.0), 0.5},
                           NamedKernel{"nishimura", Kernel::nishimura(1.0), 0.5},     NamedKernel{"blinn", Kernel::blinn(1.0, 4.0), 0.5},
                           NamedKernel{"cauchy", Kernel::cauchy(1.0, 3.0), 0.5},      NamedKernel{"blanc_schlick", Kernel::blanc_schlick(1.0, 10.0), 0.5}};
  testing::Random random(3);
  for (const NamedKernel& k : kernels) {
    const double r = iso_distance(k.kernel, k.iso);
    for (const RoundShape& shape : kRoundShapes) {
      for (int turn = 0; turn < 3; ++turn) {
        Primitive primitive;
        primitive.shape = shape.kind;
        primitive.size = shape.size;
        primitive.kernel = k.kernel;
        Body body = body_of({{primitive, random.in_box(1.0)}});
        body.skeleton.iso = k.iso;
        if (turn > 0) body.parts[0].orientation = random.rotation();
        body.place();
        const double exact = parallel_volume(shape, r);
        for (const double cells : {6.0, 8.0}) {
          EXPECT_NEAR(enclosed_volume(body.field, r / cells) / exact, 1.0, promised(1.0, cells)) << k.name << ", " << shape.name;
        }
      }
    }
  }
}

TEST(Volume, OfALayerIsExactForPlanes) {
  // The sides of a thin plate, wherever the lattice cuts it; its rim is that of a rounded box.
  const double r = iso_distance(Kernel::wyvill(0.3), 0.5);
  for (int i = 0; i < 8; ++i) {
    Primitive plate = wyvill_point(0.3);
    plate.shape = ShapeKind::Box;
    plate.size = {1.0, 1.0, 0.5};
    const Body body = body_of({{plate, Vec3(0.0123 * i, 0.0077 * i, 0.0041 * i)}});
    const double exact = parallel_volume({"", ShapeKind::Box, plate.size}, r);
    EXPECT_NEAR(enclosed_volume(body.field, r / 6.0) / exact, 1.0, 0.2 * promised(1.0, 6.0)) << i;  // its bends are a fifth of it
  }
}

/// Two Wyvill points on the x axis.
struct Pair {
  double first, second;  ///< supports [m]
  double distance;       ///< [m]

  [[nodiscard]] double value(int which, double x, double r) const {
    const double from = x + (which == 0 ? 0.5 : -0.5) * distance;
    return evaluate(Kernel::wyvill(which == 0 ? first : second), from * from + r * r).value;
  }
  [[nodiscard]] Body body(const Quat& turn, const Vec3& place) const {
    return body_of({{wyvill_point(first), place - turn * Vec3(0.5 * distance, 0, 0)}, {wyvill_point(second), place + turn * Vec3(0.5 * distance, 0, 0)}});
  }
};

double bisect(double low, double high, const auto& positive) {
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (positive(middle) ? low : high) = middle;
  }
  return low;
}

/// Both together, and where the first is the stronger one, by discs across the axis.
std::pair<double, double> exact_volumes(const Pair& pair) {
  const int discs = 4000;  // the midpoint rule errs by the power 3/2 of their thickness at the ends
  const double from = -1.5, step = 3.0 / discs;
  double both = 0.0, first = 0.0;
  for (int i = 0; i < discs; ++i) {
    const double x = from + (i + 0.5) * step;
    const auto inside = [&](double r) { return pair.value(0, x, r) + pair.value(1, x, r) > 0.5; };
    if (!inside(0.0)) continue;
    const double rim = bisect(0.0, 1.2, inside);
    const auto ahead = [&](double r) { return pair.value(0, x, r) > pair.value(1, x, r); };
    const bool in_middle = ahead(0.0);
    const double change = ahead(rim) == in_middle ? rim : bisect(0.0, rim, [&](double r) { return ahead(r) == in_middle; });
    both += kPi * rim * rim * step;
    first += kPi * (in_middle ? change * change : rim * rim - change * change) * step;
  }
  return {both, first};
}

TEST(Volume, OfBlendedPairsIsThatOfTheirDiscs) {
  testing::Random random(11);
  for (const double second : {1.0, 0.8, 0.5}) {
    const double cell = iso_distance(Kernel::wyvill(second), 0.5) / 6.0;
    for (const double distance : {0.2, 0.5, 0.7, 0.9, 1.1}) {
      const Pair pair{1.0, second, distance};
      const auto [both, first] = exact_volumes(pair);
      for (int turn = 0; turn < 3; ++turn) {
        const Body body = pair.body(turn == 0 ? Quat(Quat::Identity()) : random.rotation(), random.in_box(1.0));
        EXPECT_NEAR(enclosed_volume(body.field, cell) / both, 1.0, promised(1.0, 6.0)) << second << ' ' << distance;
      }
    }
  }
}

TEST(Volume, OfBallsFarApartTakesTheCellsOfTheBallsOnly) {
  // The box around them holds 1e22 cells; coordinates resolve a cell to 1e-9 of it.
  const double size = 5e-7;
  const Body body = body_of({{wyvill_point(size), Vec3::Zero()}, {wyvill_point(size), Vec3(1, 0.3, 0)}, {wyvill_point(size), Vec3(0, -1, 1)}});
  const double r = iso_distance(Kernel::wyvill(size), 0.5);
  EXPECT_NEAR(enclosed_volume(body.field, r / 6.0) / (4.0 * kPi * r * r * r), 1.0, promised(1.0, 6.0) + 1e-7);
  for (const double part : part_volumes(body.field, r / 6.0, 3)) EXPECT_NEAR(part / (4.0 / 3.0 * kPi * r * r * r), 1.0, promised(1.0, 6.0) + 1e-7);
}

TEST(Volume, CellsThatCoordinatesDoNotResolveAreLarger) {
  const Body body = body_of({{wyvill_point(1e-40), Vec3(1, 0, 0)}});
  EXPECT_EQ(enclosed_volume(body.field, 1e-41), 0.0);
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
  // Lags by the drift, 0.2 / s at most, over 3 alpha = 12 / s; cells err by little.
  EXPECT_LT(worst, 0.03);
  EXPECT_NEAR(state.volume / control.target, 1.0, 1e-3);  // settled: 2 s are 24 time constants
}

TEST(Volume, ControlFollowsItsLaw) {
  const VolumeControl control{.target = 2.0, .rate = 0.5, .damping = 0.1};
  VolumeState state{.scale = 1.5, .volume = 1.99};
  control_volume(control, 1.98, 0.1, state);
  EXPECT_DOUBLE_EQ(state.scale, 1.5 * (1.0 + (0.5 * 0.02 * 0.1 + 0.1 * 0.01) / 2.0));
  EXPECT_EQ(state.volume, 1.98);
  EXPECT_NEAR(state.rate, (0.5 * 0.02 * 0.1 + 0.1 * 0.01) / 2.0 / 0.1, 1e-12);
  VolumeState fresh;
  control_volume(control, 1.0, 100.0, fresh);  // limited
  EXPECT_DOUBLE_EQ(fresh.scale, 1.02);

  // However long the step, a ball comes to rest: its error then follows that of the last step by -3 beta (e - e_last).
  VolumeState ball;
  for (int i = 0; i < 100; ++i) control_volume(control, 1.9 * ball.scale * ball.scale * ball.scale, 100.0, ball);
  EXPECT_NEAR(ball.volume, 2.0, 1e-9);
}

TEST(PartVolumes, AddUpAndFollowTheTerritories) {
  testing::Random random(12);
  for (const double second : {1.0, 0.8}) {
    const double cell = iso_distance(Kernel::wyvill(second), 0.5) / 6.0;
    for (const double distance : {0.5, 0.7, 0.9, 1.1}) {
      const Pair pair{1.0, second, distance};
      const auto [both, first] = exact_volumes(pair);
      for (int turn = 0; turn < 3; ++turn) {
        const Body body = pair.body(turn == 0 ? Quat(Quat::Identity()) : random.rotation(), random.in_box(1.0));
        const std::vector<double> parts = part_volumes(body.field, cell, 2);
        EXPECT_NEAR(parts[0] + parts[1], enclosed_volume(body.field, cell), 1e-12);
        EXPECT_NEAR(parts[0] / first, 1.0, 1e-3) << second << ' ' << distance;
        EXPECT_NEAR(parts[1] / (both - first), 1.0, 1e-3) << second << ' ' << distance;
      }
    }
  }
}

TEST(PartVolumes, OfThreeAlikeAreAThirdEachAndOneApartHasItsBall) {
  std::vector<std::pair<Primitive, Vec3>> points{{wyvill_point(0.6), Vec3(0, 0, 3)}};
  for (const double angle : {0.1, 0.1 + 2.0 * kPi / 3.0, 0.1 + 4.0 * kPi / 3.0}) {
    points.emplace_back(wyvill_point(1.0), 0.35 * Vec3(std::cos(angle), std::sin(angle), 0.2));
  }
  const Body body = body_of({points[0], points[1], points[2], points[3]});
  const double r = iso_distance(Kernel::wyvill(0.6), 0.5), cell = r / 6.0;
  const std::vector<double> parts = part_volumes(body.field, cell, 4);
  EXPECT_NEAR(parts[0] / parallel_volume(kRoundShapes[0], r), 1.0, promised(cell, r));
  const double all = enclosed_volume(body.field, cell);
  EXPECT_NEAR(parts[0] + parts[1] + parts[2] + parts[3], all, 1e-12);
  for (std::size_t k = 1; k < 4; ++k) EXPECT_NEAR(parts[k] / (all - parts[0]), 1.0 / 3.0, 1e-3);
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
