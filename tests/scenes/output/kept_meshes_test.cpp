// Meshes keep from frame to frame what does not move, and no bit tells.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "implicit/bodies.h"
#include "model/divide.h"
#include "scenes/run_scenes.h"
#include "simulation/frame.h"
#include "simulation/kept_budget.h"
#include "supple/implicit/creases.h"
#include "supple/implicit/march_cubes.h"

namespace supple::scenes {
namespace {

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void expect_same(const std::vector<Mesh>& kept, const std::vector<Mesh>& alone) {
  ASSERT_EQ(kept.size(), alone.size());
  for (std::size_t m = 0; m < kept.size(); ++m) {
    EXPECT_GT(kept[m].triangle_count(), 0u);
    ASSERT_TRUE(same_bits(kept[m].position, alone[m].position)) << m;
    ASSERT_TRUE(same_bits(kept[m].normal, alone[m].normal)) << m;
    ASSERT_TRUE(same_bits(kept[m].triangle, alone[m].triangle)) << m;
    ASSERT_EQ(kept[m].columns.size(), alone[m].columns.size());
    for (std::size_t c = 0; c < kept[m].columns.size(); ++c) {
      ASSERT_TRUE(same_bits(kept[m].columns[c].values, alone[m].columns[c].values)) << m << " " << kept[m].columns[c].name;
    }
  }
}

/// A ball, or two that unite without blending.
implicit::testing::Body small_body(bool creased) {
  std::vector<std::pair<implicit::Primitive, Vec3>> balls;
  for (int k = 0; k < (creased ? 2 : 1); ++k) balls.emplace_back(implicit::testing::wyvill_point(1.0), Vec3(0.5 * k, 0.1 * k, 0.0));
  implicit::testing::Body body = implicit::testing::body_of(balls);
  if (creased) body.skeleton.blend.rule = implicit::BlendRule::Graph;
  body.place();
  return body;
}

// Of both kinds of meshers, in frames that need more and less memory: together they keep no more than allowed, whichever is meshed first.
TEST(KeptMeshes, ToAnErrorShareWhatTheyMayKeep) {
  const implicit::testing::Body ball = small_body(false), pair = small_body(true);
  const Executor executor(1);
  const auto mesh_with = [&](KeptBudget& budget, auto& mesher, const implicit::Field& field, double error) {
    return budget.use(mesher, [&](auto& m) -> const Mesh& { return m.make(field, {.lattice = {.origin = Vec3::Zero(), .cell = 0.0}, .error = error}, executor); });
  };
  const auto frame = [&](std::uint64_t most, double error, std::vector<implicit::CubeMesher>& cubes, std::vector<implicit::CreaseMesher>& creases) {
    KeptBudget budget(most);
    for (const auto& mesher : cubes) budget.add(mesher);
    for (const auto& mesher : creases) budget.add(mesher);
    std::vector<Mesh> meshes;
    for (auto& mesher : cubes) meshes.push_back(mesh_with(budget, mesher, ball.field, error));
    for (auto& mesher : creases) meshes.push_back(mesh_with(budget, mesher, pair.field, error));
    std::uint64_t kept = 0;
    for (const auto& mesher : cubes) kept += mesher.kept_to_error();
    for (const auto& mesher : creases) kept += mesher.kept_to_error();
    EXPECT_EQ(budget.kept(), kept);
    return std::pair{meshes, kept};
  };
  std::vector<implicit::CubeMesher> cubes(2), all_cubes(2);
  std::vector<implicit::CreaseMesher> creases(2), all_creases(2);
  const std::uint64_t all = frame(~std::uint64_t{0}, 0.005, all_cubes, all_creases).second, most = all / 2;
  for (const double error : {0.005, 0.005, 0.002, 0.02, 0.005}) {
    std::vector<implicit::CubeMesher> fresh_cubes(2);
    std::vector<implicit::CreaseMesher> fresh_creases(2);
    const auto [meshes, kept] = frame(most, error, cubes, creases);
    expect_same(meshes, frame(~std::uint64_t{0}, error, fresh_cubes, fresh_creases).first);
    EXPECT_LE(kept, most);
    EXPECT_GT(kept, error == 0.005 ? all / 4 : 0u);
  }
}

// Pairs of balls, with creases and without: meshers of a frame share one budget, in the frames after the first one, too.
TEST(KeptMeshes, ToAnErrorOfAFrameShareWhatTheyMayKeep) {
  for (const char* blend : {"", ", blend: {rule: graph}"}) {
    std::string text = "schema: 1\nduration: 1 s\nframe_rate: 10\noutput: {meshing: {error: 0.0005, search: false}}\nobjects:\n";
    for (int k = 0; k < 4; ++k) {
      const std::string number = std::to_string(k);
      text.append("  - {name: pair").append(number);
      text.append(", particles: {arrange: line, count: 2, spacing: 0.08, mass: 0.1, at: [0, ").append(number);
      text.append(", 0]}, skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.2}}]").append(blend).append("}\n");
    }
    Simulation simulation = make(text);
    const Model& model = simulation.model();
    const Executor executor(1);
    Profile unused{};
    const auto kept_within = [&](std::uint64_t most) {
      Frame frame(model, simulation.bodies());
      StageContext context{model, simulation.bodies(), model.rules, executor, unused};
      context.most_kept = most;
      place_contact_bodies(context, simulation.state().particles, frame);
      place_and_index_all(context, simulation.state().particles, frame);
      const Division division = division_of(model, simulation.bodies(), frame.field, frame.bodies, frame.surface, executor);
      std::uint64_t kept = 0;
      for (int round = 0; round < 2; ++round) {
        expect_same(polygonise_objects(context, division, simulation.state(), simulation.laws(), frame), simulation.meshes());
        kept = 0;
        for (const auto& mesher : frame.mesher) kept += mesher.kept_to_error();
        for (const auto& mesher : frame.creases) kept += mesher.kept_to_error();
        EXPECT_LE(kept, most) << blend << ' ' << round;
      }
      return kept;
    };
    const std::uint64_t all = kept_within(~std::uint64_t{0});
    EXPECT_GT(all, 0u);
    EXPECT_GE(kept_within(all / 2), all / 4);  // those of one body are a quarter of all
  }
}

/// By a simulation that has made no mesh before.
std::vector<Mesh> meshes_alone(const Scene& scene, const State& state) {
  Simulation alone(scene, {});
  alone.restore(State(state));
  return alone.meshes();
}

TEST(KeptMeshes, OfAPileAreThoseOfEachFrameMeshedAlone) {
  const std::vector<std::string> small{"objects.balls.particles.columns=3", "objects.balls.particles.rows=3", "objects.balls.particles.layers=2",
                                       "objects.balls.particles.at=[0, 0, 0.11]", "output.cell=0.012"};
  for (const std::vector<std::string>& bulge :
       {std::vector<std::string>{}, {"contact.bulge=0.4"}, {"contact.bulge=0.4", "contact.bulge_literal=true"}}) {
    std::vector<std::string> keys = small;
    keys.insert(keys.end(), bulge.begin(), bulge.end());
    const Scene scene = library_scene("contacts/pile_rests", keys);
    Simulation simulation(scene, {.threads = 2});
    for (const int frame : {3, 4, 5, 6, 8, 30, 31}) {
      run(simulation, frame);
      ASSERT_NO_FATAL_FAILURE(expect_same(simulation.meshes(), meshes_alone(scene, simulation.state()))) << frame << " " << bulge.size();
    }
  }
}

TEST(KeptMeshes, OfAPileToAnErrorAreThoseOfEachFrameMeshedAlone) {
  const Scene scene = library_scene("contacts/pile_rests", {"objects.balls.particles.columns=2", "objects.balls.particles.rows=2",
                                                            "objects.balls.particles.layers=2", "objects.balls.particles.at=[0, 0, 0.11]",
                                                            "output.meshing.error=0.001"});
  Simulation simulation(scene, {.threads = 2});
  for (const int frame : {3, 4, 8, 30}) {
    run(simulation, frame);
    ASSERT_NO_FATAL_FAILURE(expect_same(simulation.meshes(), meshes_alone(scene, simulation.state()))) << frame;
  }
}

// Bulges beside obstacles that are led along depend on where these are.
TEST(KeptMeshes, OfABeltAndAPressAreThoseOfEachFrameMeshedAlone) {
  const Scene scene = library_scene("contacts/press_and_belt");
  Simulation simulation(scene, {.threads = 2});
  for (const int frame : {2, 3, 20, 21}) {
    run(simulation, frame);
    ASSERT_NO_FATAL_FAILURE(expect_same(simulation.meshes(), meshes_alone(scene, simulation.state()))) << frame;
  }
}

TEST(KeptMeshes, VisitOnlyWhatMovedAlsoAfterAStateIsRestored) {
  for (const char* error : {"", ", meshing: {error: 0.001}"}) {
    const std::string text = std::string(R"(
schema: 1
duration: 1 s
frame_rate: 10
objects:
  - name: balls
    particles: {arrange: line, count: 12, spacing: 0.19, mass: 0.1}
    separate: true
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 2e4}
output: {cell: 0.01)") + error + "}\n";
    Simulation simulation = make(text);
    const auto visited = [&] {
      const std::uint64_t before = simulation.profile(Stage::Polygonise).visited;
      (void)simulation.meshes();
      return simulation.profile(Stage::Polygonise).visited - before;
    };
    const std::uint64_t all = visited();
    EXPECT_GT(all, 100u);
    State state = simulation.state();
    simulation.restore(State(state));
    EXPECT_EQ(visited(), 0u);
    state.particles.position[6].y() += 0.003;
    simulation.restore(State(state));
    const std::uint64_t moved = visited();
    EXPECT_GT(moved, 0u);
    EXPECT_LT(moved, all / 3);  // it has a twelfth, and its neighbours reach some of the blocks beside
    expect_same(simulation.meshes(), meshes_alone(parse_scene(text, "test.yaml", "."), state));
  }
}

// Bodies that touch no other: marched, with creases where nodes unite, with kernels that grow and shrink.
TEST(KeptMeshes, OfBodiesApartAreThoseOfEachFrameMeshedAlone) {
  for (const char* blend : {"", "blend: {rule: graph, groups: [{particles: [0, 1]}, {particles: [4, 5, 6]}]}", "blend: {rule: ricci}", "blend: {rule: gradient}"}) {
    const std::string text = std::string(R"(
schema: 1
duration: 1 s
frame_rate: 10
objects:
  - name: row
    particles: {arrange: line, count: 14, spacing: 0.19, mass: 0.1}
    skeleton: [{shape: segment, half_length: 0.05, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    )") + blend + "\noutput: {cell: 0.02, meshing: {search: false}}\n";
    const Scene scene = parse_scene(text, "test.yaml", ".");
    Simulation simulation = make(text);
    State state = simulation.state();
    for (std::size_t moving : {3u, 3u, 9u, 13u}) {
      ASSERT_NO_FATAL_FAILURE(expect_same(simulation.meshes(), meshes_alone(scene, state))) << blend << ' ' << moving;
      state.particles.position[moving] += Vec3(0.01, -0.004, 0.007);
      simulation.restore(State(state));
    }
  }
  const Scene scene = library_scene("objects/blob_keeps_its_volume");
  Simulation simulation(scene, {.threads = 2});
  for (const int frame : {2, 3}) {
    run(simulation, frame);
    ASSERT_NO_FATAL_FAILURE(expect_same(simulation.meshes(), meshes_alone(scene, simulation.state()))) << frame;
  }
}

}  // namespace
}  // namespace supple::scenes
