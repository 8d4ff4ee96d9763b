#include <gtest/gtest.h>

#include <array>
#include <random>

#include "collision/bodies.h"
#include "supple/implicit/solids.h"

namespace supple::collision {
namespace {

using testing::Linear;
using testing::LinearSphere;
using testing::sphere_samples;
using testing::Stage;

double uniform(std::mt19937_64& engine, double low, double high) {
  return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
}

TEST(OverlappingBoxes, AreThoseThatBruteForceFinds) {
  std::mt19937_64 engine(11);
  const Executor one(1), three(3);
  constexpr double kFar = std::numeric_limits<double>::infinity();
  for (const double longest : {0.0, 0.05, 0.4, 3.0}) {     // points, small ones, middling ones, and some across everything
    for (const Vec3& spread : {Vec3(10, 4, 1), Vec3(1, 1, 1), Vec3(0, 0, 5), Vec3(0, 0, 0)}) {
      std::vector<Box> boxes;
      for (int i = 0; i < 400; ++i) {
        const Vec3 at(uniform(engine, -1, 1), uniform(engine, -1, 1), uniform(engine, -1, 1));
        const Vec3 half(uniform(engine, 0, 1), uniform(engine, 0, 1), uniform(engine, 0, 1));
        const Vec3 centre = at.cwiseProduct(spread), reach = (i % 40 == 0 ? 4.0 : 0.5) * longest * half;
        boxes.push_back({centre - reach, centre + reach});
      }
      boxes.push_back({});
      boxes.push_back({Vec3(-kFar, -kFar, -kFar), Vec3(kFar, kFar, -0.5)});
      boxes.push_back({Vec3(-kFar, -kFar, -kFar), Vec3(kFar, kFar, kFar)});
      std::vector<BodyPair> expected;
      for (std::uint32_t a = 0; a < boxes.size(); ++a) {
        for (std::uint32_t b = a + 1; b < boxes.size(); ++b) {
          if (!boxes[a].empty() && !boxes[b].empty() && boxes[a].overlaps(boxes[b])) expected.push_back({a, b});
        }
      }
      EXPECT_EQ(overlapping_boxes(boxes, one), expected) << longest << ' ' << spread.transpose();
      EXPECT_EQ(overlapping_boxes(boxes, three), expected) << longest << ' ' << spread.transpose();
    }
  }
  EXPECT_TRUE(overlapping_boxes({}, one).empty());
}

TEST(OverlapList, GivesTheSamePairsWhileBoxesMoveALittleAndALot) {
  std::mt19937_64 engine(12);
  const Executor executor(1);
  constexpr double kFar = std::numeric_limits<double>::infinity();
  std::vector<Box> boxes;
  const auto random = [&](double size) { return Vec3(uniform(engine, -size, size), uniform(engine, -size, size), uniform(engine, -size, size)); };
  for (int i = 0; i < 200; ++i) {
    const Vec3 centre = random(1.0), half = Vec3::Constant(0.2) + random(0.1);
    boxes.push_back({centre - half, centre + half});
  }
  boxes.push_back({});
  boxes.push_back({Vec3(-kFar, -kFar, -kFar), Vec3(kFar, kFar, -0.5)});
  OverlapList list;
  std::vector<BodyPair> found;
  for (int step = 0; step < 60; ++step) {
    list.find(boxes, executor, found);
    ASSERT_EQ(found, overlapping_boxes(boxes, executor)) << step;
    // Less than a margin at a time, but far in the end; now and then one jumps, and boxes come and go.
    for (Box& box : boxes) {
      const Vec3 move = random(3e-3) + Vec3(2e-3, 0, 0);
      box = {box.lower + move, box.upper + move};
    }
    if (step % 10 == 5) boxes[static_cast<std::size_t>(step)] = {Vec3(-0.3, -0.3, -0.3), Vec3(0.3, 0.3, 0.3)};
    if (step % 20 == 9) boxes.pop_back();
    if (step % 20 == 19) boxes.push_back({Vec3(-0.1, -0.1, -2.0), Vec3(0.1, 0.1, 2.0)});
  }
}

TEST(BroadPhase, FindsThePairsThatBruteForceFinds) {
  std::mt19937_64 engine(3);
  std::vector<LinearSphere> spheres;
  for (int i = 0; i < 80; ++i) {
    const Vec3 x(uniform(engine, -3, 3), uniform(engine, -1, 1), uniform(engine, -1, 1));
    spheres.push_back({x, Linear{uniform(engine, 0.05, 0.6), 1.0}});
  }
  const implicit::HalfSpace ground{Vec3(0, 0, -0.8), Vec3::UnitZ(), 1.0}, wall{Vec3(-3, 0, 0), Vec3::UnitX(), 1.0};
  Stage stage;
  for (const LinearSphere& s : spheres) stage.add(s);
  stage.add(ground).fixed = true;
  stage.add(wall).fixed = true;
  stage.rules.allowed = [](std::uint32_t a, std::uint32_t b) { return (a + b) % 5 != 0; };
  std::vector<BodyPair> expected;
  for (std::uint32_t a = 0; a < stage.bodies().size(); ++a) {
    for (std::uint32_t b = a + 1; b < stage.bodies().size(); ++b) {
      const bool both_fixed = stage.bodies()[a].fixed && stage.bodies()[b].fixed;
      if (both_fixed || (a + b) % 5 == 0) continue;
      if (stage.bodies()[a].field.surface_box().overlaps(stage.bodies()[b].field.surface_box())) {
        expected.push_back({a, b});
      }
    }
  }
  EXPECT_EQ(broad_phase(stage.bodies(), stage.rules, Executor(1)), expected);
  EXPECT_GT(expected.size(), 50u);
}

TEST(FindContacts, SeedsAnOverlapMuchSmallerThanTheSampleSpacing) {
  std::mt19937_64 engine(4);
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3 direction = Vec3(uniform(engine, -1, 1), uniform(engine, -1, 1), uniform(engine, -1, 1)).normalized();
    const double delta = 1e-7;
    const LinearSphere left{Vec3::Zero(), Linear{1.0, 1.0}}, right{(1.7 - delta) * direction, Linear{0.7, 1.0}};
    const auto left_samples = sphere_samples(left.centre, 1.0, 200), right_samples = sphere_samples(right.centre, 0.7, 100);
    Stage stage;
    stage.add(left).samples = &left_samples;
    stage.add(right).samples = &right_samples;
    const ContactSurface& s = stage.solve();
    ASSERT_EQ(s.summary.size(), 1u) << trial;
    EXPECT_EQ(s.summary[0].rule, ContactRule::Polar);
    EXPECT_NEAR(s.summary[0].largest_overlap, delta, 1e-3 * delta);
  }
}

TEST(FindContacts, LeavesOutPairsWhoseSamplesAreFarFromTheOtherSurface) {
  // The boxes overlap, the spheres do not.
  const LinearSphere left{Vec3::Zero(), Linear{1.0, 1.0}}, right{Vec3(1.3, 1.3, 1.3), Linear{1.0, 1.0}};
  const auto left_samples = sphere_samples(left.centre, 1.0, 400), right_samples = sphere_samples(right.centre, 1.0, 400);
  Stage stage;
  stage.add(left).samples = &left_samples;
  stage.add(right).samples = &right_samples;
  stage.solve();
  EXPECT_EQ(broad_phase(stage.bodies(), stage.rules, Executor(1)).size(), 1u);
  EXPECT_TRUE(stage.candidates.pair.empty());
}

TEST(FindContacts, GivesTheSameForceForAnyNumberOfSamples) {
  // The ascent ends within 1e-6 of the patch of its peak, where the pressure is less by 1e-12 of itself, and the quadrature
  // does not feel its pole's place.
  const LinearSphere left{Vec3::Zero(), Linear{1.0, 1.0}}, right{Vec3(1.0, 0.9, 0.8), Linear{0.7, 3.0}};
  const double peak = (1.7 - right.centre.norm()) / (1.0 + 1.0 / 3.0);  // springs in series on the axis
  double force = 0.0;
  for (const int count : {60, 200, 1000}) {
    const auto left_samples = sphere_samples(left.centre, 1.0, count), right_samples = sphere_samples(right.centre, 0.7, count);
    Stage stage;
    stage.add(left).samples = &left_samples;
    stage.add(right).samples = &right_samples;
    const ContactSurface& s = stage.solve({.error = 1e-4});
    ASSERT_EQ(s.summary.size(), 1u);
    EXPECT_EQ(s.summary[0].rule, ContactRule::Polar);
    EXPECT_NEAR(s.summary[0].largest_pressure, peak, 1e-11 * peak);
    if (force > 0.0) {
      EXPECT_NEAR(s.summary[0].force.norm(), force, 1e-9 * force);
    }
    force = s.summary[0].force.norm();
  }
}

/// A body of one primitive in a pose.
struct Shaped {
  implicit::Field field;
  Shaped(implicit::ShapeKind shape, const Vec3& size, const Pose& pose) {
    implicit::Skeleton skeleton;
    implicit::Primitive p;
    p.shape = shape;
    p.size = size;
    p.kernel = implicit::Kernel::gascuel(0.2, 0.5, 2.5);
    skeleton.primitive.push_back(p);
    skeleton.part_count = 1;
    implicit::PlacedSkeleton placed;
    implicit::place_skeleton(skeleton, {&pose, 1}, placed);
    implicit::index_field(skeleton, placed, field);
  }
};

TEST(ConvexBodies, MeetWithoutSamplesWithTheForceThatAScanFinds) {
  using implicit::ShapeKind;
  std::mt19937_64 engine(11);
  const auto vector = [&](double r) {
    return Vec3(uniform(engine, -r, r), uniform(engine, -r, r), uniform(engine, -r, r));
  };
  const std::array<ShapeKind, 5> shapes{ShapeKind::Point, ShapeKind::Segment, ShapeKind::Rectangle, ShapeKind::Disc, ShapeKind::Box};
  int touching = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const auto draw = [&](const Vec3& place) {
      const Pose pose{place, Quat(Eigen::AngleAxisd(uniform(engine, 0, 3), vector(1).normalized()))};
      return Shaped(shapes[engine() % shapes.size()], Vec3(0.3, 0.2, 0.15), pose);
    };
    const Shaped a = draw(Vec3::Zero()), b = draw(vector(0.5));
    Stage stage;
    for (const Shaped* body : {&a, &b}) stage.add(body->field);
    const ContactSurface found = stage.solve({.error = 3e-2, .max_refinement = 2});
    if (stage.candidates.pair.empty() || stage.candidates.convex[0] == 0) continue;  // apart, or the cores meet
    ASSERT_EQ(stage.candidates.seed.size(), 1u);
    ContactCandidates scanned = stage.candidates;
    scanned.convex[0] = 0;
    scanned.seed.clear();
    scanned.offset = {0, 0};
    ContactSurface expected;
    solve_contact_surface(stage.bodies(), scanned, {.error = 3e-2, .max_refinement = 2}, Executor(1), expected);
    if (expected.summary.empty()) continue;  // a scan may miss what is thinner than its mesh
    ASSERT_EQ(found.summary.size(), 1u) << trial;
    ++touching;
    // Where cores are well apart, the seed of an overlap lies in it.
    if (found.summary[0].largest_overlap > 0.02) {
      EXPECT_GT(implicit::FieldView(a.field).value(stage.candidates.seed[0]), 0.0) << trial;
      EXPECT_GT(implicit::FieldView(b.field).value(stage.candidates.seed[0]), 0.0) << trial;
    }
    const auto &x = found.summary[0], &y = expected.summary[0];
    const double error = 1.5 * (x.error_estimate + y.error_estimate);
    EXPECT_LE((x.force - y.force).norm(), error * y.force.norm()) << trial;
  }
  EXPECT_GT(touching, 25);
}

TEST(ConvexBodies, AreFoundAtAnyDepth) {
  // A ball over the middle of a plate: the overlap is a lens of depth 1e-9 to .1.
  for (const double depth : {1e-9, 1e-6, 1e-3, 0.1}) {
    const Shaped plate(implicit::ShapeKind::Rectangle, Vec3(0.3, 0.3, 0), {});
    const Shaped ball(implicit::ShapeKind::Point, Vec3::Zero(), {Vec3(0.05, -0.07, 0.4 - depth), Quat::Identity()});
    Stage stage;
    stage.add(plate.field);
    stage.add(ball.field);
    const ContactSurface& s = stage.solve();
    ASSERT_EQ(s.summary.size(), 1u) << depth;
    EXPECT_NEAR(s.summary[0].largest_overlap, depth, 1e-5 * depth + 1e-15);
  }
}

TEST(ContactMaterial, CombinesByGeometricMeanAndByCompliance) {
  const PairMaterial m = combine({.modulus = 1e4, .friction = 0.4, .dissipation = 0.5},
                                 {.modulus = 3e4, .friction = 0.1, .dissipation = 0.1});
  EXPECT_DOUBLE_EQ(m.friction, 0.2);
  EXPECT_DOUBLE_EQ(m.dissipation, (0.5 * 3e4 + 0.1 * 1e4) / 4e4);
}

TEST(ConvexBodies, AreLeftOutWhenCertainlyApartAndKeptAtTheLeastOverlap) {
  // Diagonal, so that the boxes overlap long before the balls do.
  const double radius = implicit::iso_distance(implicit::Kernel::wyvill(1.0), 0.5);
  const Vec3 direction = Vec3(1.0, 1.1, 0.9).normalized();
  for (const double gap : {-1e-3, -1e-8, 1e-8, 1e-3}) {
    testing::Blobs a({Vec3(0.3, 0.1, 0.2)}, 1.0), b({Vec3(0.3, 0.1, 0.2) + (2.0 * radius + gap) * direction}, 1.0);
    testing::Stage stage;
    stage.add(a.field, a.centre);
    stage.add(b.field, b.centre);
    stage.solve({.error = 1e-2});
    ASSERT_EQ(broad_phase(stage.bodies(), {}, Executor(1)).size(), 1u);
    EXPECT_EQ(stage.candidates.pair.size(), gap < 0.0 ? 1u : 0u) << gap;
    EXPECT_EQ(stage.surface.summary.size(), gap < 0.0 ? 1u : 0u) << gap;
  }
}

// Their cores are all of them, so that nothing but rounding is left between those that meet.
TEST(ConvexBodies, WithoutRoundedEdgesAreKeptWhereTheyOverlap) {
  std::mt19937_64 engine(5);
  const auto direction = [&engine] { return Vec3(uniform(engine, -1, 1), uniform(engine, -1, 1), uniform(engine, -1, 1)); };
  const auto pose = [&] { return Pose{0.05 * direction(), Quat(uniform(engine, -1, 1), uniform(engine, -1, 1), uniform(engine, -1, 1), uniform(engine, -1, 1)).normalized()}; };
  int overlapping = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Pose at_thin = pose(), at_thick = pose();
    const Vec3 thin(uniform(engine, 0.005, 0.02), 0.3, 0.3), thick(0.1, 0.3, 0.3);
    const implicit::SolidBox one(at_thin, thin, 0.0, 1.0), other(at_thick, thick, 0.0, 1.0);
    Vec3 x;
    bool overlap = false;
    for (int k = 0; k < 200 && !overlap; ++k) {
      x = at_thin.position + at_thin.orientation * thin.cwiseProduct(direction());
      overlap = implicit::FieldView(one).value(x) > 0.0 && implicit::FieldView(other).value(x) > 0.0;
    }
    if (!overlap) continue;
    ++overlapping;
    Stage stage;
    stage.add(one, {at_thin.position});
    stage.add(other, {at_thick.position});
    const auto bodies = stage.bodies();
    ContactCandidates candidates;
    find_contacts(bodies, broad_phase(bodies, {}, Executor(1)), Executor(1), candidates);
    EXPECT_EQ(candidates.pair.size(), 1u) << trial;
  }
  EXPECT_GT(overlapping, 250);
}

}  // namespace
}  // namespace supple::collision
