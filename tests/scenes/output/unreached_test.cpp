/// Finished runs drawn with other solids: as long as nothing came to them.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "simulation/reach.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// A ball that flies along x, from 0 to 5 m in five frames; its support has a radius of 0.2 m.
std::string flight(const std::string& rest, const std::string& velocity = "[10, 0, 0]") {
  return "schema: 1\nduration: 0.5\nframe_rate: 10\nobjects:\n  - {name: ball, particles: {at: [0, 0, 1], velocity: " + velocity +
         ", mass: 1}, skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.2}}], contact: {}}\n"
         "output: {images: {size: [32, 24], samples: 1}}\ncamera: {from: [2, -9, 2], look_at: [2, 0, 1]}\n" + rest;
}
std::string wall(const std::string& name, double x, double y = 0.0) {
  return "{name: " + name + ", shape: box, at: [" + std::to_string(x) + ", " + std::to_string(y) + ", 1], half_sizes: [0.02, 0.5, 0.5]}";
}
std::string walls(const std::string& list) { return "obstacles: [" + list + "]\n"; }

class Unreached : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  static Scene scene(const std::string& text) { return parse_scene(text, "flight.yaml", "."); }
  void run(const std::string& text) const {
    const RunResult result = run_scene(scene(text), {.folder = folder_, .threads = 1, .overwrite = true});
    ASSERT_EQ(result.outcome, "done") << result.reason;
  }
  /// The exit code of drawing the run again.
  [[nodiscard]] int drawn(const std::string& text, const std::set<int>& frames = {}) const {
    return render_run(scene(text), {.folder = folder_, .frames = frames, .threads = 1, .overwrite = true}).exit_code;
  }

  fs::path folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
};

TEST_F(Unreached, SolidsMayBeAddedMovedAndLeftOut) {
  run(flight(""));
  EXPECT_EQ(drawn(flight(walls(wall("far", 7.0)))), 0);
  EXPECT_EQ(drawn(flight("ground: {height: 0}\n" + walls(wall("beside", 2.5, 1.0)))), 0);
  run(flight("ground: {height: 0}\ncontact: {error: 1e-4}\n" + walls(wall("far", 7.0))));
  EXPECT_EQ(drawn(flight("ground: {height: 0}\ncontact: {error: 1e-4}\n" + walls(wall("far", 6.0)))), 0);
  EXPECT_EQ(drawn(flight("ground: {height: -1}\ncontact: {error: 1e-4}\n")), 0);
  EXPECT_EQ(drawn(flight("")), 0);  // where nothing touches, rules of contact have no effect
}

TEST_F(Unreached, AreNoneThatTheMotionPasses) {
  run(flight(""));
  // Between two frames, where no saved state is near it.
  EXPECT_EQ(drawn(flight(walls(wall("thin", 2.5)))), 7);
  EXPECT_EQ(drawn(flight("ground: {height: 0.95}\n")), 7);
  EXPECT_EQ(drawn(flight(walls(wall("thin", 2.5))), {1, 2, 3}), 0);  // up to 2 m, where it ends
}

TEST_F(Unreached, AreNoneThatTheRunTouched) {
  run(flight(walls(wall("met", 2.5)), "[1, 0, 0]"));
  EXPECT_EQ(drawn(flight("", "[1, 0, 0]")), 0);  // it is not met at this speed
  run(flight(walls(wall("met", 0.3)), "[1, 0, 0]"));
  EXPECT_EQ(drawn(flight("", "[1, 0, 0]")), 7);
  EXPECT_EQ(drawn(flight(walls(wall("met", 0.3) + ", " + wall("far", 9.0)), "[1, 0, 0]")), 0);
}

TEST_F(Unreached, KeepTheOthersAndTheirNumbers) {
  const std::string ground = "gravity: [0, 0, -9.81]\nground: {height: 0.9}\ncontact: {stick: {stiffness: 100}}\n", still = "[0.1, 0, 0]";
  run(flight(ground + walls(wall("b", 9.0)), still));
  EXPECT_EQ(drawn(flight(ground + walls(wall("a", 8.0) + ", " + wall("b", 9.0)), still)), 0);
  EXPECT_EQ(drawn(flight("gravity: [0, 0, -9.81]\nground: {height: 0.8}\ncontact: {stick: {stiffness: 100}}\n" + walls(wall("b", 9.0)), still)), 7);
  Simulation simulation(scene(flight(ground + walls(wall("b", 9.0)), still)));
  ASSERT_TRUE(simulation.advance_to(5));
  State state = simulation.state();
  ASSERT_FALSE(state.record.pair_contacts.empty());
  const std::uint32_t before = state.record.pair_contacts.front().objects.b;
  Model model = build_model(scene(flight(walls(wall("a", 8.0)) + "ground: {height: 0.9}\n", still)));
  std::swap(model.fixed[0], model.fixed[1]);
  renumber_solids(model, state);
  EXPECT_EQ(state.record.pair_contacts.front().objects.b, before + 1);
  EXPECT_TRUE(state.record.solids[1].reached);
  EXPECT_FALSE(state.record.solids[0].reached);
}

TEST_F(Unreached, GiveThePictureOfARunWithThem) {
  const std::string with = flight(walls(wall("far", 7.0)));
  const auto picture = [&] { return io::read_file(folder_ / "frames" / "flight.0004.png", 1 << 20); };
  run(with);
  const std::vector<std::byte> own = picture();
  run(flight(""));
  EXPECT_NE(picture(), own);
  ASSERT_EQ(drawn(with), 0);
  EXPECT_EQ(picture(), own);
}

TEST_F(Unreached, DoNotLetARunGoOn) {
  run(flight(""));
  RunOptions options{.folder = folder_, .threads = 1};
  options.resume = true;
  EXPECT_EQ(run_scene(scene(flight(walls(wall("far", 7.0)))), options).exit_code, 7);
}

TEST(Reach, HoldsTheSurfaceInFewBoxesHoweverLongARunIs) {
  const Scene scene = parse_scene(flight("", "[0.1, 0, 0]") + "time_step: {substeps: 1}\n", "flight.yaml", ".", std::vector<std::string>{"duration=20"});
  Simulation simulation(scene);
  ASSERT_TRUE(simulation.advance_to(150));
  const RunRecord& record = simulation.state().record;
  ASSERT_EQ(record.reach.size(), 1U);
  EXPECT_LE(record.reach[0].size(), 32U);
  EXPECT_EQ(record.reach_frames, 8U);
  Box all;
  for (const Box& box : record.reach[0]) all = all.united(box);
  EXPECT_LE(all.lower.x(), -0.2);
  EXPECT_GE(all.upper.x(), 149 * 0.01 + 0.2);
  EXPECT_LE(all.upper.x(), 149 * 0.01 + 0.25);
  EXPECT_LE(record.reach[0].front().upper.x(), 0.35);
}

}  // namespace
}  // namespace supple::scenes
