#include "supple/scenes/simulation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <thread>

#include "scenes/run_scenes.h"
#include "scenes/small_scenes.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/mesh.h"
#include "supple/scenes/read_scene.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// Two deformable balls that meet off centre and spin, without friction and damping.
std::string two_balls(const std::string& extra = "") {
  return R"(
schema: 1
duration: 1 s
frame_rate: 10
)" + extra + R"(
objects:
  - name: left
    particles: {arrange: single, at: [-0.6, 0.05, 0], velocity: [2, 0, 0], spin: [0, 1, 2], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    contact: {modulus: 2e3}
  - name: right
    particles: {arrange: single, at: [0.6, -0.05, 0.1], velocity: [-1, 0, 0], mass: 0.8}
    skeleton: [{shape: ellipsoid, semi_axes: [0.7, 0.9, 0.6], kernel: {type: wyvill}}]
    contact: {modulus: 3e3}
)";
}

/// Two balls in a row about `kMiddle`.
const Vec3 kMiddle(0.013, 0.007, 0.004);
Mesh mesh_of_graph(const std::string& meshing) {
  Simulation simulation = make(R"(
schema: 1
duration: 1 s
objects:
  - name: pair
    particles: {arrange: line, count: 2, spacing: 0.4, at: [0.013, 0.007, 0.004], mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    blend: {rule: graph}
output: {mesh: ply, cell: 0.05, meshing: )" + meshing + "}\n");
  return simulation.meshes().front();
}

TEST(Advancing, EndsAtTheFrameOrWhereItIsTold) {
  Simulation simulation = make(two_balls());
  EXPECT_TRUE(simulation.advance_to(1, [] { return false; }));
  EXPECT_EQ(simulation.state().steps, 0u);
  int asked = 0;
  EXPECT_FALSE(simulation.advance_to(3, [&] { return ++asked < 2; }));
  EXPECT_EQ(simulation.state().steps, 2u);
  EXPECT_TRUE(simulation.advance_to(3));
  Simulation straight = make(two_balls());
  run(straight, 3);
  EXPECT_EQ(simulation.state_hash(), straight.state_hash());
}

TEST(Advancing, IsInterruptedWithinAStepAndGoesOnFromTheLastFrame) {
  Simulation undisturbed = make(two_balls()), simulation = make(two_balls());
  std::atomic<int> interrupt{0};
  const InterruptScope scope(&interrupt);
  simulation.advance_to(3);
  const std::uint64_t at_frame = simulation.state_hash();
  simulation.step();
  simulation.step();
  interrupt = 2;
  EXPECT_THROW(simulation.step(), Interrupted);
  EXPECT_EQ(simulation.frame(), 3);
  EXPECT_EQ(simulation.state_hash(), at_frame);
  interrupt = 0;
  simulation.advance_to(5);
  undisturbed.advance_to(5);
  EXPECT_EQ(simulation.state_hash(), undisturbed.state_hash());
}

// Ten thousand times stiffer than its steps resolve: the linear system of one of them takes minutes.
TEST(Advancing, IsInterruptedWithinALinearSystem) {
  Simulation simulation = make(R"(
schema: 1
duration: 1 s
frame_rate: 24
integrator: {method: backward_euler}
gravity: [0, 0, -9.81]
objects:
  - name: sheet
    particles: {arrange: grid, columns: 120, rows: 120, spacing: 0.01, mass: 1e-4}
    interactions: [{law: bond_frame, within: 0.015, stretch: 1e12, rotation: 0.1}]
    pins: [{particle: 0}, {particle: -1}]
)");
  std::atomic<int> interrupt{0};
  const InterruptScope scope(&interrupt);
  std::chrono::steady_clock::time_point told;
  std::jthread signal([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    told = std::chrono::steady_clock::now();
    interrupt = 2;
  });
  EXPECT_THROW(simulation.advance_to(1000), Interrupted);
  signal.join();
  EXPECT_LT(std::chrono::steady_clock::now() - told, std::chrono::seconds(5));  // a second, on a machine that others use, too
}

class Arrays : public testing::TestWithParam<const char*> {};
TEST_P(Arrays, StayWhereTheyAreInMemory) {
  Simulation simulation = make(two_balls(std::string("integrator: {method: ") + GetParam() + "}\n"));
  const core::ParticleState& particles = simulation.state().particles;
  const auto places = [&] {
    return std::array<const void*, 4>{particles.position.data(), particles.orientation.data(), particles.velocity.data(),
                                      particles.angular_momentum.data()};
  };
  const auto before = places();
  simulation.step();
  EXPECT_EQ(places(), before) << "by a step";
  simulation.restore(State(simulation.state()));
  EXPECT_EQ(places(), before) << "by a state from elsewhere";
  std::vector<Vec3> elsewhere = particles.position;
  elsewhere[0].x() -= 1.0;
  simulation.set_particles({.position = elsewhere});
  EXPECT_EQ(places(), before) << "by other places";
}
INSTANTIATE_TEST_SUITE_P(Integrators, Arrays, testing::Values("symplectic", "rk4", "adaptive", "backward_euler", "implicit_midpoint"));

TEST(Adopting, OfTheSameSceneGoesOnWithTheSameBits) {
  Simulation first = make(two_balls()), second = make(two_balls());
  run(first, 4);
  for (int k = 0; k < 3; ++k) first.step();
  ASSERT_FALSE(first.contacts().summary.empty());
  second.adopt(first.state());
  EXPECT_EQ(second.time(), first.time());
  run(first, 8);
  run(second, 8);
  EXPECT_EQ(second.state().particles.position, first.state().particles.position);
  EXPECT_EQ(second.state().particles.angular_momentum, first.state().particles.angular_momentum);
}

TEST(Adopting, LetsOtherNumbersAct) {
  // As if the motion had been set by hand in a scene of these numbers, but at its own frame.
  Simulation first = make(two_balls());
  run(first, 4);
  Scene heavy = first.scene();
  heavy.objects[0].particles.mass = 2.0;
  heavy.objects[1].contact->friction = 0.5;
  heavy.objects[0].contact->friction = 0.5;
  Simulation adopted(heavy), set(heavy);
  adopted.adopt(first.state());
  const core::ParticleState& motion = first.state().particles;
  set.set_particles({.position = motion.position, .orientation = motion.orientation, .velocity = motion.velocity, .angular_momentum = motion.angular_momentum});
  EXPECT_EQ(adopted.frame(), 4);
  run(adopted, 8);
  run(set, 5);
  EXPECT_EQ(adopted.state().particles.position, set.state().particles.position);
  EXPECT_NE(adopted.state().particles.position, first.state().particles.position);
  EXPECT_LT(adopted.audits().momentum_error, 1e-13);
  EXPECT_LT(adopted.audits().energy_error, 1e-2);  // that of the automatic step; the jump to a fourfold mass is no part of it
}

TEST(Adopting, NeedsTheSameParticles) {
  Simulation two = make(two_balls()), one = make(R"(
schema: 1
duration: 1 s
objects:
  - name: left
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
)");
  try {
    two.adopt(one.state());
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "state: expected 2 particles, found 1; the scenes must have the same objects");
  }
}

TEST(SetParticles, WithTheSameMotionChangesNoBit) {
  Simulation set = make(two_balls()), left = make(two_balls());
  run(set, 3);
  run(left, 3);
  const core::ParticleState& same = set.state().particles;
  set.set_particles({.position = same.position, .orientation = same.orientation, .velocity = same.velocity, .angular_momentum = same.angular_momentum});
  EXPECT_EQ(set.state_hash(), left.state_hash());
}

TEST(SetParticles, IsAsIfTheSceneHadBegunThere) {
  // Only the ledger tells the two apart, so what they do next is compared, to the bit.
  Simulation set = make(two_balls());
  Scene scene = set.scene();
  scene.objects[0].particles.at = Vec3(-0.4, 0.1, 0.05);
  scene.objects[1].particles.velocity = Vec3(-3, 0.5, 0);
  scene.objects[1].particles.spin = Vec3(1, 2, 3);
  Simulation born(scene);
  const core::ParticleState& there = born.state().particles;
  set.set_particles({.position = there.position, .velocity = there.velocity, .angular_velocity = std::vector<Vec3>{Vec3(0, 1, 2), Vec3(1, 2, 3)}});
  for (int k = 0; k < 20; ++k) {
    set.step();
    born.step();
  }
  EXPECT_EQ(set.state().particles.position, born.state().particles.position);
  EXPECT_EQ(set.state().particles.angular_momentum, born.state().particles.angular_momentum);
}

TEST(SetParticles, KeepsTheAudits) {
  // An impulse, a couple, a change of place and one of overlap in the middle of a contact: momenta stay exact, and energy as
  // exact as the steps are without it.
  const std::string fine = "time_step: {size: 1e-4 s}\n";
  Simulation simulation = make(two_balls(fine)), undisturbed = make(two_balls(fine));
  run(undisturbed, 8);
  run(simulation, 4);
  ParticleChange change{.position = simulation.state().particles.position,
                        .velocity = simulation.state().particles.velocity,
                        .angular_momentum = simulation.state().particles.angular_momentum};
  (*change.position)[1] += Vec3(0.0, 0.05, 0.02);
  (*change.velocity)[0] += Vec3(0.5, -0.5, 1.0);
  (*change.angular_momentum)[1] += Vec3(0.01, 0.02, -0.01);
  simulation.set_particles(change);
  ASSERT_FALSE(simulation.contacts().summary.empty());
  run(simulation, 8);
  const Audits audits = simulation.audits();
  EXPECT_LT(audits.momentum_error, 1e-13);
  EXPECT_LT(audits.angular_momentum_error, 1e-13);
  EXPECT_GT(std::abs(simulation.state().ledger.external_work), 0.1);
  EXPECT_LT(audits.energy_error, 10.0 * std::max(undisturbed.audits().energy_error, 1e-6));
}

TEST(SetParticles, TakesNoVelocityOfWhatPinsHold) {
  Simulation simulation = make(R"(
schema: 1
duration: 1 s
objects:
  - name: chain
    particles: {arrange: line, count: 3, spacing: 0.2, mass: 1}
    interactions: [{law: bond_frame, stretch: 100, rotation: 1}]
    pins: [{particle: 0}]
)");
  Quat longer = Quat::Identity();
  longer.coeffs() *= 3.0;
  simulation.set_particles({.orientation = std::vector<Quat>(3, longer), .velocity = std::vector<Vec3>(3, Vec3(0, 1, 0))});
  EXPECT_EQ(simulation.state().particles.velocity[0], Vec3(Vec3::Zero()));
  EXPECT_EQ(simulation.state().particles.velocity[2], Vec3(0, 1, 0));
  for (const Quat& q : simulation.state().particles.orientation) EXPECT_DOUBLE_EQ(q.norm(), 1.0);
}

TEST(SetParticles, SaysWhatIsWrong) {
  Simulation simulation = make(two_balls());
  const auto message = [&](const ParticleChange& change) {
    try {
      simulation.set_particles(change);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Usage);
      return std::string(error.what());
    }
    return std::string("nothing");
  };
  const std::vector<Vec3> good(2, Vec3::Zero());
  EXPECT_EQ(message({.position = std::vector<Vec3>(1, Vec3::Zero())}), "position: expected 2 rows, found 1");
  EXPECT_EQ(message({.velocity = std::vector<Vec3>{Vec3::Zero(), Vec3(0, std::nan(""), 0)}}),
            "velocity: expected finite numbers, found others in row 1");
  EXPECT_EQ(message({.orientation = std::vector<Quat>(2, Quat(0, 0, 0, 0))}),
            "orientation: expected finite quaternions of a length > 0, found others in row 0");
  EXPECT_EQ(message({.angular_momentum = good, .angular_velocity = good}), "angular_velocity: expected it, or angular_momentum, found both");
}

TEST(Meshes, HaveCreasesWhereNodesOfAGraphUnite) {
  // The surfaces of the two balls meet on a circle in the plane between them; cubes have no vertex of it.
  const auto on_crease = [](const Mesh& mesh) {
    constexpr double kRadius = 0.8 * 0.454202019;
    const double circle = std::sqrt(kRadius * kRadius - 0.2 * 0.2);
    return std::count_if(mesh.position.begin(), mesh.position.end(), [&](const Vec3& p) {
      const Vec3 d = p - kMiddle;
      return std::abs(d.x()) < 1e-6 && std::abs(std::hypot(d.y(), d.z()) - circle) < 1e-6;
    });
  };
  EXPECT_GT(on_crease(mesh_of_graph("{}")), 20);
  EXPECT_EQ(on_crease(mesh_of_graph("{method: cubes}")), 0);
  EXPECT_TRUE(inspect(mesh_of_graph("{}")).closed);
}

TEST(Meshes, ByWayOfAGridAreNotThoseOfCubes) {
  const Mesh cubes = mesh_of_graph("{method: cubes}"), grid = mesh_of_graph("{method: openvdb}");
  EXPECT_TRUE(inspect(grid).closed);
  EXPECT_NE(grid.triangle_count(), cubes.triangle_count());
  EXPECT_NEAR(inspect(grid).volume, inspect(cubes).volume, 0.02 * inspect(cubes).volume);
}

TEST(Meshes, ThatAreLeftOpenTakeTheCheaperWayWhichThePlanNames) {
  const auto reason = [](const std::string& meshing) {
    const Simulation simulation = make(two_balls("output: {mesh: ply, " + (meshing[0] == '{' ? "meshing: " + meshing : meshing) + "}"));
    const StepPlan plan = plan_step(simulation.scene(), simulation.model(), requested_outputs(simulation.scene()));
    return plan.stages[static_cast<std::size_t>(Stage::Polygonise)].reason;
  };
  EXPECT_NE(reason("{}").find("auto: marching cubes (estimated cost: marching cubes "), std::string::npos) << reason("{}");
  EXPECT_NE(reason("{}").find("OpenVDB "), std::string::npos);
  EXPECT_NE(reason("{method: openvdb}").find("volumeToMesh"), std::string::npos);
  EXPECT_NE(reason("cell: 1e-5").find(" ms, cells are too small for OpenVDB)"), std::string::npos) << reason("cell: 1e-5");
  EXPECT_EQ(reason("{method: cubes}").find("auto"), std::string::npos);
}

TEST(Meshes, ByAComponentThatIsAbsentAreRefusedByItsName) {
  try {
    (void)make(two_balls("output: {mesh: ply, meshing: {method: delaunay}}"));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Scene);
    EXPECT_EQ(std::string(error.what()),
              "test.yaml:5:39: output.meshing.method: expected a program with the component supple_cgal for delaunay, found one "
              "without it; install libcgal-dev and build again, or use method: cubes");
  }
}

TEST(FreeCollision, KeepsMomentumAndAngularMomentumToRoundOffAtEveryStep) {
  for (const std::string& scene : {std::string("contacts/spiral_free"), std::string("contacts/two_balls")}) {
    Simulation simulation(library_scene(scene));
    const core::Motion start = core::measure_motion(simulation.model().particles, simulation.state().particles);
    double momentum_scale = start.momentum_scale, angular_scale = start.angular_momentum_scale;
    double momentum = 0.0, angular = 0.0;
    bool touched = false;
    while (simulation.time() < 1.5) {
      simulation.step();
      const core::Motion now = core::measure_motion(simulation.model().particles, simulation.state().particles);
      momentum_scale = std::max(momentum_scale, now.momentum_scale);
      angular_scale = std::max(angular_scale, now.angular_momentum_scale);
      momentum = std::max(momentum, (now.momentum - start.momentum).norm());
      angular = std::max(angular, (now.angular_momentum - start.angular_momentum).norm());
      touched |= (now.momentum_scale != start.momentum_scale);
    }
    EXPECT_TRUE(touched) << scene;
    EXPECT_LT(momentum / momentum_scale, 1e-12) << scene;
    EXPECT_LT(angular / angular_scale, 1e-12) << scene;
  }
}

TEST(FreeCollision, EnergyDriftFallsWithTheSquareOfTheStep) {
  // Fixed substeps; the drift is the largest |E - E0| over the frames of the bounce.
  const auto drift = [](int substeps) {
    Simulation simulation =
        make(two_balls("time_step: {substeps: " + std::to_string(substeps) + "}\ncontact: {error: 1e-8}"));
    run(simulation, 11);
    const Audits audits = simulation.audits();
    EXPECT_GT(audits.largest_overlap, 0.0);
    return audits.energy_error;
  };
  const double coarse = drift(128), middle = drift(256), fine = drift(512);
  EXPECT_GT(coarse / middle, 3.0);
  EXPECT_LT(coarse / middle, 5.5);
  EXPECT_GT(middle / fine, 3.0);
  EXPECT_LT(middle / fine, 5.5);
}

TEST(FreeCollision, BothDeformedSurfacesAgreeOnEveryContactSample) {
  Simulation simulation = make(two_balls());
  double residual = 0.0;
  std::size_t samples = 0;
  while (simulation.frame() < 11) {
    simulation.step();
    for (const auto& s : simulation.contacts().summary) residual = std::max(residual, s.residual);
    samples += simulation.contacts().point.size();
  }
  EXPECT_GT(samples, 100u);
  EXPECT_LT(residual, 1e-10);
}

class SceneDeterminism : public testing::TestWithParam<int> {};

TEST_P(SceneDeterminism, StateHashDoesNotDependOnThreadCount) {
  for (const std::string& name : {std::string("figures/ball_hits_spiral"), std::string("contacts/two_balls")}) {
    const Scene scene = library_scene(name);
    EXPECT_EQ(hash_after(scene, 16, {.threads = GetParam()}), hash_after(scene, 16, {.threads = 1})) << name;
  }
}
INSTANTIATE_TEST_SUITE_P(Threads, SceneDeterminism, testing::Values(2, 3, 8));

TEST(SceneDeterminism, SwitchingSkipsOffChangesNoBitAndVisitsMore) {
  const Scene scene = library_scene("figures/ball_hits_spiral");
  Simulation with(scene, {.skip = true}), without(scene, {.skip = false});
  run(with, 16);
  run(without, 16);
  EXPECT_EQ(with.state_hash(), without.state_hash());
  const auto index = static_cast<std::size_t>(Stage::IndexField);
  EXPECT_LT(with.profile()[index].visited, without.profile()[index].visited);
}

TEST(SceneDeterminism, OutputsAreObservers) {
  const Scene scene = library_scene("figures/ball_hits_spiral");
  Simulation quiet(scene), watched(scene);
  run(quiet, 12);
  while (watched.frame() < 12) {
    watched.step_frame();
    EXPECT_FALSE(watched.meshes().empty());
    (void)watched.energies();
  }
  EXPECT_EQ(quiet.state_hash(), watched.state_hash());
}

TEST(SceneDeterminism, RestartFromASavedStateGivesTheSameBits) {
  const Scene scene = library_scene("figures/ball_hits_spiral");
  Simulation whole(scene);
  run(whole, 10);
  for (int k = 0; k < 5; ++k) whole.step();  // in the middle of a frame too
  const fs::path path = temp_folder() / "restart.state";
  save_state(path, whole.state(), {.scene = 42});
  run(whole, 16);

  Simulation resumed(scene);
  resumed.restore(load_state(path, {.scene = 42}));
  run(resumed, 16);
  EXPECT_EQ(whole.state_hash(), resumed.state_hash());
  EXPECT_THROW((void)load_state(path, {.scene = 43}), Error);
  fs::remove(path);
}

// A load pushes the drop and gravity pulls it: far beyond what the first frame lets one believe.
TEST(SceneDeterminism, StepsPastTheLastFrameAreThoseOfALongerScene) {
  const std::string text = R"(
schema: 1
frame_rate: 1
time_step: {substeps: 1}
gravity: [0, 0, -1000]
objects:
  - name: drop
    particles: {arrange: single, at: [0, 0, 0], mass: 0.001}
    skeleton: [{shape: point, kernel: {radius: 1 cm}}]
    loads: [{particle: 0, force: [1, 0, 0], from: 2 s, until: 4 s}]
)";
  Simulation brief(parse_scene(text + "duration: 1 s\n", "brief.yaml", ".")), lengthy(parse_scene(text + "duration: 30 s\n", "lengthy.yaml", "."));
  ASSERT_EQ(brief.scene().frame_count(), 2);
  run(brief, 31);
  run(lengthy, 31);
  EXPECT_EQ(brief.time(), 30.0);
  EXPECT_EQ(brief.state_hash(), lengthy.state_hash());
  const double fallen = 0.5 * 1000.0 * 30.0 * 30.0;
  EXPECT_NEAR(brief.state().particles.position[0].z(), -fallen, 1e-12 * fallen);
}

// Ways of 10^4 of the drop's size, by a load alone.
TEST(Simulation, WhatALoadDrivesFarIsNoDivergence) {
  Simulation simulation(parse_scene(R"(
schema: 1
duration: 4 s
frame_rate: 10
time_step: {substeps: 1}
objects:
  - name: drop
    particles: {arrange: single, mass: 0.001}
    skeleton: [{shape: point, kernel: {radius: 1 cm}}]
    loads: [{particle: 0, force: [100, 0, 0]}]
)", "driven.yaml", "."));
  run(simulation, 41);
  EXPECT_NEAR(simulation.state().particles.position[0].x(), 0.5 * 1e5 * 16.0, 1e-6);
}

TEST(SceneDeterminism, OrderOfObjectsInTheFileChangesNoBit) {
  const std::string head = "schema: 1\nduration: 1 s\nframe_rate: 10\nobjects:\n";
  const std::string left = R"(  - name: left
    particles: {arrange: single, at: [-0.5, 0.05, 0], velocity: [2, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    contact: {modulus: 2e3}
)";
  const std::string right = R"(  - name: right
    particles: {arrange: single, at: [0.5, 0, 0], mass: 0.8}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.7}}]
    contact: {modulus: 3e3}
)";
  EXPECT_EQ(hash_after(parse_scene(head + left + right, "a.yaml", "."), 8, {}),
            hash_after(parse_scene(head + right + left, "b.yaml", "."), 8, {}));
}

TEST(Simulation, GivesNoForceWhileBodiesDoNotTouch) {
  Simulation simulation = make(two_balls());
  EXPECT_TRUE(simulation.contacts().summary.empty());
  simulation.step();
  EXPECT_EQ(simulation.state().particles.velocity[0], Vec3(2, 0, 0));
}

TEST(Simulation, RestsOnTheGroundAtTheDepthThatCarriesItsWeight) {
  // A drop onto the ground with medium damping; at rest the contact carries m g.
  Simulation simulation = make(R"(
schema: 1
duration: 6 s
frame_rate: 10
gravity: [0, 0, -9.81]
ground: {height: 0, modulus: 1e6}
objects:
  - name: drop
    particles: {arrange: single, at: [0, 0, 0.25], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 5e3}
    medium: {linear: 6, angular: 6}
)");
  run(simulation, 61);
  ASSERT_EQ(simulation.contacts().summary.size(), 1u);
  EXPECT_NEAR(simulation.contact_forces()[0].z(), 0.2 * 9.81, 1e-6 * 0.2 * 9.81);
  EXPECT_LT(simulation.audits().momentum_error, 1e-10);
}

TEST(Simulation, SaysWhatDivergedAndKeepsTheLastFrame) {
  Simulation simulation = make(small::kUnstable);
  try {
    for (int k = 0; k < 100; ++k) simulation.step_frame();
    FAIL() << "a step of fifty periods cannot be stable";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Diverged);
    EXPECT_NE(std::string(error.what()).find("of chain, particle"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("the scene fixes the time step"), std::string::npos) << error.what();
    EXPECT_TRUE(simulation.state().particles.position[0].allFinite());
  }
}

TEST(Simulation, FeelsAWholeBlowHoweverShort) {
  for (const char* method : {"symplectic", "rk4", "backward_euler"}) {
    Simulation simulation = make(std::string(R"(
schema: 1
duration: 1 s
frame_rate: 20
integrator: {method: )") + method + R"(}
objects:
  - name: puck
    particles: {mass: 2, inertia_radius: 0.1}
    loads: [{particle: 0, force: [1000, 0, 0], from: 0.2571 s, until: 0.2671 s}]
)");
    while (simulation.time() < 0.5) simulation.step_frame();
    EXPECT_NEAR(simulation.state().particles.velocity[0].x(), 5.0, 1e-12) << method;
    EXPECT_LT(simulation.audits().momentum_error, 1e-14) << method;
    if (std::string(method) == "symplectic") {
      EXPECT_NEAR(simulation.state().ledger.external_work, 25.0, 1e-12);
    }
  }
}

TEST(Simulation, TakesASmallBodyFarFromTheOriginForWhatItIs) {
  Simulation simulation = make(R"(
schema: 1
duration: 3 s
frame_rate: 20
time_step: {substeps: 64}
gravity: [0, 0, -9.81]
objects:
  - name: bead
    particles: {at: [3 km, 0, 40], mass: 1 mg}
    skeleton: [{shape: point, kernel: {radius: 1 mm}}]
)");
  for (int k = 0; k < 40; ++k) simulation.step_frame();
  EXPECT_NEAR(simulation.state().particles.position[0].z(), 40.0 - 0.5 * 9.81 * 4.0, 1e-9);
}

TEST(Simulation, RefusesAStepFinerThanAllowedAndNamesTheKey) {
  try {
    (void)make(R"(
schema: 1
duration: 1 s
time_step: {max_substeps: 2}
integrator: {method: symplectic}
objects:
  - name: chain
    particles: {arrange: line, count: 3, spacing: 0.2, mass: 0.01}
    interactions: [{law: bond_frame, stretch: 1e6, rotation: 10}]
)");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    EXPECT_NE(std::string(error.what()).find("time_step.max_substeps"), std::string::npos) << error.what();
  }
}

// Two balls that must not touch each other press on the ground and under a third one.
TEST(Simulation, BodiesThatMustNotTouchPassThroughEachOtherWhateverElseTheyTouch) {
  const auto surfaces = [](const std::string& collide) {
    Simulation simulation(parse_scene(R"(
schema: 1
duration: 1 s
objects:
  - {name: a, particles: {at: [-0.1, 0, 0.21]}, skeleton: [{shape: point, kernel: {radius: 0.5}}], contact: {modulus: 2e3}}
  - {name: b, particles: {at: [0.1, 0, 0.21]}, skeleton: [{shape: point, kernel: {radius: 0.5}}], contact: {modulus: 2e3}}
  - {name: c, particles: {at: [0, 0, 0.59]}, skeleton: [{shape: point, kernel: {radius: 0.5}}], contact: {modulus: 2e3}}
pairs: [{objects: [a, b], collide: )" + collide + "}]\nground: {}\noutput: {mesh: ply, cell: 0.02}\n", "test.yaml", "."));
    return simulation.meshes();
  };
  const double whole = 0.392496505 / 8.0;  // of one ball
  const std::vector<Mesh> apart = surfaces("false"), touching = surfaces("true");
  for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(inspect(apart[k]).closed) << k;
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_LT(inspect(touching[k]).volume, 0.85 * whole);  // half of where they overlap
    EXPECT_GT(inspect(apart[k]).volume, 0.98 * whole);     // the third one takes little
  }
  EXPECT_NEAR(inspect(apart[2]).volume, inspect(touching[2]).volume, 1e-12);
}

TEST(Meshes, OfTouchingObjectsCoincideOnTheContactAndAreClosed) {
  Simulation simulation = make(two_balls());
  while (simulation.frame() < 11 && simulation.contacts().summary.empty()) simulation.step();
  for (int k = 0; k < 10; ++k) simulation.step();
  ASSERT_EQ(simulation.contacts().summary.size(), 1u);
  const std::vector<Mesh>& meshes = simulation.meshes();
  ASSERT_EQ(meshes.size(), 2u);
  std::array<std::vector<std::array<double, 3>>, 2> shared;
  for (std::size_t m = 0; m < 2; ++m) {
    const MeshReport report = inspect(meshes[m]);
    EXPECT_TRUE(report.closed);
    EXPECT_TRUE(report.oriented);
    EXPECT_EQ(report.euler_characteristic, 2);
    const auto column = std::find_if(meshes[m].columns.begin(), meshes[m].columns.end(),
                                     [](const Mesh::Column& c) { return c.name == "contact"; });
    ASSERT_NE(column, meshes[m].columns.end());
    for (std::size_t v = 0; v < meshes[m].vertex_count(); ++v) {
      const Vec3& p = meshes[m].position[v];
      if (column->values[v] != 0.0) shared[m].push_back({p.x(), p.y(), p.z()});
    }
    std::sort(shared[m].begin(), shared[m].end());
  }
  EXPECT_GT(shared[0].size(), 10u);
  EXPECT_EQ(shared[0], shared[1]);
}

TEST(Meshes, AreMadeAsTheSceneAsks) {
  const auto meshes_of = [](const std::string& output) {
    Simulation simulation = make(two_balls("output: {" + output + "}"));
    return simulation.meshes();
  };
  const Mesh cubes = meshes_of("cell: 0.03").front();
  const Mesh tetrahedra = meshes_of("cell: 0.03, meshing: {method: tetrahedra}").front();
  EXPECT_EQ(cubes.triangle_count(), meshes_of("cell: 0.03, meshing: {method: cubes}").front().triangle_count());
  EXPECT_GT(tetrahedra.triangle_count(), 2 * cubes.triangle_count());
  EXPECT_NEAR(inspect(cubes).volume, inspect(tetrahedra).volume, 0.02 * inspect(cubes).volume);
  const Mesh coarse = meshes_of("meshing: {error: 5 mm}").front(), fine = meshes_of("meshing: {error: 0.05 mm}").front();
  EXPECT_GT(fine.triangle_count(), 20 * coarse.triangle_count());
  EXPECT_TRUE(cubes.columns.empty());
  const Mesh moving = meshes_of("cell: 0.03, meshing: {motion: true}").front();
  ASSERT_EQ(moving.columns.size(), 4u);
  EXPECT_EQ(moving.columns[0].name, "velocity_x");
  for (std::size_t v = 0; v < moving.vertex_count(); ++v) {
    const Vec3 expected = Vec3(2, 0, 0) + Vec3(0, 1, 2).cross(moving.position[v] - Vec3(-0.6, 0.05, 0));
    EXPECT_NEAR(moving.columns[0].values[v], expected.x(), 1e-12);
    EXPECT_EQ(moving.columns[3].values[v], 0.0);
  }
}

TEST(Meshes, RefuseABillionNodesAndNameTheKey) {
  Simulation simulation = make(two_balls("output: {cell: 1e-5}"));
  try {
    (void)simulation.meshes();
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    EXPECT_NE(std::string(error.what()).find("output.cell: expected at most 1000000000 lattice nodes"), std::string::npos)
        << error.what();
  }
}

TEST(Meshes, BulgeAroundTheContactWhenAskedTo) {
  const auto volume = [](const std::string& extra) {
    Simulation simulation = make(two_balls(extra));
    while (simulation.frame() < 11 && simulation.contacts().summary.empty()) simulation.step();
    for (int k = 0; k < 10; ++k) simulation.step();
    const std::vector<Mesh>& meshes = simulation.meshes();
    return inspect(meshes[0]).volume + inspect(meshes[1]).volume;
  };
  EXPECT_GT(volume("contact: {bulge: 0.5}"), volume("") * 1.0001);
  EXPECT_EQ(volume("contact: {bulge: 0}"), volume(""));
}



}  // namespace
}  // namespace supple::scenes
