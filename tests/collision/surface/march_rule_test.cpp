/// Marching, and the choice of a rule, on patches that are rings: contacts with a circle in closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "benchmarks/contact_shapes.h"
#include "collision/bodies.h"
#include "supple/core/hash.h"

namespace supple::collision {
namespace {

using testing::Stage;

constexpr double kPi = std::numbers::pi;
constexpr double kIso = 0.5;
constexpr double kGivesWay = 2e-9;

/// One primitive with kernel (1 - d^2 / S^2)^3.
struct Shape {
  implicit::Skeleton skeleton;
  Pose pose;
  implicit::PlacedSkeleton placed;
  implicit::Field field;

  Shape(implicit::ShapeKind kind, double size, double support, const Pose& where) : pose(where) {
    implicit::Primitive p;
    p.shape = kind;
    if (kind != implicit::ShapeKind::Point) p.size = Vec3(size, 0.0, 0.0);
    p.kernel = implicit::Kernel::wyvill(support);
    skeleton.primitive = {p};
    skeleton.part_count = 1;
    implicit::place_skeleton(skeleton, {&pose, 1}, placed);
    implicit::index_field(skeleton, placed, field);
  }
  void add_to(Stage& stage, double modulus = 1.0) const {
    stage.add(field, {pose.position}, modulus).skeleton = &skeleton;
    stage.pose(stage.bodies().size() - 1)[0] = pose;
  }
};

/// A contact whose pressures depend on the distance in the plane through the axis of a circle: Sigma is the line, of half width w, from
/// which both bodies are equally far, at s = 0 by `nearest`, turned around the axis at radius `radius` + s `lean`.
struct Line {
  double support, nearest, radius;
  [[nodiscard]] double surface() const { return support * std::sqrt(1.0 - std::cbrt(kIso)); }
  [[nodiscard]] double half_width() const { return std::sqrt(surface() * surface() - nearest * nearest); }
  /// 2 pi times radius times the integral of p ds over the line; what is odd in s cancels.
  [[nodiscard]] double load() const {
    const double S = support * support, q = 1.0 - nearest * nearest / S, w = half_width(), v = w * w / S;
    return 2.0 * kPi * radius * 2.0 * w * (q * q * q - kIso - q * q * v + 0.6 * q * v * v - v * v * v / 7.0);
  }
  [[nodiscard]] double area() const { return 2.0 * kPi * radius * 2.0 * half_width(); }
  /// Of the circle of radius `surface` beyond the line: area, and its first moment about the circle's centre.
  [[nodiscard]] double segment() const {
    const double a = surface();
    return a * a * std::acos(nearest / a) - nearest * half_width();
  }
  [[nodiscard]] double first() const { return 2.0 / 3.0 * std::pow(half_width(), 3); }
};

const Pose kTurned{Vec3(0.3, -0.2, 0.7), Quat(0.3, -0.5, 0.7, 0.2).normalized()};

Pose at(const Pose& frame, const Vec3& place) { return {frame.to_world(place), frame.orientation}; }

/// Force along the axis of the frame, and area, against closed forms; a plane of modulus 1e10 gives way by 1e-9 of the depth.
void expect_solved(const ContactSurface::Summary& s, const Pose& frame, double force, double area, double asked) {
  EXPECT_LE(s.error_estimate, 1.01 * asked);
  EXPECT_LE((frame.orientation.conjugate() * s.force - Vec3(0, 0, force)).norm(), (s.error_estimate + kGivesWay) * std::abs(force)) << asked;
  EXPECT_LE(std::abs(s.area - area), (s.error_estimate + kGivesWay) * area) << asked;
  const Vec3 centre = frame.to_body(s.centre_of_pressure);
  EXPECT_LE(std::hypot(centre.x(), centre.y()), s.error_estimate * std::sqrt(area)) << asked;
}

constexpr std::array<double, 4> kAsked{1e-2, 1e-3, 1e-4, 1e-7};

/// A ring of radius 1 on a stiff plane.
struct RingOnPlane {
  Shape ring;
  implicit::HalfSpace plane;
  Stage stage;
  Line line;
  RingOnPlane(double support, double height, const Pose& frame = {}, bool swap = false)
      : ring(implicit::ShapeKind::Ring, 1.0, support, at(frame, Vec3(0, 0, height))),
        plane{frame.position, frame.orientation * Vec3::UnitZ(), 1e10},
        line{support, height, 1.0} {
    if (!swap) ring.add_to(stage);
    stage.add(plane).fixed = true;
    if (swap) ring.add_to(stage);
  }
};

TEST(AnnularPatch, OfARingOnAPlaneMeetsTheErrorAsked) {
  // From a patch that is a fifth of the radius wide to one of a hundredth, which the first mesh's triangles are ten times as wide as.
  for (const double depth : {0.3, 0.03, 3e-3}) {
    const double surface = 0.3 * std::sqrt(1.0 - std::cbrt(kIso));
    for (const bool turned : {false, true}) {
      const Pose frame = turned ? kTurned : Pose{};
      for (const double asked : kAsked) {
        RingOnPlane scene(0.3, surface * (1.0 - depth), frame, turned);
        const ContactSurface::Summary s = scene.stage.solve({.error = asked}).summary.at(0);
        expect_solved(s, frame, turned ? -scene.line.load() : scene.line.load(), scene.line.area(), asked);
        const double volume = 2.0 * kPi * scene.line.segment(), displaced = turned ? s.displaced_b : s.displaced_a;
        EXPECT_NEAR(displaced, volume, (asked + kGivesWay) * volume) << depth << ' ' << asked;
      }
    }
  }
}

// Belts and crescents many times as narrow as a triangle of the mesh is wide, whose rims meet where the plane leaves the ring.
TEST(AnnularPatch, IsCutAlongItsRidgeWhereItIsNarrow) {
  benchmarks::Draw draw(5);
  const double surface = 0.3 * std::sqrt(1.0 - std::cbrt(kIso));
  for (int i = 0; i < 40; ++i) {
    const double depth = surface * draw.logarithmic(1e-3, 0.1), lean = depth * draw.uniform(0.0, 3.0);
    const Pose frame{Vec3::Zero(), Quat(Eigen::AngleAxisd(lean, Vec3(draw.uniform(-1.0, 1.0), draw.uniform(-1.0, 1.0), 0.0).normalized()))};
    RingOnPlane scene(0.3, surface - depth, {});
    scene.plane.normal = frame.orientation * Vec3::UnitZ();
    const auto march = [&](double error) { return scene.stage.solve({.error = error, .only = ContactRule::March}).summary.at(0); };
    const ContactSurface::Summary finest = march(1e-7);
    for (const double error : {1e-2, 1e-4}) {
      const ContactSurface::Summary s = march(error);
      EXPECT_LE(s.error_estimate, error) << i;
      EXPECT_LE((s.force - finest.force).norm(), (s.error_estimate + finest.error_estimate) * finest.force.norm()) << i << ' ' << error;
      EXPECT_NEAR(s.area / finest.area, 1.0, s.error_estimate + finest.error_estimate) << i << ' ' << error;
      // Pieces as narrow as the patch would take up to 46,000 and 87,000 points.
      EXPECT_LE(s.points, error >= 1e-2 ? 20'000u : 35'000u) << i;
    }
  }
}

TEST(AnnularPatch, OfARingOnADiscMeetsTheErrorAsked) {
  // Of equal kernels Sigma is the parabola around the ring: z = (D^2 - s^2) / 2 D, d = (D^2 + s^2) / 2 D.
  constexpr double kSupport = 0.3, kDistance = 0.24;
  const double a = kSupport * std::sqrt(1.0 - std::cbrt(kIso)), w = std::sqrt(kDistance * (2.0 * a - kDistance));
  constexpr int kNodes = 4000;  // Simpson
  double force = 0.0, area = 0.0;
  for (int i = 0; i <= kNodes; ++i) {
    const double s = w * i / kNodes, share = (i == 0 || i == kNodes ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * w / kNodes / 3.0;
    const double d = (kDistance * kDistance + s * s) / (2.0 * kDistance);
    force += 4.0 * kPi * share * (std::pow(1.0 - d * d / (kSupport * kSupport), 3) - kIso);
    area += 4.0 * kPi * share * std::hypot(1.0, s / kDistance);
  }
  for (const double asked : kAsked) {
    const Shape ring(implicit::ShapeKind::Ring, 1.0, kSupport, kTurned), disc(implicit::ShapeKind::Disc, 1.6, kSupport, at(kTurned, Vec3(0, 0, kDistance)));
    Stage stage;
    ring.add_to(stage);
    disc.add_to(stage);
    expect_solved(stage.solve({.error = asked}).summary.at(0), kTurned, -force, area, asked);
  }
}

TEST(AnnularPatch, OfABallInARingMeetsTheErrorAsked) {
  // Of equal kernels Sigma is the cone that halves the way from the ball's centre to the ring; at height 0 a cylinder.
  constexpr double kSupport = 1.2;
  for (const double height : {0.35, 0.0}) {
    const double L = std::hypot(1.0, height);
    const Line line{kSupport, 0.5 * L, 0.5};
    for (const double asked : kAsked) {
      const Shape ball(implicit::ShapeKind::Point, 0.0, kSupport, at(kTurned, Vec3(0, 0, height))), ring(implicit::ShapeKind::Ring, 1.0, kSupport, kTurned);
      Stage stage;
      ball.add_to(stage);
      ring.add_to(stage);
      const ContactSurface::Summary s = stage.solve({.error = asked}).summary.at(0);
      EXPECT_LE(s.error_estimate, 1.01 * asked);
      // A force that cancels is measured against a thousandth of the load.
      const double force = line.load() * height / L;
      EXPECT_LE((kTurned.orientation.conjugate() * s.force - Vec3(0, 0, force)).norm(), s.error_estimate * std::max(force, 1e-3 * line.load())) << asked;
      EXPECT_LE(std::abs(s.load - line.load()), s.error_estimate * line.load());
      EXPECT_LE(std::abs(s.area - line.area()), s.error_estimate * line.area());
      if (asked > 1e-3) continue;
      const double of_ball = 2.0 * kPi * line.first() / L, of_ring = 2.0 * kPi * (line.segment() - line.first() / L);
      EXPECT_NEAR(s.displaced_a, of_ball, asked * of_ball);
      EXPECT_NEAR(s.displaced_b, of_ring, asked * of_ring);
    }
  }
}

TEST(AnnularPatch, IsTheSameForBodiesThatChangePlaces) {
  RingOnPlane one(0.3, 0.12), other(0.3, 0.12, {}, true);
  const ContactSettings settings{.error = 1e-4, .only = ContactRule::March};
  const ContactSurface::Summary s = one.stage.solve(settings).summary.at(0), t = other.stage.solve(settings).summary.at(0);
  const double bound = s.error_estimate + t.error_estimate;
  EXPECT_LE(bound, 2e-4);
  EXPECT_LT((s.force + t.force).norm(), bound * s.force.norm());
  EXPECT_LT((s.moment + t.moment).norm(), bound * s.force.norm());
  EXPECT_NEAR(s.area, t.area, bound * s.area);
  EXPECT_NEAR(s.displaced_a, t.displaced_b, 1e-4 * s.displaced_a);
}

TEST(MarchRule, ConvergesFasterThanAnyPower) {
  // From 1e-3 to 1e-8 a rule of order two would look at a hundred thousand times as many points.
  RingOnPlane scene(0.3, 0.12);
  std::vector<std::uint64_t> evaluations;
  for (const double asked : {1e-3, 1e-5, 1e-8}) {
    const ContactSurface::Summary s = scene.stage.solve({.error = asked, .only = ContactRule::March}).summary.at(0);
    EXPECT_EQ(s.rule, ContactRule::March);
    expect_solved(s, {}, scene.line.load(), scene.line.area(), asked);
    evaluations.push_back(s.evaluations);
  }
  EXPECT_LT(evaluations[2], 10 * evaluations[0]);
}

TEST(MarchRule, HasABoundThatCoversItsErrorInEveryPose) {
  // Ring, plane and lattice lie in all ways to one another; the rim leaves triangles at corners, grazes edges and turns back in them.
  for (int pose = 0; pose < 60; ++pose) {
    const double a = 0.7 * pose, b = 1.3 * pose + 0.4;
    const auto [sa, ca] = math::sin_cos(a);
    const auto [sb, cb] = math::sin_cos(b);
    const Pose frame{Vec3(0.1 * sa, 0.1 * cb, 0.1 * sb), Quat(sa, ca * sb, ca * cb, 0.3).normalized()};
    RingOnPlane scene(0.3, 0.1363 * (1.0 - 0.4 * (pose + 1) / 60.0), frame);
    for (const double asked : {1e-2, 1e-3}) {
      const ContactSurface::Summary s = scene.stage.solve({.error = asked, .energy = false, .only = ContactRule::March}).summary.at(0);
      expect_solved(s, frame, scene.line.load(), scene.line.area(), asked);
    }
  }
}

/// Two bodies pressed together at random, by one rule.
struct Pressed {
  benchmarks::Rigid a, b;
  double size;

  void pose(std::uint64_t seed, int index) {
    benchmarks::Draw draw(seed);
    for (int i = 0; i <= index; ++i) press(a, b, draw.logarithmic(0.01, 0.3) * size, draw);
  }
  ContactSurface::Summary solve(double error, ContactRule rule) {
    const std::array<ContactBody, 2> bodies{a.body(), b.body()};
    const Executor executor(1);
    ContactCandidates candidates;
    ContactSurface surface;
    find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
    solve_contact_surface(bodies, candidates, {.error = error, .only = rule}, executor, surface);
    return surface.summary.at(0);
  }
};

constexpr double kModulus = 1e6, kSpacing = 0.03;

Pressed ball_and_plate() {
  return {benchmarks::Rigid(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.22), kModulus, kSpacing),
          benchmarks::Rigid(benchmarks::wyvill_shape(implicit::ShapeKind::Rectangle, Vec3(0.15, 0.15, 0.0), 0.15), kModulus, kSpacing), 0.07};
}
Pressed disc_and_box() {
  return {benchmarks::Rigid(benchmarks::wyvill_shape(implicit::ShapeKind::Disc, Vec3(0.15, 0.0, 0.0), 0.15), kModulus, kSpacing),
          benchmarks::Rigid(benchmarks::wyvill_shape(implicit::ShapeKind::Box, Vec3(0.2, 0.1, 0.1), 0.15), 2.0 * kModulus, kSpacing), 0.07};
}
Pressed capsules() {
  return {benchmarks::Rigid(benchmarks::wyvill_shape(implicit::ShapeKind::Segment, Vec3(0.2, 0.0, 0.0), 0.2), kModulus, kSpacing),
          benchmarks::Rigid(benchmarks::wyvill_shape(implicit::ShapeKind::Segment, Vec3(0.1, 0.0, 0.0), 0.25), 3.0 * kModulus, kSpacing), 0.1};
}
Pressed boxes() {
  const implicit::Skeleton box = benchmarks::linear_shape(implicit::ShapeKind::Box, Vec3(0.1, 0.08, 0.05), 0.02);
  return {benchmarks::Rigid(box, 2.0 * kModulus, kSpacing), benchmarks::Rigid(box, 4.0 * kModulus, kSpacing), 0.02};
}

/// The polar rule at its best in the pose it is in.
ContactSurface::Summary expect_bound_holds(Pressed& pair, double error) {
  const ContactSurface::Summary exact = pair.solve(1e-10, ContactRule::Polar), s = pair.solve(error, ContactRule::March);
  const double bound = s.error_estimate + exact.error_estimate;
  EXPECT_EQ(s.rule, ContactRule::March);
  EXPECT_LE(s.error_estimate, 1.01 * error);
  EXPECT_LE((s.force - exact.force).norm(), bound * exact.force.norm());
  EXPECT_LE(std::abs(s.area - exact.area), bound * exact.area);
  EXPECT_LE((s.centre_of_pressure - exact.centre_of_pressure).norm(), bound * std::sqrt(exact.area));
  return s;
}

TEST(MarchRule, HasABoundThatCoversItsErrorAcrossKinks) {
  // Poses in which rules agreed on what both of them had wrong: kinks that clip a piece, that nearly go along its rays, or that leave it
  // over the rim between two of them.
  Pressed plate = ball_and_plate(), disc = disc_and_box();
  plate.pose(77, 6);
  expect_bound_holds(plate, 1e-6);
  constexpr std::array<std::pair<std::uint64_t, int>, 5> kPoses{{{77, 11}, {5, 4}, {9001, 15}, {31, 3}, {77, 82}}};
  for (const auto& [seed, pose] : kPoses) {
    SCOPED_TRACE(seed);
    disc.pose(seed, pose);
    expect_bound_holds(disc, 1e-6);
  }
}

TEST(MarchRule, FindsTheRimWhereThePressureBendsAtIt) {
  // The rim was told to be on the wrong side of a place that was still far off Sigma.
  Pressed pair = boxes();
  pair.pose(9101, 236);
  for (const double asked : {1e-6, 1e-8}) expect_bound_holds(pair, asked);
}

TEST(MarchRule, IsNearerToSigmaTheFinerTheErrorAsked) {
  Pressed pair = capsules();
  for (const int pose : {18, 49, 54}) {
    SCOPED_TRACE(pose);
    pair.pose(9401, pose);
    expect_bound_holds(pair, 1e-10);
  }
}

TEST(MarchRule, ConvergesAcrossKinksAsWithoutThem) {
  // Of order three, as triangles that kinks cross uncut are, 1e-9 would take a hundred times the points of 1e-3.
  Pressed pair = ball_and_plate();
  pair.pose(77, 6);
  const std::uint64_t coarse = pair.solve(1e-3, ContactRule::March).points, fine = expect_bound_holds(pair, 1e-9).points;
  EXPECT_LT(fine, 25 * coarse);
}

TEST(MarchRule, LeavesNothingSidewaysToAnAxisOfSymmetry) {
  const double tilt = 0.3;
  const Pose other{Vec3(2.0, 0.1, -0.4), Quat(Eigen::AngleAxisd(tilt, Vec3(0.6, 0.8, 0.0)))};
  for (const Pose& frame : {Pose{}, kTurned, other}) {
    const Shape ball(implicit::ShapeKind::Point, 0.0, 1.2, at(frame, Vec3(0, 0, 0.35))), ring(implicit::ShapeKind::Ring, 1.0, 1.2, frame),
        thin(implicit::ShapeKind::Ring, 1.0, 0.3, at(frame, Vec3(0, 0, 0.12))), high(implicit::ShapeKind::Ring, 1.0, 0.3, at(frame, Vec3(0, 0, 0.136))), disc(implicit::ShapeKind::Disc, 1.6, 0.3, at(frame, Vec3(0, 0, -0.12)));
    const implicit::HalfSpace plane{frame.position, frame.orientation * Vec3::UnitZ(), 1e3};
    const auto expect_straight = [&](Stage& stage, const char* what) {
      // As coarse as may be asked, and what orders 3, 4 and 5 must split pieces for.
      for (const double asked : {0.1, 5e-3, 5e-5, 1e-6, 1e-8}) {
        const ContactSurface::Summary s = stage.solve({.error = asked, .energy = false, .only = ContactRule::March}).summary.at(0);
        const Vec3 force = frame.orientation.conjugate() * s.force, centre = frame.to_body(s.centre_of_pressure);
        EXPECT_LE(std::hypot(force.x(), force.y()), 1e-12 * std::abs(force.z())) << what << ' ' << asked;
        EXPECT_LE(std::hypot(centre.x(), centre.y()), 1e-12 * std::sqrt(s.area)) << what << ' ' << asked;
      }
    };
    Stage in_ring, on_plane, touching, on_disc;
    ball.add_to(in_ring);
    ring.add_to(in_ring);
    expect_straight(in_ring, "ball in ring");
    thin.add_to(on_plane);
    on_plane.add(plane).fixed = true;
    expect_straight(on_plane, "ring on plane");
    high.add_to(touching);
    touching.add(plane).fixed = true;
    expect_straight(touching, "ring that touches a plane");
    disc.add_to(on_disc);
    thin.add_to(on_disc);
    expect_straight(on_disc, "ring on disc");
  }
}

TEST(MarchRule, HasTheSameBitsForAnyNumberOfThreads) {
  std::uint64_t expected = 0;
  for (const int threads : {1, 2, 3, 8}) {
    std::vector<std::unique_ptr<Shape>> rings;
    const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
    Stage stage;
    for (int i = 0; i < 24; ++i) {
      const Vec3 place(3.0 * i, 0.01 * i, 0.105 + 0.001 * i);
      rings.push_back(std::make_unique<Shape>(implicit::ShapeKind::Ring, 0.5 + 0.02 * (i % 5), 0.3, Pose{place, Quat::Identity()}));
      rings.back()->add_to(stage);
    }
    stage.add(plane).fixed = true;
    const ContactSurface& s = stage.solve({.error = 1e-3}, threads);
    EXPECT_EQ(s.summary.size(), 24u);
    Hasher hasher;
    hasher.add(std::span<const Vec3>(s.point));
    hasher.add(std::span<const double>(s.area));
    hasher.add(std::span<const double>(s.pressure));
    for (const auto& summary : s.summary) hasher.add(summary.energy);
    if (threads == 1) expected = hasher.value();
    EXPECT_EQ(hasher.value(), expected) << threads;
  }
}

}  // namespace
}  // namespace supple::collision
