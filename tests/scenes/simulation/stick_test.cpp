// Friction that holds: what should stay stays, what should slide slides, and the audits know of the springs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

constexpr double kMass = 0.5, kStiffness = 5000.0, kGravity = 9.81;
constexpr double kSlope = 20.0 * std::numbers::pi / 180.0;

/// A table of three feet on a slope of 20 degrees.
std::string table(double friction, const std::string& stick) {
  const std::string normal = "[0.342020143, 0, 0.939692621]", mu = std::to_string(friction);
  const std::string foot = ", kernel: {type: wyvill, radius: 0.1}}\n";
  return "schema: 1\nduration: 4 s\nframe_rate: 24\ngravity: [0, 0, -9.81]\ncontact: {error: 1e-3" + stick +
         "}\nobjects:\n  - name: table\n    particles: {arrange: single, at: [0.025823, 0, 0.070947], axis: " + normal +
         ", mass: 0.5, inertia_radius: 0.12}\n    skeleton:\n      - {shape: point, at: [0.1, 0, -0.03]" + foot +
         "      - {shape: point, at: [-0.06, -0.09, -0.03]" + foot + "      - {shape: point, at: [-0.06, 0.09, -0.03]" + foot +
         "    contact: {modulus: 5e4, friction: " + mu + ", dissipation: 1}\nobstacles:\n  - {name: slope, shape: plane, normal: " +
         normal + ", friction: " + mu + ", modulus: 1e9}\n";
}
const std::string kStick = ", stick: {stiffness: 5e3, damping: 0.5 ms}";

Simulation make(const std::string& text, int threads = 1) {
  return Simulation(parse_scene(text, "test.yaml", "."), {.threads = threads});
}
double down(const Simulation& s) {
  const Vec3& x = s.state().particles.position[0];
  return std::cos(kSlope) * x.x() - std::sin(kSlope) * x.z();
}
void run(Simulation& s, int frames) {
  for (int i = 0; i < frames; ++i) s.step_frame();
}

TEST(Stick, HoldsATableBelowTheAngleOfFriction) {
  Simulation s = make(table(0.5, kStick));  // tan 20 deg = 0.364
  run(s, 72);
  const double settled = down(s);
  run(s, 12);
  // What is left of the landing is slower than 1e-5 m/s (below) at more than 50 rad/s.
  EXPECT_LT(std::abs(down(s) - settled), 2e-6);
  // At rest the spring alone carries the weight along the slope: m g sin / k of way.
  ASSERT_EQ(s.state().sticks.spring.size(), 1u);
  const double way = kMass * kGravity * std::sin(kSlope) / kStiffness;
  EXPECT_NEAR(s.state().sticks.spring[0].displacement[0].norm(), way, 1e-3 * way);
  EXPECT_LT(s.state().particles.velocity[0].norm(), 1e-5);
  const RunRecord& r = s.state().record;
  EXPECT_LT(r.momentum_error, 1e-12 * r.momentum_scale * std::sqrt(static_cast<double>(s.state().steps)));
  EXPECT_LT(r.angular_momentum_error, 1e-11 * r.angular_momentum_scale);
  EXPECT_LT(r.energy_error, 2e-3 * r.largest_energy);
  EXPECT_LT(r.energy_returned, 1e-8 * r.largest_energy);  // springs give back what they hold, step by step
  EXPECT_GT(s.state().ledger.dissipated, 0.0);

  Simulation creeps = make(table(0.5, "") + "integrator: {method: symplectic}\n");
  run(creeps, 30);
  const double before = down(creeps);
  run(creeps, 24);
  EXPECT_GT(down(creeps) - before, 1e-3);
}

TEST(Stick, LetsATableSlideAboveItWithTheAccelerationOfCoulomb) {
  Simulation s = make(table(0.2, kStick));
  run(s, 12);
  const double begin = down(s);
  const Vec3 v = s.state().particles.velocity[0];
  const double speed = std::cos(kSlope) * v.x() - std::sin(kSlope) * v.z();
  run(s, 24);
  // s = v t + a t^2 / 2, a = g (sin - mu cos); feet still rock a little after the landing.
  const double way = speed + 0.5 * kGravity * (std::sin(kSlope) - 0.2 * std::cos(kSlope));
  EXPECT_NEAR(down(s) - begin, way, 0.01 * way);
}

TEST(Stick, LetsAStackOfTenInAShaftThatGrowsHeavierUpwardFallAsleep) {
  std::string text = "schema: 1\nduration: 5 s\nframe_rate: 24\ngravity: [0, 0, -9.81]\nsleep: {speed: 0.01, time: 0.3}\n"
                     "contact: {error: 1e-2, stick: {stiffness: 5e3, damping: 2 ms}}\nground: {height: 0, modulus: 1e6}\nobstacles:\n";
  const char* const walls[] = {"[-0.105, 0, 0], normal: [1, 0, 0]", "[0.105, 0, 0], normal: [-1, 0, 0]",
                               "[0, -0.105, 0], normal: [0, 1, 0]", "[0, 0.105, 0], normal: [0, -1, 0]"};
  for (int k = 0; k < 4; ++k) {
    text += "  - {name: wall" + std::to_string(k) + ", shape: plane, modulus: 1e6, friction: 0.5, at: " + walls[k] + "}\n";
  }
  text += "objects:\n";
  double mass = 0.1, weight = 0.0;
  for (int k = 0; k < 10; ++k) {
    text += "  - name: ball" + std::to_string(k) + "\n    particles: {arrange: single, at: [" + std::to_string(k % 2 == 0 ? 0.002 : -0.002) +
            ", " + std::to_string(0.0015 * (k % 3 - 1)) + ", " + std::to_string(0.1 + 0.2 * k) + "], mass: " + std::to_string(mass) +
            "}\n    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]\n"
            "    contact: {modulus: 2e5, friction: 0.5, dissipation: 2}\n";
    weight += kGravity * mass;
    mass *= 1.3;
  }
  Simulation s = make(text);
  run(s, 60);
  const auto& island = s.state().sleep.island;
  EXPECT_EQ(island, std::vector<std::uint32_t>(10, 0));  // one island, asleep
  for (std::size_t k = 1; k < 10; ++k) EXPECT_GT(s.state().particles.position[k].z(), s.state().particles.position[k - 1].z());
  // Ground and walls carry the weight: what is left over moves bodies that fall asleep at less than the speed of the rule.
  Vec3 carried = Vec3::Zero();
  const auto& surface = s.contacts();
  for (std::size_t k = 0; k < surface.summary.size(); ++k) {
    if (surface.summary[k].bodies.b >= 10) carried += s.contact_forces()[k];
  }
  EXPECT_NEAR(carried.z(), weight, 0.02 * weight);
}

TEST(Stick, LetsAHundredBallsInABinComeToRestAndSleep) {
  const std::vector<std::string> finer{"accuracy=2.5e-3"};
  Simulation s(read_scene(source_dir() / "scenes/library/contacts/pile_rests.yaml", finer), {.threads = 2});
  run(s, 73);  // three seconds
  const State& state = s.state();
  ASSERT_EQ(state.particles.position.size(), 100u);
  EXPECT_EQ(std::count(state.sleep.island.begin(), state.sleep.island.end(), collision::SleepState::kAwake), 0);
  for (std::size_t k = 0; k < 100; ++k) {
    const Vec3& x = state.particles.position[k];
    EXPECT_EQ(state.particles.velocity[k], Vec3::Zero());
    // A ball pressed in by a quarter of its radius carries pi E R^2 / 16 (1 - 1/6) = 8.2 N, the weight of 17.
    EXPECT_GT(x.z(), 0.75 * 0.05);
    EXPECT_LT(std::max(std::abs(x.x()), std::abs(x.y())), 0.32 - 0.75 * 0.05);
  }
  EXPECT_LT(s.audits().energy_error, 1e-3);
  EXPECT_LT(s.audits().momentum_error, 1e-11);
}

TEST(Stick, GoesOnFromASavedStateWithTheSameBits) {
  Simulation whole = make(table(0.5, kStick)), first = make(table(0.5, kStick)), second = make(table(0.5, kStick), 2);
  run(whole, 12);
  run(first, 6);
  const std::filesystem::path file = temp_folder() / "stick.state";
  save_state(file, first.state(), {.scene = 7});
  second.restore(load_state(file, {.scene = 7}));
  std::filesystem::remove(file);
  ASSERT_FALSE(second.state().sticks.spring.empty());
  run(second, 6);
  EXPECT_EQ(second.state_hash(), whole.state_hash());
}

}  // namespace
}  // namespace supple::scenes
