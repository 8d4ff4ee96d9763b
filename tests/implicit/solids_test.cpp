#include "supple/implicit/solids.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "bodies.h"
#include "supple/core/error.h"
#include "supple/core/mesh.h"

namespace supple::implicit {
namespace {

const Pose kPose{Vec3(0.3, -0.2, 0.5), Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()))};
const Vec3 kHalf(0.5, 0.3, 0.2);

SolidBox make_box(double rounding = 0.0) { return {kPose, kHalf, rounding, 4.0}; }

/// h = 0.3 sin(2 x) cos(1.5 y), sampled.
double wave(double x, double y) { return 0.3 * std::sin(2.0 * x) * std::cos(1.5 * y); }
HeightField make_terrain(std::size_t n = 21) {
  const double spacing = 2.0 / static_cast<double>(n - 1);
  std::vector<double> heights;
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      heights.push_back(wave(-1.0 + spacing * static_cast<double>(i), -1.0 + spacing * static_cast<double>(j)));
    }
  }
  return {Vec3(-1.0, -1.0, 0.25), spacing, n, n, heights, 3.0};
}

template <class Solid>
void expect_gradients(const Solid& solid, double reach, double tolerance) {
  const FieldView field(solid);
  const double h = 1e-5;
  for (const Vec3& p : testing::random_points(3, 200, reach)) {
    Vec3 gradient;
    std::ignore = field.value(p, gradient);
    for (int k = 0; k < 3; ++k) {
      const double forward = field.value(p + h * Vec3::Unit(k)) - field.value(p);
      const double backward = field.value(p) - field.value(p - h * Vec3::Unit(k));
      if (std::abs(forward - backward) > 1e-3 * h) continue;  // a crease between the two
      EXPECT_NEAR(0.5 * (forward + backward) / h, gradient[k], tolerance) << p.transpose();
    }
  }
}

template <class Solid>
void expect_bounds(const Solid& solid, double reach) {
  const std::vector<Vec3> corners = testing::random_points(5, 100, reach);
  const std::vector<Vec3> inside = testing::random_points(6, 50, 1.0);
  for (std::size_t i = 0; i + 1 < corners.size(); i += 2) {
    Box box;
    box.include(corners[i]);
    box.include(corners[i + 1]);
    const Interval bound = solid.bound(box);
    const double steepest = solid.gradient_bound(box);
    for (const Vec3& u : inside) {
      Vec3 gradient;
      const Vec3 p = box.centre() + 0.5 * u.cwiseProduct(box.extent());
      const double value = FieldView(solid).value(p, gradient);
      EXPECT_TRUE(bound.contains(value)) << value << " in [" << bound.lower << ", " << bound.upper << ']';
      EXPECT_LE(gradient.norm(), steepest);
    }
  }
}

TEST(SolidBox, FieldIsTheScaledDistance) {
  for (const double rounding : {0.0, 0.1}) {
    const SolidBox box = make_box(rounding);
    const FieldView field(box);
    const auto at = [&](double x, double y, double z) { return field.value(kPose.to_world(Vec3(x, y, z))); };
    EXPECT_NEAR(at(0.5 + 0.25, 0.1, 0.05), -4.0 * 0.25, 1e-14);
    EXPECT_NEAR(at(0.0, 0.0, 0.2), 0.0, 1e-14);
    EXPECT_NEAR(at(0.1, 0.0, 0.15), 4.0 * 0.05, 1e-14);
    // Beyond an edge the distance is to the edge, or to its rounding.
    const double out = std::hypot(0.3 + rounding, 0.4 + rounding) - rounding;
    EXPECT_NEAR(at(0.5 + 0.3, 0.3 + 0.4, 0.0), -4.0 * out, 1e-14);
    const double corner = Vec3::Constant(0.1 + rounding).norm() - rounding;
    EXPECT_NEAR(at(-0.6, -0.4, -0.3), -4.0 * corner, 1e-14);
  }
}

TEST(SolidBox, GradientIsThatOfItsValue) {
  expect_gradients(make_box(), 1.0, 2e-3);
  expect_gradients(make_box(0.1), 1.0, 2e-3);
}

TEST(SolidBox, BoundsHold) {
  expect_bounds(make_box(), 1.5);
  expect_bounds(make_box(0.15), 1.5);
}

TEST(SolidBox, SurfaceLiesInItsBoxAndOnItsMesh) {
  const SolidBox box = make_box();
  const Mesh mesh = box.mesh();
  EXPECT_NEAR(inspect(mesh).volume, 8.0 * kHalf.prod(), 1e-14);
  EXPECT_NEAR(inspect(mesh).area, 8.0 * (0.5 * 0.3 + 0.5 * 0.2 + 0.3 * 0.2), 1e-13);
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_NEAR(FieldView(box).value(mesh.position[i]), 0.0, 1e-14);
    EXPECT_TRUE(box.surface_box().contains(mesh.position[i]));
    EXPECT_GT(mesh.normal[i].dot(mesh.position[i] - kPose.position), 0.0);
  }
}

TEST(SolidBox, RefusesARoundingThicknessDoesNotHold) {
  EXPECT_THROW((SolidBox{kPose, kHalf, 0.3, 1.0}), ContractViolation);
}

TEST(Cores, AreAtOneDistanceFromTheSurface) {
  // On the way out of the nearest core point the surface comes after `radius`.
  const auto expect_core = [](const FieldView& field, double reach) {
    for (const Vec3& place : testing::random_points(8, 100, reach)) {
      const std::optional<CorePoint> core = field.core_point(place);
      ASSERT_TRUE(core);
      const Vec3 way = place - core->point;
      if (way.norm() < 1e-6) continue;
      EXPECT_NEAR(field.value(core->point + core->radius * way.normalized()), 0.0, 1e-12) << place.transpose();
    }
  };
  const SolidBox box = make_box(0.1);
  const HalfSpace plane{Vec3(0, 0, 0.2), Vec3(0.6, 0, 0.8), 2.0};
  expect_core(box, 2.0);
  expect_core(plane, 2.0);
  for (const ShapeKind shape : {ShapeKind::Point, ShapeKind::Segment, ShapeKind::Rectangle, ShapeKind::Disc, ShapeKind::Box,
                                ShapeKind::Triangle}) {
    Primitive p;
    p.shape = shape;
    p.size = Vec3(0.3, 0.2, 0.1);
    p.kernel = Kernel::wyvill(0.5);
    if (shape == ShapeKind::Triangle) p.control = {Vec3(0.3, 0, 0), Vec3(0, 0.4, 0), Vec3(-0.2, -0.1, 0.1)};
    Skeleton skeleton{.primitive = {p}, .part_count = 1, .iso = 0.5, .blend = {}};
    EXPECT_TRUE(has_convex_core(skeleton));
    PlacedSkeleton placed;
    Field field;
    place_skeleton(skeleton, {&kPose, 1}, placed);
    index_field(skeleton, placed, field);
    expect_core(field, 1.5);
  }
}

TEST(Cores, AreThoseOfConvexBodiesOnly) {
  EXPECT_FALSE(FieldView(make_terrain()).core_point(Vec3::Zero()));
  Skeleton two{.primitive = {Primitive{}, Primitive{}}, .part_count = 1, .iso = 0.5, .blend = {}};
  EXPECT_FALSE(has_convex_core(two));
  two.primitive.resize(1);
  EXPECT_TRUE(has_convex_core(two));
  two.primitive[0].stretch = Vec3(1, 2, 1);
  EXPECT_FALSE(has_convex_core(two));
}

TEST(HeightField, PassesThroughItsHeightsAndConvergesAtFourthOrder) {
  // Away from the borders, where the slope is held at 0.
  const auto error = [](std::size_t n) {
    const HeightField terrain = make_terrain(n);
    double largest = 0.0;
    for (double x = -0.3; x <= 0.3; x += 0.037) {
      for (double y = -0.3; y <= 0.3; y += 0.041) {
        largest = std::max(largest, std::abs(terrain.height(x, y).x() - 0.25 - wave(x, y)));
      }
    }
    return largest;
  };
  EXPECT_NEAR(make_terrain().height(0.4, -0.7).x(), 0.25 + wave(0.4, -0.7), 1e-14);
  EXPECT_NEAR(std::log2(error(41) / error(81)), 4.0, 0.3);
}

TEST(HeightField, GradientIsThatOfItsValue) { expect_gradients(make_terrain(), 1.5, 1e-6); }

TEST(HeightField, BoundsHold) { expect_bounds(make_terrain(), 1.5); }

TEST(HeightField, IsConstantBeyondItsBorders) {
  const HeightField terrain = make_terrain();
  EXPECT_EQ(terrain.height(1.7, 0.2).x(), terrain.height(1.0, 0.2).x());
  for (const double border : {-1.0, 1.0}) {
    EXPECT_NEAR(terrain.height(border, 0.2).y(), 0.0, 1e-13);
    EXPECT_NEAR(terrain.height(0.2, border).z(), 0.0, 1e-13);
  }
  EXPECT_EQ(terrain.height(-4.0, -3.0).x(), terrain.height(-1.0, -1.0).x());
}

TEST(HeightField, MeshLiesOnTheField) {
  const HeightField terrain = make_terrain(5);
  const Mesh mesh = terrain.mesh(4);
  EXPECT_EQ(mesh.vertex_count(), 17u * 17u);
  EXPECT_EQ(mesh.triangle_count(), 2u * 16u * 16u);
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    Vec3 gradient;
    EXPECT_NEAR(FieldView(terrain).value(mesh.position[i], gradient), 0.0, 1e-14);
    EXPECT_LT((mesh.normal[i] + gradient.normalized()).norm(), 1e-14);
  }
  for (const auto& [a, b, c] : mesh.triangle) {
    EXPECT_GT((mesh.position[b] - mesh.position[a]).cross(mesh.position[c] - mesh.position[a]).z(), 0.0);
  }
}

}  // namespace
}  // namespace supple::implicit
