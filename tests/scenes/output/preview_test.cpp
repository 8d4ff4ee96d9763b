/// Previews and dry runs.
#include "supple/scenes/preview.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "../small_scenes.h"
#include "supple/scenes/estimate.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

const std::string kScene = std::string(small::kTwoDrops) + "duration: 1 s\noutput: {images: {size: [320, 200]}, mesh: ply, particles: csv}\n";

TEST(Preview, IsSmallerAndCoarser) {
  const Scene whole = parse_scene(kScene, "drops.yaml", ".");
  const Scene small = parse_scene(kScene, "drops.yaml", ".", preview_overrides(whole));
  EXPECT_EQ(small.output.images->size, (std::vector<int>{80, 50}));
  EXPECT_EQ(small.output.images->samples, 1);
  EXPECT_TRUE(small.output.mesh.empty());
  EXPECT_TRUE(small.output.particles.empty());
  EXPECT_TRUE(small.output.film.has_value());
  EXPECT_EQ(small.frame_count(), whole.frame_count());
  EXPECT_EQ(small.contact.error, 3e-2);
  EXPECT_NEAR(build_model(small).cell, 2.0 * build_model(whole).cell, 1e-12);
}

TEST(Preview, KeepsStepsThatTheSceneFixes) {
  const std::string text = kScene + "time_step: {substeps: 64}\n";
  EXPECT_FALSE(parse_scene(text, "drops.yaml", ".", preview_overrides(parse_scene(text, "drops.yaml", "."))).accuracy.has_value());
  const std::string fine = kScene + "accuracy: 1e-4\n";
  EXPECT_EQ(parse_scene(fine, "drops.yaml", ".", preview_overrides(parse_scene(fine, "drops.yaml", "."))).accuracy, 1e-2);
}

TEST(DryRun, CountsWhatTheRunMakes) {
  const fs::path folder = temp_folder() / "dry_run";
  const std::string text = std::string(small::kTwoDrops) + "duration: 1 s\noutput: {mesh: ply, particles: csv}\n";
  const Scene scene = parse_scene(text, "drops.yaml", folder);
  RunOptions options{.folder = folder};
  const RunEstimate estimate = estimate_run(scene, options);
  EXPECT_FALSE(fs::exists(folder));
  EXPECT_EQ(estimate.particles, 2u);
  EXPECT_EQ(estimate.frames, 9);
  EXPECT_EQ(estimate.followed, 9);
  const RunResult run = run_scene(scene, options);
  ASSERT_EQ(run.exit_code, 0) << run.reason;
  Simulation simulation(scene);
  while (simulation.frame() < 9) simulation.step_frame();
  EXPECT_NEAR(static_cast<double>(estimate.steps), static_cast<double>(simulation.state().steps), 0.1 * static_cast<double>(simulation.state().steps));
  double bytes = 0.0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && entry.path().extension() != ".json") bytes += static_cast<double>(entry.file_size());
  }
  EXPECT_NEAR(estimate.disk, bytes, 0.3 * bytes);  // one frame in nine has large meshes, and may be outside the sample
  EXPECT_GT(estimate.triangles, 0.0);
  EXPECT_NE(text_of(estimate).find("particles   2\n"), std::string::npos) << text_of(estimate);
  fs::remove_all(folder);
}

TEST(DryRun, CountsTheFramesAskedFor) {
  std::string text = small::kTwoDrops;
  text.append("duration: 1 s\n");
  const Scene scene = parse_scene(text, "drops.yaml", ".");
  const RunEstimate estimate = estimate_run(scene, {.folder = {}, .frames = {1, 2, 3}});
  EXPECT_EQ(estimate.frames, 3);
}

}  // namespace
}  // namespace supple::scenes
