#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "collision/bodies.h"
#include "supple/collision/deformed_field.h"

namespace supple::collision {
namespace {

using implicit::Kernel;
using implicit::Primitive;
using implicit::ShapeKind;
using testing::Stage;

constexpr double kAsNeeded = std::numeric_limits<double>::infinity();

/// One part with one primitive.
struct Solid {
  implicit::Skeleton skeleton;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  Solid(ShapeKind shape, const Kernel& kernel, const Vec3& at, const Vec3& size = Vec3::Zero(), std::vector<Vec3> control = {}) {
    Primitive p;
    p.shape = shape;
    p.kernel = kernel;
    p.offset.position = at;
    p.size = size;
    if (!control.empty()) p.control = std::move(control);
    skeleton.part_count = 1;
    skeleton.primitive.push_back(p);
    const std::vector<Pose> parts{Pose{Vec3::Zero(), Quat::Identity()}};
    implicit::place_skeleton(skeleton, parts, placed);
    implicit::index_field(skeleton, placed, field);
  }
};

/// Integral of w(rho) over where a field is positive on a ray, W its antiderivative; samples see every piece, bisection its ends.
template <class W>
double on_ray(const implicit::FieldView& field, const Vec3& from, const Vec3& along, double far, const W& integral) {
  constexpr int kSamples = 64;
  std::vector<Vec3> at;
  for (int k = 0; k <= kSamples; ++k) at.push_back(from + (far * k / kSamples) * along);
  std::vector<double> value(at.size());
  field.evaluate(at, value);
  double sum = value.front() > 0.0 ? -integral(0.0) : 0.0;
  for (std::size_t k = 0; k + 1 < value.size(); ++k) {
    const bool leaves = value[k] > 0.0;
    if (leaves == (value[k + 1] > 0.0)) continue;
    double low = far * static_cast<double>(k) / kSamples, high = low + far / kSamples;
    for (int n = 0; n < 40; ++n) {
      const double middle = 0.5 * (low + high);
      ((field.value(from + middle * along) > 0.0) == leaves ? low : high) = middle;
    }
    sum += (leaves ? 1.0 : -1.0) * integral(low);
  }
  return sum + (value.back() > 0.0 ? integral(far) : 0.0);
}

/// Volume of what is the same all around the z axis within `angle` of the direction -z, or all around the circle of a radius: rays from it in one half-plane, at
/// midpoints. Where the surface has a kink they err by the square of their distance.
double turned_volume(const implicit::FieldView& field, double radius, double height, double angle, double far, int rays) {
  double sum = 0.0;
  for (int k = 0; k < rays; ++k) {
    const double a = (radius > 0.0 ? 2.0 * std::numbers::pi : angle) * (k + 0.5) / rays;
    const Vec3 along(std::sin(a), 0.0, -std::cos(a));
    sum += on_ray(field, Vec3(radius, 0.0, height), along, far, [&](double rho) { return 0.5 * radius * rho * rho + along.x() * rho * rho * rho / 3.0; });
  }
  return sum * 2.0 * std::numbers::pi * (radius > 0.0 ? 2.0 * std::numbers::pi : angle) / rays;
}

/// Volume by rays from a point, at midpoints of angle and of height on the unit sphere.
double volume_about(const implicit::FieldView& field, const Vec3& from, double far, int rays) {
  double sum = 0.0;
  for (int j = 0; j < rays; ++j) {
    for (int i = 0; i < 2 * rays; ++i) {
      const double z = 2.0 * (j + 0.5) / rays - 1.0, r = std::sqrt(1.0 - z * z), a = std::numbers::pi * (i + 0.5) / rays;
      sum += on_ray(field, from, Vec3(r * std::cos(a), r * std::sin(a), z), far, [](double rho) { return rho * rho * rho / 3.0; });
    }
  }
  return sum * 2.0 * std::numbers::pi / (rays * rays);
}

Kernel kernel(int which) {
  switch (which) {
    case 0: return Kernel::wyvill(1.0 / 0.454202019);
    case 1: return Kernel::gascuel(1.0, 1.5, 1.0);
    case 2: return Kernel::soft_object(2.0);
    default: return Kernel::blanc_schlick(2.0, 1.0);
  }
}

/// The bulges of the first body, what of its volume it loses and what they hold; by rays.
struct Balance {
  std::vector<BulgeVolume> bulges;
  double lost = 0.0, gained = 0.0;
  [[nodiscard]] double displaced() const {
    double sum = 0.0;
    for (const BulgeVolume& b : bulges) sum += b.displaced;
    return sum;
  }
  [[nodiscard]] double held() const {
    double sum = 0.0;
    for (const BulgeVolume& b : bulges) sum += b.held;
    return sum;
  }
};

template <class Volume>
Balance balance_of(Stage& stage, double width, const Volume& volume) {
  const BulgeSettings settings{.width = width, .keep_volume = true};
  const DeformedPressure pressure(stage.bodies(), 0, stage.surface, settings);
  Balance out;
  out.bulges.assign(pressure.volumes().begin(), pressure.volumes().end());
  const double cut = volume(DeformedField(stage.bodies(), 0, stage.surface, {.attenuation = 0.0}));
  out.lost = volume(stage.bodies()[0].field) - cut;
  out.gained = volume(DeformedField(stage.bodies(), 0, stage.surface, settings)) - cut;
  return out;
}

struct TwoBalls {
  int kernel;
  double half;  // of the distance of their centres, of the radius
  double width;
  bool holds;
};

class KeptVolume : public ::testing::TestWithParam<TwoBalls> {};

// Kernels that are smooth, of other curvature outside the surface, steep there; light and deep; narrow, wide and as wide as it takes.
INSTANTIATE_TEST_SUITE_P(Balls, KeptVolume,
                         ::testing::Values(TwoBalls{0, 0.999, kAsNeeded, true}, TwoBalls{0, 0.97, 0.15, true}, TwoBalls{0, 0.75, kAsNeeded, true}, TwoBalls{0, 0.75, 0.15, false},
                                           TwoBalls{0, 0.6, 0.5, true}, TwoBalls{1, 0.999, kAsNeeded, true}, TwoBalls{1, 0.97, kAsNeeded, true}, TwoBalls{1, 0.9, kAsNeeded, true},
                                           TwoBalls{1, 0.75, 0.5, false}, TwoBalls{2, 0.97, 0.15, true}, TwoBalls{2, 0.75, kAsNeeded, true}, TwoBalls{2, 0.75, 0.15, false},
                                           TwoBalls{3, 0.97, kAsNeeded, true}, TwoBalls{3, 0.9, 0.5, true}, TwoBalls{3, 0.5, kAsNeeded, false}));

TEST_P(KeptVolume, OfABallOnABall) {
  const TwoBalls& given = GetParam();
  const Solid upper(ShapeKind::Point, kernel(given.kernel), Vec3::Zero()), lower(ShapeKind::Point, kernel(given.kernel), Vec3(0.0, 0.0, -2.0 * given.half));
  Stage stage;
  stage.add(upper.field, {Vec3::Zero()}, 1e4);
  stage.add(lower.field, {Vec3::Zero()}, 1e4);
  stage.solve({.error = 1e-6});
  // The rest of the ball is as it was: the contact spans acos(half), its bulge not three times as much.
  const double angle = std::min(4.0 * std::acos(given.half), 0.999 * std::numbers::pi);
  const Balance b = balance_of(stage, given.width, [&](const implicit::FieldView& f) { return turned_volume(f, 0.0, 0.0, angle, 1.6, 4000); });
  ASSERT_EQ(b.bulges.size(), 1u);
  const double displaced = b.bulges[0].displaced;
  EXPECT_NEAR(b.lost, displaced, 1e-4 * displaced);
  EXPECT_NEAR(b.gained, b.bulges[0].held, 1.1e-3 * displaced);  // 1e-3 of `find_bulges`, and the rays' error
  EXPECT_EQ(b.bulges[0].falls_short(), !given.holds);
  if (given.holds) {
    EXPECT_NEAR(b.gained, displaced, 1.1e-3 * displaced);
  } else {
    EXPECT_LT(b.gained, 0.9 * displaced);
  }
}

// Around what is far steeper a bulge with k = 1 is a film.
TEST(KeptVolumes, AreHeldBesideRigidBodies) {
  for (const int which : {0, 1}) {
    for (const double z : {0.97, 0.75}) {
      const Solid ball(ShapeKind::Point, kernel(which), Vec3(0.0, 0.0, z));
      const implicit::HalfSpace plane;
      Stage stage;
      stage.add(ball.field, {Vec3::Zero()}, 1e3);
      stage.add(plane, {Vec3::Zero()}, 1e8);
      stage.solve({.error = 1e-6});
      const Balance b = balance_of(stage, kAsNeeded, [&](const implicit::FieldView& f) { return turned_volume(f, 0.0, z, 0.999 * std::numbers::pi, 1.8, 8000); });
      ASSERT_EQ(b.bulges.size(), 1u);
      EXPECT_FALSE(b.bulges[0].falls_short());
      EXPECT_NEAR(b.gained, b.bulges[0].displaced, 1.1e-3 * b.bulges[0].displaced) << which << ' ' << z;
    }
  }
}

// Two rims, and no gradient in the middle between them.
TEST(KeptVolumes, AreHeldByARingOnABall) {
  const Solid ring(ShapeKind::Ring, Kernel::wyvill(0.4 / 0.454202019), Vec3(0.0, 0.0, 0.9), Vec3(1.0, 0.0, 0.0)), ball(ShapeKind::Point, kernel(0), Vec3::Zero());
  Stage stage;
  stage.add(ring.field, {Vec3::Zero()}, 1e4);
  stage.add(ball.field, {Vec3::Zero()}, 1e4);
  stage.solve({.error = 1e-6});
  const Balance b = balance_of(stage, kAsNeeded, [&](const implicit::FieldView& f) { return turned_volume(f, 1.0, 0.9, 0.0, 0.7, 4000); });
  ASSERT_EQ(b.bulges.size(), 1u);
  EXPECT_NEAR(b.lost, b.bulges[0].displaced, 1e-3 * b.bulges[0].displaced);
  EXPECT_NEAR(b.gained, b.bulges[0].displaced, 2e-3 * b.bulges[0].displaced);
}

// Two contacts whose rims lie so near that their bulges overlap, and a third one of another kernel; by rays that err by less than 1e-3 of what is lost.
TEST(KeptVolumes, AreThoseOfTheBodyWhereBulgesMeet) {
  const Kernel small = Kernel::wyvill(0.45 / 0.454202019);
  const Solid ball(ShapeKind::Point, kernel(0), Vec3::Zero()), right(ShapeKind::Point, small, Vec3(1.21, 0.45, 0.05)), left(ShapeKind::Point, small, Vec3(1.21, -0.45, 0.05)),
      below(ShapeKind::Point, kernel(1), Vec3(-1.8, 0.1, -0.2));
  Stage stage;
  stage.add(ball.field, {Vec3::Zero()}, 1e4);
  stage.add(right.field, {Vec3::Zero()}, 1e4);
  stage.add(left.field, {Vec3::Zero()}, 1e4);
  stage.add(below.field, {Vec3::Zero()}, 2e4);
  stage.solve({.error = 1e-6});
  const Balance b = balance_of(stage, kAsNeeded, [&](const implicit::FieldView& f) { return volume_about(f, Vec3::Zero(), 1.6, 100); });
  ASSERT_EQ(b.bulges.size(), 3u);
  for (const BulgeVolume& v : b.bulges) EXPECT_NEAR(v.held, v.displaced, 1e-3 * v.displaced);
  EXPECT_NEAR(b.gained, b.held(), 2e-3 * b.displaced());
}

TEST(KeptVolumes, AreThoseOfBoxesAndCurves) {
  const Kernel thin = Kernel::wyvill(0.4 / 0.454202019);
  const Solid box(ShapeKind::Box, thin, Vec3::Zero(), Vec3(1.0, 0.7, 0.8)), above(ShapeKind::Point, kernel(0), Vec3(0.2, 0.1, 2.0)),
      beside(ShapeKind::Point, kernel(0), Vec3(1.6, 0.2, 1.5)),
      curve(ShapeKind::Curve, thin, Vec3::Zero(), Vec3::Zero(), {Vec3(-1.5, 0, 0), Vec3(-0.5, 0.8, 0), Vec3(0.5, -0.8, 0), Vec3(1.5, 0, 0)}),
      below(ShapeKind::Point, kernel(0), Vec3(0.3, 0.1, -1.25));
  const auto expect_held = [](const Solid& first, const Solid& second, const Vec3& from, double far) {
    Stage stage;
    stage.add(first.field, {Vec3::Zero()}, 1e4);
    stage.add(second.field, {Vec3::Zero()}, 1e4);
    stage.solve({.error = 1e-5});
    const Balance b = balance_of(stage, kAsNeeded, [&](const implicit::FieldView& f) { return volume_about(f, from, far, 80); });
    ASSERT_EQ(b.bulges.size(), 1u);
    EXPECT_FALSE(b.bulges[0].falls_short());
    EXPECT_NEAR(b.bulges[0].held, b.bulges[0].displaced, 1e-3 * b.bulges[0].displaced);
    EXPECT_NEAR(b.gained, b.bulges[0].held, 5e-3 * b.bulges[0].displaced) << from.transpose();  // of the rays, most
  };
  expect_held(box, above, Vec3(0.2, 0.1, 0.8), 2.5);
  expect_held(box, beside, Vec3(0.9, 0.2, 0.7), 2.5);
  expect_held(curve, below, Vec3(0.3, -0.1, 0.0), 2.0);
  expect_held(below, curve, Vec3(0.3, 0.1, -0.6), 2.0);
}

// Nothing pops up at first touch: heights fall with the overlap, and to those of first order in it.
TEST(KeptVolumes, BeginWithTheBulgeOfFirstOrder) {
  for (const double overlap : {1e-2, 1e-3, 1e-4, 1e-6}) {
    const Solid upper(ShapeKind::Point, kernel(0), Vec3::Zero()), lower(ShapeKind::Point, kernel(0), Vec3(0.0, 0.0, -2.0 + overlap));
    Stage stage;
    stage.add(upper.field, {Vec3::Zero()}, 1e4);
    stage.add(lower.field, {Vec3::Zero()}, 1e4);
    stage.solve({.error = 1e-6});
    const DeformedPressure pressure(stage.bodies(), 0, stage.surface, {.width = kAsNeeded, .keep_volume = true});
    ASSERT_EQ(pressure.volumes().size(), 1u);
    EXPECT_FALSE(pressure.volumes()[0].falls_short());
    // On the surface of the undeformed ball beside the contact, of half-width sqrt(overlap): its largest lift is a0.
    double lift = 0.0;
    for (int k = 0; k < 4000; ++k) {
      const double a = 4.0 * std::sqrt(overlap) * k / 4000.0;
      const Vec3 at(std::sin(a), 0.0, -std::cos(a));
      lift = std::max(lift, implicit::FieldView(pressure).value(at) - 1e4 * implicit::FieldView(upper.field).value(at));
    }
    const ContactSurface::Summary& s = stage.surface.summary.at(0);
    Vec3 a_slope, b_slope;
    const implicit::FieldView a(upper.field), b(lower.field);
    static_cast<void>(a.value(s.centre_of_pressure, a_slope));
    static_cast<void>(b.value(s.centre_of_pressure, b_slope));
    const double first_order = volume_keeping_height(s.displaced_a, s.area, s.load, 1e4 * (a_slope - b_slope).norm(), kAsNeeded);
    // The surfaces bend away from each other by a share of the width of the zone, sqrt(overlap), in the second order: its square. 1e-3 of a volume are 5e-4 of a height.
    EXPECT_NEAR(lift, first_order, (2.0 * overlap + 6e-4) * first_order) << overlap;
  }
}

// However tight the cage, all bulges together stay below half of what would fill the space around.
TEST(KeptVolumes, FillNoSpaceFarFromTheBody) {
  const Solid ball(ShapeKind::Point, kernel(0), Vec3::Zero());
  std::vector<Solid> cage;
  cage.reserve(4);
  for (const Vec3& d : {Vec3(1, 0, 0.1), Vec3(0.6, 0.8, 0), Vec3(0.7, 0, 0.75), Vec3(0.75, 0.5, -0.5)}) cage.emplace_back(ShapeKind::Point, Kernel::wyvill(0.8 / 0.454202019), 1.2 * d.normalized());
  Stage stage;
  stage.add(ball.field, {Vec3::Zero()}, 1e3);
  for (const Solid& s : cage) stage.add(s.field, {Vec3::Zero()}, 1e4);
  stage.solve({.error = 1e-3});
  const DeformedPressure pressure(stage.bodies(), 0, stage.surface, {.width = kAsNeeded, .keep_volume = true});
  ASSERT_EQ(pressure.volumes().size(), 4u);
  double largest = 0.0;
  for (int k = 0; k < 64; ++k) {
    for (int j = 0; j < 64; ++j) {
      const double z = (k + 0.5) / 32.0 - 1.0, r = std::sqrt(1.0 - z * z), a = 2.0 * std::numbers::pi * j / 64.0;
      for (double rho = 0.8; rho < 3.0; rho += 0.05) {
        const Vec3 at = rho * Vec3(r * std::cos(a), r * std::sin(a), z);
        largest = std::max(largest, implicit::FieldView(pressure).value(at) - 1e3 * implicit::FieldView(ball.field).value(at));
      }
    }
  }
  EXPECT_LE(largest, 0.25 * 1e3 * (1.0 + 1e-12));
}

}  // namespace
}  // namespace supple::collision
