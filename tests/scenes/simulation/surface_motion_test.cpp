// Velocities of meshes are those of the surface also where it is not carried rigidly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "scenes/run_scenes.h"
#include "scenes/small_scenes.h"
#include "supple/core/mesh.h"
#include "supple/scenes/read_scene.h"

namespace supple::scenes {
namespace {

constexpr const char* kOutput = "output: {mesh: ply, cell: 0.03, meshing: {motion: true}}\n";

Vec3 velocity(const Mesh& mesh, std::size_t v) {
  EXPECT_EQ(mesh.columns.at(0).name, "velocity_x");
  return {mesh.columns[0].values[v], mesh.columns[1].values[v], mesh.columns[2].values[v]};
}

TEST(SurfaceMotion, OfABallThatGrowsIsOutward) {
  Simulation simulation = make(std::string(R"(
schema: 1
duration: 1 s
frame_rate: 20
objects:
  - name: ball
    particles: {at: [0.1, 0.2, 0.3], mass: 1, velocity: [0.5, 0, 0]}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    volume: {target: 0.1, rate: 3}
)") + kOutput);
  for (int i = 0; i < 3; ++i) simulation.step_frame();
  const double rate = simulation.state().volumes.at(0).rate;
  EXPECT_GT(rate, 0.1);
  const Mesh& mesh = simulation.meshes().at(0);
  ASSERT_GT(mesh.vertex_count(), 100u);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const Vec3 arm = mesh.position[v] - simulation.state().particles.position[0];
    ASSERT_LT((velocity(mesh, v) - Vec3(0.5, 0, 0) - rate * arm).norm(), 1e-8);
  }
}

/// What F changes by at vertices that are carried through a step, over the step: it falls with the step where velocities are right. Not of
/// vertices that may pass the crease.
double drift(Simulation& simulation) {
  const Mesh mesh = simulation.meshes().at(0);
  const std::vector<Vec3>& particle = simulation.state().particles.position;
  const Vec3 crease = 0.5 * (particle[0] + particle[1]);
  const double begin = simulation.time();
  std::vector<double> before(mesh.vertex_count()), after(mesh.vertex_count());
  simulation.fields().at(0).evaluate(mesh.position, before);
  simulation.step();
  const double dt = simulation.time() - begin;
  std::vector<Vec3> moved;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) moved.push_back(mesh.position[v] + dt * velocity(mesh, v));
  simulation.fields().at(0).evaluate(moved, after);
  double most = 0.0;
  for (std::size_t v = 0; v < moved.size(); ++v) {
    if (std::abs(mesh.position[v].x() - crease.x()) > 0.03) most = std::max(most, std::abs(after[v] - before[v]));
  }
  return most / dt;
}

TEST(SurfaceMotion, FollowsABlendThatFades) {
  std::vector<double> found;
  for (const char* step : {"4 ms", "2 ms"}) {
    Simulation simulation = make(std::string(R"(
schema: 1
duration: 2 s
frame_rate: 5
time_step: {size: )") + step + R"(}
objects:
  - name: dumbbell
    particles: {arrange: line, count: 2, spacing: 0.5, mass: 0.5}
    interactions: [{law: bond_frame, stretch: 200, rotation: 1}]
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.7}}]
    loads: [{particle: 0, force: [-20, 0, 0], until: 0.05 s}, {particle: 1, force: [20, 0, 0], until: 0.05 s}]
    breaking: {stretch: 0.02}
    blend: {rule: graph, neighbours: 1, fade: 0.2 s}
)" + kOutput);
    while (!(simulation.state().broken_for.at(0) > 0.06)) simulation.step();
    found.push_back(drift(simulation));
    EXPECT_EQ(simulation.bodies().size(), 1u);
  }
  EXPECT_LT(found[0], 0.4);  // the fading alone is up to 1.5 / 0.2 s times a share of a half
  EXPECT_LT(found[1], 0.6 * found[0]);
}

// A ball looks the same however it turns.
TEST(SurfaceMotion, OfBallsThatTurnWhereTheyAreIsTangential) {
  Simulation simulation = make(std::string(R"(
schema: 1
duration: 1 s
frame_rate: 20
objects:
  - name: pair
    particles: {arrange: line, count: 2, spacing: 0.5, mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.7}}]
    loads: [{particle: 0, torque: [0, 0.05, 0.1]}]
    blend: {rule: gradient}
)") + kOutput);
  simulation.step_frame();
  ASSERT_GT(simulation.state().particles.angular_momentum[0].norm(), 0.0);
  const Mesh& mesh = simulation.meshes().at(0);
  ASSERT_GT(mesh.vertex_count(), 100u);
  double fastest = 0.0;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    fastest = std::max(fastest, velocity(mesh, v).norm());
    EXPECT_LT(std::abs(velocity(mesh, v).dot(mesh.normal[v])), 1e-8);
  }
  EXPECT_GT(fastest, 0.01);
}

}  // namespace
}  // namespace supple::scenes
