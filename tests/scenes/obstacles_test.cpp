// Solids that stand still, and objects whose particles are bodies of their own.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Simulation make(const std::string& text, const fs::path& folder = ".", SimulationOptions options = {}) {
  return Simulation(parse_scene(text, "test.yaml", folder), options);
}

void run(Simulation& simulation, int frames) {
  while (simulation.frame() < frames) simulation.step_frame();
}

std::string ball_over(const std::string& below) {
  return R"(
schema: 1
duration: 6 s
frame_rate: 10
gravity: [0, 0, -9.81]
)" + below + R"(
objects:
  - name: drop
    particles: {arrange: single, at: [0.02, 0.01, 0.25], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 5e3}
    medium: {linear: 6, angular: 6}
)";
}

double rest_height(Simulation simulation) {
  run(simulation, 61);
  EXPECT_EQ(simulation.contacts().summary.size(), 1u);
  EXPECT_NEAR(simulation.contact_forces()[0].z(), 0.2 * 9.81, 1e-5 * 0.2 * 9.81);
  EXPECT_LT(simulation.audits().momentum_error, 1e-10);
  return simulation.state().particles.position[0].z();
}

TEST(Obstacles, CarryABallAsTheGroundDoes) {
  const fs::path folder = fs::temp_directory_path() / "supple_obstacles";
  fs::create_directories(folder);
  {
    std::ofstream file(folder / "flat.csv");
    file << "x,y,z\n";
    for (const double y : {-1.0, 0.0, 1.0, 2.0}) {
      for (const double x : {-1.0, 0.0, 1.0}) file << x << ',' << y << ",0\n";
    }
  }
  const double on_ground = rest_height(make(ball_over("ground: {height: 0, modulus: 1e6}")));
  EXPECT_NEAR(rest_height(make(ball_over("obstacles: [{name: floor, shape: plane, modulus: 1e6}]"))), on_ground, 1e-9);
  EXPECT_NEAR(rest_height(make(ball_over(
                  "obstacles: [{name: floor, shape: box, at: [0, 0, -0.5], half_sizes: [2, 2, 0.5], modulus: 1e6}]"))),
              on_ground, 1e-7);
  EXPECT_NEAR(rest_height(make(ball_over("obstacles: [{name: floor, shape: heights, file: flat.csv, modulus: 1e6}]"), folder)),
              on_ground, 1e-7);
}

TEST(Obstacles, RefuseHeightsThatAreNoGrid) {
  const fs::path folder = fs::temp_directory_path() / "supple_obstacles";
  fs::create_directories(folder);
  std::ofstream(folder / "holes.csv") << "0,0,0\n1,0,0\n0,1,0\n";
  try {
    make(ball_over("obstacles: [{name: hills, shape: heights, file: holes.csv}]"), folder);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("obstacles.hills.file: expected points of a regular grid"), std::string::npos)
        << error.what();
  }
}

TEST(Obstacles, AreNamedInPairs) {
  const std::string floor = "obstacles: [{name: floor, shape: plane}]\n";
  Simulation through = make(ball_over(floor + "pairs: [{objects: [drop, floor], collide: false}]"));
  run(through, 11);
  EXPECT_LT(through.state().particles.position[0].z(), -1.0);
  const Simulation slippery = make(ball_over(floor + "pairs: [{objects: [floor, drop], friction: 0.25}]"));
  ASSERT_EQ(slippery.model().rules.overrides.size(), 1u);
  EXPECT_EQ(slippery.model().rules.overrides[0].material.friction, 0.25);
}

/// Five balls in a row, the first thrown at the others.
std::string row_of_balls(bool separate) {
  return R"(
schema: 1
duration: 1 s
frame_rate: 20
objects:
  - name: balls
    particles: {arrange: line, count: 5, spacing: 0.5, mass: 0.1, velocity: [1, 0, 0], disorder: 0.02}
    separate: )" + std::string(separate ? "true" : "false") + R"(
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 5e3}
  - name: wall
    particles: {arrange: single, at: [1.6, 0, 0], mass: 5}
    skeleton: [{shape: box, half_sizes: [0.1, 0.5, 0.5], kernel: {type: wyvill, radius: 0.2}}]
    contact: {modulus: 5e3}
)";
}

TEST(SeparateBodies, TouchEachOther) {
  Simulation simulation = make(row_of_balls(true));
  EXPECT_EQ(simulation.bodies().size(), 6u);
  EXPECT_EQ(simulation.bodies()[2].name, "balls.3");
  const core::Motion start = core::measure_motion(simulation.model().particles, simulation.state().particles);
  bool among_balls = false;
  while (simulation.frame() < 21) {
    simulation.step_frame();
    for (const auto& s : simulation.contacts().summary) among_balls = among_balls || s.bodies.b < 5;
  }
  EXPECT_TRUE(among_balls);
  const core::Motion end = core::measure_motion(simulation.model().particles, simulation.state().particles);
  EXPECT_LE((end.momentum - start.momentum).norm(), 1e-12 * start.momentum_scale);
  EXPECT_LT(simulation.state().particles.velocity[4].x(), 0.5);  // the last one was stopped by the wall
  EXPECT_EQ(simulation.meshes().size(), 2u);

  const Simulation one = make(row_of_balls(false));
  EXPECT_EQ(one.bodies().size(), 2u);
}

// Six that move make 15 pairs, and each of them two with what stands still.
TEST(SeparateBodies, AreCountedAsPairsOneByOne) {
  Simulation simulation = make(row_of_balls(true) + "ground: {height: -1}\nobstacles: [{name: end, shape: plane, at: [3, 0, 0], normal: [-1, 0, 0]}]\n");
  simulation.step();
  const StageProfile found = simulation.profile()[static_cast<std::size_t>(Stage::FindContacts)];
  ASSERT_GT(found.calls, 0u);
  EXPECT_EQ(found.present, 27 * found.calls);
}

TEST(SeparateBodies, HaveTheSameBitsForAnyThreadsAndWithoutSkips) {
  const auto hash_of = [](SimulationOptions options) {
    Simulation simulation = make(row_of_balls(true), ".", options);
    run(simulation, 15);
    return simulation.state_hash();
  };
  const std::uint64_t one = hash_of({.threads = 1});
  EXPECT_EQ(hash_of({.threads = 3}), one);
  EXPECT_EQ(hash_of({.threads = 1, .skip = false}), one);
}

}  // namespace
}  // namespace supple::scenes
