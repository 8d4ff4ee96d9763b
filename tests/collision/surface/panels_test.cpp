/// Panels: patches of any shape on which level functions are cut along lines, against plain sums over a plane that symmetry puts Sigma in.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "../../collision/src/surface/panels/level_roots.h"
#include "../../collision/src/surface/panels/panel_corners.h"
#include "benchmarks/many_parts.h"
#include "collision/bodies.h"
#include "supple/implicit/solids.h"

namespace supple::collision {
namespace {

using testing::Blobs;
using testing::LinearSphere;
using testing::Stage;

TEST(LevelRoots, OfASineAreFoundBetweenSamplesAndBeyondThem) {
  // sin(x) on (0.5, 9.6) has roots at pi, 2 pi, 3 pi; between the last two samples it turns and comes back.
  std::vector<LevelSample> samples;
  for (const double x : {0.7, 2.5, 4.0, 5.6, 7.2, 8.8}) samples.push_back({x, std::sin(x), std::cos(x)});
  std::vector<LevelRoot> roots;
  EXPECT_TRUE(predict_roots(samples, 0.5, 9.6, roots));
  ASSERT_EQ(roots.size(), 3u);
  // The cubic's error is at most h^4 / 384 with h <= 1.8; the parabola beyond the last sample is off by 0.8^3 / 6 at most.
  EXPECT_NEAR(roots[0].guess, std::numbers::pi, 0.03);
  EXPECT_NEAR(roots[1].guess, 2.0 * std::numbers::pi, 0.03);
  EXPECT_NEAR(roots[2].guess, 3.0 * std::numbers::pi, 0.086);
  EXPECT_FALSE(roots[0].rises);
  EXPECT_TRUE(roots[1].rises);
  EXPECT_TRUE(roots[2].open_high);
}

TEST(LevelRoots, OfACubicThatTurnsBetweenTwoSamplesArePairs) {
  // (x - 1)^2 - 0.04 from samples at 0 and 2, which are both positive.
  const std::vector<LevelSample> samples{{0.0, 0.96, -2.0}, {2.0, 0.96, 2.0}};
  std::vector<LevelRoot> roots;
  EXPECT_TRUE(predict_roots(samples, 0.0, 2.0, roots));
  ASSERT_EQ(roots.size(), 2u);
  EXPECT_NEAR(roots[0].guess, 0.8, 1e-3);  // a cubic is met exactly, its root by twelve halvings
  EXPECT_NEAR(roots[1].guess, 1.2, 1e-3);
  EXPECT_FALSE(roots[0].rises);
  EXPECT_TRUE(roots[1].rises);
}

TEST(PanelCorners, LieWhereChordsOfADiscVanish) {
  // Chords of the unit disc at y = 0.6 and 0.9: half lengths 0.8 and 0.436, which vanish at y = 1. The square of a chord is a parabola, so that its
  // tangent at y meets zero at y + (1 - y^2) / (2 y).
  const auto chord = [](double y) {
    const double half = std::sqrt(1.0 - y * y);
    return std::vector<LineEnd>{{0, -half, y / half}, {0, half, -y / half}};
  };
  const std::vector<LineEnd> ends = chord(0.9);
  const LineShape last{0.9, 2.0 * std::sqrt(0.19), 0.1, ends}, none{1.1, 0.0, 0.0, {}};
  const auto corner = corner_between(last, none, -2.0, 2.0);
  ASSERT_TRUE(corner.has_value());
  EXPECT_NEAR(corner->at, 0.9 + 0.19 / 1.8, 1e-12);
  EXPECT_FALSE(corner_between(last, last, -2.0, 2.0).has_value());
}

/// Blobs above the plane z = 0 and their mirror images below: Sigma is the part of the plane where they press.
struct Mirrored {
  Blobs upper, lower;

  explicit Mirrored(const std::vector<Vec3>& centres, double radius = kSupport) : upper(centres, radius), lower(mirrored(centres), radius) {}
  static std::vector<Vec3> mirrored(std::vector<Vec3> centres) {
    for (Vec3& x : centres) x.z() = -x.z();
    return centres;
  }
  /// 16 blobs that touch the plane with caps of their own, some of which flow together.
  static std::vector<Vec3> bed() {
    std::vector<Vec3> centres;
    for (int j = 0; j < 4; ++j) {
      for (int i = 0; i < 4; ++i) centres.emplace_back(0.05 * i + 0.004 * ((3 * i + j) % 4), 0.05 * j + 0.003 * ((i + 2 * j) % 3), 0.031 + 0.0015 * ((i + 3 * j) % 4));
    }
    return centres;
  }
  void add_to(Stage& stage) const {
    stage.add(upper.field, upper.centre, 2.0).skeleton = &upper.skeleton;
    stage.add(lower.field, lower.centre, 2.0).skeleton = &lower.skeleton;
  }
  static constexpr double kSupport = 0.08;
};

struct PlaneSums {
  double force = 0.0, area = 0.0;
  Vec3 centre = Vec3::Zero();
};

/// Midpoints of squares. The rim cuts about one square in a row: n^-1.5 of the area at most as its places in squares are even, n^-2 of the force.
template <class Pressure>
PlaneSums sum_over_plane(const Box& box, int n, const Pressure& pressure) {
  std::vector<Vec3> row(static_cast<std::size_t>(n));
  PlaneSums sums;
  const double dx = box.extent().x() / n, dy = box.extent().y() / n;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) row[static_cast<std::size_t>(i)] = Vec3(box.lower.x() + (i + 0.5) * dx, box.lower.y() + (j + 0.5) * dy, 0.0);
    const std::vector<double> p = pressure(row);
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (!(p[i] > 0.0)) continue;
      sums.force += p[i] * dx * dy;
      sums.area += dx * dy;
      sums.centre += p[i] * dx * dy * row[i];
    }
  }
  sums.centre /= sums.force;
  return sums;
}

std::vector<double> pressures(const ContactBody& body, const std::vector<Vec3>& at) {
  std::vector<double> p(at.size());
  body.field.evaluate(at, p);
  for (double& x : p) x *= body.material.modulus;
  return p;
}

double error_of(const ContactSurface::Summary& s, const PlaneSums& exact) {
  return std::max({std::abs(s.force.norm() - exact.force) / exact.force, std::abs(s.area - exact.area) / exact.area, (s.centre_of_pressure - exact.centre).norm() / std::sqrt(exact.area)});
}

TEST(Panels, OfABedOfBlobsKeepTheirEstimatesAndCostMoreForLess) {
  const Mirrored bed(Mirrored::bed());
  Stage stage;
  bed.add_to(stage);
  constexpr int kRows = 3000;
  const PlaneSums exact = sum_over_plane({Vec3(-0.06, -0.06, 0.0), Vec3(0.24, 0.24, 0.0)}, kRows, [&](const std::vector<Vec3>& row) { return pressures(stage.bodies()[0], row); });
  constexpr double kOfReference = 1e-5;  // a rim of 16 patches, sqrt(16) (1 / 500)^1.5 of the area: each is 500 squares wide
  std::uint64_t points = 0;
  for (const double asked : {1e-1, 1e-2, 1e-3, 1e-4}) {
    const ContactSurface::Summary s = stage.solve({.error = asked}).summary.at(0);
    EXPECT_EQ(s.rule, ContactRule::Panels) << asked;
    EXPECT_EQ(s.reason, RuleReason::ManyHills) << asked;
    EXPECT_LE(s.error_estimate, asked);
    EXPECT_LE(error_of(s, exact), s.error_estimate + kOfReference) << asked;
    EXPECT_GE(s.points, points) << asked;
    points = s.points;
    EXPECT_LE(s.points, asked >= 1e-2 ? 800u : 4000u) << asked;
  }
}

TEST(Panels, AskedForMeetClosedFormsOfTwoBalls) {
  for (const double h : {0.95, 0.8, 0.5}) {
    const LinearSphere upper{Vec3(0.1, 0.2, h), {}}, lower{Vec3(0.1, 0.2, -h), {}};
    Stage stage;
    const auto one = testing::sphere_samples(upper.centre, 1.0, 400), other = testing::sphere_samples(lower.centre, 1.0, 400);
    stage.add(upper, {upper.centre}).samples = &one;
    stage.add(lower, {lower.centre}).samples = &other;
    const double depth = 1.0 - h, exact = std::numbers::pi / 3.0 * depth * depth * (1.0 + 2.0 * h), area = std::numbers::pi * (1.0 - h * h);
    const double energy = 2.0 * std::numbers::pi / 3.0 * (depth * depth * depth - 0.5 * depth * depth * depth * depth);
    for (const double asked : {1e-2, 1e-3, 1e-4}) {
      const ContactSurface::Summary s = stage.solve({.error = asked, .only = ContactRule::Panels}).summary.at(0);
      EXPECT_EQ(s.rule, ContactRule::Panels);
      EXPECT_LE(s.error_estimate, asked);
      EXPECT_NEAR(s.force.norm(), exact, s.error_estimate * exact) << h << ' ' << asked;
      EXPECT_NEAR(s.area, area, s.error_estimate * area) << h << ' ' << asked;
      EXPECT_NEAR(s.energy, energy, asked * energy) << h << ' ' << asked;
    }
  }
}

/// Of a bed with a third body: where it presses harder on the plane, the pair has nothing.
TEST(Panels, AreCutWhereAThirdBodyPressesHarder) {
  const Mirrored bed(Mirrored::bed());
  Stage stage;
  bed.add_to(stage);
  const Blobs third({Vec3(0.08, 0.07, 0.004)}, 0.12);
  stage.add(third.field, third.centre, 6.0).skeleton = &third.skeleton;
  constexpr int kRows = 3000;
  const PlaneSums exact = sum_over_plane({Vec3(-0.06, -0.06, 0.0), Vec3(0.24, 0.24, 0.0)}, kRows, [&](const std::vector<Vec3>& row) {
    std::vector<double> p = pressures(stage.bodies()[0], row);
    const std::vector<double> c = pressures(stage.bodies()[2], row);
    for (std::size_t i = 0; i < p.size(); ++i) p[i] = c[i] > p[i] ? 0.0 : p[i];
    return p;
  });
  Stage alone;
  bed.add_to(alone);
  EXPECT_LT(exact.force, 0.9 * alone.solve({.error = 1e-2, .only = ContactRule::Panels}).summary.at(0).force.norm());
  for (const double asked : {1e-2, 1e-3}) {
    const ContactSurface& surface = stage.solve({.error = asked, .only = ContactRule::Panels});
    const ContactSurface::Summary& s = surface.summary.at(0);
    ASSERT_EQ(s.bodies, (BodyPair{0, 1}));
    EXPECT_LE(s.error_estimate, asked);
    // Where a third body cuts, the pressure does not fall to zero: squares at that rim miss n^-1.5 of the force, too.
    EXPECT_LE(error_of(s, exact), s.error_estimate + 1e-4) << asked;
  }
}

struct ConvexSphere : LinearSphere {
  [[nodiscard]] bool convex() const { return true; }
};

/// Of three balls whose middle planes are known: of the pair's disc of radius a the third body takes the segment x > x0.
TEST(Imprints, ThatTakeLessThanTheErrorLeaveThePatchAsItIs) {
  constexpr double h = 0.9, x0 = 0.4168;
  const double a2 = 1.0 - h * h, d = x0 + std::sqrt(x0 * x0 + h * h);  // on z = 0 the third ball presses harder where 2 x d > d^2 - h^2
  const double half = std::acos(x0 / std::sqrt(a2)), whole = std::numbers::pi * a2, segment = a2 * half - x0 * std::sqrt(a2 - x0 * x0);
  ASSERT_GT(segment, 5e-3 * whole);  // what is left of the error is less than that
  const ConvexSphere upper{{Vec3(0.0, 0.0, h), {}}}, lower{{Vec3(0.0, 0.0, -h), {}}}, third{{Vec3(d, 0.0, 0.0), {}}};
  Stage stage;
  for (const ConvexSphere* ball : {&upper, &lower, &third}) stage.add(*ball, {ball->centre});
  const auto solve = [&](double asked) {
    const ContactSurface::Summary s = stage.solve({.error = asked}).summary.at(0);
    EXPECT_EQ(s.bodies, (BodyPair{0, 1}));
    EXPECT_LE(s.error_estimate, asked);
    EXPECT_NEAR(s.area, whole - segment, s.error_estimate * whole) << asked;
    return s;
  };
  const ContactSurface::Summary left = solve(1e-2), cut = solve(1e-3);
  EXPECT_NEAR(left.area, whole, 1e-3 * whole);
  EXPECT_GT(left.error_estimate, segment / whole);
  EXPECT_LT(cut.area, whole - 0.5 * segment);
  EXPECT_LT(left.points, cut.points);
}

/// A ball, a capsule and a ball with a soft rim in one place: the pair of the first two keeps a sliver of their Sigma. The force was found by columns through
/// the squeezed region, and by marching to 1e-8, to the digits given.
TEST(Panels, OfASliverBesideAThirdBodyAreAsGoodAsAsked) {
  struct Body {
    implicit::Skeleton skeleton;
    Pose pose;
    implicit::PlacedSkeleton placed;
    implicit::Field field;
    Body(const implicit::Primitive& p, const Vec3& at) : pose{at, Quat::Identity()} {
      skeleton.primitive = {p};
      skeleton.part_count = 1;
      implicit::place_skeleton(skeleton, {&pose, 1}, placed);
      implicit::index_field(skeleton, placed, field);
    }
  };
  implicit::Primitive ball, capsule, soft;
  ball.kernel = implicit::Kernel::wyvill(0.3163171964219842);
  capsule.shape = implicit::ShapeKind::Segment;
  capsule.size = Vec3(0.37009387604476923, 0.0, 0.0);
  capsule.kernel = implicit::Kernel::wyvill(0.30139374470582964);
  capsule.offset.orientation = Quat(Eigen::AngleAxisd(158.5474337786485 * std::numbers::pi / 180.0, Vec3(0.4800612874950526, 0.2510202673427182, 0.8405533805962492).normalized()));
  soft.kernel = implicit::Kernel::gascuel(0.3127687209714328, 0.5848504363572992, 2.5556389535987902);
  const Body a(ball, Vec3::Zero()), b(capsule, Vec3(0.342920569445983, -0.18166312803178913, -0.45705860799386905)),
      c(soft, Vec3(0.24321067832368198, -0.1436887846850645, 0.07842620875877751));
  Stage stage;
  const std::vector<std::pair<const Body*, double>> bodies{{&a, 3.121196004362557}, {&b, 2.8048647090278944}, {&c, 3.2890717134877008}};
  for (const auto& [body, modulus] : bodies) {
    stage.add(body->field, {body->pose.position}, modulus).skeleton = &body->skeleton;
  }
  constexpr double kForce = 2.2052537e-4;
  for (const double asked : {1e-3, 1e-4}) {
    const ContactSurface::Summary s = stage.solve({.error = asked, .energy = false, .only = ContactRule::Panels}).summary.at(0);
    ASSERT_EQ(s.bodies, (BodyPair{0, 1}));
    EXPECT_LE(s.error_estimate, asked);
    EXPECT_NEAR(s.force.norm(), kForce, asked * kForce) << asked;
  }
  // Without a rule by name, too, and by rays from the peak; the area is that of marching to 1e-8.
  constexpr double kArea = 2.88039746e-3;
  for (const ContactRule only : {ContactRule::None, ContactRule::Polar}) {
    for (const double asked : {1e-2, 1e-3, 1e-4}) {
      const ContactSurface::Summary s = stage.solve({.error = asked, .only = only}).summary.at(0);
      EXPECT_LE(s.error_estimate, asked);
      EXPECT_NEAR(s.force.norm(), kForce, s.error_estimate * kForce) << asked;
      EXPECT_NEAR(s.area, kArea, s.error_estimate * kArea) << asked;
    }
  }
}

/// Rings are not cut where bodies have several parts: asked for by name they are refused, not summed as if nothing were there.
TEST(Panels, AreWhatIsLeftWhereRingsAreAskedForBesideAThirdBody) {
  const Mirrored bed(Mirrored::bed());
  Stage stage;
  bed.add_to(stage);
  const Blobs third({Vec3(0.08, 0.07, 0.004)}, 0.12);
  stage.add(third.field, third.centre, 6.0).skeleton = &third.skeleton;
  const ContactSurface::Summary s = stage.solve({.error = 1e-3, .only = ContactRule::Polar}).summary.at(0);
  EXPECT_EQ(s.error_estimate, 1.0);
  EXPECT_EQ(s.force.norm(), 0.0);
}

TEST(Panels, AreSharedOnceByBodiesThatLieInOnePlace) {
  const Mirrored bed(Mirrored::bed());
  Stage pair, three;
  bed.add_to(pair);
  bed.add_to(three);
  const Blobs copy(bed.lower.centre, Mirrored::kSupport);
  three.add(copy.field, copy.centre, 2.0).skeleton = &copy.skeleton;
  const ContactSettings settings{.error = 1e-3, .only = ContactRule::Panels};
  const Vec3 alone = pair.solve(settings).summary.at(0).force;
  Vec3 sum = Vec3::Zero();
  for (const ContactSurface::Summary& s : three.solve(settings).summary) {
    if (s.bodies.a == 0) sum += s.force;
  }
  EXPECT_LE((sum - alone).norm(), 2e-3 * alone.norm());
}

TEST(Panels, ForcesAreTheGradientOfTheEnergy) {
  const double step = 1e-5;
  const auto solve = [](double shift) {
    std::vector<Vec3> centres = Mirrored::bed();
    Stage stage;
    const Blobs lower(Mirrored::mirrored(centres), Mirrored::kSupport);
    for (Vec3& x : centres) x += Vec3(0.7 * shift + 0.004, 0.0, shift);
    const Blobs upper(centres, Mirrored::kSupport);
    stage.add(upper.field, upper.centre, 1.0).skeleton = &upper.skeleton;
    stage.add(lower.field, lower.centre, 3.0).skeleton = &lower.skeleton;
    return stage.solve({.error = 1e-5, .only = ContactRule::Panels}).summary.at(0);
  };
  const ContactSurface::Summary here = solve(0.0), up = solve(step), down = solve(-step);
  EXPECT_EQ(here.rule, ContactRule::Panels);
  const double along = here.force.dot(Vec3(0.7, 0.0, 1.0));
  // Energies are as good as asked; their difference over 2e-5 m is a two hundredth of them, and their errors nearly the same in both.
  EXPECT_NEAR((down.energy - up.energy) / (2.0 * step), along, 1e-3 * std::abs(along));
}

/// Blobs that hang over the edge of a box: Sigma turns by a right angle around its rounding, and is a graph only as seen from between its two sides.
TEST(Panels, OfABedOverAnEdgeAgreeWithMarching) {
  const Blobs bed(Mirrored::bed(), Mirrored::kSupport);
  const implicit::SolidBox box(Pose{Vec3(-0.11, 0.1, -0.2), Quat::Identity()}, Vec3(0.2, 0.4, 0.2), 0.01, 20.0);
  Stage stage;
  stage.add(bed.field, bed.centre, 1.0).skeleton = &bed.skeleton;
  stage.add(box).fixed = true;
  const ContactSurface::Summary exact = stage.solve({.error = 1e-5, .energy = false, .only = ContactRule::March}).summary.at(0);
  ASSERT_LE(exact.error_estimate, 2e-5);
  const PlaneSums sums{exact.force.norm(), exact.area, exact.centre_of_pressure};
  for (const double asked : {1e-2, 1e-3}) {
    const ContactSurface::Summary s = stage.solve({.error = asked}).summary.at(0);
    EXPECT_EQ(s.rule, ContactRule::Panels) << asked;
    EXPECT_LE(s.error_estimate, asked);
    EXPECT_LE(error_of(s, sums), s.error_estimate + exact.error_estimate) << asked;
  }
}

/// Two layers of blobs that a hard block takes in up to the middle of the upper one: normals of the blobs there point all ways, but Sigma is nearly the block's face.
TEST(Panels, OfABodyPressedDeeplyIntoAHardBlockAgreeWithMarching) {
  std::vector<Vec3> centres = Mirrored::bed();
  for (const Vec3& x : Mirrored::bed()) centres.push_back(x + Vec3(0.0, 0.0, 0.06));
  const Blobs body(centres, Mirrored::kSupport);
  const implicit::SolidBox block(Pose{Vec3(0.1, 0.1, -0.11), Quat::Identity()}, Vec3(0.4, 0.4, 0.2), 0.01, 20.0);
  Stage stage;
  stage.add(body.field, body.centre, 1.0).skeleton = &body.skeleton;
  stage.add(block, {}, 100.0).fixed = true;
  const ContactSurface::Summary exact = stage.solve({.error = 1e-5, .energy = false, .only = ContactRule::March}).summary.at(0);
  ASSERT_LE(exact.error_estimate, 2e-5);
  const PlaneSums sums{exact.force.norm(), exact.area, exact.centre_of_pressure};
  for (const double asked : {1e-1, 1e-2, 1e-3}) {
    const ContactSurface::Summary s = stage.solve({.error = asked, .energy = false}).summary.at(0);
    EXPECT_EQ(s.rule, ContactRule::Panels) << asked;
    EXPECT_LE(s.error_estimate, asked);
    EXPECT_LE(error_of(s, sums), s.error_estimate + exact.error_estimate) << asked;
    EXPECT_LE(s.points, 2000u) << asked;
    EXPECT_LE(s.largest_overlap, 0.15);  // the body's height
    EXPECT_GE(s.largest_overlap, 0.05);
  }
}

/// Ellipsoids of many sizes on the edge of a box: slivers of the patch lie in panels whose nodes do not press, beside panels whose lines lead into them, or
/// between two nodes.
TEST(Panels, OfUnequalEllipsoidsOnAnEdgeKeepTheirEstimates) {
  constexpr std::uint64_t kSeed = 5;
  benchmarks::Parts body = benchmarks::limbs(32);
  const std::vector<Pose> rest = body.pose;
  const implicit::SolidBox box(Pose{Vec3(-0.4, 0.0, -0.2), Quat::Identity()}, Vec3(0.4, 0.4, 0.2), 0.01, 1.0);
  benchmarks::Draw draw(kSeed);
  for (int pose = 0; pose < 3; ++pose) {
    benchmarks::lay(body, rest, draw);
    Stage stage;
    stage.add(body.field) = body.body();
    stage.add(box, {Vec3::Zero()}, 1e6).fixed = true;
    const ContactSurface::Summary exact = stage.solve({.error = 1e-5, .energy = false, .only = ContactRule::March}).summary.at(0);
    ASSERT_LE(exact.error_estimate, 2e-5);
    const PlaneSums sums{exact.force.norm(), exact.area, exact.centre_of_pressure};
    for (const double asked : {1e-2, 1e-3}) {
      const ContactSurface::Summary s = stage.solve({.error = asked, .energy = false}).summary.at(0);
      EXPECT_LE(s.error_estimate, asked);
      EXPECT_LE(error_of(s, sums), s.error_estimate + exact.error_estimate) << pose << ' ' << asked;
    }
  }
}

/// Sums of a pressure and of 1 over {p_other >= p_own > 0} by equal cells of a box.
std::array<double, 2> summed_by_cells(const implicit::FieldView& own, double own_modulus, const implicit::FieldView& other, double other_modulus, const Box& box, int cells) {
  const Vec3 width = box.extent() / cells;
  std::vector<Vec3> row(static_cast<std::size_t>(cells));
  std::vector<double> a(row.size()), b(row.size());
  std::array<double, 2> sums{};
  for (int i = 0; i < cells; ++i) {
    for (int j = 0; j < cells; ++j) {
      for (int k = 0; k < cells; ++k) row[static_cast<std::size_t>(k)] = box.lower + width.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5));
      own.evaluate(row, a);
      other.evaluate(row, b);
      for (std::size_t k = 0; k < row.size(); ++k) {
        if (!(a[k] > 0.0 && other_modulus * b[k] >= own_modulus * a[k])) continue;
        sums[0] += own_modulus * a[k] * width.prod();
        sums[1] += width.prod();
      }
    }
  }
  return sums;
}

/// A body that presses on a ring from within, on two sides: columns along one axis hold neither side.
TEST(Panels, HoldWhatABodyLosesOnTwoSides) {
  constexpr int kCells = 160;
  constexpr double kOfCells = 4e-3;  // what the sums of these are off by
  implicit::Skeleton skeleton;
  skeleton.part_count = 24;
  for (std::uint32_t k = 0; k < skeleton.part_count; ++k) {
    implicit::Primitive& p = skeleton.primitive.emplace_back();
    p.part = k;
    p.kernel = implicit::Kernel::wyvill(0.08);
  }
  benchmarks::Parts body(std::move(skeleton), 0.012);
  for (std::size_t k = 0; k < body.pose.size(); ++k) body.pose[k].position = Vec3(0.012 * (static_cast<double>(k) - 11.5), 0.003, 0.01);
  body.index();
  implicit::Skeleton hoop;
  hoop.part_count = 1;
  implicit::Primitive& ring = hoop.primitive.emplace_back();
  ring.shape = implicit::ShapeKind::Ring;
  ring.size = Vec3(0.2, 0.0, 0.0);
  ring.kernel = implicit::Kernel::wyvill(0.08);
  benchmarks::Parts around(std::move(hoop), 0.012);
  around.index();
  Stage stage;
  stage.add(body.field) = body.body();
  collision::ContactBody& obstacle = stage.add(around.field) = around.body();
  obstacle.material.modulus = 1e6;
  obstacle.fixed = true;
  const ContactSurface::Summary s = stage.solve({.error = 1e-2, .only = ContactRule::Panels}).summary.at(0);
  const Box overlap = body.field.surface_box().intersection(around.field.surface_box());
  const auto [energy, volume] = summed_by_cells(body.field, body.body().material.modulus, around.field, 1e6, overlap, kCells);
  EXPECT_NEAR(s.energy_a, energy, (1e-2 + kOfCells) * energy);
  EXPECT_NEAR(s.displaced_a, volume, (2e-2 + kOfCells) * volume);
  EXPECT_LE(s.evaluations, 60000u);  // cells of a plane would take 250,000 more
}

/// A limb that dips into hard ground and runs on beneath its surface.
benchmarks::Parts limb_beneath_the_ground() {
  implicit::Skeleton skeleton;
  skeleton.part_count = 24;
  for (std::uint32_t k = 0; k < skeleton.part_count; ++k) {
    implicit::Primitive& p = skeleton.primitive.emplace_back();
    p.part = k;
    p.kernel = implicit::Kernel::wyvill(0.08);
  }
  benchmarks::Parts body(std::move(skeleton), 0.012);
  for (std::size_t k = 0; k < body.pose.size(); ++k) body.pose[k].position = Vec3(0.02 * static_cast<double>(k), 0.0, 0.06 - 0.008 * static_cast<double>(k));
  body.index();
  return body;
}

/// Most of its samples lie where no Sigma is above them.
TEST(Panels, OfALimbBeneathTheGroundAreFew) {
  benchmarks::Parts body = limb_beneath_the_ground();
  const implicit::HalfSpace ground{Vec3::Zero(), Vec3::UnitZ(), 20.0};
  Stage stage;
  stage.add(body.field) = body.body();
  stage.add(ground, {Vec3::Zero()}, 1e6).fixed = true;
  const ContactSurface::Summary exact = stage.solve({.error = 1e-5, .energy = false, .only = ContactRule::March}).summary.at(0);
  const PlaneSums sums{exact.force.norm(), exact.area, exact.centre_of_pressure};
  const ContactSurface::Summary s = stage.solve({.error = 1e-2, .energy = false}).summary.at(0);
  EXPECT_EQ(s.rule, ContactRule::Panels);
  EXPECT_LE(s.error_estimate, 1e-2);
  EXPECT_LE(error_of(s, sums), s.error_estimate + exact.error_estimate);
  EXPECT_LE(s.points, 400u);
  EXPECT_LE(s.evaluations, 80000u);  // most of them in the cells that hold what the limb loses: it runs on beyond Sigma
}

/// Beyond Sigma the limb runs on beneath the ground, where no column begins: cells have to hold what it loses.
TEST(Panels, HoldWhatALimbLosesBeyondSigma) {
  constexpr int kCells = 160;
  constexpr double kOfCells = 4e-3;  // what the sums of these are off by
  benchmarks::Parts body = limb_beneath_the_ground();
  const implicit::HalfSpace ground{Vec3::Zero(), Vec3::UnitZ(), 20.0};
  Stage stage;
  stage.add(body.field) = body.body();
  stage.add(ground, {Vec3::Zero()}, 1e6).fixed = true;
  const ContactSurface::Summary s = stage.solve({.error = 1e-2}).summary.at(0);
  EXPECT_EQ(s.rule, ContactRule::Panels);
  Box below = body.field.surface_box();
  below.upper.z() = 0.0;
  const auto [energy, volume] = summed_by_cells(body.field, body.body().material.modulus, ground, 1e6, below, kCells);
  EXPECT_NEAR(s.energy_a, energy, (1e-2 + kOfCells) * energy);
  EXPECT_NEAR(s.displaced_a, volume, (2e-2 + kOfCells) * volume);
}

TEST(Panels, AreTheSameWhicheverBodyIsNamedFirst) {
  const Mirrored bed(Mirrored::bed());
  Stage stage, swapped;
  stage.add(bed.upper.field, bed.upper.centre, 2.0).skeleton = &bed.upper.skeleton;
  stage.add(bed.lower.field, bed.lower.centre, 5.0).skeleton = &bed.lower.skeleton;
  swapped.add(bed.lower.field, bed.lower.centre, 5.0).skeleton = &bed.lower.skeleton;
  swapped.add(bed.upper.field, bed.upper.centre, 2.0).skeleton = &bed.upper.skeleton;
  const ContactSurface::Summary one = stage.solve({.error = 1e-3}).summary.at(0), other = swapped.solve({.error = 1e-3}).summary.at(0);
  EXPECT_EQ(one.points, other.points);
  EXPECT_LE((one.force + other.force).norm(), 1e-12 * one.force.norm());
  EXPECT_NEAR(one.area, other.area, 1e-12 * one.area);
  EXPECT_NEAR(one.energy, other.energy, 1e-12 * one.energy);
}

}  // namespace
}  // namespace supple::collision
