#include "supple/implicit/solids.h"

#include <gtest/gtest.h>

#include <cmath>

#include "implicit/bodies.h"
#include "implicit/check_fields.h"
#include "supple/core/error.h"
#include "supple/core/mesh.h"

namespace supple::implicit {
namespace {

const Pose kPose{Vec3(0.3, -0.2, 0.5), Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()))};
const Vec3 kHalf(0.5, 0.3, 0.2);

SolidBox make_box(double rounding = 0.0) { return {kPose, kHalf, rounding, 4.0}; }

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
  testing::expect_gradients(make_box(), 1.0, 2e-3);
  testing::expect_gradients(make_box(0.1), 1.0, 2e-3);
}

TEST(SolidBox, BoundsHold) {
  testing::expect_bounds(make_box(), 1.5);
  testing::expect_bounds(make_box(0.15), 1.5);
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
  Skeleton two{.primitive = {Primitive{}, Primitive{}}, .part_count = 1, .iso = 0.5, .blend = {}};
  EXPECT_FALSE(has_convex_core(two));
  two.primitive.resize(1);
  EXPECT_TRUE(has_convex_core(two));
  two.primitive[0].stretch = Vec3(1, 2, 1);
  EXPECT_FALSE(has_convex_core(two));
}

}  // namespace
}  // namespace supple::implicit
