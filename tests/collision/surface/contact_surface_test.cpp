#include <gtest/gtest.h>

#include <numbers>

#include "collision/bodies.h"
#include "supple/core/hash.h"
#include "supple/implicit/solids.h"

namespace supple::collision {
namespace {

using testing::Blobs;
using testing::Ellipsoid;
using testing::Linear;
using testing::LinearSphere;
using testing::sphere_samples;
using testing::Stage;

constexpr double kIsoRadius = 0.454202019;  // of a Wyvill kernel of support 1 at the value 1/2 [m]

std::vector<Vec3> moved(std::vector<Vec3> points, const Quat& q, const Vec3& shift, double scale) {
  for (Vec3& x : points) x = scale * (q * x) + shift;
  return points;
}

/// Two bodies of blobs that overlap obliquely, the second twice as stiff.
const std::vector<Vec3> kLeft{Vec3(-0.4, 0, 0), Vec3(0, 0.1, 0), Vec3(-0.2, 0.3, 0.1)};
const std::vector<Vec3> kRight{Vec3(0.62, 0.15, 0.1), Vec3(0.85, -0.1, 0.3)};

struct TwoBlobs {
  Blobs left, right;
  Stage stage;
  TwoBlobs(const Quat& q, const Vec3& shift, double scale, bool swap = false)
      : left(moved(kLeft, q, shift, scale), scale), right(moved(kRight, q, shift, scale), scale) {
    if (swap) {
      stage.add(right.field, right.centre, 2.0);
      stage.add(left.field, left.centre, 1.0);
    } else {
      stage.add(left.field, left.centre, 1.0);
      stage.add(right.field, right.centre, 2.0);
    }
  }
};

ContactSurface::Summary two_blobs(const Quat& q, const Vec3& shift, double scale, bool swap = false,
                                  double error = 1e-6) {
  TwoBlobs bodies(q, shift, scale, swap);
  const ContactSurface& s = bodies.stage.solve({.error = error});
  return s.summary.empty() ? ContactSurface::Summary{} : s.summary.front();
}

TEST(ContactSurface, OfManyPairsIsThatOfEachPairAlone) {
  constexpr std::size_t kBodies = 1302;  // in several portions, the last of them short
  std::vector<LinearSphere> row;
  for (std::size_t i = 0; i < kBodies; ++i) {
    row.push_back({Vec3(0.9 * static_cast<double>(i), 0.01 * static_cast<double>(i % 3), 0.0), Linear{0.5 + 0.01 * static_cast<double>(i % 7), 1.0}});
  }
  Stage stage;
  for (const LinearSphere& s : row) stage.add(s);
  const ContactSettings settings{.error = 1e-2};
  ContactSurface surface = stage.solve(settings, 3);
  ASSERT_EQ(surface.summary.size(), kBodies - 1);
  std::size_t at = 0;
  for (std::size_t k = 0; k + 1 < kBodies; ++k) {
    Stage alone;
    alone.add(row[k]);
    alone.add(row[k + 1]);
    const ContactSurface& expected = alone.solve(settings);
    ASSERT_EQ(expected.summary.size(), 1u);
    EXPECT_EQ(surface.summary[k].force, expected.summary[0].force);
    EXPECT_EQ(surface.summary[k].area, expected.summary[0].area);
    ASSERT_LE(at + expected.point.size(), surface.point.size());
    for (std::size_t i = 0; i < expected.point.size(); ++i, ++at) {
      ASSERT_EQ(surface.pair[at], k);
      ASSERT_EQ(surface.point[at], expected.point[i]);
      ASSERT_EQ(surface.normal[at], expected.normal[i]);
      ASSERT_EQ(surface.area[at], expected.area[i]);
      ASSERT_EQ(surface.pressure[at], expected.pressure[i]);
    }
  }
  EXPECT_EQ(at, surface.point.size());
  // Of fewer pairs, into the same arrays.
  Stage few;
  few.add(row[4]);
  few.add(row[5]);
  const ContactSurface fresh = few.solve(settings);
  solve_contact_surface(few.bodies(), few.candidates, settings, Executor(1), surface);
  EXPECT_EQ(surface.summary.size(), 1u);
  EXPECT_EQ(surface.pair, fresh.pair);
  EXPECT_EQ(surface.point, fresh.point);
  EXPECT_EQ(surface.pressure, fresh.pressure);
}

TEST(ContactSurface, OfBodiesThatAreTheSameAroundALineIsThatOfAllRays) {
  const Vec3 along = Vec3(0.3, -0.5, 0.7).normalized(), at(3.0, -2.0, 1.0);
  const Blobs ball({at}, 1.0), small({at + 0.65 * along}, 0.6), other({at + 0.8 * along}, 1.0);
  const implicit::HalfSpace plane{at + 0.4 * along, -along, 0.7};
  struct Pair {
    implicit::FieldView field;
    double modulus;
  };
  for (const Pair& b : {Pair{small.field, 1.0}, Pair{other.field, 3.0}, Pair{plane, 2.0}}) {
    for (const bool swap : {false, true}) {
      for (const double error : {1e-2, 1e-3, 1e-6, 1e-10}) {
        Stage stage;
        if (swap) stage.add(b.field, {at + along}, b.modulus);
        stage.add(ball.field, ball.centre);
        if (!swap) stage.add(b.field, {at + along}, b.modulus);
        ContactSettings settings{.error = error};
        const ContactSurface one = stage.solve(settings);
        settings.symmetry = false;
        const ContactSurface all = stage.solve(settings);
        ASSERT_EQ(one.summary.size(), 1u);
        ASSERT_EQ(all.summary.size(), 1u);
        const ContactSurface::Summary &a = one.summary[0], &e = all.summary[0];
        ASSERT_EQ(a.rule, ContactRule::Polar);
        EXPECT_LE(a.error_estimate, error);
        const double most = a.error_estimate + e.error_estimate;
        EXPECT_LE((a.force - e.force).norm(), most * e.force.norm());
        EXPECT_NEAR(a.area, e.area, most * e.area);
        EXPECT_LE((a.centre_of_pressure - e.centre_of_pressure).norm(), most * std::sqrt(e.area));
        // Columns are as exact as asked for; bounds are of force, area and centre, and may be far below.
        const double columns = std::max(10.0 * most, error);
        EXPECT_NEAR(a.energy, e.energy, columns * e.energy);
        EXPECT_NEAR(a.displaced_a, e.displaced_a, columns * e.displaced_a);
        EXPECT_LT(a.force.cross(along).norm(), 1e-15 * a.force.norm());
        settings.energy = false;  // squeezed regions take as many points either way
        const std::uint64_t evaluations = stage.solve(settings).summary[0].evaluations;
        settings.symmetry = true;
        EXPECT_LT(2 * stage.solve(settings).summary[0].evaluations, evaluations);
        // Its points carry the same force, and lie where both pressures are equal.
        Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
        for (std::size_t i = 0; i < one.point.size(); ++i) {
          const Vec3 f = -one.area[i] * one.pressure[i] * one.normal[i];
          force += f;
          moment += (one.point[i] - at).cross(f);
          Vec3 ga, gb;
          const double pa = stage.bodies()[0].material.modulus * stage.bodies()[0].field.value(one.point[i], ga);
          const double pb = stage.bodies()[1].material.modulus * stage.bodies()[1].field.value(one.point[i], gb);
          EXPECT_NEAR(pa, pb, 1e-10);
          EXPECT_NEAR(one.pressure[i], pa, 1e-10);
          const Vec3 normal = stage.bodies()[1].material.modulus * gb - stage.bodies()[0].material.modulus * ga;
          EXPECT_LT((one.normal[i] - normal.normalized()).norm(), 1e-9);
        }
        EXPECT_LT((force - a.force).norm(), 1e-14 * a.force.norm());
        EXPECT_LT(moment.norm(), 1e-14 * a.force.norm());
      }
    }
  }
}

TEST(ContactSurface, LeavesNothingSidewaysToAnAxisByAllRays) {
  const Vec3 at(0.6, -0.4, 0.2);
  for (int turn = 0; turn < 20; ++turn) {
    const Vec3 along = (Quat(Eigen::AngleAxisd(0.7 * turn, Vec3(0.3, 0.5, -0.8).normalized())) * Vec3(0.3, -0.5, 0.7)).normalized();
    const Blobs ball({at}, 1.0), small({at + 0.65 * along}, 0.6), other({at + 0.8 * along}, 1.0);
    const implicit::HalfSpace plane{at + 0.4 * along, -along, 0.7};
    for (const implicit::FieldView field : {implicit::FieldView(small.field), implicit::FieldView(other.field), implicit::FieldView(plane)}) {
      for (const double error : {1e-2, 1e-3, 1e-6, 1e-10}) {
        Stage stage;
        stage.add(ball.field, ball.centre);
        stage.add(field, {at + along}, 3.0);
        const ContactSurface::Summary s = stage.solve({.error = error, .symmetry = false}).summary.at(0);
        ASSERT_EQ(s.rule, ContactRule::Polar);
        EXPECT_GE(s.points, 24u);
        EXPECT_LE(s.force.cross(along).norm(), 1e-12 * s.force.norm()) << error;
        EXPECT_LE((s.centre_of_pressure - at).cross(along).norm(), 1e-12 * std::sqrt(s.area)) << error;
      }
    }
  }
}

/// A sphere that counts at how many points it is asked.
struct CountedSphere {
  LinearSphere sphere;
  mutable std::uint64_t asked = 0;

  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    asked += points.size();
    sphere.evaluate(points, values);
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    asked += points.size();
    sphere.evaluate(points, values, gradients);
  }
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const {
    asked += points.size();
    sphere.evaluate_parts(points, parts);
  }
  [[nodiscard]] Interval bound(const Box& box) const { return sphere.bound(box); }
  [[nodiscard]] double gradient_bound(const Box& box) const { return sphere.gradient_bound(box); }
  [[nodiscard]] Box surface_box() const { return sphere.surface_box(); }
  [[nodiscard]] double feature_size() const { return sphere.feature_size(); }
};

TEST(ContactSurface, OfBodiesApartCostsNothingButTestsOfBoxes) {
  std::vector<CountedSphere> sphere;
  for (int i = 0; i < 300; ++i) sphere.push_back({{Vec3(2.1 * (i % 20), 2.1 * (i / 20), 0.0), Linear{1.0, 1.0}}});
  sphere.push_back({{Vec3(4.2, 4.2, 1.8), Linear{1.0, 1.0}}});  // on one of them
  Stage stage;
  for (const CountedSphere& s : sphere) stage.add(s);
  const ContactSurface& surface = stage.solve({.error = 1e-6});
  ASSERT_EQ(surface.summary.size(), 1u);
  constexpr std::size_t kBelow = 42;
  EXPECT_EQ(surface.summary[0].bodies, (BodyPair{kBelow, 300}));
  for (std::size_t i = 0; i < sphere.size(); ++i) EXPECT_EQ(sphere[i].asked > 0, i == kBelow || i == 300) << i;
  const std::uint64_t together = sphere[kBelow].asked;
  Stage alone;
  alone.add(sphere[kBelow]);
  alone.add(sphere[300]);
  static_cast<void>(alone.solve({.error = 1e-6}));
  EXPECT_EQ(sphere[kBelow].asked, 2 * together);
}

TEST(ContactSurface, FollowsAllRaysWhereOneBodyIsNotRound) {
  const Blobs ball({Vec3(0.1, 0.2, 0.75)}, 1.0);
  implicit::Skeleton skeleton;
  implicit::Primitive rod;
  rod.shape = implicit::ShapeKind::Segment;
  rod.size = Vec3(0.4, 0.0, 0.0);
  rod.kernel = implicit::Kernel::wyvill(1.0);
  skeleton.part_count = 1;
  skeleton.primitive = {rod};
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  const Pose pose;
  implicit::place_skeleton(skeleton, {&pose, 1}, placed);
  implicit::index_field(skeleton, placed, field);
  const implicit::SolidBox box({Vec3(0.1, 0.2, -0.1), Quat::Identity()}, Vec3(0.5, 0.4, 0.4), 0.1, 2.0);
  for (const implicit::FieldView other : {implicit::FieldView(field), implicit::FieldView(box)}) {
    Stage stage;
    stage.add(ball.field, ball.centre);
    stage.add(other);
    const ContactSurface one = stage.solve({.error = 1e-4});
    const ContactSurface all = stage.solve({.error = 1e-4, .symmetry = false});
    ASSERT_EQ(one.summary.size(), 1u);
    EXPECT_EQ(one.point, all.point);
    EXPECT_EQ(one.area, all.area);
    EXPECT_EQ(one.pressure, all.pressure);
  }
}

TEST(ContactSurface, HasBothPressuresEqualAtEveryPoint) {
  for (const ContactRule rule : {ContactRule::Polar, ContactRule::March}) {
    TwoBlobs bodies(Quat::Identity(), Vec3::Zero(), 1.0);
    const ContactSurface& s = bodies.stage.solve({.error = 1e-3, .only = rule});
    ASSERT_EQ(s.summary.size(), 1u);
    ASSERT_EQ(s.summary[0].rule, rule);
    for (std::size_t i = 0; i < s.point.size(); ++i) {
      Vec3 ga, gb;
      const double a = bodies.stage.bodies()[0].field.value(s.point[i], ga);
      const double b = 2.0 * bodies.stage.bodies()[1].field.value(s.point[i], gb);
      EXPECT_LE(std::abs(a - b), 1e-10);
      EXPECT_NEAR(s.pressure[i], a, 1e-10);
      EXPECT_LT((s.normal[i] - (2.0 * gb - ga).normalized()).norm(), 1e-9);
      EXPECT_GT(s.area[i], 0.0);
    }
    EXPECT_LE(s.summary[0].residual, 1e-10);
    EXPECT_EQ(s.summary[0].points, s.point.size());
  }
}

TEST(ContactSurface, IsEmptyWhenBodiesDoNotTouch) {
  const LinearSphere left{Vec3::Zero(), Linear{1.0, 1.0}}, right{Vec3(2.0 + 1e-9, 0, 0), Linear{1.0, 1.0}};
  const auto left_samples = sphere_samples(left.centre, 1.0, 300), right_samples = sphere_samples(right.centre, 1.0, 300);
  Stage stage;
  stage.add(left).samples = &left_samples;
  stage.add(right).samples = &right_samples;
  EXPECT_TRUE(stage.solve().summary.empty());
  EXPECT_TRUE(stage.surface.point.empty());
  for (const PartLoads& load : stage.react()) {
    EXPECT_EQ(load.force[0], Vec3::Zero());
    EXPECT_EQ(load.torque[0], Vec3::Zero());
  }
}

TEST(ContactSurface, OfBodiesThatBarelyTouchAsksForNoMoreThanRoundOffLets) {
  // F = pi K a d^2 / 4 for equal balls that overlap by d << a. Where d is round-off of the coordinates no rule tells more than the first one,
  // which with the search for hills costs some thousands of evaluations: marching costs a million.
  const double ulp = std::numeric_limits<double>::epsilon();
  for (double d = 1e-3; d > 1e-17; d *= 0.1) {
    const LinearSphere left{Vec3(0, 0, 0.7), Linear{}}, right{Vec3(0, 0, 2.7 - d), Linear{}};
    const double overlap = left.centre.z() + 2.0 - right.centre.z();
    Stage stage;
    stage.add(left);
    stage.add(right);
    const ContactSurface& s = stage.solve({.error = 1e-3});
    const ContactSurface::Summary found = s.summary.empty() ? ContactSurface::Summary{} : s.summary.front();
    const double force = std::numbers::pi / 4.0 * overlap * overlap;
    EXPECT_LE(found.evaluations, 30000u) << d;
    if (found.points > 0) {
      EXPECT_NEAR(found.force.norm(), force, (found.error_estimate + overlap) * force) << d;
      EXPECT_LE(found.error_estimate, std::max(1e-3, 100.0 * ulp / overlap)) << d;
    } else {
      EXPECT_LE(overlap, 100.0 * ulp) << d;
    }
  }
}

TEST(ContactSurface, TurnsMovesAndScalesWithTheBodies) {
  // F scales with P L^2, moments with P L^3, energy with P L^3; P is the same. 1e-9: round-off of the peak's frame.
  const ContactSurface::Summary rest = two_blobs(Quat::Identity(), Vec3::Zero(), 1.0);
  ASSERT_EQ(rest.rule, ContactRule::Polar);
  const Quat q = Quat(0.3, -0.5, 0.7, 0.2).normalized();
  const Vec3 shift(3, -2, 5);
  for (const double scale : {1.0, 1e-3, 1e3}) {
    const ContactSurface::Summary s = two_blobs(q, scale * shift, scale);
    const double size = rest.force.norm();
    EXPECT_LT((s.force / (scale * scale) - q * rest.force).norm(), 1e-9 * size) << scale;
    EXPECT_NEAR(s.energy / (scale * scale * scale), rest.energy, 1e-8 * rest.energy);
    EXPECT_NEAR(s.area / (scale * scale), rest.area, 1e-9 * rest.area);
    EXPECT_LT((s.centre_of_pressure - scale * (q * rest.centre_of_pressure + shift)).norm(), 1e-9 * scale);
  }
}

TEST(ContactSurface, GivesTheOppositeWhenBodiesChangePlaces) {
  const ContactSurface::Summary one = two_blobs(Quat::Identity(), Vec3::Zero(), 1.0);
  const ContactSurface::Summary other = two_blobs(Quat::Identity(), Vec3::Zero(), 1.0, true);
  EXPECT_LT((one.force + other.force).norm(), 1e-12 * one.force.norm());
  EXPECT_LT((one.moment + other.moment).norm(), 1e-12 * one.force.norm());
  EXPECT_NEAR(one.area, other.area, 1e-12);
  EXPECT_NEAR(one.displaced_a, other.displaced_b, 1e-10 * one.displaced_a);
}

TEST(ContactSurface, AgreesBetweenItsTwoRules) {
  const ContactSurface::Summary polar = two_blobs(Quat::Identity(), Vec3::Zero(), 1.0, false, 1e-8);
  TwoBlobs bodies(Quat::Identity(), Vec3::Zero(), 1.0);
  const ContactSurface::Summary march =
      bodies.stage.solve({.error = 1e-6, .only = ContactRule::March}).summary.front();
  const double bound = march.error_estimate;
  EXPECT_LE(bound, 1e-6);
  EXPECT_LT((polar.force - march.force).norm(), bound * polar.force.norm());
  EXPECT_NEAR(polar.area, march.area, bound * polar.area);
  // Volumes are no part of the bound, but as good as was asked.
  EXPECT_NEAR(polar.energy, march.energy, 1e-6 * polar.energy);
  EXPECT_NEAR(polar.displaced_a, march.displaced_a, 1e-6 * polar.displaced_a);
  EXPECT_NEAR(polar.displaced_b, march.displaced_b, 1e-6 * polar.displaced_b);
  EXPECT_NEAR(polar.largest_overlap, march.largest_overlap, 0.05 * polar.largest_overlap);
}

TEST(ContactEnergy, HasForceAndTorqueAsItsGradient) {
  // Two oblique ellipsoids: F = -dU/dx and T = -dU/dtheta (Elandt; gradient of the integral of min(p_A, p_B)).
  // Central differences with h = 1e-3 leave h^2/6 U'''/U' ~ 1e-6 / delta^2 with delta ~ .2 the overlap: 1e-5 relative.
  Ellipsoid left{Vec3::Zero(), Quat(0.9, 0.2, -0.3, 0.1).normalized(), Vec3(1.0, 0.7, 0.8), 0.5};
  Ellipsoid right{Vec3(0.95, 0.25, 0.1), Quat(0.8, -0.3, 0.2, 0.4).normalized(), Vec3(0.7, 0.9, 0.6), 0.5};
  const auto solve = [&] {
    Stage stage;
    stage.add(left, {left.centre}, 1.5);
    stage.add(right, {right.centre}, 1.0);
    return stage.solve({.error = 1e-10}).summary.at(0);
  };
  const ContactSurface::Summary s = solve();
  ASSERT_EQ(s.rule, ContactRule::Polar);
  const double h = 1e-3;
  const Vec3 torque = s.moment - left.centre.cross(s.force);
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 e = Vec3::Unit(axis);
    const Ellipsoid rest = left;
    double energy[2], turned[2];
    for (const int i : {0, 1}) {
      const double step = i == 0 ? -h : h;
      left = rest;
      left.centre += step * e;
      energy[i] = solve().energy;
      left = rest;
      left.orientation = Quat(Eigen::AngleAxisd(step, e)) * rest.orientation;
      turned[i] = solve().energy;
    }
    left = rest;
    EXPECT_NEAR(s.force[axis], -(energy[1] - energy[0]) / (2.0 * h), 3e-5 * s.force.norm());
    EXPECT_NEAR(torque[axis], -(turned[1] - turned[0]) / (2.0 * h), 3e-5 * s.force.norm());
  }
}

/// Of two blobs of support 1, `count` each.
implicit::SurfaceSamples samples_of_two(const Blobs& blobs, int count) {
  implicit::SurfaceSamples samples = sphere_samples(blobs.centre[0], kIsoRadius, count);
  const implicit::SurfaceSamples more = sphere_samples(blobs.centre[1], kIsoRadius, count);
  samples.point.insert(samples.point.end(), more.point.begin(), more.point.end());
  samples.area.insert(samples.area.end(), more.area.begin(), more.area.end());
  samples.valid.insert(samples.valid.end(), more.valid.begin(), more.valid.end());
  return samples;
}

TEST(ContactSurface, FindsBothPatchesOfAPlateWithTwoBumps) {
  // Each bump is a Wyvill sphere of its own on a rigid plane, h = .40 and .35: closed forms of the two add up.
  const Blobs bumps({Vec3(-1.5, 0, 0.40), Vec3(1.5, 0.2, 0.35)}, 1.0);
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
  for (const bool sampled : {false, true}) {
    const auto samples = samples_of_two(bumps, 150);
    Stage stage;
    ContactBody& body = stage.add(bumps.field, bumps.centre);
    if (sampled) body.samples = &samples;
    stage.add(plane).fixed = true;
    const ContactSurface& s = stage.solve({.error = 1e-8});
    ASSERT_EQ(s.summary.size(), 1u);
    EXPECT_EQ(s.summary[0].rule, ContactRule::Polar);
    EXPECT_EQ(s.summary[0].patches, 2u);
    EXPECT_NEAR(s.summary[0].force.z(), 0.0066147403 + 0.0223527569, 1e-8);
  }
}

// Pinched between two blobs of one body, so deeply that each patch lies within two thicknesses of the other one, and that body's pressure goes
// on from one to the other, so that columns lead through the ball. Marching knows neither patches nor columns.
TEST(ContactSurface, FindsBothPatchesOfABallThatIsPinched) {
  int both = 0;
  for (const double apart : {0.585, 0.6, 0.605, 0.61}) {
    for (const double side : {0.0, 0.03, 0.06}) {
      for (const double out : {0.0, 0.04}) {
        const Blobs ball({Vec3(side, out, 0.01)}, 0.34), blobs({Vec3(-apart, 0, 0), Vec3(apart, 0.02, 0)}, 1.0);
        const auto ball_samples = sphere_samples(ball.centre[0], 0.34 * kIsoRadius, 120);
        const auto samples = samples_of_two(blobs, 400);
        Stage stage;
        stage.add(ball.field, ball.centre).samples = &ball_samples;
        stage.add(blobs.field, blobs.centre).samples = &samples;
        const auto solve = [&](ContactRule only) {
          const ContactSurface& s = stage.solve({.error = 1e-4, .only = only});
          return s.summary.empty() ? ContactSurface::Summary{} : s.summary.front();
        };
        const ContactSurface::Summary found = solve(ContactRule::None), marched = solve(ContactRule::March);
        const double bound = found.error_estimate + marched.error_estimate;
        EXPECT_LE(bound, 2e-4);
        EXPECT_NEAR(found.area / marched.area, 1.0, bound) << apart << ' ' << side << ' ' << out;
        EXPECT_LE((found.force - marched.force).norm(), bound * marched.load) << apart << ' ' << side << ' ' << out;
        EXPECT_NEAR(found.energy / marched.energy, 1.0, 4e-4) << apart << ' ' << side << ' ' << out;
        if (found.rule == ContactRule::Polar && found.patches == 2) ++both;
      }
    }
  }
  EXPECT_GE(both, 12);
}

// What a patch may be off by moves the centre of pressure by its distance from there, and is more of a force when that of another patch cancels it.
TEST(ContactSurface, HasBoundsOfSeveralPatchesTogether) {
  const Blobs bumps({Vec3(-12, 0, 0.40), Vec3(12, 0, 0.42)}, 1.0), blobs({Vec3(-0.75, 0, 0), Vec3(0.75, 0, 0)}, 1.0), ball({Vec3(0.001, 0, 0)}, 0.68);
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
  const auto samples = samples_of_two(bumps, 150), two = samples_of_two(blobs, 400), one = sphere_samples(ball.centre[0], 0.68 * kIsoRadius, 300);
  Stage flat, pinch;
  flat.add(bumps.field, bumps.centre).samples = &samples;
  flat.add(plane).fixed = true;
  pinch.add(ball.field, ball.centre).samples = &one;
  pinch.add(blobs.field, blobs.centre).samples = &two;
  for (Stage* stage : {&flat, &pinch}) {
    const ContactSurface::Summary finest = stage->solve({.error = 1e-10}).summary.at(0);
    for (double error = 1e-2; error > 1e-7; error *= 0.7) {
      const ContactSurface::Summary s = stage->solve({.error = error, .only = ContactRule::Polar}).summary.at(0);
      ASSERT_EQ(s.patches, 2u);
      const double scale = std::max(finest.force.norm(), 1e-3 * finest.load);
      const double off = std::max({(s.force - finest.force).norm() / scale, std::abs(s.area / finest.area - 1.0),
                                   (s.centre_of_pressure - finest.centre_of_pressure).norm() / std::sqrt(finest.area)});
      EXPECT_LE(s.error_estimate, 1.01 * error);
      EXPECT_LE(off, s.error_estimate + finest.error_estimate) << error;
    }
  }
}

/// Integral of [p]+ over the plane z = 0 by the midpoint rule.
double plane_integral(const implicit::FieldView& field, double half) {
  const int n = 800;
  std::vector<Vec3> row(n);
  std::vector<double> p(n);
  double sum = 0.0;
  const double h = 2.0 * half / n;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) row[static_cast<std::size_t>(i)] = Vec3(-half + (i + 0.5) * h, -half + (j + 0.5) * h, 0);
    field.evaluate(row, p);
    for (const double x : p) sum += std::max(x, 0.0) * h * h;
  }
  return sum;
}

TEST(ContactSurface, IntegratesARingShapedPatch) {
  std::vector<Vec3> ring;
  for (int k = 0; k < 16; ++k) {
    const auto [s, c] = math::sin_cos(2.0 * std::numbers::pi * k / 16);
    ring.push_back(Vec3(c, s, 0.3));
  }
  const Blobs torus(ring, 0.7);
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
  Stage stage;
  stage.add(torus.field, torus.centre);
  stage.add(plane).fixed = true;
  const ContactSurface& s = stage.solve({.error = 1e-3});
  ASSERT_EQ(s.summary.size(), 1u);
  EXPECT_EQ(s.summary[0].rule, ContactRule::March);
  const double force = plane_integral(torus.field, 2.0);
  EXPECT_LE(s.summary[0].error_estimate, 1e-3);
  EXPECT_NEAR(s.summary[0].force.z(), force, s.summary[0].error_estimate * force + 1e-5 * force);  // of the midpoint rule
  EXPECT_LT(s.summary[0].centre_of_pressure.norm(), 1e-3);
}

/// Force between unit spheres p = 1 - rho at (0, 0, +-h) where x < at: on the plane between them p = 1 - (h^2 + r^2)^(1/2), so that
/// a ray to r holds r^2 / 2 - ((h^2 + r^2)^(3/2) - h^3) / 3. Midpoints in the angle, on the pieces between the rim's corners.
double cut_force(double h, double at) {
  const double rim = std::sqrt(1.0 - h * h);
  const auto ray = [h](double r) { return 0.5 * r * r - (std::pow(h * h + r * r, 1.5) - h * h * h) / 3.0; };
  const double corner = std::acos(at / rim);
  constexpr int kSteps = 200000;
  const auto sum = [&](double from, double to, auto&& f) {
    double total = 0.0;
    for (int i = 0; i < kSteps; ++i) total += f(from + (to - from) * (i + 0.5) / kSteps);
    return total * (to - from) / kSteps;
  };
  // Where the ray meets the line x = at: it ends there, or begins there where the line leaves the middle out.
  const double whole = sum(corner, std::numbers::pi, [&](double) { return ray(rim); });
  if (at >= 0.0) return 2.0 * (whole + sum(0.0, corner, [&](double t) { return ray(std::min(rim, at / std::cos(t))); }));
  return 2.0 * sum(corner, std::numbers::pi, [&](double t) { return ray(rim) - ray(std::min(rim, at / std::cos(t))); });
}

TEST(ContactSurface, OfThreeBodiesStopsWhereTheThirdPressesHarder) {
  // Equal linear spheres: the interface of two ends in the plane that is equally far from the third, here before the
  // point of largest pressure or beyond it.
  for (const double away : {1.0, 0.85, 0.7}) {
    const LinearSphere a{Vec3(0, 0, 0.8), Linear{1.0, 1.0}}, b{Vec3(0, 0, -0.8), Linear{1.0, 1.0}};
    const LinearSphere c{Vec3(away, 0, 0), Linear{1.0, 1.0}};
    const double at = 0.5 * (away * away - 0.64) / away, force = cut_force(0.8, at);
    EXPECT_LT(force, 0.9 * cut_force(0.8, 0.599999));
    for (const double error : {1e-2, 1e-3, 1e-6, 1e-9}) {
      Stage stage;
      stage.add(a);
      stage.add(b);
      stage.add(c);
      const ContactSurface& s = stage.solve({.error = error});
      ASSERT_EQ(s.summary.size(), 3u);
      EXPECT_EQ(s.summary[0].rule, ContactRule::Polar);
      const double off = (s.summary[0].force - Vec3(0, 0, force)).norm();
      EXPECT_LE(s.summary[0].error_estimate, 1.01 * error) << away << ' ' << error;
      EXPECT_LE(off, s.summary[0].error_estimate * force + 1e-10 * force) << away << ' ' << error;
      for (std::size_t i = 0; i < s.point.size(); ++i) {
        const BodyPair pair = s.summary[s.pair[i]].bodies;
        EXPECT_LE(stage.bodies()[3 - pair.a - pair.b].field.value(s.point[i]), s.pressure[i] + 1e-12);
      }
    }
    Stage stage;
    stage.add(a);
    stage.add(b);
    stage.add(c);
    const ContactSurface::Summary& marched = stage.solve({.error = 1e-2, .only = ContactRule::March}).summary.front();
    EXPECT_EQ(marched.rule, ContactRule::March);
    EXPECT_LE(marched.error_estimate, 1e-2) << away;
    EXPECT_LE((marched.force - Vec3(0, 0, force)).norm(), marched.error_estimate * force) << away;
  }
}

TEST(ContactSurface, OfThreeBodiesIsNotThereWhereTheThirdPressesHarderAllOver) {
  const LinearSphere a{Vec3(0, 0, 0.95), Linear{1.0, 1.0}}, b{Vec3(0, 0, -0.95), Linear{1.0, 1.0}};
  const LinearSphere c{Vec3(0.3, 0, 0), Linear{1.0, 1.0}};
  Stage stage;
  stage.add(a);
  stage.add(b);
  stage.add(c);
  const ContactSurface& s = stage.solve({.error = 1e-3});
  ASSERT_EQ(s.summary.size(), 2u);
  EXPECT_EQ(s.summary[0].bodies, (BodyPair{0, 2}));
  EXPECT_EQ(s.summary[1].bodies, (BodyPair{1, 2}));
}

TEST(ContactSurface, OfSeveralBodiesInOnePlaceIsTheSumOverItsPoints) {
  // Two thirds whose borders meet on the patch: the sum of p over a fine grid of the plane between a and b.
  const LinearSphere a{Vec3(0, 0, 0.8), Linear{1.0, 1.0}}, b{Vec3(0, 0, -0.8), Linear{1.0, 1.0}};
  const LinearSphere c{Vec3(0.9, 0.3, 0), Linear{1.0, 1.0}}, d{Vec3(0.2, 0.9, 0), Linear{1.0, 1.0}};
  Stage stage;
  stage.add(a);
  stage.add(b);
  stage.add(c);
  stage.add(d);
  const ContactSurface& s = stage.solve({.error = 1e-4});
  ASSERT_GE(s.summary.size(), 1u);
  ASSERT_EQ(s.summary[0].bodies, (BodyPair{0, 1}));
  EXPECT_EQ(s.summary[0].rule, ContactRule::Polar);
  constexpr int kCells = 2000;
  const double cell = 1.4 / kCells;
  double force = 0.0;
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      const double x = -0.7 + (i + 0.5) * cell, y = -0.7 + (j + 0.5) * cell;
      const double p = 1.0 - std::sqrt(0.64 + x * x + y * y);
      const Vec3 at(x, y, 0.0);
      const double third = 1.0 - std::min((at - c.centre).norm(), (at - d.centre).norm());
      if (p > 0.0 && third < p) force += p * cell * cell;
    }
  }
  // Cells on the borders, some 1,500 of them, are taken or left whole: at random that is 1e-4 of the force.
  EXPECT_NEAR(s.summary[0].force.z(), force, (s.summary[0].error_estimate + 3e-4) * force);
}

std::uint64_t hash_of(const ContactSurface& s) {
  Hasher hasher;
  hasher.add(std::span<const Vec3>(s.point));
  hasher.add(std::span<const Vec3>(s.normal));
  hasher.add(std::span<const double>(s.area));
  hasher.add(std::span<const double>(s.pressure));
  hasher.add(std::span<const Vec3>(s.volume_point));
  hasher.add(std::span<const double>(s.volume_weight));
  for (const auto& summary : s.summary) {
    hasher.add(std::uint64_t{summary.bodies.a});
    hasher.add(std::uint64_t{summary.bodies.b});
    hasher.add(summary.energy);
  }
  return hasher.value();
}

TEST(ContactSurface, HasTheSameBitsForAnyNumberOfThreads) {
  std::vector<LinearSphere> spheres;
  std::vector<implicit::SurfaceSamples> samples;
  for (int i = 0; i < 27; ++i) {
    spheres.push_back({Vec3(i % 3, i / 3 % 3, i / 9) * 0.95 + Vec3(0.01 * i, 0, 0), Linear{0.5, 1.0}});
    samples.push_back(sphere_samples(spheres.back().centre, 0.5, 200));
  }
  std::uint64_t expected = 0;
  for (const int threads : {1, 2, 3, 8}) {
    Stage stage;
    for (std::size_t i = 0; i < spheres.size(); ++i) stage.add(spheres[i]).samples = &samples[i];
    const ContactSurface& s = stage.solve({}, threads);
    EXPECT_GT(s.summary.size(), 20u);
    const std::uint64_t hash = hash_of(s);
    if (threads == 1) expected = hash;
    EXPECT_EQ(hash, expected) << threads;
  }
}

}  // namespace
}  // namespace supple::collision
