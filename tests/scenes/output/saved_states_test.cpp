/// Saved states from which a run resumes, and those it refuses.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "output/files/saved_frames.h"
#include "output/run/program_identity.h"
#include "scenes/small_scenes.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

const std::string kDrops = std::string(small::kTwoDrops) + "duration: 0.5 s\n";
const std::vector<std::string> kPictures{"output={images: {size: [32, 24], samples: 1}}"};
const std::vector<std::string> kUsd{"output={mesh: usd, cell: 0.1}"};

std::vector<std::byte> bytes_of(const fs::path& path) { return io::read_file(path, std::size_t{1} << 24); }

class SavedStates : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    const RunResult whole = run_scene(scene(), options());
    ASSERT_EQ(whole.outcome, "done") << whole.reason;
    ASSERT_EQ(whole.frames, 5);
    final_ = whole.state_hash;
  }
  void TearDown() override { fs::remove_all(folder_); }

  static Scene scene(const std::vector<std::string>& sets = {}) { return parse_scene(kDrops, "drops.yaml", ".", sets); }
  [[nodiscard]] RunOptions options(bool resume = false) const {
    RunOptions o{.folder = folder_, .threads = 1};
    o.resume = resume;
    return o;
  }
  [[nodiscard]] fs::path state(int frame) const { return folder_ / "states" / ("drops.000" + std::to_string(frame) + ".state"); }
  void copy(int from, int to) const { fs::copy_file(state(from), state(to), fs::copy_options::overwrite_existing); }
  void damage(int frame) const { fs::resize_file(state(frame), fs::file_size(state(frame)) - 9); }
  void expect_refused(const RunResult& result, const std::string& reason) const {
    EXPECT_EQ(result.exit_code, 7);
    EXPECT_EQ(result.outcome, "io");
    EXPECT_EQ(result.reason, reason);
  }

  fs::path folder_;
  std::uint64_t final_ = 0;
};

TEST_F(SavedStates, OfAnotherFrameAreRefused) {
  copy(2, 5);
  const std::string last = state(5).string() + ": expected the state of frame 5, found that of frame 2; give the file its own name, or remove it: "
                                               "`supple run --resume` computes it again";
  expect_refused(run_scene(scene(), options(true)), last);
  expect_refused(export_run(scene(kUsd), options()), last);
  expect_refused(render_run(scene(kPictures), options()), last);
  fs::remove(state(5));
  copy(2, 3);  // in the middle
  const std::string middle = state(3).string() + ": expected the state of frame 3, found that of frame 2; ";
  for (const RunResult& result : {run_scene(scene(), options(true)), export_run(scene(kUsd), options()), render_run(scene(kPictures), options())}) {
    EXPECT_EQ(result.exit_code, 7);
    EXPECT_TRUE(result.reason.starts_with(middle)) << result.reason;
  }
  EXPECT_FALSE(fs::exists(folder_ / "drops.usda"));
}

TEST_F(SavedStates, ThatChangedPlacesAreRefused) {
  fs::rename(state(2), folder_ / "two");
  fs::rename(state(3), state(2));
  fs::rename(folder_ / "two", state(3));
  const RunResult result = run_scene(scene(), options(true));
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_NE(result.reason.find("expected the state of frame 2, found that of frame 3"), std::string::npos) << result.reason;
}

TEST_F(SavedStates, BetweenTwoFramesAreRefusedAsOnesOfAFrame) {
  Simulation simulation(scene({"time_step.substeps=4"}));
  simulation.step();
  save_state(state(1), simulation.state(), origin_of(simulation.scene()));
  RunResult result = run_scene(scene({"time_step.substeps=4"}), options(true));
  EXPECT_NE(result.reason.find("expected the state of frame 1, found one between frames 1 and 2"), std::string::npos) << result.reason;
}

TEST_F(SavedStates, OfAnotherSceneAreRefusedByTheKeysThatDiffer) {
  const std::vector<std::string> heavy{"objects.left.particles.mass=2"};
  expect_refused(run_scene(scene(heavy), options(true)),
                 state(1).string() + ": expected a state of this scene, found one of a scene with objects.left.particles.mass=0.5 (here 2); "
                                     "its scene is this one with --set objects.left.particles.mass=0.5, or run the scene again: supple run --overwrite, or start a "
                                     "variation from a frame N of this run: supple run SCENE --from-frame N --from THIS_FOLDER --out ANOTHER");
  const Scene other = parse_scene("schema: 1\nduration: 0.5 s\nframe_rate: 8\nobjects: [{name: ball, particles: {inertia_radius: 1}}]\n", "drops.yaml", ".");
  const RunResult result = render_run(other, options());
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_NE(result.reason.find("objects.ball=none (here given), objects.left=given (here none), objects.right=given (here none); use the scene file "
                               "and the --set that wrote it"),
            std::string::npos)
      << result.reason;
}

TEST_F(SavedStates, OfAnotherBuildAreLookedAtButNotGoneOnFrom) {
  for (int frame = 1; frame <= 5; ++frame) {
    std::vector<std::byte> bytes = bytes_of(state(frame));
    const std::string build = program_identity();
    const auto as_bytes = std::as_bytes(std::span(build));
    const auto at = std::search(bytes.begin(), bytes.end(), as_bytes.begin(), as_bytes.end());
    ASSERT_NE(at, bytes.end());
    *at ^= std::byte{1};
    const std::uint64_t check = hash_bytes(std::span(bytes).first(bytes.size() - sizeof(std::uint64_t)));
    std::memcpy(&bytes[bytes.size() - sizeof check], &check, sizeof check);
    io::write_atomically(state(frame), bytes);
  }
  EXPECT_EQ(render_run(scene(kPictures), options()).pictures_drawn, 5);
  expect_refused(run_scene(scene(), options(true)),
                 state(1).string() + ": expected a state of this build of supple, found one of another build, whose results may differ in the last bit; continue "
                                     "with that build, or use --overwrite to run the scene again");
}

TEST_F(SavedStates, ThatAreLostOrDamagedAreSimulatedAgain) {
  const std::vector<std::byte> second = bytes_of(state(2));
  for (const bool pictures : {false, true}) {
    const Scene again = scene(pictures ? kPictures : std::vector<std::string>{});
    fs::remove(state(2));
    damage(4);
    damage(5);
    const RunResult result = run_scene(again, options(true));
    ASSERT_EQ(result.outcome, "done") << result.reason;
    EXPECT_EQ(result.state_hash, final_);
    EXPECT_EQ(result.frames, 5);
    EXPECT_EQ(result.warnings, (std::vector<std::string>{"frame 2 is simulated again: its saved state is lost",
                                                         "frames 4-5 are simulated again: their saved states are damaged"}));
    EXPECT_EQ(bytes_of(state(2)), second);
    EXPECT_EQ(result.pictures_drawn, pictures ? 5 : 0);
    EXPECT_TRUE(run_scene(again, options(true)).warnings.empty());
  }
  damage(1);
  EXPECT_EQ(run_scene(scene(), options(true)).state_hash, final_);
}

TEST_F(SavedStates, BeforeTheFirstOneAreMissedOnlyWhereFramesAreWritten) {
  for (int frame = 1; frame <= 3; ++frame) fs::remove(state(frame));
  fs::remove(state(5));
  EXPECT_EQ(run_scene(scene(), options(true)).state_hash, final_);
  EXPECT_FALSE(fs::exists(state(3)));
  const RunResult drawn = run_scene(scene(kPictures), options(true));
  EXPECT_EQ(drawn.state_hash, final_);
  EXPECT_EQ(drawn.pictures_drawn, 5);
  EXPECT_EQ(drawn.warnings, std::vector<std::string>{"frames 1-3 are simulated again: their saved states are lost"});
  // Where the only one is damaged the run begins anew.
  for (int frame = 1; frame <= 4; ++frame) fs::remove(state(frame));
  damage(5);
  EXPECT_EQ(run_scene(scene(), options(true)).state_hash, final_);
}

TEST_F(SavedStates, ThatAreLostAreNamedByWhoOnlyLooksAtThem) {
  fs::remove(state(3));
  RunResult result = render_run(scene(kPictures), options());
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_EQ(result.reason, state(3).string() + ": expected the saved state of frame 3, found none; `supple run --resume` computes it from the last one before it");
  damage(2);
  result = render_run(scene(kPictures), options());
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_EQ(result.reason, state(2).string() + ": expected a complete saved state, found content that does not match its checksum; `supple run --resume` "
                                               "continues from the last good one before it");
}

TEST_F(SavedStates, GoOnInAFolderOfAnotherName) {
  const fs::path moved = folder_.string() + "_moved";
  fs::remove_all(moved);
  fs::rename(folder_, moved);
  fs::remove(moved / "states/drops.0005.state");
  RunOptions o = options(true);
  o.folder = moved;
  EXPECT_EQ(run_scene(scene(), o).state_hash, final_);
  fs::remove_all(moved);
}

TEST_F(SavedStates, EndWithTheLastFrameAskedForAndAreGoneOnFrom) {
  RunOptions some = options();
  some.overwrite = true;
  some.frames = {2, 3};
  const RunResult part = run_scene(scene(kPictures), some);
  EXPECT_EQ(part.outcome, "done");
  EXPECT_EQ(part.frames, 3);
  EXPECT_TRUE(fs::exists(state(3)));
  EXPECT_FALSE(fs::exists(state(4)));
  EXPECT_FALSE(fs::exists(folder_ / "frames/drops.0001.png"));
  std::ifstream file(folder_ / "result.json");
  const nlohmann::json report = nlohmann::json::parse(file);
  EXPECT_EQ(report.at("frames"), 3);
  EXPECT_EQ(report.at("frame_count"), 5);
  some.resume = true;
  some.frames = {4, 1000};  // beyond the end
  EXPECT_EQ(run_scene(scene(kPictures), some).state_hash, final_);
  some.frames = {1};  // goes back to no state
  EXPECT_EQ(run_scene(scene(kPictures), some).frames, 5);
  EXPECT_TRUE(fs::exists(folder_ / "frames/drops.0001.png"));
}

TEST_F(SavedStates, AreLookedForBeforeAFolderIsMade) {
  RunOptions nowhere = options();
  nowhere.folder = folder_ / "nowhere";
  for (const auto& command : {render_run, export_run}) {
    EXPECT_THROW((void)command(scene({kPictures[0], "output.particles=csv"}), nowhere), Error);
    EXPECT_FALSE(fs::exists(nowhere.folder));
  }
}

TEST(FramesText, JoinsNeighbours) {
  EXPECT_EQ(frames_text({8}), "frame 8");
  EXPECT_EQ(frames_text({1, 2}), "frames 1-2");
  EXPECT_EQ(frames_text({1, 3, 4, 5, 9, 11, 12}), "frames 1, 3-5, 9, 11-12");
}

}  // namespace
}  // namespace supple::scenes
