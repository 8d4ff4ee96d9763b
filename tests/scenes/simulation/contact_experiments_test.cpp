// Experiments on contact against closed forms: bounces, sliding, a row of balls, and what must not happen.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <tuple>

#include "model/model_contact.h"
#include "simulation/contact_work.h"
#include "supple/scenes/contact_report.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Simulation make(const std::string& text) { return Simulation(parse_scene(text, "test.yaml", ".")); }

Simulation library(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return Simulation(read_scene(source_dir() / "scenes/library" / (name + ".yaml"), overrides));
}

/// A ball of linear pressure (half its modulus at its centre) dropped by 0.2 m, in equal steps of a millisecond or less.
std::string dropped(const std::string& rest = "", int substeps = 1, const std::string& modulus = "2e4",
                    const std::string& gravity = "-9.81", const std::string& velocity = "0") {
  return R"(
schema: 1
duration: 3 s
frame_rate: 1000
time_step: {substeps: )" + std::to_string(substeps) + R"(}
contact: {error: 1e-6}
gravity: [0, 0, )" + gravity + R"(]
obstacles: [{name: floor, shape: plane, modulus: 1e9}]
objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, 0.3], velocity: [0, 0, )" + velocity + R"(], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: )" + modulus + R"(}
)" + rest;
}

/// Speeds up over speeds down before it, bounce by bounce.
std::vector<double> restitutions(Simulation simulation, int bounces) {
  std::vector<double> found;
  double down = 0.0;
  bool below = false;
  while (static_cast<int>(found.size()) < bounces && simulation.time() < 2.9) {
    simulation.step();
    const double z = simulation.state().particles.position[0].z(), v = simulation.state().particles.velocity[0].z();
    // Speeds are taken at contact's beginning and end, at the height where both meet: z = r.
    const double speed = std::sqrt(std::max(0.0, v * v + 2.0 * 9.81 * (z - 0.1)));
    if (z > 0.1 && v < 0.0) down = speed;
    if (z <= 0.1) below = true;
    if (z > 0.1 && v > 0.0 && below) {
      found.push_back(speed / down);
      below = false;
    }
  }
  return found;
}

TEST(Bounce, LosesNothingOverFourBouncesAtAMillisecond) {
  const std::vector<double> e = restitutions(make(dropped()), 4);
  ASSERT_EQ(e.size(), 4u);
  for (const double value : e) EXPECT_NEAR(value, 1.0, 1e-3);
}

TEST(Bounce, ReboundsAsAsked) {
  // Without weight: over the time of a soft contact it takes as much as the tolerance.
  for (const double asked : {0.9, 0.5, 0.2}) {
    const std::string text = dropped("pairs: [{objects: [ball, floor], restitution: {value: " + std::to_string(asked) + ", at_speed: 2}}]\n", 16, "2e7",
                                     "0", "-2");
    Simulation simulation = make(text);
    const auto& ball = simulation.state().particles;
    while (ball.velocity[0].z() < 0.0 || ball.position[0].z() < 0.1) {
      simulation.step();
      ASSERT_LT(simulation.time(), 0.5);
    }
    EXPECT_NEAR(ball.velocity[0].z() / 2.0 / asked, 1.0, 1e-3) << asked;
  }
}

TEST(Bounce, LosesSpeedFromBounceToBounceByTheClosedForm) {
  // A stiff ball, whose weight does nothing while it touches: what is left of a speed v is the e with dissipation_for(e, v) = d.
  Simulation simulation = library("contacts/bounces");
  const double d = 0.0842;
  const auto left = [d](double v) {
    double low = 0.05, high = 1.0;
    for (int i = 0; i < 60; ++i) {
      const double e = 0.5 * (low + high);
      (dissipation_for(e, v) > d ? low : high) = e;
    }
    return 0.5 * (low + high);
  };
  double down = 0.0;
  bool below = false;
  std::vector<double> found, expected;
  while (found.size() < 4 && simulation.time() < 2.9) {
    simulation.step();
    const double z = simulation.state().particles.position[0].z(), v = simulation.state().particles.velocity[0].z();
    const double speed = std::sqrt(std::max(0.0, v * v + 2.0 * 9.81 * (z - 0.1)));  // where the ball meets the floor
    if (z > 0.1 && v < 0.0) down = speed;
    if (z <= 0.1) below = true;
    if (z > 0.1 && v > 0.0 && below) {
      found.push_back(speed);
      expected.push_back(left(down) * down);
      below = false;
    }
  }
  ASSERT_EQ(found.size(), 4u);
  EXPECT_NEAR(found[0] / std::sqrt(2.0 * 9.81), 0.8, 0.02);  // as the scene says
  for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(found[k], expected[k], 0.005 * expected[k]);
}

TEST(Contacts, AreReportedByOneCall) {
  Simulation simulation = make(R"(
schema: 1
duration: 1 s
ground: {height: 0, modulus: 1e12, friction: 0.5}
objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, 0.09], mass: 0.2, velocity: [1, 0, -0.5]}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 2e4, friction: 0.5, dissipation: 0.4}
)");
  const ContactReport report = report_contacts(simulation);
  ASSERT_EQ(report.pairs.size(), 1u);
  const ContactReport::Pair& pair = report.pairs[0];
  EXPECT_EQ(pair.a, "ball");
  EXPECT_EQ(pair.b, "ground");
  EXPECT_EQ(pair.last - pair.first, report.points.point.size());
  double area = 0.0;
  for (std::size_t i = pair.first; i < pair.last; ++i) area += report.points.area[i];
  EXPECT_NEAR(pair.area, area, 1e-12 * area);
  // One moving body, sliding without spin on a plane so stiff that the contact is flat: damping adds d times the approach of 0.5 m/s to the pressure, and friction
  // is mu times that; their power is what acts against the velocity.
  EXPECT_NEAR(pair.force.z(), pair.elastic_force.z() * (1.0 + 0.4 * 0.5), 1e-5 * pair.force.z());
  EXPECT_NEAR(pair.force.x(), -0.5 * pair.force.z(), 1e-5 * pair.force.z());
  const Vec3 velocity(1, 0, -0.5);
  EXPECT_NEAR(pair.dissipated_power, -(pair.force - pair.elastic_force).dot(velocity), 1e-5 * pair.dissipated_power);
  EXPECT_EQ(report.dissipated_power, pair.dissipated_power);
  EXPECT_EQ(report.energy, pair.energy);
  EXPECT_GT(report.energy, 0.0);
  EXPECT_LE((report.loads.force[0] - pair.force).norm(), 1e-12 * pair.force.norm());
  EXPECT_EQ(report.dissipated_work, 0.0);
  simulation.step();
  EXPECT_GT(report_contacts(simulation).dissipated_work, 0.0);
}

/// A ball that bounces without weight and loses some of its speed, beside one that only a medium brakes. @return work of the pair, lost by the ball [J]
std::array<double, 2> bounced(int substeps, bool restart = false) {
  Simulation simulation = make(dropped(R"(  - name: slow
    particles: {arrange: single, at: [5, 0, 3], velocity: [1, 0, 0], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    medium: {linear: 2}
pairs: [{objects: [ball, floor], dissipation: 0.5}]
)",
                                       substeps, "2e4", "0", "-2"));
  double work = 0.0;
  while (simulation.state().particles.velocity[0].z() < 0.0 || simulation.state().particles.position[0].z() < 0.101) {
    if (restart && simulation.state().particles.position[0].z() < 0.09) {
      const fs::path file = temp_folder() / "pair_work.state";
      save_state(file, simulation.state(), {.scene = 1});
      simulation.restore(load_state(file, {.scene = 1}));
      restart = false;
    }
    simulation.step();
    const ContactReport report = report_contacts(simulation);
    for (const ContactReport::Pair& pair : report.pairs) EXPECT_EQ(pair.dissipated_work, report.dissipated_work);
    EXPECT_GE(report.dissipated_work, work);  // kept when they are apart
    work = report.dissipated_work;
    if (simulation.time() > 0.5) break;
  }
  EXPECT_GT(simulation.state().ledger.dissipated, 1.1 * work);  // the medium's too
  return {work, 0.5 * 0.2 * (4.0 - simulation.state().particles.velocity[0].squaredNorm())};
}

TEST(Contacts, SayWhatEachPairTook) {
  std::vector<double> off;
  for (const int substeps : {2, 4, 8}) {
    const auto [work, lost] = bounced(substeps);
    EXPECT_GT(lost, 0.1);
    off.push_back(std::abs(work / lost - 1.0));
  }
  // The sum over the steps is of second order in them.
  EXPECT_LT(off[0], 1e-2);
  EXPECT_LT(off[1], 0.5 * off[0]);
  EXPECT_LT(off[2], 0.5 * off[1]);
  EXPECT_EQ(bounced(2, true), bounced(2));
}

TEST(Contacts, KeepTheirWorkByNameWhenBodiesAreNumberedAnew) {
  const Simulation simulation = make(R"(
schema: 1
duration: 1 s
ground: {height: 0}
objects:
  - name: a
    particles: {arrange: single, at: [0, 0, 5]}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
  - name: b
    particles: {arrange: single, at: [0, 0, 6]}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
)");
  const std::vector<Body>& both = simulation.bodies();
  ASSERT_EQ(both.size(), 2u);
  const std::vector<Body> other{both[1]}, turned{both[1], both[0]};
  RunRecord record;
  record.pair_work = {{{0, 1}, 1.0, 0.1}, {{0, 2}, 2.0, 0.2}, {{1, 2}, 4.0, 0.4}};  // 2: the ground
  RunRecord only_b = record;
  rename_pair_work(simulation.model(), both, other, only_b);
  ASSERT_EQ(only_b.pair_work.size(), 1u);
  EXPECT_EQ(pair_work(only_b, {0, 1}), 4.0);
  EXPECT_EQ(only_b.pair_work[0].power, 0.4);
  rename_pair_work(simulation.model(), both, turned, record);
  EXPECT_EQ(pair_work(record, {0, 1}), 1.0);
  EXPECT_EQ(pair_work(record, {0, 2}), 4.0);
  EXPECT_EQ(pair_work(record, {1, 2}), 2.0);
  EXPECT_EQ(pair_work(record, {1, 3}), 0.0);
  EXPECT_EQ(all_pair_work(record), 7.0);
}

TEST(Bounce, RestsAtTheDepthThatCarriesTheWeight) {
  // F = pi E d^2 (1 - 2 d / 3 R) for a ball of linear pressure on a rigid plane.
  Simulation simulation = make(dropped("    medium: {linear: 8, angular: 8}\n"));
  while (simulation.time() < 2.9) simulation.step();
  const double d = 0.1 - simulation.state().particles.position[0].z();
  const double force = std::numbers::pi * 1e4 * d * d * (1.0 - 2.0 * d / 0.3);
  EXPECT_NEAR(force, 0.2 * 9.81, 2e-3 * 0.2 * 9.81);  // .1 % in d
}

/// A dumbbell and a ball, pressed together by 1 to 2 cm and sliding past each other; keys of `contact` are added.
std::string dumbbell_on_ball(const std::string& contact) {
  return R"(
schema: 1
duration: 1 s
frame_rate: 100
contact: {)" + contact + R"(}
objects:
  - name: dumbbell
    particles: {arrange: line, count: 2, spacing: 0.08, axis: [1, 0, 0], at: [0.01, 0, 0.1], velocity: [0.3, 0.1, 0], mass: 0.1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.15}}]
    interactions: [{law: bond_frame, neighbours: 1, stretch: 100, rotation: 1}]
    contact: {modulus: 1e4, friction: 0.5}
  - name: ball
    particles: {arrange: single, at: [0, 0.01, 0], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.2}}]
    contact: {modulus: 2e4, friction: 0.5}
)";
}

TEST(ContactKeys, EachOfTheRulesHasItsOwnPointsAndTheSameForce) {
  Vec3 force = Vec3::Zero();
  std::vector<std::uint64_t> points;
  for (const auto& [name, rule, error] : {std::tuple{"auto", collision::ContactRule::Polar, 1e-3},
                                          {"panels", collision::ContactRule::Panels, 5e-3},
                                          {"march", collision::ContactRule::March, 2e-2}}) {
    Simulation simulation = make(dumbbell_on_ball("error: " + std::to_string(error) + ", rule: " + name));
    ASSERT_EQ(simulation.contacts().summary.size(), 1u);
    const auto& s = simulation.contacts().summary[0];
    EXPECT_EQ(s.rule, rule);
    EXPECT_LE(s.error_estimate, error);
    if (points.empty()) force = s.force;
    EXPECT_LT((s.force - force).norm(), (error + 1e-3) * force.norm()) << name;
    EXPECT_EQ(std::count(points.begin(), points.end(), s.points), 0);
    points.push_back(s.points);
    const std::string text = explain(simulation);
    EXPECT_NE(text.find(std::string("find_contacts leaves a pair; ") + name), std::string::npos) << text;
    const std::string taken = rule == collision::ContactRule::Polar ? "polar (smooth patches" : name + std::string(" (set in the scene");
    EXPECT_NE(text.find("ball, dumbbell: " + taken), std::string::npos) << text;
  }
}

TEST(Incline, SlidesByGravityLessFrictionAndStaysBelowTheFrictionAngle) {
  Simulation simulation = library("contacts/slide_on_incline");
  const Vec3 down(0.939692621, 0.0, -0.342020143);
  const std::vector<Vec3> start = simulation.state().particles.position;
  const auto way = [&](std::size_t i) { return (simulation.state().particles.position[i] - start[i]).dot(down); };
  // Averaged over the second half, after the blocks have settled on the slope.
  double early = 0.0;
  while (simulation.frame() < 25) {
    simulation.step_frame();
    if (simulation.frame() == 13) early = simulation.state().particles.velocity[0].dot(down);
  }
  const double acceleration = (simulation.state().particles.velocity[0].dot(down) - early) / 0.5;
  EXPECT_NEAR(acceleration, 9.81 * (0.342020143 - 0.2 * 0.939692621), 0.01);
  EXPECT_GT(way(0), 0.7);
  EXPECT_LT(std::abs(way(1)), 0.01);
}

/// T61: where friction mu f(v) N with f = y (2 - y), y = v / slow, carries what gravity drives, y = 1 - sqrt(1 - tan / mu).
TEST(Incline, CreepsBySolvingTheFadingFrictionAndBelowTheFrictionSpeedInFineSteps) {
  const double sine = 0.342020143, cosine = 0.939692621, mu = 0.5, friction_speed = 1e-3;
  for (const int substeps : {64, 512}) {
    // A ball that may not turn.
    Simulation simulation = make(R"(
schema: 1
duration: 1 s
frame_rate: 24
time_step: {substeps: )" + std::to_string(substeps) + R"(}
gravity: [0, 0, -9.81]
obstacles: [{name: slope, shape: plane, normal: [0.342020143, 0, 0.939692621], friction: 0.2, modulus: 1e9}]
objects:
  - name: block
    particles: {at: [0.0342020143, 0, 0.0939692621], mass: 0.5}
    pins: [{particle: 0, position: false}]
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]
    contact: {modulus: 5e4, friction: 1.25, dissipation: 2}
)");
    const auto place = [&] { return simulation.state().particles.position[0].dot(Vec3(cosine, 0.0, -sine)); };
    simulation.advance_to(19);  // by then it has come to rest on the slope
    const double before = place();
    simulation.advance_to(25);
    const double creep = (place() - before) / 0.25;
    // What a step can hold: it takes 1.6 times the slip at most, where friction rises by 2 mu N / slow and the block has m.
    const double held = 2.0 / 1.6 * mu * 9.81 * cosine / (24.0 * substeps);
    const double slow = std::max(friction_speed, held);
    EXPECT_NEAR(creep, slow * (1.0 - std::sqrt(1.0 - sine / cosine / mu)), 0.01 * creep) << substeps;
    EXPECT_EQ(creep < friction_speed, substeps == 512);
  }
}

/// Down a slope of ten degrees along x, `substeps` a frame of a 24th of a second.
std::string rolling(int substeps, const std::string& dissipation) {
  return R"(
schema: 1
duration: 1 s
time_step: {substeps: )" + std::to_string(substeps) + R"(}
gravity: [0, 0, -9.81]
obstacles: [{name: slope, shape: plane, normal: [0.17364817766693033, 0, 0.984807753012208], modulus: 1e7, friction: 0.5}]
objects:
  - name: ball
    particles: {at: [0, 0, 0.1], mass: 1}
    skeleton: [{shape: point, kernel: {radius: 0.22}}]
    contact: {modulus: 2e5, friction: 0.5, dissipation: )" + dissipation + R"(}
)";
}

TEST(RollingBall, HasTheAccelerationOfItsMomentsAndNoForceAside) {
  const double sine = 0.17364817766693033, cosine = 0.984807753012208;
  Simulation simulation = make(rolling(32, "0"));
  double height = 0.0;  // of its centre over the slope, mean
  while (simulation.frame() < 25) {
    simulation.step_frame();
    const Vec3& x = simulation.state().particles.position[0];
    height += (sine * x.x() + cosine * x.z()) / 24.0;
    const ContactReport report = report_contacts(simulation);
    ASSERT_EQ(report.pairs.size(), 1u);
    EXPECT_LT(std::abs(report.pairs[0].force.y()), 1e-12 * report.pairs[0].force.norm());
  }
  const Vec3& v = simulation.state().particles.velocity[0];
  const double inertia = simulation.model().particles.inertia[0].y();  // of a kilogram
  // It bounces by a twentieth of its radius, which changes the mean of 1 / height^2 by a hundredth of that.
  EXPECT_NEAR(cosine * v.x() - sine * v.z(), 9.81 * sine / (1.0 + inertia / (height * height)), 5e-3 * 1.2);
}

TEST(RollingBall, FeelsTheFrictionOfFinerSteps) {
  const auto frictions = [](int substeps) {
    Simulation simulation = make(rolling(substeps, "2"));
    std::vector<double> out;
    while (simulation.frame() < 25) {
      simulation.step_frame();
      const Vec3 force = report_contacts(simulation).pairs.at(0).force;
      out.push_back(0.984807753012208 * force.x() - 0.17364817766693033 * force.z());
    }
    return out;
  };
  const std::vector<double> found = frictions(32), exact = frictions(1024);
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], exact[k], 0.05 * std::abs(exact[k])) << k;
}

TEST(Cradle, PassesTheSpeedOfTheFirstBallToTheLast) {
  Simulation simulation = library("contacts/newtons_cradle");
  while (simulation.frame() < 61) simulation.step_frame();
  const auto& v = simulation.state().particles.velocity;
  EXPECT_GT(v[4].x(), 0.98);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT(std::abs(v[i].x()), 0.1);
  EXPECT_LT(simulation.audits().momentum_error, 1e-13);
  EXPECT_LT(simulation.audits().energy_error, 1e-3);
}

/// A ball that has come to rest in the ring, by one rule.
void expect_held(const char* rule, double sideways) {
  Simulation simulation = library("contacts/ball_in_ring", {"contact.error=0.1", std::string("contact.rule=") + rule, "objects.ball.particles.at=[0, 0, 0.11]",
                                                            "objects.ball.medium.linear=60", "objects.ball.contact.friction=0"});
  // Where the ball first touches the ring: surfaces lie at sqrt(1 - 2^(-1/3)) of the supports.
  const double reach = std::sqrt(1.0 - std::cbrt(0.5)) * (0.4 + 0.1);
  const double first_touch = std::sqrt(reach * reach - 0.2 * 0.2);
  EXPECT_TRUE(simulation.contacts().point.empty());
  while (simulation.frame() < 25) simulation.step_frame();
  const Vec3 at = simulation.state().particles.position[0];
  EXPECT_LT(at.z(), first_touch);
  EXPECT_GT(at.z(), first_touch - 0.03);
  EXPECT_LT(std::hypot(at.x(), at.y()), sideways);
  const Vec3 force = simulation.contact_loads().force[0];
  EXPECT_NEAR(force.z(), 9.81, 1e-5 * 9.81);
  EXPECT_LT(std::hypot(force.x(), force.y()), sideways * force.z());
}

TEST(Ring, HoldsABallThatIsTooLargeForIt) {
  expect_held("march", 1e-12);
}

TEST(SpiralHitByThreeBalls, KeepsItsMomentaAndTurnsThemBack) {
  Simulation simulation = library("contacts/spiral_three_balls", {"contact.error=1e-2"});
  const core::ParticleState start = simulation.state().particles;
  const auto& model = simulation.model();
  while (simulation.frame() < 25) simulation.step_frame();
  const Audits audits = simulation.audits();
  EXPECT_LT(audits.momentum_error, 1e-12);
  EXPECT_LT(audits.angular_momentum_error, 1e-12);
  EXPECT_LT(audits.energy_error, 1e-3);
  EXPECT_LT(audits.contact_residual, 1e-9);
  for (std::size_t i = 0; i < start.size(); ++i) {
    const Vec3 before = start.velocity[i], after = simulation.state().particles.velocity[i];
    if (before.norm() == 0.0) continue;  // the spiral
    EXPECT_LT(after.dot(before), 0.0) << model.objects[model.particles.object[i]].name;
  }
}

TEST(Tunnelling, HappensAtNoSpeedAndPhaseOfAutomaticSteps) {
  // A small ball shot at a thin plate that is held: it must not be found on the other side.
  for (const double speed : {10.0, 100.0, 600.0}) {
    for (int phase = 0; phase < 5; ++phase) {
      Simulation simulation = make(R"(
schema: 1
duration: 1 s
frame_rate: 1000
time_step: {max_substeps: 65536}
objects:
  - name: ball
    particles: {arrange: single, at: [0.013, 0.007, )" + std::to_string(0.2 + 0.2 * speed * 1e-3 * phase) +
                                   R"(], velocity: [0, 0, )" + std::to_string(-speed) + R"(], mass: 0.001}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e8}
  - name: plate
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: square, half_size: 0.3, kernel: {type: wyvill, radius: 0.06}}]
    contact: {modulus: 1e9}
    pins: [{particle: 0}]
)");
      while (simulation.frame() < 5) simulation.step_frame();
      EXPECT_GT(simulation.state().particles.position[0].z(), 0.0) << speed << ' ' << phase;
    }
  }
}

}  // namespace
}  // namespace supple::scenes
