// Runs that start from a state of another run.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "scenes/small_scenes.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "supple/scenes/state.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class Variation : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    ASSERT_EQ(run_scene(scene(), options("first")).outcome, "done");
  }
  void TearDown() override { fs::remove_all(folder_); }

  static Scene scene(const std::vector<std::string>& overrides = {}) {
    return parse_scene(std::string(small::kTwoDrops) + "title: Two drops\nduration: 1 s\noutput: {images: {size: [48, 32], samples: 1}, film: true}\n", "drops.yaml", ".", overrides);
  }
  [[nodiscard]] RunOptions options(const std::string& name) const { return {.folder = folder_ / name, .threads = 1, .simulate_only = true}; }
  [[nodiscard]] RunOptions from(int frame) const {
    RunOptions varied = options("varied");
    varied.from = RunStart{.folder = folder_ / "first", .frame = frame};
    return varied;
  }
  [[nodiscard]] State state(const std::string& name, int frame, const Scene& of) const {
    return load_state(folder_ / name / "states" / ("drops.000" + std::to_string(frame) + ".state"), origin_of(of));
  }

  fs::path folder_;
  const std::vector<std::string> heavy_{"objects.right.particles.mass=2"};
};

TEST_F(Variation, GoesOnFromAFrameWithOtherValues) {
  const RunResult result = run_scene(scene(heavy_), from(3));
  ASSERT_EQ(result.outcome, "done") << result.reason;
  EXPECT_EQ(result.frames, 9);
  EXPECT_FALSE(fs::exists(folder_ / "varied/states/drops.0002.state"));
  const State before = state("first", 3, scene()), at = state("varied", 3, scene(heavy_));
  EXPECT_EQ(at.particles.position, before.particles.position);
  EXPECT_EQ(at.particles.velocity, before.particles.velocity);
  EXPECT_NE(state("varied", 9, scene(heavy_)).particles.position, state("first", 9, scene()).particles.position);
  std::ifstream file(folder_ / "varied/result.json");
  const json report = json::parse(file);
  EXPECT_EQ(report["origin"]["folder"], fs::absolute(folder_ / "first").lexically_normal().string());
  EXPECT_EQ(report["origin"]["frame"], 3);
  EXPECT_EQ(report["origin"]["differences"], "objects.right.particles.mass=0.5 (here 2)");
  std::ifstream first(folder_ / "first/result.json");
  EXPECT_FALSE(json::parse(first).contains("origin"));
}

TEST_F(Variation, ContinuesToTheSameBits) {
  const RunResult straight = run_scene(scene(heavy_), from(3));
  RunOptions again = options("varied");
  again.resume = true;
  fs::remove(folder_ / "varied/result.json");
  for (const int frame : {6, 7, 8, 9}) fs::remove(folder_ / "varied/states" / ("drops.000" + std::to_string(frame) + ".state"));
  const RunResult resumed = run_scene(scene(heavy_), again);
  EXPECT_EQ(resumed.outcome, "done") << resumed.reason;
  EXPECT_EQ(resumed.state_hash, straight.state_hash);
  ASSERT_TRUE(resumed.origin.has_value());
  EXPECT_EQ(resumed.origin->frame, 3);
  fs::remove(folder_ / "varied/states/drops.0003.state");  // the state that it starts from
  EXPECT_EQ(run_scene(scene(heavy_), again).state_hash, straight.state_hash);
  EXPECT_TRUE(fs::exists(folder_ / "varied/states/drops.0003.state"));
}

TEST_F(Variation, HasAFilmFromItsFirstFrameOn) {
  RunOptions drawn = from(5);
  drawn.simulate_only = false;
  const RunResult result = run_scene(scene(heavy_), drawn);
  ASSERT_EQ(result.outcome, "done") << result.reason;
  EXPECT_TRUE(fs::exists(folder_ / "varied/drops.mp4"));
  EXPECT_FALSE(fs::exists(folder_ / "varied/frames/drops.0004.png"));
  EXPECT_EQ(render_run(scene(heavy_), {.folder = folder_ / "varied", .threads = 1}).pictures_kept, 5);
}

TEST_F(Variation, OfAnUnchangedSceneIsTheSameMotion) {
  ASSERT_EQ(run_scene(scene(), from(1)).outcome, "done");
  EXPECT_EQ(state("varied", 9, scene()).particles.position, state("first", 9, scene()).particles.position);
}

TEST_F(Variation, SaysWhatIsWrong) {
  const auto message = [](const auto& body) -> std::string {
    try {
      return body().reason;
    } catch (const Error& error) {
      return error.what();
    }
  };
  EXPECT_EQ(message([&] { return run_scene(scene(), from(10)); }), "--from-frame: expected a frame from 1 to 9, found 10; the run goes on from there to its last frame");
  RunOptions same = from(3);
  same.folder = folder_ / "first";
  EXPECT_EQ(message([&] { return run_scene(scene(), same); }),
            "--out: expected another folder than that of the run that is varied, found " + same.folder.string() + "; a variation is a run of its own");
  RunOptions both = from(3);
  both.resume = true;
  EXPECT_EQ(message([&] { return run_scene(scene(), both); }), "--from-frame: expected it without --resume, found both; --resume alone continues a variation that was begun");
  fs::remove(folder_ / "first/states/drops.0003.state");
  EXPECT_EQ(message([&] { return run_scene(scene(), from(3)); }),
            (folder_ / "first/states").string() + ": expected the saved state of frame 3, found none of this frame; --from-frame takes a frame of an earlier run; --from FOLDER names the folder of that run");
  const Scene other = parse_scene("schema: 1\nduration: 1 s\nframe_rate: 8\nobjects: [{name: ball, particles: {arrange: single, mass: 1, inertia_radius: 1}}]\n", "drops.yaml", ".");
  EXPECT_NE(message([&] { return run_scene(other, from(4)); }).find("state: expected 1 particles, found 2; the scenes must have the same objects"), std::string::npos)
      << message([&] { return run_scene(other, from(4)); });
}

}  // namespace
}  // namespace supple::scenes
