/// The times of stages add up to what steps take.
#include <gtest/gtest.h>

#include <numeric>
#include <string>
#include <vector>

#include "scenes/run_scenes.h"
#include "supple/core/cpu_time.h"

namespace supple::scenes {
namespace {

/// CPU time of the stages of a spiral that is hit, over that of the process.
double share_of_stages(bool profile, const std::string& duration, double& advance) {
  const std::vector<std::string> quiet{"output={}", "integrator.method=symplectic", "duration=" + duration};
  Simulation simulation(library_scene("figures/ball_hits_spiral", quiet), {.profile = profile});
  const double begin = process_cpu_seconds();
  run(simulation, simulation.scene().frame_count());
  const double whole = process_cpu_seconds() - begin;
  EXPECT_GT(simulation.state().steps, 1000u);
  const Profile stages = simulation.profile();
  advance = stages[static_cast<std::size_t>(Stage::Integrate)].cpu_s;
  return std::accumulate(stages.begin(), stages.end(), 0.0, [](double sum, const StageProfile& s) { return sum + s.cpu_s; }) / whole;
}

// All of a step belongs to a stage; the loop around it and the clocks do not.
TEST(StageTimes, AddUpToTheWholeWhereEveryStepIsMeasured) {
  double advance = 0.0;
  const double share = share_of_stages(true, "0.5 s", advance);
  EXPECT_GT(share, 0.85);
  EXPECT_LT(share, 1.01);
  EXPECT_GT(advance, 0.0);
}

// One step in 61 stands for the others. A quarter allows for one that other programs on the machine make take a hundred times as long.
TEST(StageTimes, AddUpToTheWholeWithinAQuarterWhereSomeStepsStandForAll) {
  double advance = 0.0;
  EXPECT_NEAR(share_of_stages(false, "3 s", advance), 1.0, 0.25);
  EXPECT_GT(advance, 0.0);
}

// Few long steps, the first of which are short: none stands for another.
TEST(StageTimes, AddUpToTheWholeOfFewLongSteps) {
  Simulation simulation(parse_scene(R"(
schema: 1
duration: 0.2 s
frame_rate: 24
gravity: [0, 0, -9.81]
integrator: {method: implicit}
objects:
  - name: block
    particles: {arrange: grid, columns: 6, rows: 6, layers: 6, spacing: 0.05, at: [0, 0, 0.23]}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.08}}]
    material: {youngs_modulus: 2e4, density: 1000, damping_ratio: 0.2}
obstacles: [{name: floor, shape: plane}]
)", "block.yaml", "."), {});
  const double begin = process_cpu_seconds();
  run(simulation, simulation.scene().frame_count());
  const double whole = process_cpu_seconds() - begin;
  const Profile stages = simulation.profile();
  EXPECT_LT(simulation.state().steps, 100u);
  EXPECT_NEAR(std::accumulate(stages.begin(), stages.end(), 0.0, [](double sum, const StageProfile& s) { return sum + s.cpu_s; }) / whole, 1.0, 0.1);
}

// A hand that closes spends most of its time on samples and contacts; a stage that is not measured would leave its time to `advance`.
TEST(StageTimes, BelongToTheStagesThatTakeThem) {
  for (const bool every_step : {true, false}) {
    Simulation simulation(library_scene("objects/hand_closes", {"output={}", "duration=0.1 s"}), {.profile = every_step});
    run(simulation, simulation.scene().frame_count());
    const Profile stages = simulation.profile();
    const auto of = [&](Stage stage) { return stages[static_cast<std::size_t>(stage)].cpu_s; };
    EXPECT_GT(of(Stage::SampleSurface) + of(Stage::FindContacts) + of(Stage::SolveContactSurface), 2.0 * of(Stage::Integrate)) << every_step;
  }
}

}  // namespace
}  // namespace supple::scenes
