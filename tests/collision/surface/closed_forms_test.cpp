/// Contact forces against the closed forms of linear, quadratic and Wyvill spheres. Tolerances: the quadrature is asked
/// for 1e-9; where the printed reference has fewer digits, half a unit of its last one.
#include <gtest/gtest.h>

#include <numbers>

#include "collision/bodies.h"

namespace supple::collision {
namespace {

using testing::Linear;
using testing::LinearSphere;
using testing::Quadratic;
using testing::QuadraticSphere;
using testing::Stage;
using testing::Wyvill;
using testing::WyvillSphere;

constexpr double kPi = std::numbers::pi;

/// The contact of two bodies of modulus 1; all zero when they do not touch.
ContactSurface::Summary contact(const implicit::FieldView& a, const implicit::FieldView& b,
                                const ContactSettings& settings = {.error = 1e-9}) {
  Stage stage;
  stage.add(a);
  stage.add(b);
  const ContactSurface& s = stage.solve(settings);
  return s.summary.empty() ? ContactSurface::Summary{} : s.summary.front();
}

/// A plane a billion times as steep as a sphere: its own compression changes the depth by 1e-9.
implicit::HalfSpace rigid_plane() { return {Vec3::Zero(), Vec3::UnitZ(), 1e9}; }

double plane_force(double delta) { return kPi / 3.0 * delta * delta * (3.0 - 2.0 * delta); }
double plane_energy(double delta) { return kPi / 3.0 * (delta - 0.5 * delta * delta) * delta * delta; }

TEST(ContactForce, OfALinearSphereOnARigidPlaneIsTheClosedForm) {
  // F = pi K / 3 delta^2 (3 a - 2 delta), U = pi K / 3 (a delta^3 - delta^4 / 2), area pi (2 a delta - delta^2).
  const double printed[4] = {0.007592182, 0.029321531, 0.108908545, 0.523598776};
  const double depth[4] = {0.05, 0.1, 0.2, 0.5};
  for (int i = 0; i < 4; ++i) {
    const double delta = depth[i];
    const LinearSphere sphere{Vec3(0.1, -0.2, 1.0 - delta), Linear{1.0, 1.0}};
    const ContactSurface::Summary s = contact(sphere, rigid_plane());
    EXPECT_EQ(s.rule, ContactRule::Polar);
    EXPECT_NEAR(s.force.z(), printed[i], 1e-9);
    // dF/d delta times the 1e-9 of the plane, relative: at most 2e-9 / delta.
    EXPECT_NEAR(s.force.z(), plane_force(delta), 1e-7 * plane_force(delta));
    EXPECT_NEAR(s.energy, plane_energy(delta), 1e-7 * plane_energy(delta));
    EXPECT_NEAR(s.area, kPi * (2.0 - delta) * delta, 1e-7);
    EXPECT_NEAR(s.largest_overlap, delta, 1e-7);
    EXPECT_NEAR(s.largest_pressure, delta, 1e-7);
    EXPECT_LT((s.centre_of_pressure - Vec3(0.1, -0.2, 0.0)).norm(), 1e-8);
    EXPECT_LT(s.force.head<2>().norm(), 1e-9);
    // A loses the cap pi delta^2 (3 - delta) / 3 to the plane, which loses nothing.
    EXPECT_NEAR(s.displaced_a, kPi * delta * delta * (3.0 - delta) / 3.0, 1e-7);
    EXPECT_LT(s.displaced_b, 1e-8);
  }
}

TEST(ContactEnergy, OfALinearSphereOnARigidPlaneIsWithinTheErrorAsked) {
  for (const double error : {1e-2, 1e-3, 1e-4, 1e-6, 1e-8}) {
    for (const double delta : {0.05, 0.1, 0.2, 0.5}) {
      const LinearSphere sphere{Vec3(0.1, -0.2, 1.0 - delta), Linear{1.0, 1.0}};
      const ContactSurface::Summary s = contact(sphere, rigid_plane(), {.error = error});
      EXPECT_NEAR(s.energy, plane_energy(delta), (error + 1e-7) * plane_energy(delta)) << error << ' ' << delta;  // 1e-7: as above
    }
  }
}

TEST(ContactForce, OfARigidSphereInACompliantHalfSpaceIsTheCapVolume) {
  const LinearSphere sphere{Vec3(0, 0, 0.9), Linear{1.0, 1e6}};
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
  EXPECT_NEAR(contact(sphere, plane).force.z(), 0.030368729, 2e-6 * 0.030368729 + 1e-9);
}

TEST(ContactForce, OfACompliantSphereOnACompliantPlaneIsTheClosedForm) {
  struct Case {
    double sphere, plane, height, force, depth;
  };
  for (const Case& c : {Case{1, 1, 0.9, 0.014922565, 0.05}, Case{1, 2, 0.9, 0.019780398, 0.1 / 3},
                        Case{2, 1, 0.8, 0.076329066, 0.4 / 3}, Case{1, 10, 0.9, 0.026742483, 0.1 / 11}}) {
    const LinearSphere sphere{Vec3(0, 0, c.height), Linear{1.0, c.sphere}};
    const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), c.plane};
    const ContactSurface::Summary s = contact(sphere, plane);
    EXPECT_NEAR(s.force.z(), c.force, 1e-9);
    EXPECT_NEAR(s.largest_pressure, c.plane * c.depth, 1e-9);  // springs in series on the axis
  }
}

TEST(ContactForce, OfEqualLinearSpheresIsTheClosedForm) {
  struct Case {
    double distance, force, energy;
  };
  for (const Case& c : {Case{1.9, 0.007592182, 0.000255254}, Case{1.8, 0.029321531, 0.001989675},
                        Case{1.5, 0.163624617, 0.028634308}}) {
    const LinearSphere left{Vec3::Zero(), Linear{1.0, 1.0}}, right{Vec3(c.distance, 0, 0), Linear{1.0, 1.0}};
    const ContactSurface::Summary s = contact(left, right);
    EXPECT_NEAR(s.force.x(), -c.force, 1e-9);
    EXPECT_NEAR(s.energy, c.energy, 1e-9);
  }
}

TEST(ContactForce, OfQuadraticAndWyvillSpheresIsTheClosedForm) {
  for (const auto& [h, force] : {std::pair{0.65, 0.0094345954}, {0.6, 0.0307876080}, {0.5, 0.0981747704}}) {
    const QuadraticSphere left{Vec3(0, 0, h), Quadratic{1.0, 0.5}}, right{Vec3(0, 0, -h), Quadratic{1.0, 0.5}};
    const ContactSurface::Summary s = contact(left, right);
    EXPECT_NEAR(s.force.z(), force, 1e-10);
    EXPECT_NEAR(s.area, kPi * (0.5 - h * h), 1e-9);
    EXPECT_NEAR(contact(left, rigid_plane()).force.z(), force, 1e-8);
  }
  for (const auto& [h, force] : {std::pair{0.40, 0.0066147403}, {0.35, 0.0223527569}, {0.30, 0.0442182300}}) {
    const WyvillSphere left{Vec3(0, 0, h), Wyvill{1.0, 0.5}}, right{Vec3(0, 0, -h), Wyvill{1.0, 0.5}};
    EXPECT_NEAR(contact(left, right).force.z(), force, 1e-10);
    EXPECT_NEAR(contact(left, rigid_plane()).force.z(), force, 1e-8);
  }
}

TEST(ContactForce, OfUnequalQuadraticSpheresLiesOnTheSphereOfApollonius) {
  const QuadraticSphere left{Vec3::Zero(), Quadratic{1.0, 0.5}}, right{Vec3(1.6, 0, 0), Quadratic{2.0, 0.5}};
  Stage stage;
  stage.add(left);
  stage.add(right);
  const ContactSurface& surface = stage.solve({.error = 1e-9});
  ASSERT_EQ(surface.summary.size(), 1u);
  EXPECT_NEAR(surface.summary[0].force.x(), -0.136753, 5e-7);
  const Vec3 centre(-1.6 / 3.0, 0, 0);
  const double radius = 3.2 / 3.0, circle = 0.624719;
  for (const Vec3& x : surface.point) EXPECT_NEAR((x - centre).norm(), radius, 1e-10);
  EXPECT_NEAR(surface.summary[0].largest_pressure, 0.5 - 0.533333333333 * 0.533333333333, 1e-9);
  EXPECT_NEAR(surface.summary[0].area, 2.0 * kPi * radius * (radius - std::sqrt(radius * radius - circle * circle)),
              3e-6);
}

TEST(ContactForce, HasAnErrorEstimateThatCoversItsError) {
  for (const double error : {1e-2, 1e-3, 1e-4, 1e-6, 1e-8}) {
    for (const double delta : {1e-4, 0.01, 0.1, 0.3, 0.6}) {
      const LinearSphere low{Vec3::Zero(), Linear{1.0, 1.0}}, high{Vec3(0, 0, 2.0 * (1.0 - delta)), Linear{1.0, 1.0}};
      const ContactSurface::Summary s = contact(low, high, {.error = error});
      const double true_error = std::abs(s.force.norm() / plane_force(delta) - 1.0);
      EXPECT_LE(true_error, s.error_estimate + 1e-13 / delta) << error << " " << delta;
      EXPECT_LE(s.error_estimate, error);
    }
  }
}

TEST(MarchRule, MeetsTheErrorAskedOnSpheres) {
  const LinearSphere sphere{Vec3(0.02, 0.03, 0.9), Linear{1.0, 1.0}};
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 2.0};
  for (const double error : {1e-2, 1e-3, 1e-5, 1e-7}) {
    const ContactSurface::Summary s = contact(sphere, plane, {.error = error, .only = ContactRule::March});
    EXPECT_EQ(s.rule, ContactRule::March);
    EXPECT_LE(s.error_estimate, error);
    EXPECT_NEAR(s.force.z(), 0.019780398, s.error_estimate * 0.019780398 + 5e-10);  // as many digits as the closed form is given with
  }
}

TEST(DeepContact, OnAThinPlateNeedsNoMarching) {
  // Beyond the plate's support there is no slope: the column into the stiff plate must start with its own, small depth.
  const LinearSphere ball{Vec3(0, 0, 0.08), {0.1, 10.0}};
  implicit::Skeleton skeleton;
  implicit::Primitive square;
  square.shape = implicit::ShapeKind::Rectangle;
  square.size = Vec3(0.2, 0.2, 0.0);
  square.kernel = implicit::Kernel::gascuel(0.03, 0.045, 30.0);
  skeleton.primitive.push_back(square);
  skeleton.part_count = 1;
  const Pose pose;
  implicit::PlacedSkeleton placed;
  implicit::Field plate;
  implicit::place_skeleton(skeleton, {&pose, 1}, placed);
  implicit::index_field(skeleton, placed, plate);
  Stage stage;
  stage.add(ball, {ball.centre}, 1.0);
  stage.add(plate, {Vec3::Zero()}, 1e4);
  stage.bodies()[1].fixed = true;
  stage.solve({.error = 1e-3});
  ASSERT_EQ(stage.surface.summary.size(), 1u);
  const ContactSurface::Summary& s = stage.surface.summary[0];
  EXPECT_EQ(s.rule, ContactRule::Polar);
  // U = pi E d^3 (1 - d / 2R) / 3 of p = E (1 - r/R) on a rigid plane; the plate gives way by 1e-4 of the depth.
  const double d = 0.05;
  EXPECT_NEAR(s.energy, 3.141592653589793 / 3.0 * d * d * d * (1.0 - d / 0.2), 1e-3 * s.energy);
}

}  // namespace
}  // namespace supple::collision
