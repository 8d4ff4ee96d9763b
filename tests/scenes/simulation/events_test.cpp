/// Courses of loads, gravity and wind; pins that end and move; cuts; loads that the caller gives.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

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

/// Two particles on a spring, the first one led along x.
std::string driven(const std::string& motion, const std::string& more = "", const std::string& method = "symplectic") {
  return "integrator: {method: " + method + "}\ntime_step: {substeps: 256}\n" + more +
         "objects:\n  - name: a\n    particles: {arrange: line, count: 2, spacing: 0.5, mass: 0.5, inertia_radius: 0.1}\n"
         "    interactions: [{law: bond_frame, stretch: 50, rotation: 0.5}, {law: friction, linear: 0.1, angular: 0.01}]\n"
         "    medium: {linear: 0.2, angular: 0.1}\n    rayleigh: {stiffness: 0.002}\n"
         "    pins: [{particle: 0, motion: {" + motion + "}}]\n";
}

TEST(MovingPins, DriveAnOscillator) {
  // Of m u'' = -k (u - a sin(w t)), w0^2 = k/m, from rest: u = a w0^2 / (w0^2 - w^2) (sin(w t) - w/w0 sin(w0 t)).
  const std::string text = "time_step: {substeps: 256}\nobjects:\n  - name: a\n    particles: {arrange: line, count: 2, spacing: 0.5, mass: 0.5, inertia_radius: 0.1}\n"
                           "    interactions: [{law: bond_frame, stretch: 50, rotation: 0.5}]\n"
                           "    pins: [{particle: 0, motion: {x: \"5 cm*sin(4*t/(1 s))\"}}]\n";
  Simulation simulation(read(text));
  const Vec3 start = simulation.state().particles.position[0], other = simulation.state().particles.position[1];
  double largest = 0.0;
  while (simulation.frame() < simulation.scene().frame_count()) {
    simulation.step_frame();
    const double t = simulation.time();
    EXPECT_NEAR(simulation.state().particles.position[0].x() - start.x(), 0.05 * std::sin(4.0 * t), 1e-6);
    const double u = 0.05 * 100.0 / (100.0 - 16.0) * (std::sin(4.0 * t) - 0.4 * std::sin(10.0 * t));
    largest = std::max(largest, std::abs(u));
    EXPECT_NEAR(simulation.state().particles.position[1].x() - other.x(), u, 2e-5) << t;
  }
  EXPECT_GT(largest, 0.05);
}

TEST(MovingPins, ReachTheirKeysAndTurn) {
  const Simulation simulation = at_end(driven("keys: [{time: 0.25, by: [0, 0, 0.2]}, {time: 0.75, by: [0.1, 0, 0.2], turn_deg: 90}], turn_axis: [0, 0, 2]"));
  const Simulation start(read(driven("keys: [{time: 0.25, by: [0, 0, 0.2]}]")));
  const core::ParticleState &now = simulation.state().particles, &then = start.state().particles;
  EXPECT_LT((now.position[0] - then.position[0] - Vec3(0.1, 0, 0.2)).norm(), 1e-14);
  EXPECT_LT((now.orientation[0] * then.orientation[0].conjugate() * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-12);
  EXPECT_EQ(now.velocity[0], Vec3::Zero());
  Simulation between(read(driven("keys: [{time: 0.25, by: [0, 0, 0.2]}]")));
  while (between.frame() < 3) between.step_frame();
  EXPECT_NEAR(between.state().particles.position[0].z() - then.position[0].z(), 0.1, 1e-14);  // half-way to the first key
}

TEST(MovingPins, DoTheWorkThatTheBalanceLacks) {
  // Drag, friction and stiffness damping act on what moves; gravity acts on the pinned particle, too.
  const std::string motion = "keys: [{time: 0.4, by: [0.1, 0.05, 0.2], turn_deg: 60}, {time: 0.9, by: [0, 0, 0.1], turn_deg: -30}], turn_axis: [0, 1, 1]";
  for (const auto& [method, error] : {std::pair{"symplectic", 1e-4}, std::pair{"rk4", 1e-4}, std::pair{"implicit_midpoint", 1e-3}}) {
    const Simulation simulation = at_end(driven(motion, "gravity: [0, 0, -5]\n", method));
    const Audits audits = simulation.audits();
    EXPECT_LT(audits.energy_error, error) << method;
    EXPECT_LT(audits.momentum_error, 1e-10) << method;
    EXPECT_LT(audits.angular_momentum_error, 1e-4) << method;
    EXPECT_GT(simulation.state().ledger.dissipated, 1e-3) << method;
  }
}

TEST(MovingPins, LetGoOfWhatKeepsItsVelocity) {
  const std::string text = std::string(kParticle) + "    pins: [{particle: 0, until: 0.5, motion: {keys: [{time: 1, by: [2, 0, 0]}], between: linear}}]\n";
  const Simulation simulation = at_end(text);
  EXPECT_NEAR(simulation.state().particles.velocity[0].x(), 2.0, 1e-12);
  EXPECT_NEAR(simulation.state().particles.position[0].x(), 2.0, 1e-12);
}

TEST(MovingPins, ContinueFromASavedStateWithTheSameBits) {
  const std::string text = driven("z: \"0.1 m*(1 - cos(5*t/(1 s)))\"");
  const Simulation whole = at_end(text);
  Simulation half(read(text));
  while (half.frame() < 8) half.step_frame();
  Simulation rest(read(text));
  rest.restore(half.state());
  while (rest.frame() < whole.frame()) rest.step_frame();
  EXPECT_EQ(rest.state_hash(), whole.state_hash());
}

TEST(MovingPins, WakeTheirBody) {
  const std::string text = "sleep: {time: 0.1}\n" + driven("keys: [{time: 0.5}, {time: 0.75, by: [0.3, 0, 0]}]");
  const Simulation simulation = at_end(text);
  EXPECT_GT(simulation.state().particles.position[1].x(), 0.3);
}

TEST(MovingPins, SayWhatIsWrong) {
  const auto message = [](const std::string& pins, const std::string& more = "") {
    try {
      (void)build_model(read(more + std::string(kParticle) + "    pins: [" + pins + "]\n"));
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message("{particle: 0, motion: {}}").find("expected either keys or x, y, z"), std::string::npos);
  EXPECT_NE(message("{particle: 0, motion: {x: \"t/(1 s)\"}}").find("expected a length"), std::string::npos);
  EXPECT_NE(message("{particle: 0, motion: {x: \"1 m*cos(t/(1 s))\"}}").find("expected 0 at t = 0"), std::string::npos);
  EXPECT_NE(message("{particle: 0, motion: {y: \"0.1 m/(t/(1 s) - 0.5) + 0.2 m\"}}").find("divisor"), std::string::npos);
  EXPECT_NE(message("{particle: 0, motion: {keys: [{time: 0, by: [1, 0, 0]}]}}").find("expected the place at the start at time 0"), std::string::npos);
  EXPECT_NE(message("{particle: 0, position: false, motion: {keys: [{time: 1, by: [1, 0, 0]}]}}").find("holds the position"), std::string::npos);
  EXPECT_NE(message("{particle: 0, orientation: false, motion: {keys: [{time: 1, turn_deg: 9}]}}").find("holds the orientation"), std::string::npos);
  EXPECT_NE(message("{particle: 0, motion: {x: \"t*1 m/s\"}}, {particle: -1, motion: {x: \"t*1 m/s\"}}").find("at most one pin with a motion"), std::string::npos);
  EXPECT_NE(message("{particle: 0, motion: {z: \"t*1 m/s\"}}", "planar: true\n").find("in the plane"), std::string::npos);
  EXPECT_EQ(message("{particle: 0, motion: {z: \"t*1 m/s\"}}"), "accepted");
}

TEST(GivenLoads, ActAsThoseOfTheSceneUntilTheNextCall) {
  const std::string text = "gravity: [0, 0, -8]\n" + std::string(kChain);
  const Simulation loaded = at_end(text + "    loads: [{particle: 5, force: [0.5, 0, 1], torque: [0, 0.1, 0]}]\n");
  Simulation given(read(text));
  core::Loads loads;
  loads.reset(6);
  loads.force[5] = {0.5, 0, 1};
  loads.torque[5] = {0, 0.1, 0};
  given.set_loads(loads);
  while (given.frame() < loaded.frame()) given.step_frame();
  EXPECT_EQ(given.state().particles.position[5], loaded.state().particles.position[5]);
  EXPECT_NEAR(given.state().ledger.external_work, loaded.state().ledger.external_work, 1e-6);
  given.set_loads({});
  const double work = given.state().ledger.external_impulse.x();
  given.step_frame();
  EXPECT_EQ(given.state().ledger.external_impulse.x(), work);
}

TEST(GivenLoads, MayChangeInEveryStep) {
  // A spring to the origin by hand: the particle swings as x0 cos(w t), w^2 = 8/2.
  Simulation simulation(read("time_step: {substeps: 64}\nobjects:\n  - name: a\n    particles: {arrange: single, at: [0.3, 0, 0], mass: 2, inertia_radius: 0.1}\n"));
  core::Loads loads;
  loads.reset(1);
  while (simulation.time() < 1.0) {
    loads.force[0] = -8.0 * simulation.state().particles.position[0];
    simulation.set_loads(loads);
    simulation.step();
  }
  EXPECT_NEAR(simulation.state().particles.position[0].x(), 0.3 * std::cos(2.0 * simulation.time()), 2e-3);
  EXPECT_LT(simulation.audits().energy_error, 1e-2);
}

TEST(GivenLoads, OfAnotherShapeAreRefused) {
  Simulation simulation(read(kChain));
  core::Loads loads;
  loads.reset(5);
  EXPECT_THROW(simulation.set_loads(loads), Error);
  loads.reset(6);
  loads.force[2].x() = std::numeric_limits<double>::infinity();
  EXPECT_THROW(simulation.set_loads(loads), Error);
}

constexpr const char* kFalling = R"(
gravity: [0, 0, -10]
ground: {height: 0}
objects:
  - {name: a, particles: {arrange: single, at: [0, 0, 0.35], mass: 1}, skeleton: [{shape: point, kernel: {radius: 0.5}}], contact: {modulus: 2e4, dissipation: 2}}
pairs: [{objects: [a, ground], )";

TEST(ContactTimes, LetBodiesPassOutsideThem) {
  // Free fall for 0.5 s, then contact: the ball is below the ground by then, and stays there where contact has ended.
  const Simulation never = at_end(std::string(kFalling) + "collide: false}]\n");
  const Simulation ended = at_end(std::string(kFalling) + "until: 0.01}]\n");
  EXPECT_EQ(ended.state().particles.position[0], never.state().particles.position[0]);
  const Simulation held = at_end(std::string(kFalling) + "from: 0.02}]\n");  // before it touches
  EXPECT_GT(held.state().particles.position[0].z(), 0.15);
  Simulation dropped = at_end(std::string(kFalling) + "until: 0.75}]\n");
  EXPECT_NEAR(dropped.state().particles.velocity[0].z(), -2.5, 0.1);  // at rest until then
  EXPECT_LT(dropped.audits().energy_error, 1e-2);
  EXPECT_TRUE(dropped.contacts().summary.empty());
}

TEST(ContactTimes, PushApartWhatOverlapsAsTheyBegin) {
  Simulation simulation = at_end(std::string(kFalling) + "from: 0.25}]\n");
  EXPECT_GT(simulation.state().ledger.external_work, 10.0);  // more than the weight does
  EXPECT_LT(simulation.audits().energy_error, 1e-2);
}

TEST(ContactTimes, ContinueFromASavedStateWithTheSameBits) {
  const std::string text = std::string(kFalling) + "from: 0.1, until: 0.6}]\n";
  const Simulation whole = at_end(text);
  for (const int frame : {2, 7, 12}) {
    Simulation begun(read(text));
    while (begun.frame() < frame) begun.step_frame();
    Simulation rest(read(text));
    rest.restore(begun.state());
    while (rest.frame() < whole.frame()) rest.step_frame();
    EXPECT_EQ(rest.state_hash(), whole.state_hash()) << frame;
  }
}

TEST(ContactTimes, WakeWhatRests) {
  const Simulation simulation = at_end("sleep: {time: 0.1}\n" + std::string(kFalling) + "until: 0.75}]\n");
  EXPECT_NEAR(simulation.state().particles.velocity[0].z(), -2.5, 0.1);
}

constexpr const char* kEmitter = "gravity: [0, 0, -8]\nobjects:\n  - name: ball\n    emit: {rate: 4 Hz, count: 3, from: 0.25 s}\n"
                                 "    particles: {arrange: single, at: [\"${i}\", 0, 1], velocity: [\"${i + 1}\", 0, 0], spin: [0, 0, 2], mass: 2}\n"
                                 "    skeleton: [{shape: point, kernel: {radius: 0.2}}]\n    contact: {modulus: 1000}\n";

TEST(Emitters, LetObjectsAppearAtTheirRate) {
  Simulation simulation(read(kEmitter));
  ASSERT_EQ(simulation.scene().objects.size(), 3u);
  EXPECT_EQ(simulation.scene().objects[1].name, "ball.2");
  while (simulation.frame() < simulation.scene().frame_count()) {
    const double t = simulation.time();
    for (std::size_t k = 0; k < 3; ++k) {
      const double way = std::max(t - 0.25 * static_cast<double>(k + 1), 0.0), speed = static_cast<double>(k + 1);
      const Vec3 place = simulation.state().particles.position[k];
      EXPECT_NEAR(place.x(), static_cast<double>(k) + speed * way, 1e-9) << t;
      EXPECT_NEAR(place.z(), 1.0 - 4.0 * way * way, 1e-9) << t;
      const bool there = t >= 0.25 * static_cast<double>(k + 1) - 1e-9;
      EXPECT_EQ(simulation.meshes()[k].position.empty(), !there) << t;
      EXPECT_EQ(simulation.state().particles.velocity[k].x(), there ? speed : 0.0) << t;
    }
    simulation.step_frame();
  }
  // What they bring is the work of others.
  const RunRecord& record = simulation.state().record;
  EXPECT_LT(record.momentum_error, 1e-12 * record.momentum_scale);
  EXPECT_LT(record.energy_error, 1e-9 * record.largest_energy);
}

TEST(Emitters, TouchNothingBeforehand) {
  // A ball flies through the place where another one appears later.
  const std::string text = "objects:\n  - name: first\n    particles: {arrange: single, at: [-0.5, 0.02, 0], velocity: [2, 0, 0], mass: 1}\n"
                           "    skeleton: [{shape: point, kernel: {radius: 0.3}}]\n    contact: {modulus: 1e4}\n"
                           "  - name: second\n    appears: $\n    particles: {arrange: single, mass: 1}\n"
                           "    skeleton: [{shape: point, kernel: {radius: 0.3}}]\n    contact: {modulus: 1e4}\n";
  const auto with = [&](const std::string& time) {
    std::string out = text;
    return at_end(out.replace(out.find('$'), 1, time));
  };
  EXPECT_EQ(with("0.75").state().particles.velocity[0], Vec3(2, 0, 0));
  EXPECT_LT(with("0").state().particles.velocity[0].x(), 1.0);
}

TEST(Emitters, ContinueFromASavedStateWithTheSameBits) {
  Simulation whole(read(kEmitter));
  std::vector<State> states;
  while (whole.frame() < whole.scene().frame_count()) {
    states.push_back(whole.state());
    whole.step_frame();
  }
  for (const State& state : states) {
    Simulation again(read(kEmitter));
    again.restore(state);
    while (again.frame() < again.scene().frame_count()) again.step_frame();
    EXPECT_EQ(again.state().hash(), whole.state().hash()) << state.frame;
  }
}

TEST(Emitters, SayWhatIsWrong) {
  const auto message = [](const std::string& emit) {
    try {
      (void)read("objects:\n  - name: a\n    emit: " + emit + "\n    particles: {arrange: single}\n");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message("{count: 3}").find("expected a rate above 0"), std::string::npos) << message("{count: 3}");
  EXPECT_NE(message("{rate: 4 Hz}").find("expected a whole number from 1"), std::string::npos);
  EXPECT_NE(message("{rate: 4 m, count: 3}").find("expected a number like 4 Hz, found 4 m"), std::string::npos) << message("{rate: 4 m, count: 3}");
  EXPECT_NE(message("{rate: 4 Hz, count: 2.5}").find("expected a whole number"), std::string::npos);
  EXPECT_NE(message("{rate: 4 Hz, count: 2, until: 3 s}").find("expected one of rate, count, from"), std::string::npos);
  EXPECT_NE(message("4").find("expected a mapping with rate and count"), std::string::npos);
}

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
