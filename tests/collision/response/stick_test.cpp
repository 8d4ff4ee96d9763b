#include "supple/collision/stick.h"

#include <gtest/gtest.h>

#include "collision/bodies.h"

namespace supple::collision {
namespace {

using testing::Linear;
using testing::LinearSphere;
using testing::Stage;

constexpr double kStiffness = 4.0, kFriction = 0.5;
const StickRule kRule{.stiffness = kStiffness, .damping = 0.0};

/// Two balls of linear pressure, A at the origin and B above it, of one part each.
struct Balls {
  LinearSphere a{Vec3::Zero(), Linear{1.0, 100.0}}, b{Vec3(0, 0, 1.9), Linear{1.0, 100.0}};
  Stage stage;
  StickState sticks;

  Balls() {
    stage.add(a, {a.centre}, 1.0).material.friction = kFriction;
    stage.add(b, {b.centre}, 1.0).material.friction = kFriction;
    commit();
  }
  void commit() { commit_sticks(stage.bodies(), stage.rules, solve(), kRule, {}, sticks); }
  const ContactSurface& solve() {
    a.centre = stage.pose(0)[0].position;
    b.centre = stage.pose(1)[0].position;
    return stage.solve({.error = 1e-6});
  }
  [[nodiscard]] double normal_load() { return solve().summary.at(0).force.norm(); }
  /// Loads of friction alone on A and B: forces and torques about the centres.
  std::vector<PartLoads> friction(const StickRule& rule = kRule) {
    solve();
    std::vector<PartLoads> loads(2), dissipative;
    for (PartLoads& l : loads) {
      l.force.assign(1, Vec3::Zero());
      l.torque.assign(1, Vec3::Zero());
    }
    dissipative = loads;
    react({stage.bodies(), stage.rules, stage.surface, {.stick = rule}, &sticks}, Executor(1), {loads, dissipative});
    return dissipative;
  }
};

TEST(Stick, HoldsWithTheForceOfItsSpringUpToTheCoulombLimit) {
  Balls balls;
  const double limit = kFriction * balls.normal_load();
  ASSERT_GT(limit, kStiffness * 0.03);
  for (const double shift : {1e-6, 1e-3, 0.03, 0.3}) {
    balls.stage.pose(0)[0].position = Vec3(shift, 0, 0);
    balls.stage.pose(1)[0].position = Vec3(0, 0, 1.9);
    // The contact plane leans as A moves to the side: what lies in it is shift times a cosine.
    const ContactSurface::Summary& s = balls.solve().summary.at(0);
    const Vec3 normal = -s.force.normalized();
    const double across = shift * std::sqrt(1.0 - normal.x() * normal.x());
    const double expected = std::min(kStiffness * across, kFriction * s.force.norm());
    const std::vector<PartLoads> loads = balls.friction();
    EXPECT_NEAR(loads[0].force[0].norm(), expected, 1e-9 * expected) << shift;
    EXPECT_LT(loads[0].force[0].x(), 0.0);
    // Momentum and angular momentum to round-off.
    EXPECT_EQ(loads[0].force[0], -loads[1].force[0]);
    const Vec3 moment = loads[0].torque[0] + loads[1].torque[0] + balls.a.centre.cross(loads[0].force[0]) +
                        balls.b.centre.cross(loads[1].force[0]);
    EXPECT_LT(moment.norm(), 1e-14 * (1.0 + expected));
  }
}

TEST(Stick, YieldsAtTheEndOfAStepAndKeepsItsForce) {
  Balls balls;
  balls.stage.pose(0)[0].position = Vec3(0.2, 0, 0);
  const double limit = kFriction * balls.normal_load();
  ASSERT_LT(limit, kStiffness * 0.19);
  const Vec3 before = balls.friction()[0].force[0];
  EXPECT_NEAR(before.norm(), limit, 1e-12 * limit);
  balls.commit();
  const StickSpring& spring = balls.sticks.spring.at(0);
  EXPECT_NEAR(spring.displacement[0].norm(), limit / kStiffness, 1e-12);
  EXPECT_NEAR(stick_energy(kRule, balls.sticks), 0.5 * limit * limit / kStiffness, 1e-12);
  EXPECT_LT((balls.friction()[0].force[0] - before).norm(), 1e-9 * limit);
}

TEST(Stick, RidesWithBothBodies) {
  // A rigid motion of all changes neither the displacement nor the twist as the bodies see them.
  Balls balls;
  balls.stage.pose(0)[0].position = Vec3(0.01, 0.004, 0);
  balls.stage.pose(0)[0].orientation = Quat(Eigen::AngleAxisd(0.02, Vec3::UnitZ()));
  balls.commit();
  const std::vector<PartLoads> rest = balls.friction();
  ASSERT_GT(rest[0].force[0].norm(), 0.04);
  const Quat turn = Quat(0.3, -0.6, 0.5, 0.2).normalized();
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
    Pose& pose = balls.stage.pose(i)[0];
    pose = {turn * pose.position + Vec3(0.4, -0.2, 0.3), (turn * pose.orientation).normalized()};
  }
  const std::vector<PartLoads> moved = balls.friction();
  EXPECT_LT((moved[0].force[0] - turn * rest[0].force[0]).norm(), 1e-9);
  EXPECT_LT((moved[0].torque[0] - turn * rest[0].torque[0]).norm(), 1e-9);
}

TEST(Stick, HoldsAgainstTwistWithTheSquareOfTheMeanArm) {
  Balls balls;
  const auto couple_at = [&](double angle) {
    balls.stage.pose(0)[0].orientation = Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ()));
    return balls.friction()[0].torque[0].z();
  };
  // p falls as a parabola to first order of the depth, so that r^2 = b^2 / 3 and the mean arm is 8 b / 15, with b^2 = .0975.
  const double b2 = 0.0975, angle = 1e-3;
  EXPECT_NEAR(couple_at(angle), -kStiffness * b2 / 3.0 * angle, 0.02 * kStiffness * b2 / 3.0 * angle);
  EXPECT_NEAR(couple_at(-angle), kStiffness * b2 / 3.0 * angle, 0.02 * kStiffness * b2 / 3.0 * angle);
  const double most = kFriction * balls.normal_load() * 8.0 / 15.0 * std::sqrt(b2);
  EXPECT_NEAR(couple_at(2.5), -most, 0.02 * most);
}

TEST(Stick, DampsBySlidingSpeed) {
  Balls balls;
  balls.stage.velocity(0)[0] = Vec3(0.1, 0, 0);
  const std::vector<PartLoads> loads = balls.friction({.stiffness = kStiffness, .damping = 0.05});
  EXPECT_NEAR(loads[0].force[0].x(), -kStiffness * 0.05 * 0.1, 1e-9);
}

TEST(Stick, SpringsComeAndGoWithContactsButStayWithBodiesThatRest) {
  Balls balls;
  EXPECT_EQ(balls.sticks.spring.size(), 1u);
  balls.stage.pose(0)[0].position = Vec3(0.01, 0, 0);
  balls.commit();
  StateWriter out;
  balls.sticks.save(out);
  StateReader in(out.bytes());
  StickState again;
  again.load(in);
  Hasher one, other, none;
  balls.sticks.hash(one);
  again.hash(other);
  EXPECT_EQ(one.value(), other.value());
  EXPECT_NE(one.value(), none.value());
  StickState asleep = balls.sticks;
  balls.stage.pose(1)[0].position = Vec3(0, 0, 2.1);
  commit_sticks(balls.stage.bodies(), balls.stage.rules, balls.solve(), kRule, {1, 1}, asleep);
  EXPECT_EQ(asleep.spring.size(), 1u);
  commit_sticks(balls.stage.bodies(), balls.stage.rules, balls.solve(), kRule, {0, 1}, asleep);
  EXPECT_TRUE(asleep.spring.empty());
}

}  // namespace
}  // namespace supple::collision
