// Bodies that rest: what sends them to sleep, what wakes them, and that nothing but cost depends on it otherwise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <iomanip>
#include <limits>
#include <sstream>

#include "simulation/rest.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Simulation make(const std::string& text, SimulationOptions options = {}) {
  return Simulation(parse_scene(text, "test.yaml", "."), options);
}

std::string sleeping(const std::string& keys, const std::string& objects) {
  return "schema: 1\nduration: 20 s\nframe_rate: 20\ncontact: {error: 1e-2}\nsleep: {speed: 0.01, time: 0.2}\n" + keys + "objects:\n" +
         objects;
}

/// A ball of linear pressure and 0.1 m on the ground, in air that damps.
std::string ball(const std::string& name, double x, double y) {
  return "  - name: " + name + "\n    particles: {arrange: single, at: [" + std::to_string(x) + ", " + std::to_string(y) +
         ", 0.1], mass: 0.2}\n    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]\n"
         "    contact: {modulus: 2e4, friction: 0.3, dissipation: 1}\n    medium: {linear: 4, angular: 4}\n";
}

/// Everything leans towards a wall.
const std::string kGround =
    "gravity: [-3, 0, -9.4]\nground: {height: 0, modulus: 1e6}\n"
    "obstacles: [{name: wall, shape: plane, at: [-0.1, 0, 0], normal: [1, 0, 0], modulus: 1e6}]\n";

/// Two pairs, three metres apart, of a ball at the wall and one that leans on it.
std::string pairs() { return ball("a_low", 0, 0) + ball("a_top", 0.2, 0) + ball("b_low", 0, 3) + ball("b_top", 0.2, 3); }

/// A ball that rolls down to the first pair in three seconds or so.
std::string visitor() { return ball("visitor", 2.2, 0); }

bool asleep(const Simulation& simulation, const std::string& name) {
  for (std::size_t i = 0; i < simulation.bodies().size(); ++i) {
    if (simulation.bodies()[i].name == name) return simulation.state().sleep.asleep(i);
  }
  ADD_FAILURE() << name;
  return false;
}

bool all_asleep(const Simulation& simulation) {
  const auto& island = simulation.state().sleep.island;
  return std::all_of(island.begin(), island.end(), [](std::uint32_t i) { return i != collision::SleepState::kAwake; });
}

void run_until(Simulation& simulation, const std::function<bool()>& done) {
  while (simulation.time() < 10.0 && !done()) simulation.step();
  ASSERT_TRUE(done()) << simulation.time();
}

std::uint64_t visited(const Simulation& simulation, Stage stage) {
  return simulation.profile()[static_cast<std::size_t>(stage)].visited;
}

TEST(Sleep, DoesNotCatchWhatFallsSlowly) {
  // Slower than sleep.speed for a second, five times sleep.time.
  Simulation simulation = make(sleeping("gravity: [0, 0, -0.01]\n", "  - {name: a, particles: {arrange: single, mass: 0.2, inertia_radius: 0.1}}\n"));
  while (simulation.time() < 4.0) simulation.step_frame();
  EXPECT_FALSE(asleep(simulation, "a"));
  EXPECT_NEAR(simulation.state().particles.position[0].z(), -0.5 * 0.01 * 16.0, 1e-12);
}

TEST(Sleep, OfEverythingCostsNoForceEvaluation) {
  Simulation simulation = make(sleeping(kGround, pairs()));
  run_until(simulation, [&] { return all_asleep(simulation); });
  EXPECT_EQ(simulation.state().sleep.island, (std::vector<std::uint32_t>{0, 0, 2, 2}));  // the ground joins no islands
  const core::ParticleState before = simulation.state().particles;
  const Profile profile = simulation.profile();
  const double impulse = simulation.state().ledger.external_impulse.z();
  while (simulation.time() < 12.0) simulation.step_frame();
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(simulation.state().particles.position[i], before.position[i]);
    EXPECT_EQ(simulation.state().particles.velocity[i], Vec3(Vec3::Zero()));
  }
  for (const Stage stage : {Stage::Interact, Stage::PlaceSkeleton, Stage::FindContacts, Stage::Integrate}) {
    EXPECT_EQ(simulation.profile()[static_cast<std::size_t>(stage)].calls, profile[static_cast<std::size_t>(stage)].calls);
  }
  EXPECT_EQ(simulation.state().ledger.external_impulse.z(), impulse);
  EXPECT_LT(simulation.audits().momentum_error, 1e-10);
  // Four on the ground, two at the wall and two at each other: what is shown is that of the state.
  EXPECT_EQ(simulation.contacts().summary.size(), 8u);
  for (const Vec3& force : simulation.contact_forces()) EXPECT_GT(force.norm(), 0.1);
}

TEST(Sleep, EndsForTheIslandThatIsTouchedAndNoOther) {
  Simulation simulation = make(sleeping(kGround, pairs() + visitor()));
  run_until(simulation, [&] { return asleep(simulation, "a_top") && asleep(simulation, "b_top"); });
  EXPECT_TRUE(asleep(simulation, "a_low"));
  EXPECT_FALSE(asleep(simulation, "visitor"));
  const std::uint64_t found = visited(simulation, Stage::FindContacts), placed = visited(simulation, Stage::PlaceSkeleton);
  simulation.step();
  EXPECT_LE(visited(simulation, Stage::FindContacts), found + 2);  // the visitor on the ground
  EXPECT_LE(visited(simulation, Stage::PlaceSkeleton), placed + 2);  // it alone, twice after the change

  run_until(simulation, [&] { return !asleep(simulation, "a_top"); });
  EXPECT_FALSE(asleep(simulation, "a_low"));
  EXPECT_TRUE(asleep(simulation, "b_low"));
  EXPECT_TRUE(asleep(simulation, "b_top"));
  const auto& x = simulation.state().particles.position;
  EXPECT_NEAR((x[4] - x[1]).norm(), 0.2, 0.005);  // less than what the visitor goes in a step
  const Vec3 far = simulation.state().particles.position[3];
  run_until(simulation, [&] { return all_asleep(simulation); });
  EXPECT_EQ(simulation.state().particles.position[3], far);
  EXPECT_LT(simulation.audits().momentum_error, 1e-10);
  EXPECT_LT(simulation.audits().angular_momentum_error, 1e-10);
  EXPECT_EQ(simulation.state().sleep.island, (std::vector<std::uint32_t>{0, 0, 2, 2, 0}));
}

TEST(Sleep, HasTheSameBitsForAnyThreadsAndWhenContinued) {
  const std::string scene = sleeping(kGround, pairs() + visitor());
  const auto run = [](Simulation& simulation, int frames) {
    while (simulation.frame() < frames) simulation.step_frame();
    return simulation.state_hash();
  };
  Simulation whole = make(scene);
  // Saved while one pair sleeps and the other does not, then with everything awake, then with everything asleep.
  std::vector<State> saved;
  const std::vector<int> frames{20, 50, 62, 70, 110};
  for (const int frame : frames) {
    run(whole, frame);
    saved.push_back(whole.state());
  }
  const std::uint64_t hash = run(whole, 140);
  EXPECT_TRUE(std::any_of(saved.begin(), saved.end(), [](const State& s) {
    return s.sleep.any_asleep() && std::count(s.sleep.island.begin(), s.sleep.island.end(), collision::SleepState::kAwake) > 0;
  }));
  const fs::path file = temp_folder() / "sleep.state";
  for (const State& state : saved) {
    save_state(file, state, {.scene = 7});
    Simulation continued = make(scene, {.threads = 2});
    continued.restore(load_state(file, {.scene = 7}));
    EXPECT_EQ(run(continued, 140), hash);
  }
  fs::remove(file);
  Simulation threads = make(scene, {.threads = 3});
  EXPECT_EQ(run(threads, 140), hash);
}

TEST(Sleep, KeepsTheMomentumOfACollision) {
  // Free balls in a row, no weight: the second and third sleep until they are hit.
  const auto free_ball = [](const std::string& name, double x, double speed) {
    return "  - name: " + name + "\n    particles: {arrange: single, at: [" + std::to_string(x) + ", 0.01, 0], velocity: [" +
           std::to_string(speed) + ", 0, 0], mass: 0.1}\n    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n"
           "    contact: {modulus: 5e3}\n";
  };
  const std::string objects = free_ball("a", 0, 1) + free_ball("b", 1, 0) + free_ball("c", 1.5, 0);
  Simulation simulation = make(sleeping("", objects));
  run_until(simulation, [&] { return asleep(simulation, "b") && asleep(simulation, "c"); });
  const core::Motion start = core::measure_motion(simulation.model().particles, simulation.state().particles);
  run_until(simulation, [&] { return !asleep(simulation, "b"); });
  EXPECT_TRUE(asleep(simulation, "c"));
  run_until(simulation, [&] { return simulation.state().particles.velocity[2].x() > 0.99; });
  const core::Motion end = core::measure_motion(simulation.model().particles, simulation.state().particles);
  EXPECT_LE((end.momentum - start.momentum).norm(), 1e-13 * start.momentum_scale);
  EXPECT_LE((end.angular_momentum - start.angular_momentum).norm(), 1e-13 * start.momentum_scale);
  // Nothing that was hit remembers that it slept.
  Simulation awake = make("schema: 1\nduration: 20 s\nframe_rate: 20\ncontact: {error: 1e-2}\nobjects:\n" + objects);
  while (awake.time() < simulation.time()) awake.step();
  EXPECT_NEAR(simulation.state().particles.velocity[2].x(), awake.state().particles.velocity[2].x(), 1e-9);
}

TEST(Rest, IsMeasuredOverTheMassOfABody) {
  const Simulation simulation = make(
      "schema: 1\nduration: 1 s\nframe_rate: 20\ngravity: [0, 0, -9.8]\nobjects:\n"
      "  - name: pair\n    particles: {arrange: line, count: 2, spacing: 0.4, mass: 0.25, velocity: [0, 2, 0]}\n"
      "    skeleton: [{shape: point, kernel: {radius: 0.2}}]\n"
      "    loads: [{particle: 1, force: [3, 0, 0], from: 0 s, until: 0.5 s}]\n");
  const auto motion = [&](double time) {
    return motions_of(simulation.bodies(), {0}, simulation.model().particles, simulation.state().particles, simulation.laws(), time)[0];
  };
  EXPECT_DOUBLE_EQ(motion(0.2).energy, 2.0);
  EXPECT_TRUE(motion(0.2).velocity.isApprox(Vec3(0, 2, 0), 1e-15));
  EXPECT_TRUE(motion(0.2).load.isApprox(Vec3(6, 0, -9.8), 1e-15));
  EXPECT_TRUE(motion(0.7).load.isApprox(Vec3(0, 0, -9.8), 1e-15));
}

TEST(Sleep, EndsWhenALoadChanges) {
  const std::string object =
      "  - name: rod\n    particles: {arrange: line, count: 2, spacing: 0.3, mass: 0.1}\n"
      "    interactions: [{law: bond_frame, stretch: 50, rotation: 0.2}]\n"
      "    loads: [{particle: 0, force: [0.5, 0, 0], from: 1 s, until: 2 s}]\n";
  const std::string head = "schema: 1\nduration: 20 s\nframe_rate: 20\ntime_step: {substeps: 16}\n";
  Simulation simulation = make(head + "sleep: {speed: 0.01, time: 0.2}\nobjects:\n" + object);
  Simulation awake = make(head + "objects:\n" + object);
  const auto step_both = [&](double until) {
    while (simulation.time() < until) {
      simulation.step();
      awake.step();
    }
  };
  step_both(0.95);
  EXPECT_TRUE(asleep(simulation, "rod"));
  const std::uint64_t pairs = visited(simulation, Stage::Interact);
  step_both(0.98);
  EXPECT_EQ(visited(simulation, Stage::Interact), pairs);
  step_both(2.5);
  EXPECT_FALSE(asleep(simulation, "rod"));
  EXPECT_GT(simulation.state().particles.position[0].x(), 0.3);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(simulation.state().particles.position[i], awake.state().particles.position[i]);
}

TEST(Sleep, EndsWhenALoadBeginsAtTheTimeOfAFrame) {
  // At all of these times; a twenty-fourth of a second is no binary fraction, so steps meet up to rounding only.
  for (int frame = 12; frame <= 60; ++frame) {
    std::ostringstream from;
    from << std::setprecision(17) << frame / 24.0;
    const std::string head = "schema: 1\nduration: 4 s\nframe_rate: 24\n", object =
        "objects:\n  - name: a\n    particles: {arrange: single, mass: 0.2, inertia_radius: 0.1}\n    loads: [{particle: 0, force: [5, 0, 0], from: " +
        from.str() + " s}]\n";
    Simulation simulation = make(head + "sleep: {speed: 0.02, time: 0.2}\n" + object), awake = make(head + object);
    while (simulation.frame() < frame) simulation.step_frame();
    EXPECT_TRUE(asleep(simulation, "a"));
    simulation.advance_to(73);
    awake.advance_to(73);
    EXPECT_EQ(simulation.state().particles.position[0].x(), awake.state().particles.position[0].x()) << frame;
    const double t = 3.0 - frame / 24.0, way = 0.5 * 25.0 * t * t;
    const double rounding = static_cast<double>(awake.state().steps) * std::numeric_limits<double>::epsilon();
    EXPECT_NEAR(awake.state().particles.position[0].x(), way, rounding * way) << frame;
  }
}

TEST(Sleep, EndsByAnImpulse) {
  Simulation simulation = make(sleeping(kGround, pairs()));
  run_until(simulation, [&] { return all_asleep(simulation); });
  State state = simulation.state();
  state.particles.velocity[1].x() = 0.5;
  simulation.restore(state);
  EXPECT_FALSE(asleep(simulation, "a_low"));
  EXPECT_FALSE(asleep(simulation, "a_top"));
  EXPECT_TRUE(asleep(simulation, "b_low"));
}

TEST(Sleep, EndsByAnotherPlace) {
  Simulation simulation = make(sleeping(kGround, pairs()));
  run_until(simulation, [&] { return all_asleep(simulation); });
  std::vector<Vec3> position = simulation.state().particles.position;
  position[1].z() += 0.01;
  simulation.set_particles({.position = position});
  EXPECT_FALSE(asleep(simulation, "a_low"));
  EXPECT_FALSE(asleep(simulation, "a_top"));
  EXPECT_TRUE(asleep(simulation, "b_low"));
}

TEST(Sleep, TakesBodiesThatRepelEachOtherTogether) {
  // They touch by a law, not by surfaces: one of them alone may not rest.
  const auto particle = [](const std::string& name, double x, double speed) {
    return "  - name: " + name + "\n    particles: {arrange: single, at: [" + std::to_string(x) + ", 0, 0], velocity: [" +
           std::to_string(speed) + ", 0, 0], mass: 0.1, inertia_radius: 0.1}\n    repulsion: {force: 1, distance: 0.3, length: 0.05}\n";
  };
  Simulation simulation = make(sleeping("", particle("a", 0, 0) + particle("b", 3, -0.5)));
  while (simulation.time() < 2.0) simulation.step();
  EXPECT_FALSE(asleep(simulation, "a"));
  Simulation alone = make(sleeping("", particle("a", 0, 0) + particle("b", 3, 0)));
  while (alone.time() < 1.0) alone.step();
  EXPECT_TRUE(all_asleep(alone));
}

TEST(Sleep, IsOffUnlessAskedFor) {
  Simulation simulation = make("schema: 1\nduration: 4 s\n" + kGround + "objects:\n" + pairs());
  while (simulation.time() < 2.0) simulation.step_frame();
  EXPECT_TRUE(simulation.state().sleep.island.empty());
  EXPECT_NE(simulation.state().particles.velocity[0], Vec3(Vec3::Zero()));
}

}  // namespace
}  // namespace supple::scenes
