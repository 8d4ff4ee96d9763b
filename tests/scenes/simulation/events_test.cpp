/// Courses of loads, gravity and wind; pins that end; cuts.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {
namespace {

Scene read(const std::string& text) { return parse_scene("schema: 1\nduration: 1 s\nframe_rate: 16\n" + text, "test.yaml", "."); }

Simulation at_end(const std::string& text) {
  Simulation simulation(read(text));
  while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
  return simulation;
}

constexpr const char* kParticle = "objects:\n  - name: a\n    particles: {arrange: single, mass: 2, inertia_radius: 0.1}\n";

TEST(Courses, OfALoadGiveItsImpulse) {
  // The impulse of 3 N sin(pi t) over a second is 6/pi; keys of a triangle give half of its height.
  const double wave = at_end(std::string(kParticle) + "    loads: [{particle: 0, force: [3, 0, 0], course: {expression: \"sin(pi*t/(1 s))\"}}]\n").state().particles.velocity[0].x();
  EXPECT_NEAR(wave, 3.0 / M_PI, 1e-5);
  const double keys = at_end(std::string(kParticle) + "    loads: [{particle: 0, force: [3, 0, 0], course: {keys: [{time: 0, factor: 0}, {time: 0.3, factor: 2}, {time: 1, factor: 0}]}}]\n")
                          .state().particles.velocity[0].x();
  EXPECT_NEAR(keys, 1.5, 1e-12);
  const double window = at_end(std::string(kParticle) + "    loads: [{particle: 0, force: [4, 0, 0], from: 0.25, until: 0.75, course: {keys: [{time: 0, factor: 0}, {time: 1, factor: 1}]}}]\n")
                            .state().particles.velocity[0].x();
  EXPECT_NEAR(window, 0.5, 1e-12);
}

TEST(Courses, TurnGravity) {
  const Simulation simulation = at_end("gravity: [0, 0, -10]\ngravity_course: {keys: [{time: 0.5, factor: 1}, {time: 0.500001, factor: -1}]}\n" + std::string(kParticle));
  EXPECT_NEAR(simulation.state().particles.velocity[0].z(), 0.0, 1e-4);
  EXPECT_NEAR(simulation.state().particles.position[0].z(), -2.5, 1e-4);  // g/8 down, another g/8 to the stop
}

TEST(Courses, SayWhatIsWrong) {
  const auto message = [](const std::string& course) {
    try {
      (void)build_model(read(std::string(kParticle) + "    loads: [{particle: 0, force: [1, 0, 0], course: " + course + "}]\n"));
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message("{expression: \"t\"}").find("expected a number without unit"), std::string::npos);
  EXPECT_NE(message("{expression: \"sin(x)\"}").find("expected a variable"), std::string::npos);
  EXPECT_NE(message("{expression: \"1/(t/(1 s) - 0.5)\"}").find("divisor"), std::string::npos) << message("{expression: \"1/(t/(1 s) - 0.5)\"}");
  EXPECT_NE(message("{}").find("expected either expression or keys"), std::string::npos);
  EXPECT_NE(message("{keys: [{time: 1, factor: 0}, {time: 1, factor: 1}]}").find("after that of the key before"), std::string::npos);
}

TEST(Wind, CarriesWhatDrags) {
  const Simulation simulation = at_end("wind: {velocity: [3, 0, 0]}\n" + std::string(kParticle) + "    medium: {linear: 2}\n");
  EXPECT_NEAR(simulation.state().particles.velocity[0].x(), 3.0 * (1.0 - std::exp(-2.0)), 1e-2);
}

TEST(Pins, EndAtTheirTime) {
  const std::string text = "gravity: [0, 0, -8]\n" + std::string(kParticle) + "    pins: [{particle: 0, until: 0.5}]\n";
  Simulation simulation = at_end(text);
  EXPECT_NEAR(simulation.state().particles.position[0].z(), -1.0, 1e-9);
  EXPECT_NEAR(simulation.state().particles.velocity[0].z(), -4.0, 1e-9);
  // A restart before and after the release gives the same bits.
  Simulation again(read(text));
  while (again.frame() < 6) again.step_frame();
  Simulation restarted(read(text));
  restarted.restore(again.state());
  while (restarted.frame() < 12) restarted.step_frame();
  Simulation later(read(text));
  later.restore(restarted.state());
  while (later.frame() < simulation.frame()) later.step_frame();
  EXPECT_EQ(later.state_hash(), simulation.state_hash());
}

constexpr const char* kChain = R"(
objects:
  - name: chain
    particles: {arrange: line, count: 6, spacing: 0.1, mass: 0.1}
    interactions: [{law: bond_frame, stretch: 100, rotation: 1}]
    pins: [{particle: 0}]
)";

TEST(Cuts, BreakBondsAtTheirTime) {
  Simulation simulation = at_end("gravity: [0, 0, -8]\n" + std::string(kChain) + "    cuts: [{time: 0.5, particles: [2, 3]}]\n");
  EXPECT_EQ(simulation.bodies().size(), 2u);
  // The free half falls freely for half a second, a metre and more; the pinned half hangs.
  EXPECT_LT(simulation.state().particles.position[4].z(), -1.0);
  EXPECT_GT(simulation.state().particles.position[2].z(), -0.5);
  Simulation plane = at_end("gravity: [0, 0, -8]\n" + std::string(kChain) + "    cuts: [{time: 0.5, at: [0, 0, 0]}]\n");
  EXPECT_EQ(plane.state_hash(), simulation.state_hash());
  const Audits audits = simulation.audits();
  EXPECT_LT(audits.momentum_error, 1e-10);
}

TEST(Cuts, NeedABond) {
  EXPECT_THROW((void)build_model(read(std::string(kChain) + "    cuts: [{time: 0.5, particles: [2, 4]}]\n")), Error);
  EXPECT_THROW((void)build_model(read(std::string(kChain) + "    cuts: [{time: 0.5, at: [3, 0, 0]}]\n")), Error);
}

}  // namespace
}  // namespace supple::scenes
