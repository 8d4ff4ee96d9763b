/// The key `accuracy`: what it sets, which method it chooses, and the errors that runs tell.
#include "supple/scenes/accuracy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "supple/core/error.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// A ball on a plane.
std::string ball(const std::string& keys, double friction) {
  return "schema: 1\nduration: 1 s\nframe_rate: 24\ngravity: [0, 0, -9.81]\n" + keys + R"(
objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, 0.3], velocity: [1, 0, 0], mass: 0.1, inertia_radius: 0.03}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e4, friction: )" + std::to_string(friction) + "}\nground: {height: 0, friction: " + std::to_string(friction) + "}\n";
}

Scene read(const std::string& text) { return parse_scene(text, "test.yaml", "."); }

TEST(AccuracyKey, SetsWhatNoKeyGives) {
  const Scene fine = read(ball("accuracy: 1e-3", 0.5));
  EXPECT_EQ(accuracy_of(fine), 1e-3);
  EXPECT_EQ(contact_error(fine), 1e-3);
  EXPECT_EQ(contact_error(read(ball("contact: {error: 1e-6}\naccuracy: 1e-3", 0.5))), 1e-6);
  const Model model = build_model(fine);
  EXPECT_EQ(*model.objects[0].mesh_error, 1e-3 * size_of(model.objects[0]));
  EXPECT_EQ(*build_model(read(ball("accuracy: 1e-3\noutput: {meshing: {error: 0.004}}", 0.5))).objects[0].mesh_error, 0.004);
  EXPECT_EQ(plan_integrator(fine, model).settings.tolerance, 1e-6);
  EXPECT_EQ(plan_integrator(read(ball("accuracy: 1e-3\nintegrator: {tolerance: 1e-8}", 0.5)), model).settings.tolerance, 1e-8);
}

// Without the key the motion is that of 1e-2, unless the scene fixes its steps or its method; meshes keep their own default.
TEST(AccuracyKey, HasADefaultWhereStepsAreOpen) {
  const Scene open = read(ball("", 0.5));
  EXPECT_EQ(accuracy_of(open), 1e-2);
  EXPECT_EQ(contact_error(open), 1e-2);
  EXPECT_EQ(Simulation(open).time_step(), Simulation(read(ball("accuracy: 1e-2", 0.5))).time_step());
  EXPECT_FALSE(build_model(open).objects[0].mesh_error.has_value());
  EXPECT_TRUE(build_model(read(ball("accuracy: 1e-2", 0.5))).objects[0].mesh_error.has_value());
  EXPECT_EQ(contact_error(read(ball("contact: {error: 1e-6}", 0.5))), 1e-6);
  for (const char* fixed : {"time_step: {size: 1 ms}", "time_step: {substeps: 64}", "integrator: {method: rk4}"}) {
    const Scene scene = read(ball(fixed, 0.5));
    EXPECT_EQ(accuracy_of(scene), std::nullopt) << fixed;
    EXPECT_EQ(contact_error(scene), 1e-4) << fixed;
  }
}

TEST(AccuracyKey, TakesStepsThatGrowWithItsRoot) {
  const auto steps = [](const std::string& accuracy) { return 1 << Simulation(read(ball("accuracy: " + accuracy, 0.0))).state().halvings; };
  EXPECT_EQ(steps("1e-4"), 8 * steps("6.4e-3"));  // both methods are of second order, steps powers of two
}

TEST(AccuracyKey, ChoosesByWhatItsErrorCosts) {
  const auto choice = [](const std::string& text) {
    const Scene scene = read(text);
    return plan_integrator(scene, build_model(scene));
  };
  const IntegratorPlan slides = choice(ball("accuracy: 1e-2", 0.5)), smooth = choice(ball("accuracy: 1e-2", 0.0));
  EXPECT_EQ(slides.settings.method, core::Integrator::ImplicitMidpoint);
  EXPECT_NE(slides.reason.find("of velocity Verlet, to resolve friction"), std::string::npos) << slides.reason;
  EXPECT_EQ(smooth.settings.method, core::Integrator::Symplectic);
  EXPECT_EQ(choice(ball("", 0.5)).settings.method, core::Integrator::ImplicitMidpoint);
  EXPECT_EQ(choice(ball("time_step: {size: 1 ms}", 0.5)).settings.method, core::Integrator::Symplectic);
  // Explicit steps that the scene selects by name are as short as friction needs them.
  EXPECT_EQ(choice(ball("accuracy: 1e-2\nintegrator: {method: symplectic}", 0.5)).settings.method, core::Integrator::Symplectic);
}

TEST(AccuracyKey, CountsTheFrictionOfBodiesThatLoadsPressTogether) {
  const auto choice = [](const std::string& force) {
    const Scene scene = read(R"(
schema: 1
duration: 2 s
frame_rate: 24
gravity: [0, 0, 0]
objects:
  - name: pressed
    particles: {at: [0, 0, 0.3], mass: 0.05}
    skeleton: [{shape: point, kernel: {radius: 0.2}}]
    contact: {modulus: 2e4, friction: 0.4}
    loads: [{particle: 0, force: )" + force + R"(}]
ground: {friction: 0.4}
)");
    return plan_integrator(scene, build_model(scene)).settings.method;
  };
  EXPECT_EQ(choice("[0.5, 0, -2]"), core::Integrator::ImplicitMidpoint);
  EXPECT_EQ(choice("[0, 0, 0]"), core::Integrator::Symplectic);  // nothing moves
}

TEST(AccuracyKey, TakesImplicitStepsWhereFastVibrationsDieOut) {
  const auto choice = [](const std::string& ratio) {
    const Scene scene = read(R"(
schema: 1
duration: 1 s
frame_rate: 24
gravity: [0, 0, -9.81]
objects:
  - name: block
    particles: {arrange: grid, columns: 10, rows: 3, layers: 3, spacing: 0.05, at: [0, 0, 0.3]}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.08}}]
    material: {youngs_modulus: 2e4, density: 1000, damping_ratio: )" + ratio + R"(}
    contact: {friction: 0}
obstacles: [{name: floor, shape: plane}]
)");
    return plan_integrator(scene, build_model(scene)).settings.method;
  };
  EXPECT_EQ(choice("0.3"), core::Integrator::ImplicitMidpoint);
  EXPECT_EQ(choice("0.002"), core::Integrator::Symplectic);
}

TEST(ImplicitMethod, IsMidpointInStepsThatResolveContactAndElseBackwardEuler) {
  const auto choice = [](const std::string& keys) {
    const Scene scene = read(ball("integrator: {method: implicit}\n" + keys, 0.5));
    return plan_integrator(scene, build_model(scene)).settings.method;
  };
  EXPECT_EQ(choice(""), core::Integrator::ImplicitMidpoint);
  EXPECT_EQ(choice("time_step: {substeps: 256}"), core::Integrator::ImplicitMidpoint);
  EXPECT_EQ(choice("time_step: {substeps: 1}"), core::Integrator::BackwardEuler);
}

TEST(AccuracyKey, TakesImplicitStepsWhereDampingIsFasterThanExplicitOnes) {
  const auto choice = [](const std::string& angular) {
    const Scene scene = read(R"(
schema: 1
duration: 1 s
frame_rate: 24
accuracy: 1e-2
gravity: [0, 0, 0]
objects:
  - name: spiral
    particles: {arrange: spiral, count: 10, inner_radius: 0.15, outer_radius: 0.55, turns: 1.2, normal: radial, mass: 40 g}
    interactions:
      - {law: bond_frame, neighbours: 1, stretch: 60, rotation: 0.5}
      - {law: friction, linear: 0.1, angular: )" + angular + R"(}
)");
    return plan_integrator(scene, build_model(scene));
  };
  const IntegratorPlan damped = choice("0.5"), free = choice("1e-6");
  EXPECT_EQ(damped.settings.method, core::Integrator::ImplicitMidpoint) << damped.reason;
  EXPECT_NE(damped.reason.find("to resolve damping between particles"), std::string::npos) << damped.reason;
  EXPECT_EQ(free.settings.method, core::Integrator::Symplectic) << free.reason;
}

TEST(ImplicitMethod, ResolvesTheContactsOfThePairsThatThereAre) {
  // A light hard ball that can only meet a soft one: the pair is about as soft as the latter.
  const auto frequency = [](const std::string& ground) {
    const Scene scene = read(R"(
schema: 1
duration: 1 s
frame_rate: 24
accuracy: 1e-2
integrator: {method: implicit}
objects:
  - name: light
    particles: {arrange: single, at: [0, 0, 0.3], mass: 0.01}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e6}
  - name: soft
    particles: {arrange: single, at: [0, 0, 0], mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e3}
)" + ground);
    return plan_integrator(scene, build_model(scene)).limiting_frequency;
  };
  EXPECT_LT(frequency(""), 0.05 * frequency("ground: {height: -1}\n"));
}

/// Balls that fall stay above the ground, and no faster than `most`.
void expect_kept(const std::string& text, double most, int frames) {
  Simulation simulation(read(text));
  simulation.advance_to(frames);
  for (std::size_t i = 0; i < simulation.state().particles.size(); ++i) {
    EXPECT_GT(simulation.state().particles.position[i].z(), 0.0) << text;
    EXPECT_LT(simulation.state().particles.velocity[i].norm(), 1.01 * most) << text;
  }
}

TEST(ImplicitMethod, NeitherExplodesNorPassesThroughInLongSteps) {
  const double most = std::sqrt(1.0 + 2.0 * 9.81 * 0.3);  // speed of all the energy that there is [m/s]
  for (const int substeps : {1, 8}) {
    for (const double modulus : {1e4, 1e6, 1e9}) {  // softer ones cannot carry the ball
      std::string text = ball("integrator: {method: implicit}\ntime_step: {substeps: " + std::to_string(substeps) + "}", 0.5);
      text.replace(text.find("1e4"), 3, std::to_string(modulus));
      expect_kept(text, most, 15);
    }
  }
}

TEST(ImplicitMethod, StopsABulletInStepsOfAFrame) {
  std::string text = ball("integrator: {method: implicit}\ntime_step: {substeps: 1}", 0.5);
  text.replace(text.find("1e4"), 3, "1e9");
  text.replace(text.find("velocity: [1, 0, 0]"), 19, "velocity: [0, 0, -400]");
  text.replace(text.find("height: 0,"), 10, "height: 0, modulus: 1e9,");  // a softer one cannot carry it
  expect_kept(text, 403.0, 12);
}

TEST(ImplicitMethod, KeepsALightBallUnderOneOfTenThousandTimesItsMassInStepsOfAFrame) {
  const std::string text = R"(
schema: 1
duration: 1 s
frame_rate: 24
gravity: [0, 0, -9.81]
integrator: {method: implicit}
time_step: {substeps: 1}
objects:
  - name: heavy
    particles: {arrange: single, at: [0, 0, 0.28], mass: 100}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e7}
  - name: light
    particles: {arrange: single, at: [0, 0, 0.06], mass: 0.01}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e7}
ground: {height: 0, modulus: 1e9}
)";
  // A heavy body can give a light one twice its speed.
  expect_kept(text, 2.0 * std::sqrt(2.0 * 9.81 * 0.28), 12);
}

/// A ball that cannot turn, on a slope of the given tangent, with a coefficient of friction of 0.3. It begins a little above its depth at rest. The slope
/// is hard, so that the contact surface is flat.
Simulation block_on_slope(double tangent, double accuracy) {
  const double slope = std::atan(tangent);
  const Vec3 normal(std::sin(slope), 0.0, std::cos(slope));
  const auto text = [](const Vec3& v) { return '[' + std::to_string(v.x()) + ", 0, " + std::to_string(v.z()) + ']'; };
  return Simulation(read("schema: 1\nduration: 10 s\nframe_rate: 24\ngravity: [0, 0, -9.81]\nintegrator: {method: implicit}\naccuracy: " +
                         std::to_string(accuracy) + R"(
objects:
  - name: block
    particles: {arrange: single, at: )" + text(0.047 * normal) + R"(, mass: 0.1, inertia_radius: 0.03}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e4, friction: 0.3, dissipation: 3}
    pins: [{particle: 0, position: false}]
obstacles:
  - {name: slope, shape: plane, normal: )" + text(normal) + R"(, friction: 0.3, modulus: 1e9}
)"));
}

TEST(ImplicitMethod, HoldsABlockOnASlopeToAMillionthOfItsSize) {
  Simulation simulation = block_on_slope(0.25, 1e-2);
  simulation.advance_to(49);  // 2 s: it has come to rest
  const Vec3 begin = simulation.state().particles.position[0];
  simulation.advance_to(241);
  EXPECT_LT((simulation.state().particles.position[0] - begin).norm(), 1e-6 * size_of(simulation.model().objects[0]));
}

TEST(ImplicitMethod, SlidesDownASlopeAtGravityLessFriction) {
  Simulation simulation = block_on_slope(0.6, 1e-3);
  simulation.advance_to(13);
  const Vec3 early = simulation.state().particles.velocity[0];
  simulation.advance_to(37);
  const double acceleration = (simulation.state().particles.velocity[0] - early).norm();  // of 1 s
  const double slope = std::atan(0.6), expected = 9.81 * (std::sin(slope) - 0.3 * std::cos(slope));
  EXPECT_NEAR(acceleration, expected, 5e-3 * expected);
}

/// What friction makes of the way of a ball that comes down slantwise and begins to roll [m].
double way_of_a_bounce(int substeps) {
  Simulation simulation(read(ball("integrator: {method: implicit}\naccuracy: 1e-4\ntime_step: {substeps: " + std::to_string(substeps) + "}", 0.5)));
  while (simulation.frame() < 13) simulation.step_frame();
  return simulation.state().particles.position[0].x();
}

TEST(ImplicitMethod, SpinsUpABallFasterThanToFirstOrder) {
  const double fine = way_of_a_bounce(1024), error16 = std::abs(way_of_a_bounce(16) - fine), error64 = std::abs(way_of_a_bounce(64) - fine);
  EXPECT_LT(error64, error16 / 4.0);
  EXPECT_LT(error64, 1e-2 * 0.09);  // of the ball's size
}

nlohmann::json errors_of(const std::string& text) {
  const fs::path folder = temp_folder() / "accuracy_errors";
  fs::remove_all(folder);
  const RunResult done = run_scene(read(text), {.folder = folder, .threads = 1});
  EXPECT_EQ(done.outcome, "done") << done.reason;
  std::ifstream file(folder / "result.json");
  return nlohmann::json::parse(file);
}

TEST(StageErrors, OfTimeFallWithTheSquareOfTheStep) {
  const auto error = [](int substeps) {
    return errors_of(R"(
schema: 1
duration: 2 s
frame_rate: 24
time_step: {substeps: )" + std::to_string(substeps) + R"(}
objects:
  - name: pair
    particles: {arrange: line, count: 2, spacing: 1, spin: [0, 0, 2], mass: 1, inertia_radius: 0.1}
    interactions: [{law: bond_frame, stretch: 400, rotation: 1}]
)").at("errors").at("time").at("position_m").get<double>();
  };
  EXPECT_NEAR(error(8) / error(16), 4.0, 0.2);
}

// The adaptive method chooses its steps by itself, however long those are that it is given.
TEST(StageErrors, OfTimeAreAboutThoseOfTheAdaptiveMethod) {
  const auto scene = [](const std::string& tolerance) {
    return R"(
schema: 1
duration: 2 s
frame_rate: 24
integrator: {method: adaptive, tolerance: )" + tolerance + R"(}
objects:
  - name: pair
    particles: {arrange: line, count: 2, spacing: 1, spin: [0, 0, 2], mass: 1, inertia_radius: 0.1}
    interactions: [{law: bond_frame, stretch: 400, rotation: 1}]
)";
  };
  const auto end = [&scene](const std::string& tolerance) {
    Simulation simulation(read(scene(tolerance)));
    while (simulation.frame() < 48) simulation.step_frame();
    return Vec3(simulation.state().particles.position[0]);
  };
  const Vec3 exact = end("1e-12");
  for (const std::string tolerance : {"1e-3", "1e-4", "1e-5"}) {
    const double error = (end(tolerance) - exact).norm(), estimate = errors_of(scene(tolerance)).at("errors").at("time").at("position_m").get<double>();
    EXPECT_GE(estimate, 0.1 * error) << tolerance;  // three frames of 48 tell no more than the order of magnitude
    EXPECT_LE(estimate, 10.0 * error) << tolerance;
  }
}

TEST(StageErrors, OfTimeDoNotGrowWhileBodiesRest) {
  // The ball rests after half a second: what its speed erred by as it fell is gone.
  const auto estimate = [](const std::string& duration) {
    return errors_of("schema: 1\nduration: " + duration + R"(
frame_rate: 24
gravity: [0, 0, -9.81]
objects:
  - name: ball
    particles: {at: [0, 0, 0.3], mass: 0.1, inertia_radius: 0.03}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e4, friction: 0.5, dissipation: 2}
    medium: {linear: 0.5, angular: 1e-3}
ground: {height: 0, friction: 0.5}
)").at("errors").at("time").at("position_m").get<double>();
  };
  const double brief = estimate("1.5 s"), late = estimate("6 s");
  EXPECT_GT(brief, 0.0);
  EXPECT_LT(late, 2.0 * brief);
}

TEST(StageErrors, OfTimeAreNoMoreThanTheWayThatIsLeft) {
  // The block falls by a centimetre and rests for nine seconds, in which differences of its last vibrations would drift by three.
  const nlohmann::json errors = errors_of(R"(
schema: 1
duration: 10 s
frame_rate: 24
gravity: [0, 0, -9.81]
integrator: {method: implicit}
accuracy: 1e-2
objects:
  - name: block
    particles: {at: [0, 0, 0.047], mass: 0.1, inertia_radius: 0.03}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e4, dissipation: 3}
ground: {height: 0, modulus: 1e9}
)").at("errors").at("time");
  EXPECT_GT(errors.at("position_m").get<double>(), 0.0);
  EXPECT_LT(errors.at("position_m").get<double>(), 0.01);
}

TEST(StageErrors, CostAtMostATenthOfTheRunForEachStageBesideTheFirstOfEachKind) {
  const nlohmann::json errors = errors_of(R"(
schema: 1
duration: 4 s
frame_rate: 24
gravity: [0, 0, -9.81]
accuracy: 1e-2
objects:
  - name: blocks
    particles: {arrange: grid, columns: 2, rows: 2, layers: 2, spacing: 0.09, at: [0, 0, 0.1], mass: 0.1, inertia_radius: 0.03}
    separate: true
    skeleton: [{shape: segment, half_length: 0.03, kernel: {type: wyvill, radius: 0.1}}]
    contact: {modulus: 1e4, friction: 0.3, dissipation: 3}
ground: {height: 0, friction: 0.5}
)").at("errors");
  EXPECT_GT(errors.at("contact").at("frames"), 1);
  EXPECT_GT(errors.at("work").get<double>(), 0.02);
  EXPECT_LT(errors.at("work").get<double>(), 0.25);  // 96 frames: the first ones are some of these
}

TEST(StageErrors, NameTheLargestAndWhatFrictionIsBlurredBy) {
  const nlohmann::json blurred = errors_of(ball("accuracy: 1e-2\nintegrator: {method: symplectic}\ntime_step: {substeps: 64}", 0.5));
  EXPECT_EQ(blurred.at("errors").at("largest"), "time");
  EXPECT_EQ(blurred.at("friction").at(0).at("a"), "ball");
  EXPECT_GT(blurred.at("friction").at(0).at("speed_m_s"), 10.0 * ContactDesc{}.friction_speed);
  EXPECT_NE(blurred.at("warnings").dump().find("explicit steps reduce friction below"), std::string::npos);
  const nlohmann::json kept = errors_of(ball("accuracy: 1e-2", 0.5));
  EXPECT_EQ(kept.at("warnings").dump().find("explicit steps"), std::string::npos);
}

}  // namespace
}  // namespace supple::scenes
