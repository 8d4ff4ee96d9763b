/// The key `integrator`: what each choice does to a scene, and what `auto` chooses.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "supple/core/error.h"
#include "supple/scenes/accuracy.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// A chain of turning ellipsoids that a load bends.
std::string chain(const std::string& integrator, const std::string& stretch = "50") {
  return R"(
schema: 1
duration: 1 s
frame_rate: 20
gravity: [0, 0, -1]
)" + integrator +
         R"(
objects:
  - name: chain
    particles: {arrange: line, count: 5, spacing: 0.2, spin: [0, 1, 2], mass: 0.1, inertia_axes: [0.1, 0.07, 0.05]}
    interactions:
      - {law: bond_frame, stretch: )" +
         stretch + R"(, rotation: 0.5}
      - {law: friction, linear: 0.1, angular: 0.001}
    medium: {linear: 0.2}
    pins: [{particle: 0}]
    loads: [{particle: -1, force: [0, 0.3, 0], ramp: 0.1, until: 0.6}]
)";
}

Simulation make(const std::string& text, int threads = 1) {
  return Simulation(parse_scene(text, "test.yaml", "."), {.threads = threads});
}

void run(Simulation& simulation, int frames) {
  while (simulation.frame() < frames) simulation.step_frame();
}

std::string method(const std::string& name) { return "integrator: {method: " + name + "}"; }

const std::vector<std::string> kMethods{"rk4", "adaptive", "backward_euler", "implicit_midpoint"};

TEST(IntegratorKey, GivesEachMethodItsOwnMotionNearTheOthers) {
  Simulation plain = make(chain(""));
  run(plain, 6);
  Simulation named = make(chain(method("symplectic")));
  run(named, 6);
  EXPECT_EQ(named.state_hash(), plain.state_hash());
  for (const std::string& name : kMethods) {
    Simulation other = make(chain(method(name)));
    run(other, 6);
    EXPECT_NE(other.state_hash(), plain.state_hash()) << name;
    EXPECT_EQ(other.time(), plain.time()) << name;
    EXPECT_TRUE(other.integration().within_tolerance) << name;
    EXPECT_LT(other.audits().momentum_error, 1e-12) << name;
    double largest = 0.0;
    for (std::size_t i = 0; i < 5; ++i) {
      largest = std::max(
          largest, (other.state().particles.position[i] - plain.state().particles.position[i]).norm());
    }
    // Verlet and the others agree to their errors; backward Euler takes one step a frame and damps.
    EXPECT_LT(largest, name == "backward_euler" || name == "implicit_midpoint" ? 0.1 : 1e-3) << name;
  }
}

TEST(IntegratorKey, TurnsAnisotropicParticlesByTheRotationItNames) {
  Simulation splitting = make(chain("")), exponential = make(chain("integrator: {rotation: exponential}"));
  run(splitting, 6);
  run(exponential, 6);
  EXPECT_NE(splitting.state_hash(), exponential.state_hash());
  EXPECT_LE((splitting.state().particles.position[4] - exponential.state().particles.position[4]).norm(), 1e-3);
}

TEST(IntegratorKey, FollowsItsTolerance) {
  const auto steps = [](const std::string& tolerance) {
    Simulation simulation = make(chain("integrator: {method: adaptive, tolerance: " + tolerance + "}"));
    run(simulation, 6);
    return simulation.integration().substeps;
  };
  EXPECT_GT(steps("1e-10"), 2 * steps("auto"));
  const auto corrections = [](const std::string& tolerance) {
    Simulation simulation = make(chain("integrator: {method: backward_euler, tolerance: " + tolerance + "}"));
    run(simulation, 6);
    return simulation.integration().newton_iterations;
  };
  EXPECT_LT(corrections("1e-2"), corrections("auto"));
}

TEST(IntegratorKey, KeepsTheBitsOfARestartAndOfEveryNumberOfThreads) {
  for (const std::string& name : kMethods) {
    const std::string text = chain(method(name));
    Simulation whole = make(text);
    run(whole, 4);
    const fs::path path = temp_folder() / ("integrator_" + name + ".state");
    save_state(path, whole.state(), {.scene = 7});
    run(whole, 8);
    Simulation resumed = make(text, 3);
    resumed.restore(load_state(path, {.scene = 7}));
    run(resumed, 8);
    EXPECT_EQ(whole.state_hash(), resumed.state_hash()) << name;
    fs::remove(path);
  }
}

TEST(IntegratorKey, OfTheLibraryFollowsFromTheDefaultAccuracy) {
  int chosen = 0;
  for (const auto& entry : fs::recursive_directory_iterator(source_dir() / "scenes/library")) {
    if (entry.path().extension() != ".yaml") continue;
    const Scene scene = read_scene(entry.path());
    if (!leaves_steps_open(scene)) continue;
    const std::string reason = plan_integrator(scene, build_model(scene)).reason;
    EXPECT_NE(reason.find(": accuracy 0.01 takes "), std::string::npos) << entry.path() << ": " << reason;
    ++chosen;
  }
  EXPECT_GE(chosen, 30);
}

// The default accuracy gives way where it needs more steps than are allowed; one that the scene gives does not.
TEST(IntegratorKey, LeavesWavesUnresolvedThatAreTooStiffForTheDefaultAccuracy) {
  Simulation stiff = make(chain("", "1e10"));
  EXPECT_EQ(stiff.integrator().settings.method, core::Integrator::BackwardEuler);
  EXPECT_NE(explain(stiff).find("which are more than time_step.max_substeps"), std::string::npos) << explain(stiff);
  run(stiff, 4);
  EXPECT_TRUE(stiff.integration().within_tolerance);
  EXPECT_THROW(make(chain("accuracy: 1e-2", "1e10")), Error);
  EXPECT_EQ(make(chain("", "1e5")).integrator().settings.method, core::Integrator::Symplectic);
}

TEST(IntegratorKey, ChoosesBackwardEulerWhereVelocityVerletWouldNeedFarMoreStepsThanTheSceneBounds) {
  const std::string bound = "time_step: {size: 50 ms}";
  Simulation soft = make(chain(bound)), stiff = make(chain(bound, "1e9"));
  EXPECT_EQ(soft.integrator().settings.method, core::Integrator::Symplectic);
  EXPECT_EQ(stiff.integrator().settings.method, core::Integrator::BackwardEuler);
  EXPECT_TRUE(stiff.integrator().chosen);
  EXPECT_NE(explain(stiff).find(" steps per frame instead of "), std::string::npos) << explain(stiff);
  EXPECT_NE(explain(soft).find("symplectic: "), std::string::npos) << explain(soft);
  run(stiff, 8);
  EXPECT_TRUE(stiff.integration().within_tolerance);
  // Also where Verlet is allowed all the steps it needs, 2^14 a frame instead of 2^2.
  const std::string allowing = "time_step: {size: 50 ms, max_substeps: 1048576}";
  Simulation allowed = make(chain(allowing, "1e9"));
  EXPECT_EQ(allowed.integrator().settings.method, core::Integrator::BackwardEuler);
  EXPECT_EQ(make(chain(allowing, "1e5")).integrator().settings.method,
            core::Integrator::Symplectic);
  // A step that the scene fixes is taken as it is.
  Simulation fixed = make(chain("time_step: {substeps: 4}", "1e9"));
  EXPECT_EQ(fixed.integrator().settings.method, core::Integrator::Symplectic);
}

TEST(IntegratorKey, RefusesWhatItsSmallestStepCannotReach) {
  Simulation simulation = make(chain("integrator: {method: adaptive, tolerance: 1e-13}\ntime_step: {max_substeps: 8}"));
  try {
    run(simulation, 3);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    EXPECT_NE(std::string(error.what()).find("integrator.tolerance"), std::string::npos) << error.what();
  }
  EXPECT_EQ(simulation.frame(), 1);
}

TEST(IntegratorKey, CarriesContactThroughEveryMethod) {
  for (const std::string& name : kMethods) {
    Simulation simulation = make(R"(
schema: 1
duration: 1 s
frame_rate: 20
gravity: [0, 0, -9.81]
ground: {height: 0, modulus: 1e6}
)" + method(name) + R"(
objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, 0.4], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 5e3}
)");
    double lowest = 1.0;
    while (simulation.frame() < 9) {
      simulation.step_frame();
      lowest = std::min(lowest, simulation.state().particles.position[0].z());
    }
    // It falls .17 m to the ground in .19 s and is at the top again at .4 s, but for a little of the energy; backward Euler takes more of it.
    EXPECT_GT(lowest, 0.1) << name;
    EXPECT_LT(lowest, 0.25) << name;
    EXPECT_NEAR(simulation.state().particles.position[0].z(), 0.4, std::string(name) == "backward_euler" ? 0.2 : 0.05) << name;
    EXPECT_LT(simulation.audits().momentum_error, 1e-12) << name;
  }
}

/// A table of four feet on a slope of 20 degrees, whose friction with it is `friction`.
Simulation table_on_slope(const std::string& integrator, double friction, int threads = 1) {
  return make(R"(
schema: 1
duration: 2 s
frame_rate: 24
gravity: [0, 0, -9.81]
)" + method(integrator) + R"(
objects:
  - name: table
    particles: {arrange: single, at: [-0.3504, 0, 0.2068], axis: [0.342020143, 0, 0.939692621], mass: 0.5, inertia_radius: 0.12}
    skeleton:
      - {shape: point, at: [0.1, 0.1, -0.03], kernel: {type: wyvill, radius: 0.1}}
      - {shape: point, at: [0.1, -0.1, -0.03], kernel: {type: wyvill, radius: 0.1}}
      - {shape: point, at: [-0.1, 0.1, -0.03], kernel: {type: wyvill, radius: 0.1}}
      - {shape: point, at: [-0.1, -0.1, -0.03], kernel: {type: wyvill, radius: 0.1}}
    contact: {modulus: 5e4, dissipation: 1}
obstacles: [{name: slope, shape: plane, normal: [0.342020143, 0, 0.939692621], modulus: 1e9}]
pairs: [{objects: [table, slope], friction: )" + std::to_string(friction) + "}]\n", threads);
}

TEST(ImplicitContact, HoldsATableBelowTheAngleOfFrictionWithoutSprings) {
  Simulation simulation = table_on_slope("backward_euler", 0.5);
  run(simulation, 13);  // it has settled
  const Vec3 before = simulation.state().particles.position[0];
  run(simulation, 37);
  EXPECT_LT((simulation.state().particles.position[0] - before).norm(), 1e-6 * 0.2) << "of its size, in a second";
  EXPECT_TRUE(simulation.integration().within_tolerance);
}

TEST(ImplicitContact, LetsATableSlideWithWhatFrictionLeaves) {
  for (const std::string name : {"backward_euler", "implicit_midpoint"}) {
    Simulation simulation = table_on_slope(name, 0.2);
    run(simulation, 13);  // it bounces no more
    const double before = simulation.state().particles.velocity[0].norm();
    run(simulation, 37);
    const double gained = simulation.state().particles.velocity[0].norm() - before;
    const double slope = 20.0 * std::numbers::pi / 180.0;
    const double expected = 9.81 * (std::sin(slope) - 0.2 * std::cos(slope));
    EXPECT_NEAR(gained, expected, 5e-3 * expected) << name;
  }
}

TEST(ImplicitContact, GivesTheSameBitsForAnyThreadsAndAfterARestart) {
  for (const std::string name : {"backward_euler", "implicit_midpoint"}) {
    Simulation one = table_on_slope(name, 0.3), four = table_on_slope(name, 0.3, 4);
    run(one, 5);
    Simulation again = table_on_slope(name, 0.3);
    again.restore(one.state());
    run(one, 9);
    run(four, 9);
    run(again, 9);
    EXPECT_EQ(four.state_hash(), one.state_hash()) << name;
    EXPECT_EQ(again.state_hash(), one.state_hash()) << name;
  }
}

TEST(ImplicitContact, KeepsTheEnergyOfABodyOfSeveralPartsToTheOrderOfTheMethod) {
  // A soft bar bounces slantwise. Were its elastic force shared by contributions, energy would change by a quarter whatever the step.
  const auto error = [](int substeps) {
    Simulation bar = make(R"(
schema: 1
duration: 1 s
frame_rate: 20
gravity: [0, 0, -9.81]
time_step: {substeps: )" + std::to_string(substeps) + "}\n" + method("implicit_midpoint") + R"(
objects:
  - name: bar
    particles: {arrange: line, count: 4, spacing: 0.05, at: [0, 0, 0.12], axis: [1, 0, 0.3], mass: 0.05}
    interactions: [{law: bond_frame, within: 0.06, stretch: 400, rotation: 0.05}]
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.08}}]
    contact: {modulus: 2e4, friction: 0, dissipation: 0}
obstacles: [{name: floor, shape: plane, modulus: 1e8}]
)");
    run(bar, 7);
    return bar.audits().energy_error;
  };
  const double coarse = error(64), fine = error(256);
  EXPECT_LT(fine, 0.2 * coarse);
  EXPECT_LT(fine, 5e-4);
}

/// Ellipsoids that fall together, with the two wells or those of `extra`.
std::string ellipsoids(const std::string& integrator, const std::string& extra = "") {
  return R"(
schema: 1
duration: 1 s
frame_rate: 20
)" + integrator +
         R"(
objects:
  - name: cluster
    particles: {arrange: grid, columns: 3, rows: 3, layers: 2, spacing: 0.25, disorder: 0.02, mass: 0.1,
                inertia_axes: [0.06, 0.08, 0.1], spin: [0, 0, 1]}
    interactions: [{law: gay_berne, geometric: true, semi_axes: [0.06, 0.08, 0.1], depth: 0.01, cut_off: 0.6)" +
         extra + "}]\n";
}

TEST(GayBerneKey, MovesEllipsoidsByEveryMethodAndKeepsEnergy) {
  Simulation plain = make(ellipsoids(""));
  run(plain, 10);
  EXPECT_LT(plain.audits().energy_error, 1e-3);
  EXPECT_LT(plain.audits().momentum_error, 1e-12);
  EXPECT_LT(plain.audits().angular_momentum_error, 1e-10);
  Simulation threads = make(ellipsoids(""), 3);
  run(threads, 10);
  EXPECT_EQ(threads.state_hash(), plain.state_hash());
  Simulation wells = make(ellipsoids("", ", wells: [1, 0.5, 0.2], mu: 2"));
  run(wells, 10);
  EXPECT_NE(wells.state_hash(), plain.state_hash());
  Simulation implicit = make(ellipsoids(method("implicit_midpoint")));
  run(implicit, 10);
  EXPECT_TRUE(implicit.integration().within_tolerance);
  for (std::size_t i = 0; i < 18; ++i) {
    const Vec3 shift = implicit.state().particles.position[i] - plain.state().particles.position[i];
    EXPECT_LT(shift.norm(), 0.02) << i;
  }
}

TEST(RayleighKey, DampsDeformationByItsStiffnessAndMotionByItsMass) {
  const auto run_with = [](const std::string& damping) {
    std::string text = chain("");
    text.insert(text.find("    medium:"), damping);
    Simulation simulation = make(text);
    run(simulation, 11);
    return std::pair{simulation.energies().total(), simulation.state().ledger.dissipated};
  };
  const auto [plain, plain_loss] = run_with("");
  const auto [stiffness, stiffness_loss] = run_with("    rayleigh: {stiffness: 20 ms}\n");
  const auto [mass, mass_loss] = run_with("    rayleigh: {mass: 2}\n");
  EXPECT_NE(stiffness, plain);
  EXPECT_GT(stiffness_loss, plain_loss);
  EXPECT_GT(mass_loss, plain_loss);
  // The mass term is the drag of a medium, linear and angular.
  std::string text = chain("");
  text.replace(text.find("medium: {linear: 0.2}"), 21, "medium: {linear: 2.2, angular: 2}");
  Simulation medium = make(text);
  run(medium, 11);
  EXPECT_NEAR(medium.energies().total(), mass, 1e-6 * mass);
}

}  // namespace
}  // namespace supple::scenes
