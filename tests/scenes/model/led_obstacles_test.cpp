// Obstacles that keys lead along: where they are, what they do to bodies, and what is booked of it.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Simulation make(const std::string& text, const fs::path& folder = ".", SimulationOptions options = {}) {
  return Simulation(parse_scene(text, "test.yaml", folder), options);
}

SolidMotion along_x(std::vector<std::pair<double, double>> keys, LeadName between) {
  SolidMotion motion{.keys = {}, .between = between};
  for (const auto& [time, x] : keys) motion.keys.push_back({.time = time, .at = Vec3(x, 0, 0), .turn = 0.0});
  return motion;
}

TEST(SolidMotion, PassesItsKeysAndStandsStillBeyondThem) {
  for (const LeadName between : {LeadName::Smooth, LeadName::Linear}) {
    const SolidMotion motion = along_x({{1, 2}, {2, 5}, {4, 6}, {5, 6}, {6, 0}}, between);
    for (const ObstacleKeyDesc& key : motion.keys) {
      EXPECT_NEAR((place_at(motion, key.time).pose.position - key.at).norm(), 0, 1e-14);
      EXPECT_NEAR((place_at(motion, key.time - 1e-9).pose.position - key.at).norm(), 0, 1e-9 * largest_speed(motion, 0.0) + 1e-14);
    }
    for (const double time : {0.0, 0.999, 6.001, 9.0, 4.5}) {
      EXPECT_FALSE(moves(motion, time, time == 4.5 ? 4.6 : time)) << time;
      EXPECT_EQ(place_at(motion, time).velocity, Vec3::Zero().eval()) << time;
    }
    EXPECT_EQ(place_at(motion, 4.5).pose.position.x(), 6.0);
    EXPECT_TRUE(moves(motion, 1.5, 1.5));
    EXPECT_TRUE(moves(motion, 0.9, 1.1));
    EXPECT_TRUE(moves(motion, 0.0, 9.0));
  }
}

TEST(SolidMotion, HasTheVelocityOfItsPlacesAndNeverGoesBeyondAKey) {
  const double h = 1e-4;
  SolidMotion motion = along_x({{0, 0}, {1, 1}, {1.5, 1.2}, {4, 3}, {5, -1}}, LeadName::Smooth);
  for (std::size_t k = 0; k < motion.keys.size(); ++k) motion.keys[k].turn = 0.3 * static_cast<double>(k * k);
  double fastest = 0.0;
  for (double t = 0.0; t < 5.0; t += 0.0137) {
    const SolidPlace now = place_at(motion, t), before = place_at(motion, t - h), after = place_at(motion, t + h);
    const Vec3 velocity = (after.pose.position - before.pose.position) / (2 * h);
    EXPECT_NEAR(now.velocity.x(), velocity.x(), 40 * h) << t;  // where pieces join the second derivative jumps
    const Quat turned = after.pose.orientation * before.pose.orientation.conjugate();
    EXPECT_NEAR(now.spin.z(), 2 * std::asin(turned.z()) / (2 * h), 40 * h) << t;
    std::size_t k = 0;
    while (motion.keys[k + 1].time < t) ++k;
    const double way = motion.keys[k + 1].at.x() - motion.keys[k].at.x();
    EXPECT_GE(now.velocity.x() * way, -1e-12) << t;  // straight from key to key
    fastest = std::max(fastest, now.velocity.norm());
  }
  EXPECT_LE(fastest, largest_speed(motion, 0.0));
  EXPECT_GE(fastest, 0.98 * largest_speed(motion, 0.0));
}

/// A ball of linear pressure and 0.1 m between the ground and a ceiling that comes down; R is its radius.
std::string pressed(const std::string& ceiling) {
  return R"(
schema: 1
duration: 3 s
frame_rate: 50
contact: {error: 1e-8}
ground: {modulus: 1e8}
obstacles: [{name: ceiling, )" + ceiling + R"(, modulus: 1e8}]
objects:
  - name: ball
    particles: {at: [0, 0, 0.1], mass: 0.05}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]
    contact: {modulus: 1e4, dissipation: 0.5}
    medium: {linear: 5, angular: 5}
)";
}

TEST(LedObstacles, OfEveryShapePressABallBetweenThemAndTheGround) {
  const fs::path folder = temp_folder() / "led";
  fs::create_directories(folder);
  std::ofstream(folder / "flat.csv") << "x,y,z\n-1,-1,0\n1,-1,0\n-1,1,0\n1,1,0\n";
  std::ofstream slab(folder / "slab.obj");
  for (const double z : {-0.5, 0.5}) {
    for (const double y : {-2.0, 2.0}) {
      for (const double x : {-2.0, 2.0}) slab << "v " << x << ' ' << y << ' ' << z << '\n';
    }
  }
  slab << "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
  slab.close();
  // From 0.25 m to 0.18 m above the ground: as a plane that looks down, a box, a box that was turned over, a mesh, a thick plate.
  const std::string plane = "shape: plane, normal: [0, 0, -1], keys: [{time: 0.2, at: [0, 0, 0.25]}, {time: 1, at: [0, 0, 0.18]}]";
  const std::string box = "shape: box, half_sizes: [2, 2, 0.5], keys: [{time: 0.2, at: [0, 0, 0.75]}, {time: 1, at: [0, 0, 0.68]}]";
  const std::string turned = "shape: box, half_sizes: [2, 0.5, 2], turn_axis: [2, 0, 0], keys: [{time: 0.2, at: [0, 0, 0.75], turn_deg: 90}, "
                             "{time: 1, at: [0, 0, 0.68], turn_deg: 90}]";
  const std::string mesh = "shape: mesh, file: slab.obj, keys: [{time: 0.2, at: [0, 0, 0.75]}, {time: 1, at: [0, 0, 0.68]}]";
  const std::string plate = "shape: implicit, skeleton: [{shape: rectangle, half_sizes: [2, 2], kernel: {type: gascuel, radius: 0.6, thickness: 0.5, slope: 1}}], "
                            "keys: [{time: 0.2, at: [0, 0, 0.75]}, {time: 1, at: [0, 0, 0.68]}]";
  double force = 0.0;
  for (const std::string& ceiling : {plane, box, turned, mesh, plate}) {
    Simulation simulation = make(pressed(ceiling), folder);
    while (simulation.time() < 2.5) simulation.step_frame();
    ASSERT_EQ(simulation.contacts().summary.size(), 2u) << ceiling;
    const double now = simulation.contacts().summary[0].force.norm();
    if (force == 0.0) force = now;
    // The force on a rigid plane is pi E d^2 (1 - 2 d / 3 R), E the rise of pressure times R, d half of what 0.2 m are short.
    const double R = 0.1, E = 1e4 * 10 * R, d = 0.01;
    EXPECT_NEAR(now, std::numbers::pi * E * d * d * (1 - 2 * d / (3 * R)), 0.01 * now) << ceiling;  // walls give way by a thousandth
    EXPECT_NEAR(now, force, 1e-4 * force) << ceiling;
    EXPECT_LT(simulation.audits().momentum_error, 1e-10) << ceiling;
  }
}

TEST(LedObstacles, WorkThatTheyDoIsBooked) {
  // A wall drives a ball ahead of it and stops: what it did is in the ball's motion, and the error falls at least with the step squared.
  const auto error_with = [](int substeps) {
    Simulation simulation = make(R"(
schema: 1
duration: 2 s
frame_rate: 20
time_step: {substeps: )" + std::to_string(substeps) + R"(}
contact: {error: 1e-8}
obstacles: [{name: wall, shape: plane, normal: [1, 0, 0], modulus: 1e5, friction: 0, keys: [{time: 0, at: [-0.11, 0, 0]}, {time: 1, at: [0.3, 0, 0]}]}]
objects:
  - name: ball
    particles: {at: [0, 0, 0], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]
    contact: {modulus: 2e3}
)");
    while (simulation.time() < 1.5) simulation.step_frame();
    EXPECT_TRUE(simulation.contacts().summary.empty());
    const double v = simulation.state().particles.velocity[0].x();
    EXPECT_GT(v, 0.5);
    EXPECT_NEAR(simulation.state().ledger.external_work, 0.5 * 0.2 * v * v, 1e-2 * v * v);
    EXPECT_LT(simulation.audits().momentum_error, 1e-12);
    return std::abs(simulation.state().ledger.external_work - simulation.state().ledger.dissipated - 0.5 * 0.2 * v * v);
  };
  const double coarse = error_with(64), fine = error_with(128);
  EXPECT_GT(coarse / fine, 3.0);
  EXPECT_LT(fine, 1e-5);
}

TEST(LedObstacles, CarryWhatStandsOnThem) {
  // A belt at 0.3 m/s: a ball laid on it slides, mu g until it rolls; sliding friction does work.
  Simulation simulation = make(R"(
schema: 1
duration: 4 s
frame_rate: 20
gravity: [0, 0, -9.81]
contact: {error: 1e-6, friction_speed: 0.02}
obstacles: [{name: belt, shape: plane, modulus: 1e9, friction: 0.2, between: linear, keys: [{time: 0, at: [0, 0, 0]}, {time: 10, at: [3, 0, 0]}]}]
objects:
  - name: ball
    particles: {at: [0, 0, 0.0975], mass: 0.2, inertia_radius: 0.1}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]
    contact: {modulus: 1e5, friction: 0.2}
)");
  while (simulation.time() < 3.0) simulation.step_frame();
  // Rolling without slip, from rest: m v = J, I w = J h, v + w h = belt => v = belt / (1 + m h^2 / I) at the height h.
  const double h = 0.1 - std::sqrt(0.2 * 9.81 / (std::numbers::pi * 1e5));
  EXPECT_NEAR(simulation.state().particles.velocity[0].x(), 0.3 / (1 + h * h / (0.4 * 0.01)), 0.01 * 0.3);
  EXPECT_LT(simulation.audits().momentum_error, 1e-11);
  EXPECT_GT(simulation.state().ledger.dissipated, 0.0);
  EXPECT_LT(simulation.audits().energy_error, 1e-4);
}

TEST(LedObstacles, WakeWhatSleepsOnThem) {
  Simulation simulation = make(R"(
schema: 1
duration: 6 s
frame_rate: 20
gravity: [0, 0, -9.81]
sleep: {speed: 0.01, time: 0.2}
obstacles: [{name: lift, shape: box, half_sizes: [1, 1, 0.1], modulus: 1e6, keys: [{time: 3, at: [0, 0, 0]}, {time: 4, at: [0, 0, -1]}]}]
objects:
  - name: ball
    particles: {at: [0, 0, 0.199], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]
    contact: {modulus: 1e5, dissipation: 2}
)");
  while (simulation.time() < 2.9) simulation.step_frame();
  EXPECT_TRUE(simulation.state().sleep.asleep(0));
  while (simulation.time() < 5.9) simulation.step_frame();
  EXPECT_TRUE(simulation.state().sleep.asleep(0));
  EXPECT_NEAR(simulation.state().particles.position[0].z(), -0.8, 5e-3);
  EXPECT_LT(simulation.audits().momentum_error, 1e-11);
}

TEST(LedObstacles, WakeWhatTheyReachInAMotionWithinOneStep) {
  // The wall comes from beyond the ball's support into its surface between two steps, and stands.
  Simulation simulation = make(R"(
schema: 1
duration: 4 s
frame_rate: 20
time_step: {substeps: 1}
sleep: {speed: 0.01, time: 0.2}
obstacles: [{name: wall, shape: box, half_sizes: [0.1, 1, 1], modulus: 1e4, between: linear, keys: [{time: 1.01, at: [-0.3, 0, 0]}, {time: 1.04, at: [-0.18, 0, 0]}]}]
objects:
  - name: ball
    particles: {at: [0, 0, 0], mass: 2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]
    contact: {modulus: 1e3}
)");
  while (simulation.time() < 0.99) simulation.step_frame();
  EXPECT_TRUE(simulation.state().sleep.asleep(0));
  while (simulation.time() < 3.9) simulation.step_frame();
  EXPECT_GT(simulation.state().particles.position[0].x(), 0.02);
}

}  // namespace
}  // namespace supple::scenes
