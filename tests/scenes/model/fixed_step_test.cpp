// Steps that a scene fixes (`time_step.substeps`) or bounds (`time_step.size`): what they may not do in silence.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "supple/core/error.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {
namespace {

Simulation make(const std::string& text, SimulationOptions options = {}) {
  return Simulation(parse_scene(text, "test.yaml", "."), std::move(options));
}

std::string text_of(double x) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.17g", x);
  return digits;
}

/// A small ball `height` above the middle of a thin plate that is held.
std::string shot(double height, double speed, const std::string& time_step, const std::string& rest = "") {
  return "schema: 1\nduration: 1 s\nframe_rate: 1000\ntime_step: {" + time_step + "}\n" + rest + R"(
objects:
  - name: ball
    particles: {arrange: single, at: [0.013, 0.007, )" + text_of(height) + "], velocity: [0, 0, " + text_of(-speed) + R"(], mass: 0.001}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e8}
  - name: plate
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: square, half_size: 0.3, kernel: {type: wyvill, radius: 0.06}}]
    contact: {modulus: 1e9}
    pins: [{particle: 0}]
)";
}

double height_of(const Simulation& simulation) { return simulation.state().particles.position[0].z(); }

/// Steps to a frame. @return the error that ends it, or ""
std::string end_of(Simulation& simulation, int frame) {
  try {
    simulation.advance_to(frame);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Diverged) << error.what();
    return error.what();
  }
  return "";
}

bool holds(const std::string& text, const std::string& words) { return text.find(words) != std::string::npos; }

TEST(LargestStep, IsCutAsFinelyAsAutomaticOnesSoThatNothingPasses) {
  const int fine = make(shot(0.2, 600.0, "max_substeps: 65536")).state().halvings;
  for (int phase = 0; phase < 10; ++phase) {
    Simulation simulation = make(shot(0.2 + 0.06 * phase, 600.0, "size: 1 ms, max_substeps: 65536"));
    EXPECT_EQ(simulation.state().halvings, fine);
    simulation.advance_to(3);
    EXPECT_GT(height_of(simulation), 0.0) << phase;
  }
}

TEST(LargestStep, IsTakenAsItIsWhereItIsStable) {
  const std::string slow = "objects:\n  - name: drop\n    particles: {arrange: single, at: [0, 0, 1], mass: 1}\n"
                           "    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n    contact: {modulus: 1e4}\n";
  const auto after = [&](const std::string& time_step) {
    Simulation simulation = make("schema: 1\nduration: 1 s\nframe_rate: 10\nground: true\ngravity: [0, 0, -9.81]\ntime_step: {" + time_step + "}\n" + slow);
    EXPECT_EQ(end_of(simulation, 11), "");
    return std::pair{simulation.state().halvings, simulation.state_hash()};
  };
  EXPECT_EQ(after("size: 0.4 ms"), after("substeps: 256"));
  EXPECT_EQ(after("size: 0.8 ms, substeps: 2"), after("substeps: 256"));  // substeps of steps of that size
  EXPECT_EQ(after("size: 0.4 ms").first, 8);
}

TEST(LargestStep, ThatIsCutLeavesTheSameBitsOverRestartsAndThreads) {
  const std::string text = shot(0.11, 100.0, "size: 1 ms, max_substeps: 65536");
  Simulation whole = make(text);
  whole.advance_to(2);
  for (int k = 0; k < 37; ++k) whole.step();
  ASSERT_GT(whole.state().substep, 0);
  SimulationOptions threads;
  threads.threads = 2;
  Simulation rest = make(text, threads);
  rest.restore(whole.state());
  whole.advance_to(4);
  rest.advance_to(4);
  EXPECT_EQ(whole.state_hash(), rest.state_hash());
}

TEST(FixedStep, LetsNothingPassUnseenAtAnyPhase) {
  int ended = 0;
  for (int phase = 0; phase < 31; ++phase) {
    for (const char* core : {"soft", "barrier"}) {
      Simulation simulation = make(shot(0.1 + 0.02 * phase, 600.0, "substeps: 1", "contact: {core: " + std::string(core) + "}"));
      const std::string error = end_of(simulation, 4);
      ended += error.empty() ? 0 : 1;
      if (error.empty()) {
        EXPECT_GT(height_of(simulation), 0.0) << phase;
      } else {
        EXPECT_TRUE(holds(error, "'ball' and 'plate'")) << error;
      }
    }
  }
  EXPECT_EQ(ended, 62);  // steps of 0.6 m are far too long for all
}

TEST(FixedStep, ThatMissesAContactEndsTheRunAndSaysWhichWhenAndWhatWouldDo) {
  Simulation simulation = make(shot(0.2, 600.0, "substeps: 1"));
  const std::string error = end_of(simulation, 4);
  for (const char* words : {"test.yaml:4:23: time_step.substeps: expected steps fine enough to follow contacts: at t = 0.001 s 'ball' and 'plate' pass each other within one step",
                            "at most 0 J at its ends, found steps of 0.001 s, automatic steps would be 1.95313e-06 s; set substeps to auto"}) {
    EXPECT_TRUE(holds(error, words)) << error;
  }
  EXPECT_EQ(simulation.frame(), 1);
  EXPECT_DOUBLE_EQ(height_of(simulation), 0.2);
  ASSERT_EQ(simulation.warnings().size(), 1u);
  EXPECT_TRUE(holds(simulation.warnings()[0], "time_step.substeps: steps of 0.001 s may be too coarse, automatic steps would be 1.95313e-06 s (at frame 1)"))
      << simulation.warnings()[0];
  // And how many steps that takes, where automatic ones are not allowed as many.
  Simulation few = make(shot(0.2, 600.0, "substeps: 1, max_substeps: 64"));
  EXPECT_TRUE(holds(end_of(few, 4), "set substeps to auto, and max_substeps at least 512"));
}

TEST(FixedStep, ThatBodiesExplodeByEndsTheRun) {
  for (const int substeps : {4, 16}) {
    for (const char* core : {"soft", "barrier"}) {
      Simulation simulation = make(shot(0.2, 600.0, "substeps: " + std::to_string(substeps), "contact: {core: " + std::string(core) + "}"));
      const std::string error = end_of(simulation, 4);
      EXPECT_TRUE(holds(error, "'ball' and 'plate' overlap more within one step than their motion allows")) << error;
    }
  }
  Simulation slow = make(shot(0.2, 20.0, "substeps: 1"));
  EXPECT_TRUE(holds(end_of(slow, 40), "are pushed apart too hard within one step"));
  Simulation fine = make(shot(0.2, 20.0, "substeps: 64"));
  EXPECT_EQ(end_of(fine, 20), "");
  EXPECT_LT(fine.audits().energy_error, 1e-2);
}

/// A ball of linear pressure that a single step takes `depth` deep into a rigid floor: F = pi E d^2 (1 - 2 d / 3 R),
/// U = pi E d^3 (1/3 - d / 6 R).
struct Landing {
  static constexpr double kRadius = 0.1, kE = 1e4, kMass = 0.2, kDepth = 0.02, kGap = 0.01;
  static constexpr double kForce = std::numbers::pi * kE * kDepth * kDepth * (1.0 - 2.0 * kDepth / (3.0 * kRadius));
  static constexpr double kEnergy = std::numbers::pi * kE * kDepth * kDepth * kDepth * (1.0 / 3.0 - kDepth / (6.0 * kRadius));
  static std::string scene(double step, double height, double speed, double dissipation) {
    return "schema: 1\nduration: " + text_of(10.0 * step) + "\nframe_rate: " + text_of(1.0 / step) +
           "\ntime_step: {substeps: 1}\ncontact: {error: 1e-6}\nobstacles: [{name: floor, shape: plane, modulus: 1e12}]\nobjects:\n" +
           "  - name: ball\n    particles: {arrange: single, at: [0, 0, " + text_of(height) + "], velocity: [0, 0, " + text_of(speed) +
           "], mass: " + text_of(kMass) + "}\n" +
           "    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]\n" +
           "    contact: {modulus: " + text_of(2.0 * kE) + ", dissipation: " + text_of(dissipation) + "}\n";
  }
  /// @return the error that ends it
  static std::string with(double step, double dissipation) {
    Simulation simulation = make(scene(step, kRadius + kGap, -(kDepth + kGap) / step, dissipation));
    return end_of(simulation, 2);
  }
};

TEST(FixedStep, IsNoMatterForWhatFliesFarPastOrPartsWithinAStep) {
  // 0.6 m a step, beside the plate; and up from a touch.
  Simulation past = make(shot(0.3, 600.0, "substeps: 1", "gravity: [0, 0, 0]"));
  core::ParticleState beside = past.state().particles;
  beside.position[0].x() = 0.5;
  past.set_particles({.position = beside.position});
  EXPECT_EQ(end_of(past, 4), "");
  EXPECT_LT(height_of(past), 0.0);
  Simulation parts = make(Landing::scene(1e-3, 0.5 * Landing::kRadius, 150.0, 0.0));
  ASSERT_GT(parts.energies().contact, 0.0);
  EXPECT_EQ(end_of(parts, 2), "");
}

TEST(FixedStep, IsRefusedWhereHalfOfItsPushGivesMoreThanContactHolds) {
  const double limit = std::sqrt(8.0 * Landing::kMass * Landing::kEnergy) / Landing::kForce;  // (h F / 2)^2 / 2 m = U
  EXPECT_EQ(Landing::with(0.98 * limit, 0.0), "");
  EXPECT_NE(Landing::with(1.02 * limit, 0.0), "");
  // Also of what begins so deep.
  for (const double share : {0.98, 1.02}) {
    Simulation begins = make(Landing::scene(share * limit, Landing::kRadius - Landing::kDepth, 0.0, 0.0));
    EXPECT_EQ(end_of(begins, 2).empty(), share < 1.0);
  }
}

TEST(FixedStep, IsRefusedWhereDampingTurnsBackMoreThanCame) {
  // v (p / v + d p - 1) > sqrt(v^2 + 2 U / m) with the elastic push p = h F / 2 m.
  const double step = 0.5 * std::sqrt(8.0 * Landing::kMass * Landing::kEnergy) / Landing::kForce;
  const double v = (Landing::kDepth + Landing::kGap) / step, p = step * Landing::kForce / (2.0 * Landing::kMass);
  const double limit = ((v + std::sqrt(v * v + 2.0 * Landing::kEnergy / Landing::kMass)) / p - 1.0) / v;
  EXPECT_EQ(Landing::with(step, 0.98 * limit), "");
  EXPECT_NE(Landing::with(step, 1.02 * limit), "");
}

TEST(FixedStep, ReportsOverloadsAsAutomaticStepsDo) {
  // Two balls of linear pressure meet with 60 % of their capacity; steps of 4 ms have (omega step)^2 = pi E R / 2 m step^2 = 0.25.
  constexpr double kCapacity = std::numbers::pi * 1e4 * 1e-3 / 3.0;
  const double speed = std::sqrt(2.0 * 0.6 * kCapacity / 0.1);
  const auto overloads = [&](const std::string& time_step) {
    const auto ball = [](const std::string& name, double x, double v) {
      return "  - name: " + name + "\n    particles: {arrange: single, at: [" + text_of(x) + ", 0, 0], velocity: [" + text_of(v) +
             ", 0, 0], mass: 0.2}\n    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]\n" +
             "    contact: {modulus: 2e4}\n";
    };
    Simulation simulation = make("schema: 1\nduration: 1 s\nframe_rate: 250\ntime_step: {" + time_step + "}\nobjects:\n" +
                                 ball("left", -0.11, 0.5 * speed) + ball("right", 0.11, -0.5 * speed));
    simulation.advance_to(15);
    return simulation.state().record.overloads;
  };
  const auto automatic = overloads("substeps: auto"), fixed = overloads("substeps: 1");
  ASSERT_EQ(automatic.size(), 1u);
  ASSERT_EQ(fixed.size(), 1u);
  EXPECT_EQ(fixed[0].a + fixed[0].b, automatic[0].a + automatic[0].b);
  EXPECT_NEAR(fixed[0].energy, automatic[0].energy, 0.25 * 0.6 * kCapacity);
  EXPECT_NEAR(fixed[0].capacity, automatic[0].capacity, 0.01 * kCapacity);
}

TEST(FixedStep, IsNamedByExplain) {
  const auto explained = [](const std::string& time_step) {
    Simulation simulation = make(shot(0.2, 600.0, time_step));
    return explain(simulation);
  };
  EXPECT_TRUE(holds(explained("substeps: 4"), "(4 per frame), fixed by the scene"));
  EXPECT_TRUE(holds(explained("substeps: 4"), "symplectic: the scene fixes the time step"));
  EXPECT_TRUE(holds(explained("size: 0.1 ms"), "(512 per frame), by time_step.size and the stability limits at frame 1"));
  EXPECT_TRUE(holds(explained("size: 0.1 ms"), "symplectic: 512 steps of velocity Verlet per frame at the start (time_step.size: at most 1e-04 s)"))
      << explained("size: 0.1 ms");
}

/// Four particles in a row, whose stiffest mode has 2.6 times the frequency that steps of 5 ms hold; a load sets it off.
std::string stiff_bar(const std::string& time_step, const std::string& rest = "") {
  return "schema: 1\nduration: 0.2 s\nframe_rate: 100\ntime_step: {" + time_step + "}\n" + rest + R"(
objects:
  - name: bar
    particles: {arrange: line, count: 4, spacing: 0.1, mass: 0.1}
    interactions: [{law: bond_frame, within: 0.15, stretch: 3000, rotation: 1}]
    loads: [{particle: 0, force: [0, 0, 1], until: 0.02}]
)";
}

TEST(CreatedEnergy, EndsTheRunAndSaysWhoMovesHowFast) {
  Simulation simulation = make(stiff_bar("substeps: 2"));
  const std::string error = end_of(simulation, 21);
  // The load of 1 N over 20 ms gives 20 mN s, and with it 0.0017 J.
  for (const char* words : {"test.yaml: diverged at step ", "'bar' moves at up to ", " m/s; all the energy that was put into the run, 0.00170", " J without a source",
                            "the scene fixes the time step; set time_step.substeps to auto"}) {
    EXPECT_TRUE(holds(error, words)) << error;
  }
  EXPECT_LT(simulation.frame(), 21);
  EXPECT_LT(simulation.audits().energy_error, 0.9);  // the state is the last one before
  Simulation fine = make(stiff_bar("substeps: auto"));
  EXPECT_EQ(end_of(fine, 21), "");
  Simulation coarse = make(stiff_bar("substeps: 4"));  // stable, though more than the margin of automatic ones allows
  EXPECT_EQ(end_of(coarse, 21), "");
}

TEST(CreatedEnergy, IsNotBlamedOnAProjectile) {
  const std::string ball = R"(
objects:
  - name: ball
    particles: {arrange: single, at: [0.2, 0, 0], velocity: [400, 0, 0], mass: 0.1}
    skeleton: [{shape: point, kernel: {radius: 0.1}}]
    contact: {modulus: 1e4}
  - name: wall
    particles: {arrange: single, at: [0.5, 0, 0], mass: 1}
    skeleton: [{shape: square, half_size: 0.3, turn_axis: [0, 1, 0], turn_deg: 90, kernel: {radius: 0.1}}]
    contact: {modulus: 1e4}
)";
  // The wall holds a ten-thousandth of its energy.
  Simulation simulation = make("schema: 1\nduration: 2 ms\nframe_rate: 1000\ntime_step: {max_substeps: 65536}\n" + ball);
  const std::string error = end_of(simulation, 3);
  EXPECT_TRUE(holds(error, "'ball' and 'wall' pass through each other")) << error;
  EXPECT_FALSE(holds(error, "without a source")) << error;
  EXPECT_EQ(simulation.state().record.overloads.size(), 1u);
}

TEST(CreatedEnergy, IsLookedForFromWhereAStateIsTakenUp) {
  Simulation simulation = make(stiff_bar("substeps: auto"));
  simulation.advance_to(3);
  State pushed = simulation.state();
  for (Vec3& v : pushed.particles.velocity) v.x() += 1e3;
  simulation.restore(pushed);
  EXPECT_EQ(end_of(simulation, 21), "");
  EXPECT_GT(simulation.state().particles.velocity[0].x(), 900.0);
}

}  // namespace
}  // namespace supple::scenes
