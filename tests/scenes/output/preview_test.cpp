/// Previews and dry runs.
#include "supple/scenes/preview.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "../small_scenes.h"
#include "supple/scenes/estimate.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> preview_of(const Scene& scene) { return preview_overrides(scene, build_model(scene)); }

const std::string kScene = std::string(small::kTwoDrops) + "duration: 1 s\noutput: {images: {size: [320, 200]}, mesh: ply, particles: csv}\n";

using Words = std::vector<std::string>;

TEST(Preview, IsSmallerAndCoarser) {
  const Scene whole = parse_scene(kScene, "drops.yaml", ".");
  const Scene small = parse_scene(kScene, "drops.yaml", ".", preview_of(whole));
  EXPECT_EQ(small.output.images->size, (std::vector<int>{80, 50}));
  EXPECT_EQ(small.output.images->samples, 1);
  EXPECT_TRUE(small.output.mesh.empty());
  EXPECT_TRUE(small.output.particles.empty());
  EXPECT_TRUE(small.output.film.has_value());
  EXPECT_EQ(small.frame_count(), whole.frame_count());  // 8 frames a second are few already
  EXPECT_EQ(small.contact.error, 0.1);
  EXPECT_NEAR(build_model(small).cell, 3.0 * build_model(whole).cell, 1e-12);
}

TEST(Preview, KeepsStepsThatTheSceneFixes) {
  const std::string text = kScene + "time_step: {substeps: 64}\n";
  EXPECT_FALSE(parse_scene(text, "drops.yaml", ".", preview_of(parse_scene(text, "drops.yaml", "."))).accuracy.has_value());
  const std::string fine = kScene + "accuracy: 1e-4\n";
  EXPECT_EQ(parse_scene(fine, "drops.yaml", ".", preview_of(parse_scene(fine, "drops.yaml", "."))).accuracy, 4e-2);
}

TEST(Preview, ShowsFewerFramesOfAFilmWithMany) {
  const auto previewed = [](std::vector<std::string> set) {
    const Scene whole = parse_scene(kScene, "drops.yaml", ".", set);
    const std::vector<std::string> smaller = preview_of(whole);
    set.insert(set.end(), smaller.begin(), smaller.end());
    return std::pair(preview_stride(whole), parse_scene(kScene, "drops.yaml", ".", set));
  };
  const auto [four, fast] = previewed({"frame_rate=48", "time_step.substeps=64"});
  EXPECT_EQ(four, 4);
  EXPECT_EQ(fast.frame_count(), 13);
  EXPECT_EQ(fast.frame_rate, 12.0);
  EXPECT_EQ(fast.time_step.substeps, 256);  // steps as long as before
  EXPECT_EQ(fast.time_step.max_substeps, 4 * 4096);
  const auto [two, enough] = previewed({"frame_rate=30"});
  EXPECT_EQ(two, 2);
  EXPECT_EQ(enough.frame_count(), 16);
  EXPECT_EQ(previewed({"frame_rate=23.9"}).first, 1);
  const auto [three, longer] = previewed({"frame_rate=24", "duration=2 s"});
  EXPECT_EQ(three, 3);
  EXPECT_EQ(longer.frame_count(), 17);
  EXPECT_EQ(previewed({"frame_rate=24", "duration=0.75 s"}).second.frame_count(), 10);
  EXPECT_EQ(previewed({"frame_rate=24", "duration=0.7 s"}).second.frame_count(), 17);
}

TEST(Preview, TakesFewerSamplesToFindContacts) {
  const Scene whole = read_scene(source_dir() / "scenes/library/contacts/slide_on_incline.yaml");
  const Scene small = read_scene(whole.source, preview_of(whole));
  EXPECT_NEAR(build_model(small).objects[0].sample_spacing, 2.0 * build_model(whole).objects[0].sample_spacing, 1e-12);
}

TEST(Preview, OfAStillHasNoFilm) {
  const Scene still = parse_scene(kScene, "drops.yaml", ".", Words{"duration=1 ms"});
  ASSERT_EQ(still.frame_count(), 1);
  std::vector<std::string> set = preview_of(still);
  set.insert(set.begin(), "duration=1 ms");
  EXPECT_FALSE(parse_scene(kScene, "drops.yaml", ".", set).output.film.has_value());
}

TEST(Preview, LeavesBodiesWholeWhereTheyTouchUnlessTheyBulge) {
  const auto length_of = [](bool divide, const Words& set) {  // of the left drop, along the line between the middles, over its width
    Simulation simulation(parse_scene(kScene, "drops.yaml", ".", set), {.divide = divide});
    while (simulation.frame() < 3) simulation.step_frame();
    EXPECT_FALSE(simulation.contacts().summary.empty());
    Box box;
    for (const Vec3& p : simulation.meshes()[0].position) box.include(p);
    return box.extent().x() / box.extent().z();
  };
  EXPECT_NEAR(length_of(false, {}), 1.0, 5e-3);  // a ball
  EXPECT_LT(length_of(true, {}), 0.99);          // cut where it touches
  EXPECT_LT(length_of(false, {"contact.bulge=0.4"}), 0.99);
}

TEST(Preview, DoesWithoutAContactSheet) {
  const fs::path folder = temp_folder() / "sheets";
  const Scene scene = parse_scene(kScene, "drops.yaml", ".", Words{"duration=0.2 s", "output={images: {size: [64, 40], samples: 1}}"});
  RunOptions options{.folder = folder, .overwrite = true};
  const fs::path sheet = folder / (scene_name(scene) + "_sheet.png");
  ASSERT_EQ(run_scene(scene, options).exit_code, 0);
  EXPECT_TRUE(fs::exists(sheet));
  options.contact_sheet = false;
  ASSERT_EQ(run_scene(scene, options).exit_code, 0);
  EXPECT_FALSE(fs::exists(sheet));
  fs::remove_all(folder);
}

TEST(Preview, DoesWithoutEstimatesOfErrors) {
  const fs::path folder = temp_folder() / "estimates";
  const Scene scene = parse_scene(kScene, "drops.yaml", ".");
  RunOptions options{.folder = folder, .overwrite = true, .simulate_only = true};
  EXPECT_GT(run_scene(scene, options).errors.time.frames, 0);
  options.estimate_errors = false;
  EXPECT_EQ(run_scene(scene, options).errors.time.frames, 0);
  fs::remove_all(folder);
}

TEST(Preview, IsThereOfEverySceneOfTheLibrary) {
  for (const auto& entry : fs::recursive_directory_iterator(source_dir() / "scenes/library")) {
    if (entry.path().extension() != ".yaml") continue;
    const Scene whole = read_scene(entry.path());
    const Scene small = read_scene(entry.path(), preview_of(whole));
    EXPECT_EQ(small.render.renderer, RendererName::Gl) << entry.path();
    EXPECT_GE(small.frame_count(), std::min(whole.frame_count(), 10)) << entry.path();
  }
}

TEST(DryRun, CountsTheOneFrameOfAStill) {
  std::string text = small::kTwoDrops;
  text.append("duration: 1 ms\noutput: {mesh: ply}\n");
  const RunEstimate estimate = estimate_run(parse_scene(text, "drops.yaml", "."), {.folder = {}});
  EXPECT_EQ(estimate.frames, 1);
  EXPECT_EQ(estimate.particles, 2u);
  EXPECT_GT(estimate.triangles, 100.0);
  EXPECT_GT(estimate.disk, 1000.0);
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
  double triangles = 0.0;
  while (true) {
    for (const Mesh& mesh : simulation.meshes()) triangles += static_cast<double>(mesh.triangle.size()) / 9.0;
    if (simulation.frame() == 9) break;
    simulation.step_frame();
  }
  EXPECT_NEAR(static_cast<double>(estimate.steps), static_cast<double>(simulation.state().steps), 0.1 * static_cast<double>(simulation.state().steps));
  double bytes = 0.0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && entry.path().extension() != ".json") bytes += static_cast<double>(entry.file_size());
  }
  EXPECT_NEAR(estimate.disk, bytes, 0.1 * bytes);  // frames with contact, which have large meshes, are counted apart
  EXPECT_NEAR(estimate.triangles, triangles, 0.1 * triangles);
  EXPECT_NE(text_of(estimate).find("particles   2\n"), std::string::npos) << text_of(estimate);
  fs::remove_all(folder);
}

TEST(DryRun, CountsTheTimeOfTheFilm) {
  const Scene scene = parse_scene(kScene, "drops.yaml", ".", Words{"output={images: {size: [64, 40], samples: 1}, film: true}", "duration=0.3 s"});
  EXPECT_GT(estimate_run(scene, {.folder = {}}).film_s, 0.0);
  EXPECT_NE(text_of(estimate_run(scene, {.folder = {}})).find(" for the film"), std::string::npos);
  EXPECT_EQ(estimate_run(scene, {.folder = {}, .frames = {2, 3}}).film_s, 0.0);  // which begins with frame 1
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
