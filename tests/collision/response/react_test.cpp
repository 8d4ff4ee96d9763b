#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "collision/bodies.h"

namespace supple::collision {
namespace {

using testing::Blobs;
using testing::Linear;
using testing::LinearSphere;
using testing::Stage;

/// Two Wyvill points on a half-space of slope 6: the example of the splits.
struct TwoPointsOnPlane {
  Blobs points{{Vec3(-0.25, 0, 0.40), Vec3(0.25, 0, 0.36)}, 1.0};
  implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 6.0};
  Stage stage;
  TwoPointsOnPlane() {
    stage.add(points.field, points.centre);
    stage.add(plane).fixed = true;
    stage.solve({.error = 1e-8});
  }
};

TEST(React, SplitsTheForceByTheGradientOfTheEnergy) {
  // Printed to six digits; the literal split by contributions has the same total but is no gradient.
  TwoPointsOnPlane scene;
  const auto energy = scene.stage.react({.split = SplitRule::Energy})[0].force;
  EXPECT_NEAR(energy[0].z(), 0.050221, 1e-6);
  EXPECT_NEAR(energy[1].z(), 0.054719, 1e-6);
  const auto literal = scene.stage.react({.split = SplitRule::Contribution})[0].force;
  EXPECT_NEAR(literal[0].z(), 0.047338, 1e-6);
  EXPECT_NEAR(literal[1].z(), 0.057603, 1e-6);
  EXPECT_NEAR(energy[0].z() + energy[1].z(), 0.104941, 1e-6);
  EXPECT_NEAR(literal[0].z() + literal[1].z(), 0.104941, 1e-6);
}

TEST(React, GivesEveryPartMinusTheDerivativeOfTheEnergy) {
  // Central differences, h = 1e-3: h^2/6 U'''/U' ~ 2e-6 / delta^2 with delta ~ .3.
  const std::vector<Vec3> left{Vec3(-0.3, 0, 0), Vec3(0.05, 0.1, 0), Vec3(-0.2, 0.3, 0.1)};
  const std::vector<Vec3> right{Vec3(0.62, 0.15, 0.1), Vec3(0.85, -0.1, 0.3)};
  const auto make = [&](const std::vector<Vec3>& moved, double* energy) {
    const Blobs a(moved, 1.0), b(right, 1.0);
    Stage stage;
    stage.add(a.field, moved, 1.0);
    stage.add(b.field, right, 2.0);
    *energy = stage.solve({.error = 1e-9}).summary.at(0).energy;
    return stage.react()[0].force;
  };
  double energy = 0.0;
  const auto force = make(left, &energy);
  const double h = 1e-3, size = force[0].norm() + force[1].norm() + force[2].norm();
  for (std::size_t k = 0; k < left.size(); ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      double at[2];
      for (const int i : {0, 1}) {
        std::vector<Vec3> moved = left;
        moved[k][axis] += i == 0 ? -h : h;
        static_cast<void>(make(moved, &at[i]));
      }
      EXPECT_NEAR(force[k][axis], -(at[1] - at[0]) / (2.0 * h), 5e-5 * size) << k << " " << axis;
    }
  }
}

/// A stick and a ball that blend by their gradients, on a half-space.
struct StickAndBallOnPlane {
  static constexpr std::size_t kParts = 2;
  implicit::Skeleton skeleton;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 6.0};
  Stage stage;
  double energy = 0.0;

  explicit StickAndBallOnPlane(const std::array<Pose, kParts>& parts) {
    skeleton.part_count = kParts;
    skeleton.blend.rule = implicit::BlendRule::Gradient;
    skeleton.primitive.resize(kParts);
    for (std::uint32_t k = 0; k < kParts; ++k) {
      skeleton.primitive[k].part = k;
      skeleton.primitive[k].kernel = implicit::Kernel::wyvill(1.0);
    }
    skeleton.primitive[0].shape = implicit::ShapeKind::Segment;
    skeleton.primitive[0].size = Vec3(0.3, 0.0, 0.0);
    implicit::place_skeleton(skeleton, parts, placed);
    implicit::index_field(skeleton, placed, field);
    stage.add(field, {parts[0].position, parts[1].position});
    stage.add(plane).fixed = true;
    energy = stage.solve({.error = 1e-6}).summary.at(0).energy;
  }
};

TEST(React, GivesPartsOfABlendByGradientsTheTorqueOfTheEnergy) {
  // A blend by gradients sees the gradients of its parts turn: to leave that out would turn the ball, which looks the same all around.
  const std::array<Pose, 2> parts{Pose{Vec3(-0.25, 0.05, 0.33), Quat(0.9, 0.2, -0.1, 0.4).normalized()}, Pose{Vec3(0.35, -0.05, 0.38), Quat::Identity()}};
  StickAndBallOnPlane rest(parts);
  const PartLoads loads = rest.stage.react()[0];
  const double size = loads.torque[0].norm();
  ASSERT_GT(size, 0.01);
  EXPECT_LT(loads.torque[1].norm(), 1e-3 * size);
  constexpr double kStep = 1e-2;
  for (int axis = 0; axis < 3; ++axis) {
    double at[2];
    for (const int i : {0, 1}) {
      std::array<Pose, 2> turned = parts;
      turned[0].orientation = Quat(Eigen::AngleAxisd(i == 0 ? -kStep : kStep, Vec3::Unit(axis))) * parts[0].orientation;
      at[i] = StickAndBallOnPlane(turned).energy;
    }
    EXPECT_NEAR(loads.torque[0][axis], -(at[1] - at[0]) / (2.0 * kStep), 2e-3 * size) << axis;
  }
}

TEST(React, GivesPartsBeyondTheMiddleOfAStiffBodyMinusTheDerivativeOfTheEnergy) {
  // By the midpoints of cells that stay where they are.
  const std::vector<Vec3> soft{Vec3(-0.35, 0.0, 0.0), Vec3(0.3, 0.05, 0.02)}, stiff{Vec3(0.02, 0.1, 0.05)};
  constexpr double kSoft = 1.0, kStiff = 10.0, kStep = 1e-2;
  const Blobs ball(stiff, 1.0);
  const auto energy = [&](const std::vector<Vec3>& at) {
    constexpr int kCells = 100;
    const Blobs blobs(at, 0.5);
    const Box box = ball.field.surface_box();
    const Vec3 cell = box.extent() / kCells;
    double sum = 0.0;
    for (int k = 0; k < kCells; ++k) {
      for (int j = 0; j < kCells; ++j) {
        for (int i = 0; i < kCells; ++i) {
          const Vec3 x = box.lower + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5));
          sum += std::max(std::min(kSoft * implicit::FieldView(blobs.field).value(x), kStiff * implicit::FieldView(ball.field).value(x)), 0.0) * cell.prod();
        }
      }
    }
    return sum;
  };
  const Blobs blobs(soft, 0.5);
  Stage stage;
  stage.add(blobs.field, soft, kSoft);
  stage.add(ball.field, stiff, kStiff);
  stage.solve({.error = 1e-3, .energy = false});
  const std::vector<Vec3> force = stage.react()[0].force;
  const double size = force[0].norm() + force[1].norm();
  for (std::size_t k = 0; k < soft.size(); ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vec3> back = soft, forth = soft;
      back[k][axis] -= kStep;
      forth[k][axis] += kStep;
      EXPECT_NEAR(force[k][axis], -(energy(forth) - energy(back)) / (2.0 * kStep), 2e-2 * size) << k << ' ' << axis;
    }
  }
}

TEST(React, GivesABodyOfOnePartTheForceAndTorqueOfSigma) {
  // Parts away from the middles of their spheres, in motion, with friction and damping.
  const LinearSphere left{Vec3(-0.4, 0, 0), Linear{0.6, 1.0}}, right{Vec3(0.5, 0.2, 0.1), Linear{0.5, 2.0}};
  const Vec3 centre[2] = {Vec3(-0.6, 0.3, 0.2), Vec3(0.7, -0.1, 0.4)};
  Stage stage;
  stage.add(left, {centre[0]});
  stage.add(right, {centre[1]});
  for (ContactBody& body : stage.bodies()) body.material = {.modulus = 1.0, .friction = 0.5, .dissipation = 0.4};
  stage.velocity(0)[0] = Vec3(0.3, 0.2, -0.1);
  stage.spin(1)[0] = Vec3(0.5, -1.0, 0.7);
  const ContactSurface& s = stage.solve({.error = 1e-6});
  ASSERT_EQ(s.summary.size(), 1u);
  const PairMaterial material = combine(stage.bodies()[0].material, stage.bodies()[1].material);
  const double slow = 1e-3;
  const std::vector<PartLoads> loads = stage.react({.friction_speed = slow});
  Vec3 force = Vec3::Zero(), torque[2] = {Vec3::Zero(), Vec3::Zero()};
  for (std::size_t i = 0; i < s.point.size(); ++i) {
    const Vec3 v = stage.velocity(0)[0] - stage.spin(1)[0].cross(s.point[i] - centre[1]);
    const double approach = v.dot(s.normal[i]), load = s.area[i] * s.pressure[i];
    const Vec3 slide = v - approach * s.normal[i];
    const double factor = std::max(0.0, 1.0 + material.dissipation * approach);
    const Vec3 f = -load * factor * (s.normal[i] + material.friction * friction_mollifier(slide.norm(), slow) * slide.normalized());
    force += f;
    torque[0] += (s.point[i] - centre[0]).cross(f);
    torque[1] -= (s.point[i] - centre[1]).cross(f);
  }
  EXPECT_LE((loads[0].force[0] - force).norm(), 1e-13 * force.norm());
  EXPECT_LE((loads[1].force[0] + force).norm(), 1e-13 * force.norm());
  for (const std::size_t i : {0u, 1u}) EXPECT_LE((loads[i].torque[0] - torque[i]).norm(), 1e-13 * torque[i].norm()) << i;
}

/// Two bodies of several parts in motion, with friction and damping.
struct MovingBlobs {
  Blobs left{{Vec3(-0.3, 0, 0), Vec3(0.05, 0.1, 0), Vec3(-0.2, 0.3, 0.1)}, 1.0};
  Blobs right{{Vec3(0.62, 0.15, 0.1), Vec3(0.85, -0.1, 0.3)}, 1.0};
  Stage stage;
  explicit MovingBlobs(std::uint64_t seed) {
    std::mt19937_64 engine(seed);
    const auto uniform = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
    for (Blobs* blobs : {&left, &right}) {
      ContactBody& body = stage.add(blobs->field, blobs->centre, 3.0);
      body.material.friction = 0.5;
      body.material.dissipation = 0.4;
      const std::size_t i = stage.bodies().size() - 1;
      for (Vec3& v : stage.velocity(i)) v = Vec3(uniform(), uniform(), uniform());
      for (Vec3& w : stage.spin(i)) w = Vec3(uniform(), uniform(), uniform());
    }
    stage.solve({.error = 1e-4});
  }
};

TEST(React, KeepsMomentumAndAngularMomentumToRoundOff) {
  for (const SplitRule split : {SplitRule::Energy, SplitRule::Contribution}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      MovingBlobs scene(seed);
      const auto loads = scene.stage.react({.split = split});
      Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
      double size = 0.0;
      for (std::size_t i = 0; i < 2; ++i) {
        for (std::size_t k = 0; k < loads[i].force.size(); ++k) {
          force += loads[i].force[k];
          moment += scene.stage.pose(i)[k].position.cross(loads[i].force[k]) + loads[i].torque[k];
          size += loads[i].force[k].norm();
        }
      }
      EXPECT_GT(size, 0.01);
      EXPECT_LT(force.norm(), 1e-14 * size);
      EXPECT_LT(moment.norm(), 1e-14 * size);
    }
  }
}

TEST(React, DissipatesExactlyThePowerOfItsVelocityDependentLoads) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    MovingBlobs scene(seed);
    ReactionReport report;
    const auto loads = scene.stage.react({}, &report);
    for (ContactBody& body : scene.stage.bodies()) body.material.friction = body.material.dissipation = 0.0;
    const auto elastic = scene.stage.react();
    double power = 0.0, size = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t k = 0; k < loads[i].force.size(); ++k) {
        power += (loads[i].force[k] - elastic[i].force[k]).dot(scene.stage.velocity(i)[k]) +
                 (loads[i].torque[k] - elastic[i].torque[k]).dot(scene.stage.spin(i)[k]);
        size += loads[i].force[k].norm() + loads[i].torque[k].norm();
      }
    }
    EXPECT_GE(report.dissipated_power, 0.0);
    EXPECT_NEAR(power, -report.dissipated_power, 1e-13 * size);
  }
}

TEST(React, PullsASlidingBodyBackWithTheCoefficientTimesTheNormalForce) {
  const LinearSphere sphere{Vec3(0, 0, 0.9), Linear{1.0, 1.0}};
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
  Stage stage;
  stage.add(sphere, {sphere.centre}).material.friction = 0.4;
  ContactBody& ground = stage.add(plane);
  ground.fixed = true;
  ground.material.friction = 0.1;
  stage.velocity(0)[0] = Vec3(1, 0, 0);
  stage.solve();
  const auto loads = stage.react();
  // mu = sqrt(.4 .1); the plane is flat to 1e-9, so every point slides along x at full speed.
  EXPECT_NEAR(loads[0].force[0].x(), -0.2 * loads[0].force[0].z(), 1e-8);
  EXPECT_NEAR(loads[1].force[0].x(), -loads[0].force[0].x(), 1e-16);  // fixed bodies hear of their loads too

  stage.rules.overrides.push_back({{0, 1}, {.friction = 0.7, .dissipation = 0.0}});
  const auto other = stage.react();
  EXPECT_NEAR(other[0].force[0].x(), -0.7 * other[0].force[0].z(), 1e-8);
}

TEST(React, TakesNotMuchMoreThanStopsSlowBodiesWithinAStep) {
  // A ball in a wedge, whose two contacts share what stops it: 1.6 times that where it is slow, and Coulomb's force where it is fast.
  const LinearSphere sphere{Vec3::Zero(), Linear{1.0, 1.0}};
  const implicit::HalfSpace left{Vec3(0, -0.9, 0), Vec3::UnitY(), 1e9}, right{Vec3(0, 0.9, 0), -Vec3::UnitY(), 1e9};
  const PartYield yield{2.0, 5.0};
  Stage stage;
  stage.add(sphere, {sphere.centre}).yield = {&yield, 1};
  stage.add(left).fixed = true;
  stage.add(right).fixed = true;
  for (ContactBody& body : stage.bodies()) body.material.friction = 0.3;
  stage.solve();
  const double normal = -stage.react()[1].force[0].y();
  const double arm2 = stage.surface.summary.at(0).centre_of_pressure.squaredNorm(), mobility = yield.inverse_mass + arm2 * yield.inverse_inertia;
  const double slow = 1e-12;
  for (const double step : {1e-3, 1e-1}) {
    stage.velocity(0)[0] = Vec3(slow, 0, 0);
    EXPECT_NEAR(-stage.react({.friction_speed = 1e-15, .step = step})[0].force[0].x() * step * mobility, 1.6 * slow, 1e-6 * slow);
    stage.velocity(0)[0] = Vec3(1e3, 0, 0);
    EXPECT_NEAR(-stage.react({.friction_speed = 1e-15, .step = step})[0].force[0].x(), 2.0 * 0.3 * normal, 1e-6 * normal);
  }
  // A large regularisation speed of its own is kept, and so it is where nothing gives way.
  stage.velocity(0)[0] = Vec3(0.1, 0, 0);
  const double own = stage.react({.friction_speed = 10.0})[0].force[0].x();
  EXPECT_EQ(stage.react({.friction_speed = 10.0, .step = 1e-3})[0].force[0].x(), own);
  stage.bodies()[0].yield = {};
  EXPECT_EQ(stage.react({.friction_speed = 10.0, .step = 1e3})[0].force[0].x(), own);
}

TEST(React, StopsSlowBodiesOfSeveralPartsLittleByLittle) {
  // What the loads of a step do to the slip at the centre of pressure, by the contributions there.
  TwoPointsOnPlane scene;
  const std::vector<PartYield> yield{{1.0, 30.0}, {4.0, 80.0}};
  scene.stage.bodies()[0].yield = yield;
  scene.stage.bodies()[0].material.friction = scene.stage.bodies()[1].material.friction = 0.5;
  const double slow = 1e-9, step = 1e-2;
  for (Vec3& v : scene.stage.velocity(0)) v = Vec3(slow, 0, 0);
  const auto elastic = scene.stage.react({.friction_speed = 1e9});
  const auto loads = scene.stage.react({.friction_speed = 1e-15, .step = step});
  const Vec3 centre = scene.stage.surface.summary.at(0).centre_of_pressure;
  implicit::FieldParts parts;
  scene.points.field.evaluate_parts(std::span(&centre, 1), parts);
  double all = 0.0, change = 0.0;
  for (const double f : parts.value) all += f;
  for (std::size_t e = 0; e < parts.part.size(); ++e) {
    const std::size_t k = parts.part[e];
    const Vec3 force = loads[0].force[k] - elastic[0].force[k], torque = loads[0].torque[k] - elastic[0].torque[k];
    const Vec3 turned = (yield[k].inverse_inertia * torque).cross(centre - scene.points.centre[k]);
    change += step * parts.value[e] / all * (yield[k].inverse_mass * force + turned).x();
  }
  EXPECT_LT(change, -0.5 * slow);
  EXPECT_GT(change, -2.0 * slow);
}

TEST(React, PressesHarderOnApproachAndNeverPulls) {
  // Hunt & Crossley: p (1 + d v_n)_+.
  const LinearSphere sphere{Vec3(0, 0, 0.9), Linear{1.0, 1.0}};
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
  Stage stage;
  stage.add(sphere, {sphere.centre});
  stage.add(plane).fixed = true;
  stage.rules.overrides.push_back({{0, 1}, {.friction = 0.0, .dissipation = 0.5}});
  stage.solve();
  const double rest = stage.react()[0].force[0].z();
  for (const double speed : {-3.0, -1.0, 0.5, 2.0}) {  // > 0: approaching
    stage.velocity(0)[0] = Vec3(0, 0, -speed);
    EXPECT_NEAR(stage.react()[0].force[0].z(), rest * std::max(0.0, 1.0 + 0.5 * speed), 1e-9 * rest);
  }
}

TEST(React, AddsUpThePairsOfEveryBodyWithTheSameBitsForAnyThreads) {
  // A row of bodies of two parts, each on the next: more pairs than one block holds.
  constexpr std::size_t kBodies = 60;
  std::vector<std::unique_ptr<Blobs>> row;
  Stage stage;
  for (std::size_t i = 0; i < kBodies; ++i) {
    const double x = 0.9 * static_cast<double>(i), y = 0.05 * static_cast<double>(i % 3);
    row.push_back(std::make_unique<Blobs>(std::vector<Vec3>{Vec3(x, y, -0.2), Vec3(x, y, 0.2)}, 1.0));
    stage.add(row.back()->field, row.back()->centre).material.friction = 0.3;
    for (Vec3& v : stage.velocity(i)) v = Vec3(0.1, i % 2 == 0 ? 0.2 : -0.3, 0.0);
  }
  const ContactSurface& surface = stage.solve({.error = 1e-3});
  ASSERT_EQ(surface.summary.size(), kBodies - 1);
  ReactionReport one, three;
  const auto loads = stage.react({}, &one, 1), again = stage.react({}, &three, 3);
  EXPECT_EQ(one.dissipated_power, three.dissipated_power);
  EXPECT_GT(one.dissipated_power, 0.0);
  for (ContactBody& body : stage.bodies()) body.material.friction = 0.0;
  const auto elastic = stage.react({}, nullptr, 3);
  std::vector<Vec3> expected(kBodies, Vec3::Zero());
  for (const auto& s : surface.summary) {
    expected[s.bodies.a] += s.force;
    expected[s.bodies.b] -= s.force;
  }
  const double size = surface.summary.front().force.norm();
  for (std::size_t i = 0; i < kBodies; ++i) {
    EXPECT_LT((elastic[i].force[0] + elastic[i].force[1] - expected[i]).norm(), 1e-13 * size) << i;
    for (const std::size_t part : {std::size_t{0}, std::size_t{1}}) {
      EXPECT_EQ(loads[i].force[part], again[i].force[part]) << i;
      EXPECT_EQ(loads[i].torque[part], again[i].torque[part]) << i;
    }
  }
}

TEST(FrictionMollifier, RisesToOneAtTheRegularisationSpeed) {
  EXPECT_DOUBLE_EQ(friction_mollifier(0.25, 1.0), 0.4375);
  EXPECT_DOUBLE_EQ(friction_mollifier(0.5, 1.0), 0.75);
  EXPECT_DOUBLE_EQ(friction_mollifier(2.0, 1.0), 1.0);
}

}  // namespace
}  // namespace supple::collision
