// Pictures drawn beside the simulation.
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <string>

#include "scenes/small_scenes.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

const std::string kDrops = std::string(small::kTwoDrops) + R"(
duration: 0.75 s
output: {images: {size: [96, 64], samples: 1}, contacts: csv, particles: csv, mesh: ply}
)";
constexpr int kFrames = 7;

const std::string kUnstable = std::string(small::kUnstable) + R"(
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.3}}]
camera: {from: [0, -3, 1], look_at: [0, 0, 0]}
output: {images: {size: [96, 64], samples: 1}}
)";

class DrawingCrew : public testing::Test {
 protected:
  DrawingCrew() : folder_(temp_folder() / (std::string("crew_") + testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::remove_all(folder_);
  }
  ~DrawingCrew() override { fs::remove_all(folder_); }

  static Scene scene_of(const std::string& text) {
    Scene scene = parse_scene(text, "drops.yaml", ".");
    scene.source = "drops.yaml";
    return scene;
  }
  RunOptions options(const char* part, int at_once) const { return {.folder = folder_ / part, .threads = 1, .frames_at_once = at_once}; }
  void expect_same_files(const char* one, const char* other, int count) const {
    int files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / one)) {
      const fs::path name = fs::relative(entry.path(), folder_ / one);
      if (!entry.is_regular_file() || name.filename() == "result.json" || name.filename() == ".lock") continue;
      ++files;
      ASSERT_TRUE(fs::exists(folder_ / other / name)) << name;
      EXPECT_EQ(io::read_file(entry.path(), std::size_t{1} << 24), io::read_file(folder_ / other / name, std::size_t{1} << 24)) << name;
    }
    EXPECT_EQ(files, count);
  }

  fs::path folder_;
};

constexpr int kFilesOfDrops = kFrames * (1 + 2 + 2 + 1 + 1) + 1;  // picture, meshes, contacts and pairs, particles, state; sheet

TEST_F(DrawingCrew, WritesTheSameFilesBesideTheSimulation) {
  const Scene scene = scene_of(kDrops);
  const RunResult alone = run_scene(scene, options("alone", 1));
  ASSERT_EQ(alone.outcome, "done") << alone.reason;
  EXPECT_EQ(alone.frames_at_once, 1);
  const RunResult beside = run_scene(scene, options("beside", 3));
  ASSERT_EQ(beside.outcome, "done") << beside.reason;
  EXPECT_EQ(beside.frames_at_once, 3);
  EXPECT_EQ(beside.frames, kFrames);
  EXPECT_EQ(beside.pictures_drawn, kFrames);
  EXPECT_EQ(beside.pictures_kept, 0);
  EXPECT_EQ(beside.pictures.images, kFrames);
  EXPECT_EQ(beside.state_hash, alone.state_hash);
  expect_same_files("alone", "beside", kFilesOfDrops);
}

TEST_F(DrawingCrew, DrawsTheFramesThatAreAskedFor) {
  RunOptions some = options("some", 3);
  some.frames = {1, 4, 6};
  const RunResult result = run_scene(scene_of(kDrops), some);
  ASSERT_EQ(result.outcome, "done") << result.reason;
  EXPECT_EQ(result.frames_at_once, 2);  // two are left after the first
  EXPECT_EQ(result.frames, 6);          // no further
  EXPECT_EQ(result.pictures_drawn, 3);
  EXPECT_FALSE(fs::exists(folder_ / "some/frames/drops.0002.png"));
}

TEST_F(DrawingCrew, IsNotMadeWhereFramesNeedOrderMemoryOrExactClocks) {
  RunOptions o = options("profile", 3);
  o.profile = true;
  EXPECT_EQ(run_scene(scene_of(kDrops), o).frames_at_once, 1);
  o = options("memory", 3);
  o.memory = 1.0;
  EXPECT_EQ(run_scene(scene_of(kDrops), o).frames_at_once, 1);
  Scene scene = scene_of(kDrops);
  scene.output.mesh = {MeshName::Usd};
  EXPECT_EQ(run_scene(scene, options("animation", 3)).frames_at_once, 1);
  scene = scene_of(kDrops);
  scene.output.samples = {TableName::Csv};
  EXPECT_EQ(run_scene(scene, options("samples", 3)).frames_at_once, 1);
}

/// Islands between the nodes in some of the frames, and a body that is never searched.
const std::string kCoins = R"(
schema: 1
frame_rate: 8
duration: 0.75 s
objects:
  - name: coin
    particles: {at: [0.3, 0.3, 0.3], velocity: [1, -0.5, -0.5], mass: 0.5}
    skeleton: [{shape: point, kernel: {radius: 0.5}}]
    meshing: {cell: 0.9}
  - name: row
    particles: {arrange: line, count: 3, spacing: 0.4, at: [0, 2, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {radius: 0.5}}]
    blend: {rule: gradient}
camera: {from: [0, -3, 1], look_at: [0, 0, 0]}
output: {images: {size: [96, 64], samples: 1}, mesh: ply, cell: 0.1}
)";

TEST_F(DrawingCrew, CountsSearchesOfAllFramesWhoeverDrawsThem) {
  const Scene scene = scene_of(kCoins);
  const RunResult alone = run_scene(scene, options("alone", 1)), beside = run_scene(scene, options("beside", 3));
  ASSERT_EQ(beside.frames_at_once, 3);
  EXPECT_GT(alone.searches.pieces, 1u);
  EXPECT_LT(alone.searches.pieces, static_cast<std::uint64_t>(kFrames));
  EXPECT_EQ(alone.searches.not_searched(Unsearched::Undecided), static_cast<std::uint64_t>(kFrames));
  EXPECT_EQ(beside.searches.pieces, alone.searches.pieces);
  EXPECT_EQ(beside.searches.unsearched, alone.searches.unsearched);
  EXPECT_EQ(beside.warnings, alone.warnings);
  ASSERT_EQ(alone.warnings.size(), 1u);
  EXPECT_TRUE(alone.warnings[0].starts_with("output.meshing.search: pieces of surfaces")) << alone.warnings[0];
  std::atomic<int> signal{0};
  for (const int at_once : {1, 3}) {
    const std::string part = "stopped" + std::to_string(at_once);
    RunOptions o = options(part.c_str(), at_once);
    o.interrupt = &signal;
    o.progress = [&](const Progress& p) {
      if (p.stage == "render" && p.frame >= 4) signal = 15;
    };
    EXPECT_EQ(run_scene(scene, o).outcome, "interrupted");
    signal = 0;
    o.progress = nullptr;
    o.resume = true;
    const RunResult resumed = run_scene(scene, o);
    EXPECT_EQ(resumed.warnings, alone.warnings);
    EXPECT_EQ(resumed.searches.pieces, alone.searches.pieces);
    EXPECT_EQ(resumed.searches.unsearched, alone.searches.unsearched);
    expect_same_files("alone", part.c_str(), kFrames * (1 + 2 + 1 + 1) + 1);  // picture, meshes, searches, state; sheet
  }
  Scene off = scene_of(kCoins);
  off.output.meshing.search = false;
  const RunResult none = run_scene(off, options("off", 3));
  EXPECT_TRUE(none.searches.empty());
  EXPECT_FALSE(fs::exists(folder_ / "off/searches"));
}

TEST_F(DrawingCrew, StopsAtASignalAndARestartDrawsTheRest) {
  const Scene scene = scene_of(kDrops);
  ASSERT_EQ(run_scene(scene, options("whole", 3)).outcome, "done");
  std::atomic<int> signal{0};
  RunOptions o = options("stopped", 3);
  o.interrupt = &signal;
  o.progress = [&](const Progress& p) {
    if (p.stage == "render" && p.frame >= 2) signal = 15;
  };
  const RunResult stopped = run_scene(scene, o);
  EXPECT_EQ(stopped.outcome, "interrupted");
  EXPECT_EQ(stopped.exit_code, 143);
  EXPECT_FALSE(fs::exists(folder_ / "stopped/drops_sheet.png"));
  o.interrupt = nullptr;
  o.progress = nullptr;
  o.resume = true;
  const RunResult resumed = run_scene(scene, o);
  EXPECT_EQ(resumed.outcome, "done") << resumed.reason;
  expect_same_files("whole", "stopped", kFilesOfDrops);
}

TEST_F(DrawingCrew, DrawsWhatCameBeforeADivergence) {
  // So soft that it takes some frames until energy from nowhere is nearly all that there is.
  std::string text = kUnstable;
  const std::string stiff = "stretch: 1e6, rotation: 10";
  text.replace(text.find(stiff), stiff.size(), "stretch: 0.5, rotation: 1e-3");
  const Scene scene = scene_of(text);
  const RunResult alone = run_scene(scene, options("alone", 1));
  ASSERT_EQ(alone.outcome, "diverged") << alone.reason;
  ASSERT_GE(alone.frames, 2);
  const RunResult beside = run_scene(scene, options("beside", 2));
  EXPECT_EQ(beside.outcome, "diverged") << beside.reason;
  EXPECT_EQ(beside.reason, alone.reason);
  EXPECT_EQ(beside.frames, alone.frames);
  EXPECT_EQ(beside.state_hash, alone.state_hash);
  expect_same_files("alone", "beside", 2 * alone.frames);
}

TEST_F(DrawingCrew, EndsTheRunWhereAPictureCannotBeWritten) {
  fs::create_directories(folder_ / "blocked/frames/drops.0003.png/folder");
  const RunResult result = run_scene(scene_of(kDrops), options("blocked", 2));
  EXPECT_EQ(result.outcome, "io");
  EXPECT_NE(result.reason.find("drops.0003.png: cannot be written"), std::string::npos) << result.reason;
  EXPECT_TRUE(fs::exists(folder_ / "blocked/frames/drops.0002.png"));
  EXPECT_TRUE(fs::exists(folder_ / "blocked/result.json"));
}

}  // namespace
}  // namespace supple::scenes
