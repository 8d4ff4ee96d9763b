#include "supple/scenes/plan.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "support/source_dir.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> library() {
  std::vector<fs::path> scenes;
  for (const auto& entry : fs::recursive_directory_iterator(source_dir() / "scenes/library")) {
    if (entry.path().extension() == ".yaml") scenes.push_back(entry.path());
  }
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

StepPlan plan_of(const Scene& scene, const OutputRequest& outputs) {
  return plan_step(scene, build_model(scene), outputs);
}

constexpr const char* kOneObject = R"(
schema: 1
duration: 1 s
objects:
  - name: ball
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 1e4}
)";

TEST(StepPlan, OfEveryLibrarySceneIsWellFormedForEveryKindOfOutput) {
  const std::vector<fs::path> scenes = library();
  ASSERT_GE(scenes.size(), 5u);
  for (const fs::path& path : scenes) {
    const Scene scene = read_scene(path);
    const Model model = build_model(scene);
    for (unsigned bits = 0; bits < 64; ++bits) {
      const OutputRequest outputs{.images = (bits & 1) != 0,
                                  .film = (bits & 2) != 0,
                                  .meshes = (bits & 4) != 0,
                                  .grids = (bits & 8) != 0,
                                  .contacts = (bits & 16) != 0,
                                  .particles = (bits & 32) != 0};
      EXPECT_TRUE(well_formed(plan_step(scene, model, outputs))) << path << " " << bits;
    }
  }
}

TEST(StepPlan, SkipsAllOfCollisionForASingleObject) {
  const Scene scene = parse_scene(kOneObject, "one.yaml", ".");
  const StepPlan plan = plan_of(scene, {});
  for (const Stage stage : {Stage::SampleSurface, Stage::FindContacts, Stage::SolveContactSurface, Stage::React}) {
    EXPECT_FALSE(plan.on(stage));
  }
  EXPECT_NE(plan.stages[static_cast<std::size_t>(Stage::FindContacts)].reason.find("single object"), std::string::npos);
}

TEST(StepPlan, SimulateOnlySkipsMeshAndRender) {
  const Scene scene = read_scene(source_dir() / "scenes/library/figures/ball_hits_spiral.yaml");
  const StepPlan plan = plan_of(scene, {});
  EXPECT_FALSE(plan.on(Stage::Polygonise));
  EXPECT_FALSE(plan.on(Stage::Render));
  EXPECT_TRUE(plan.on(Stage::SolveContactSurface));
  const StepPlan film = plan_of(scene, {.images = true, .film = true});
  EXPECT_TRUE(film.on(Stage::Polygonise));
  EXPECT_TRUE(film.on(Stage::Render));
}

TEST(StepPlan, IsNotWellFormedWhenAStageReadsWhatNobodyWrote) {
  const Scene scene = read_scene(source_dir() / "scenes/library/figures/ball_hits_spiral.yaml");
  StepPlan plan = plan_of(scene, {.images = true});
  plan.stages[static_cast<std::size_t>(Stage::IndexField)].on = false;
  EXPECT_FALSE(well_formed(plan));
}

TEST(Explain, NamesEveryStageWithItsReason) {
  Simulation simulation(parse_scene(kOneObject, "one.yaml", "."));
  const std::string text = explain(simulation);
  for (const StageInfo& stage : stage_table()) EXPECT_NE(text.find(stage.name), std::string::npos) << text;
  EXPECT_NE(text.find("off  find_contacts"), std::string::npos) << text;
}

}  // namespace
}  // namespace supple::scenes
