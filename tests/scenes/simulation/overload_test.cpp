// Pairs that press harder than they can hold: what is reported, what hard cores do, and that nothing passes below.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "supple/core/error.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

/// Two balls of linear pressure, E = 1e4 Pa and R = 0.1 m, of 0.2 kg each, that meet head-on or nearly.
std::string balls(double speed, const std::string& rest = "") {
  const auto ball = [](const std::string& name, double x, double y, double v) {
    return "  - name: " + name + "\n    particles: {arrange: single, at: [" + std::to_string(x) + ", " + std::to_string(y) +
           ", 0], velocity: [" + std::to_string(v) + ", 0, 0], mass: 0.2}\n" +
           "    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]\n" +
           "    contact: {modulus: 2e4}\n";
  };
  return "schema: 1\nduration: 10 s\nframe_rate: 1000\ntime_step: {max_substeps: 65536}\n" + rest + "objects:\n" +
         ball("left", -0.11, 0.0, 0.5 * speed) + ball("right", 0.11, 0.01, -0.5 * speed);
}

Simulation run(const std::string& text, int frames) {
  Simulation simulation(parse_scene(text, "test.yaml", "."));
  while (simulation.frame() < frames) simulation.step_frame();
  return simulation;
}

/// The message with which a run to this frame ends as diverged; empty where it does not.
std::string end_of(Simulation& simulation, int frames) {
  try {
    while (simulation.frame() < frames) simulation.step_frame();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Diverged);
    return error.what();
  }
  return {};
}

constexpr double kCapacity = std::numbers::pi * 1e4 * 1e-3 / 3.0;  // of two such balls [J]

TEST(Overload, IsReportedAboveHalfOfTheCapacityOnly) {
  const double safe = std::sqrt(2.0 * 0.45 * kCapacity / 0.1);  // of 45 % with half the mass of a ball
  EXPECT_TRUE(run(balls(safe), 60).state().record.overloads.empty());

  const double harder = std::sqrt(2.0 * 0.6 * kCapacity / 0.1);
  const Simulation simulation = run(balls(harder), 60);
  ASSERT_EQ(simulation.state().record.overloads.size(), 1u);
  const RunRecord::Overload& found = simulation.state().record.overloads[0];
  EXPECT_EQ(found.a, "left");
  EXPECT_EQ(found.b, "right");
  // Verlet's kinetic energy and that of the contact, each of which swings by (omega dt)^2 = 9 % at most, make the largest sum.
  EXPECT_NEAR(found.energy, 0.6 * kCapacity, 0.09 * 0.6 * kCapacity);
  EXPECT_NEAR(found.capacity, kCapacity, 0.01 * kCapacity);
  EXPECT_NEAR(found.time, 0.02 / harder, 2e-3);
}

TEST(Overload, EndsTheRunWhereBodiesPassThroughEachOther) {
  // With less than the capacity at the centre the balls, which are not in line, turn each other aside.
  const double most = std::sqrt(2.0 * kCapacity / 0.1);
  for (const auto& [speed, passes] : {std::pair{0.95 * most, false}, {1.1 * most, true}, {40.0, true}, {400.0, true}, {4000.0, true}}) {
    for (const char* method : {"symplectic", "implicit_midpoint"}) {
      Simulation simulation(parse_scene(balls(speed, std::string("integrator: {method: ") + method + "}\n"), "test.yaml", "."));
      const std::string error = end_of(simulation, 30);
      EXPECT_EQ(simulation.state().record.overloads.size(), 1u) << speed << ' ' << method;
      EXPECT_EQ(error.find("'left' and 'right' pass through each other; their contact holds at most 10.4") != std::string::npos, passes)
          << speed << ' ' << method << ": " << error;
      EXPECT_EQ(simulation.frame() == 30, !passes);
      const auto& x = simulation.state().particles.position;  // the last frame before
      EXPECT_TRUE(!passes || x[1].x() > x[0].x()) << speed << ' ' << method;
    }
  }
}

TEST(Overload, OfASteadyLoadBeginsWhereTheBallCarriesNoMore) {
  // A linear ball on a rigid plane carries at most pi E R^2 / 3 = 104.7 N, at the depth R, where half of its capacity is spent.
  const auto pressed = [](double force) {
    return Simulation(parse_scene(R"(
schema: 1
duration: 10 s
frame_rate: 100
contact: {error: 0.01}
obstacles: [{name: floor, shape: plane, modulus: 1e9}]
objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, 0.1], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 2e4}
    medium: {linear: 40, angular: 40}
    loads: [{particle: 0, force: [0, 0, -)" + std::to_string(force) + R"(], ramp: 0.2}]
)",
                                  "test.yaml", "."));
  };
  Simulation carried = pressed(80.0);
  EXPECT_EQ(end_of(carried, 60), "");
  EXPECT_TRUE(carried.state().record.overloads.empty());
  EXPECT_GT(carried.state().particles.position[0].z(), 0.0);
  Simulation crushed = pressed(150.0);
  const std::string error = end_of(crushed, 60);
  EXPECT_NE(error.find("'ball' and 'floor' pass through each other"), std::string::npos) << error;
  ASSERT_EQ(crushed.state().record.overloads.size(), 1u);
  EXPECT_NEAR(crushed.state().record.overloads[0].capacity, kCapacity, 0.01 * kCapacity);
  EXPECT_TRUE(crushed.state().particles.position[0].allFinite());
}

TEST(Overload, OfWhatBeginsWhollyWithinIsReportedAtOnce) {
  const auto begin_at = [](double height) {
    return Simulation(parse_scene(R"(
schema: 1
duration: 1 s
frame_rate: 100
gravity: [0, 0, -9.81]
ground: {height: 0, modulus: 1e9}
objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, )" + std::to_string(height) + R"(], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 2e4}
)",
                                  "test.yaml", "."));
  };
  EXPECT_TRUE(begin_at(0.05).state().record.overloads.empty());
  Simulation simulation = begin_at(-0.15);
  ASSERT_EQ(simulation.state().record.overloads.size(), 1u);
  const RunRecord::Overload found = simulation.state().record.overloads[0];
  EXPECT_EQ(found.a, "ball");
  EXPECT_EQ(found.b, "ground");
  EXPECT_EQ(found.time, 0.0);
  EXPECT_NEAR(found.energy, kCapacity, 1e-4 * kCapacity);  // to which regions are filled
  EXPECT_EQ(found.capacity, found.energy);
  while (simulation.frame() < 20) simulation.step_frame();
  ASSERT_EQ(simulation.state().record.overloads.size(), 1u);
  EXPECT_EQ(simulation.state().record.overloads[0].time, 0.0);
  EXPECT_LE(simulation.audits().energy_error, 1e-4);
  const nlohmann::json json = nlohmann::json::parse(query_contact(simulation, false));
  EXPECT_EQ(json["pairs"][0]["capacity_j"], json["pairs"][0]["energy_j"]);
  EXPECT_EQ(json["pairs"][0]["error_met"], true);
}

// Their surfaces press alike all over but for rounding, which is neither a force nor a change of energy.
TEST(Overload, OfConcentricBallsHoldsTheEnergyOfTheSofter) {
  const auto ball = [](const std::string& name, const std::string& modulus) {
    return "  - name: " + name + "\n    particles: {arrange: single, mass: 0.1}\n" +
           "    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]\n" +
           "    contact: {modulus: " + modulus + "}\n";
  };
  Simulation simulation(parse_scene("schema: 1\nduration: 1 s\nobjects:\n" + ball("soft", "1e4") + ball("hard", "2e4"), "test.yaml", "."));
  ASSERT_EQ(simulation.contacts().summary.size(), 1u);
  EXPECT_EQ(simulation.contacts().summary[0].reason, collision::RuleReason::Within);
  EXPECT_NEAR(simulation.contacts().summary[0].energy, kCapacity, 1e-4 * kCapacity);
  while (simulation.frame() < 4) simulation.step_frame();
  EXPECT_EQ(simulation.audits().energy_error, 0.0);
}

// A shelf of 10 mm that is part of a block of 1 m.
TEST(Overload, IsNotReportedOfAThinPartOfAMesh) {
  const std::filesystem::path folder = temp_folder() / "overload_shelf";
  std::filesystem::create_directories(folder);
  std::ofstream file(folder / "shelf.obj");
  // A profile in x and z, between two planes of y.
  for (const double y : {0.5, -0.5}) {
    for (const auto& [x, z] : {std::pair{-0.5, 0.0}, {0.5, 0.0}, {0.5, 0.6}, {0.8, 0.6}, {0.8, 0.61}, {0.5, 0.61}, {0.5, 1.0}, {-0.5, 1.0}}) {
      file << "v " << x << ' ' << y << ' ' << z << '\n';
    }
  }
  for (const auto& f : std::initializer_list<std::array<int, 3>>{{2, 1, 8}, {3, 2, 8}, {5, 4, 3}, {6, 5, 3}, {8, 7, 6}, {3, 8, 6}, {16, 9, 10}, {16,
           10, 11}, {11, 12, 13}, {11, 13, 14}, {14, 15, 16}, {14, 16, 11}, {10, 9, 2}, {2, 9, 1}, {11, 10, 3}, {3, 10, 2}, {12, 11, 4}, {4, 11, 3},
           {13, 12, 5}, {5, 12, 4}, {14, 13, 6}, {6, 13, 5}, {15, 14, 7}, {7, 14, 6}, {9, 16, 1}, {1, 16, 8}, {16, 15, 8}, {8, 15, 7}}) {
    file << "f " << f[0] << ' ' << f[1] << ' ' << f[2] << '\n';
  }
  file.close();
  Simulation simulation(parse_scene(R"(
schema: 1
duration: 1 s
gravity: [0, 0, -9.81]
contact: {error: 0.01}
obstacles: [{name: block, shape: mesh, file: shelf.obj}]
objects:
  - name: ball
    particles: {arrange: single, at: [0.65, 0, 0.71], mass: 0.05}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e4, dissipation: 1}
)",
                                    "test.yaml", folder));
  while (simulation.frame() < 6) simulation.step_frame();
  ASSERT_EQ(simulation.contacts().summary.size(), 1u);
  EXPECT_TRUE(simulation.state().record.overloads.empty());
}

TEST(Overload, IsKeptWithTheState) {
  const Simulation simulation = run(balls(15.0), 8);
  const std::filesystem::path file = temp_folder() / "overload.state";
  save_state(file, simulation.state(), {.scene = 1});
  const State loaded = load_state(file, {.scene = 1});
  ASSERT_EQ(loaded.record.overloads.size(), 1u);
  EXPECT_EQ(loaded.record.overloads[0].b, "right");
  EXPECT_EQ(loaded.record.overloads[0].energy, simulation.state().record.overloads[0].energy);
}

TEST(Overload, CapacityStandsInTheAnswerToAQuery) {
  Simulation simulation = run(balls(1.0), 40);
  const auto answer = nlohmann::json::parse(query_contact(simulation, false));
  EXPECT_NEAR(answer["pairs"][0]["capacity_j"].get<double>(), kCapacity, 0.01 * kCapacity);
}

// Balls that begin with their middles in one another are parted by all the energy of that, no more.
TEST(DeepStart, IsRecoveredWithTheEnergyOfTheOverlap) {
  constexpr double kRadius = 0.1, kE = 1e4, kMass = 0.2;
  for (const double distance : {0.03, 0.08, 0.12}) {
    std::string text = balls(0.0, "contact: {error: 1e-4}\n");
    const auto put = [&text](const std::string& from, double x) {
      const std::size_t at = text.find(from);
      text.replace(at, from.size(), std::to_string(x));
    };
    put(std::to_string(-0.11), -0.5 * distance);
    put(std::to_string(0.11), 0.5 * distance);
    const double depth = kRadius - 0.5 * std::hypot(distance, 0.01);  // of each in the plane between
    const double energy = 2.0 * std::numbers::pi * kE * depth * depth * depth * (1.0 / 3.0 - depth / (6.0 * kRadius));
    Simulation s = run(text, 80);
    EXPECT_TRUE(s.contacts().summary.empty());
    EXPECT_GT(s.state().particles.position[1].x() - s.state().particles.position[0].x(), 2.0 * kRadius);
    double kinetic = 0.0;
    for (const Vec3& v : s.state().particles.velocity) kinetic += 0.5 * kMass * v.squaredNorm();
    EXPECT_NEAR(kinetic, energy, 0.01 * energy) << distance;
    EXPECT_LT(s.audits().energy_error, 0.01);
    EXPECT_LT(s.audits().momentum_error, 1e-13);
  }
}

TEST(Tunnelling, HappensAtNoSpeedWithHardCores) {
  for (const double speed : {20.0, 150.0, 600.0}) {
    const int frames = 20 + static_cast<int>(100.0 / speed);
    Simulation soft(parse_scene(balls(speed, "contact: {error: 0.1}\n"), "test.yaml", "."));
    const Simulation hard = run(balls(speed, "contact: {core: barrier}\n"), frames);
    const auto gap = [](const Simulation& s) { return s.state().particles.position[1].x() - s.state().particles.position[0].x(); };
    EXPECT_NE(end_of(soft, frames), "") << speed;
    EXPECT_GT(gap(hard), 0.1) << speed;
    EXPECT_GT(hard.state().record.core_impulses, 0u);
    EXPECT_EQ(hard.state().record.overloads.size(), 1u);
    EXPECT_LT(hard.audits().momentum_error, 1e-13);
    EXPECT_LT(hard.audits().angular_momentum_error, 1e-12);
    // Verlet's energy swings by (omega dt)^2 at most; the cores add nothing.
    EXPECT_LT(hard.audits().energy_error, 0.01);
  }
}

TEST(HardCores, DoNothingBelowThem) {
  const Simulation soft = run(balls(5.0), 60), hard = run(balls(5.0, "contact: {core: barrier}\n"), 60);
  EXPECT_EQ(hard.state().record.core_impulses, 0u);
  EXPECT_EQ(soft.state_hash(), hard.state_hash());
}

}  // namespace
}  // namespace supple::scenes
