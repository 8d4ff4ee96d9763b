// What contacts of pairs did, step by step, against closed forms.
#include "simulation/pair_contacts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "scenes/run_scenes.h"
#include "supple/scenes/state_bytes.h"

namespace supple::scenes {
namespace {

using PairContact = RunRecord::PairContact;

constexpr double kMass = 0.2, kRadius = 0.1, kSlope = 5.0, kModulus = 1e5, kSpeed = 0.5;
constexpr double kPressure = kSlope * kModulus;  // p = kPressure (radius - r) [Pa/m]

/// The ball of linear pressure against a rigid plane.
std::string ball_and_floor(const std::string& rest, const std::string& velocity = "[0, 0, -0.5]", const std::string& at = "[0, 0, 0.1003]", double dissipation = 0.0) {
  return R"(
schema: 1
duration: 1 s
frame_rate: 20
contact: {error: 1e-6}
obstacles: [{name: floor, shape: plane, modulus: 1e12}]
objects:
  - name: ball
    particles: {arrange: single, at: )" + at + ", velocity: " + velocity + R"(, mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e5, dissipation: )" + std::to_string(dissipation) + "}\n" + rest;
}

/// Force of the plane at a depth: pi g (a D^2 - 2 D^3 / 3); the energy is its integral.
double force_at(double depth) { return std::numbers::pi * kPressure * (kRadius * depth * depth - 2.0 / 3.0 * depth * depth * depth); }
double energy_at(double depth) { return std::numbers::pi * kPressure * (kRadius * std::pow(depth, 3) / 3.0 - std::pow(depth, 4) / 6.0); }

/// Where the kinetic energy has gone into the contact.
double turning_depth() {
  double low = 0.0, high = kRadius;
  for (int i = 0; i < 60; ++i) (energy_at(0.5 * (low + high)) < 0.5 * kMass * kSpeed * kSpeed ? low : high) = 0.5 * (low + high);
  return low;
}

/// 2 integral dD / v, with D = turning depth times 1 - s^2, so that the end where v vanishes is smooth.
double bounce_time() {
  constexpr int kSteps = 20000;
  const double deepest = turning_depth(), whole = energy_at(deepest);
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double s = (i + 0.5) / kSteps, depth = deepest * (1.0 - s * s);
    sum += 2.0 * deepest * s / std::sqrt(2.0 * (whole - energy_at(depth)) / kMass) / kSteps;
  }
  return 2.0 * sum;
}

const PairContact& only_pair(const Simulation& simulation) {
  EXPECT_EQ(simulation.state().record.pair_contacts.size(), 1u);
  return simulation.state().record.pair_contacts.at(0);
}

TEST(PairContacts, OfABounceAreThoseOfTheClosedForm) {
  Simulation simulation = make(ball_and_floor("time_step: {substeps: 512}\ngravity: [0, 0, 0]\n"));
  run(simulation, 4);
  const PairContact& pair = only_pair(simulation);
  EXPECT_EQ(pair_member_name(simulation.model(), pair.objects.a), "ball");
  EXPECT_EQ(pair_member_name(simulation.model(), pair.objects.b), "floor");
  EXPECT_EQ(pair.touches, 1u);
  EXPECT_FALSE(pair.touching);
  // Steps of 0.1 ms in a bounce of some 50 ms: Verlet and the ends of steps err by (dt / T)^2, times ten at most.
  EXPECT_NEAR(pair.contact_time / bounce_time(), 1.0, 1e-4);
  EXPECT_NEAR(pair.first_end - pair.first_begin, pair.contact_time, 1e-12);
  EXPECT_NEAR(pair.first_begin, 0.0003 / kSpeed, 1e-6);
  EXPECT_NEAR(pair.largest_depth / turning_depth(), 1.0, 1e-4);
  EXPECT_NEAR(pair.peak_force / force_at(turning_depth()), 1.0, 1e-4);
  EXPECT_NEAR(pair.peak_time, pair.first_begin + 0.5 * pair.contact_time, 2e-4);
  EXPECT_NEAR(pair.impulse.z() / (2.0 * kMass * kSpeed), 1.0, 1e-5);
  EXPECT_NEAR(pair.approach_speed, kSpeed, 1e-6);
  EXPECT_NEAR(pair.rebound_speed, kSpeed, 1e-5);
}

TEST(PairContacts, DateTheContactWithinAStep) {
  Simulation simulation = make(ball_and_floor("time_step: {substeps: 16}\ngravity: [0, 0, 0]\n"));  // steps of 3 ms, 16 in the bounce
  run(simulation, 4);
  const PairContact& pair = only_pair(simulation);
  EXPECT_NEAR(pair.contact_time / bounce_time(), 1.0, 0.01);
  EXPECT_NEAR(pair.approach_speed, kSpeed, 1e-9);  // what the first step took is given back
}

TEST(PairContacts, OfImplicitStepsAreTheirMeans) {
  Simulation simulation = make(ball_and_floor("integrator: {method: implicit_midpoint}\ntime_step: {substeps: 128}\ngravity: [0, 0, 0]\n"));
  run(simulation, 4);
  const PairContact& pair = only_pair(simulation);
  EXPECT_NEAR(pair.contact_time / bounce_time(), 1.0, 0.02);
  EXPECT_NEAR(pair.peak_force / force_at(turning_depth()), 1.0, 0.01);
  EXPECT_NEAR(pair.impulse.z(), kMass * (simulation.state().particles.velocity[0].z() + kSpeed), 1e-9);
  EXPECT_NEAR(pair.approach_speed, kSpeed, 1e-9);
  EXPECT_NEAR(pair.rebound_speed, simulation.state().particles.velocity[0].z(), 1e-12);
}

TEST(PairContacts, OfABallAtRestBalanceItsWeight) {
  Simulation simulation = make(ball_and_floor("gravity: [0, 0, -9.81]\nintegrator: {method: backward_euler}\n", "[0, 0, 0]", "[0, 0, 0.0966]", 20.0));
  run(simulation, 20);
  const PairContact& pair = only_pair(simulation);
  EXPECT_TRUE(pair.touching);
  EXPECT_LT(pair.first_end, 0.0);
  EXPECT_NEAR(pair.force.z() / (kMass * 9.81), 1.0, 1e-3);
  // Steps of 50 ms fall by 25 mm before their contact pushes back; the depth is that at their end.
  EXPECT_NEAR(pair.depth, kRadius - simulation.state().particles.position[0].z(), 1e-6);
  EXPECT_NEAR(pair.contact_time, simulation.time(), 1e-2);
}

TEST(PairContacts, OfSleepingBodiesGoOn) {
  Simulation simulation = make(ball_and_floor("gravity: [0, 0, -9.81]\nsleep: {}\n", "[0, 0, 0]", "[0, 0, 0.0966]", 20.0));
  run(simulation, 20);
  ASSERT_TRUE(simulation.state().sleep.any_asleep());
  const PairContact before = only_pair(simulation);
  run(simulation, 25);
  const PairContact& pair = only_pair(simulation);
  EXPECT_EQ(pair.touches, before.touches);
  EXPECT_TRUE(pair.touching);
  EXPECT_NEAR(pair.contact_time - before.contact_time, 5.0 / 20.0, 1e-9);
  EXPECT_NEAR((pair.impulse - before.impulse).z(), before.force.z() * 5.0 / 20.0, 1e-9);
}

constexpr const char* kTwoBalls = R"(
schema: 1
duration: 1 s
frame_rate: 20
gravity: [0, 0, 0]
time_step: {substeps: 256}
contact: {error: 1e-6}
objects:
  - name: b
    particles: {arrange: line, count: 2, spacing: 0.3, at: [0, 0, 0.21], velocity: [0, 0, -0.5], mass: 0.3}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e5}
    interactions: [{law: bond_frame, stretch: 400, rotation: 1}]
  - name: a
    particles: {arrange: line, count: 2, spacing: 0.3, at: [0, 0, 0], velocity: [0, 0, 0.5], mass: 0.1}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e5}
    interactions: [{law: bond_frame, stretch: 400, rotation: 1}]
)";

TEST(PairContacts, OfTwoObjectsHaveTheImpulseBetweenThem) {
  Simulation simulation = make(kTwoBalls);
  run(simulation, 5);
  const PairContact& pair = only_pair(simulation);
  EXPECT_EQ(pair_member_name(simulation.model(), pair.objects.a), "a");
  // Objects are numbered by name: particles 0 and 1 are those of a.
  const auto& velocity = simulation.state().particles.velocity;
  EXPECT_NEAR(pair.impulse.z(), 0.1 * (velocity[0].z() + velocity[1].z()) - 0.1, 1e-6);
  EXPECT_NEAR(pair.impulse.z(), -(0.3 * (velocity[2].z() + velocity[3].z()) + 0.3), 1e-6);
  EXPECT_NEAR(pair.approach_speed, 1.0, 1e-6);
  EXPECT_NEAR(pair.rebound_speed, 0.5 * (velocity[2].z() + velocity[3].z() - velocity[0].z() - velocity[1].z()), 1e-6);
}

TEST(PairContacts, AreKeptBySavedStates) {
  Simulation straight = make(kTwoBalls), resumed = make(kTwoBalls);
  run(straight, 5);
  run(resumed, 2);
  const StateOrigin origin = origin_of(resumed.scene());
  const std::vector<std::byte> bytes = state_bytes(resumed.state(), origin);
  Simulation fresh = make(kTwoBalls);
  fresh.restore(state_of_bytes("state", bytes, origin, {}));
  ASSERT_TRUE(fresh.state().record.pair_contacts.empty() || fresh.state().record.pair_contacts[0].touches > 0);
  run(fresh, 5);
  EXPECT_EQ(state_bytes(fresh.state(), origin), state_bytes(straight.state(), origin));
}

}  // namespace
}  // namespace supple::scenes
