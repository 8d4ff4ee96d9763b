/// Films and contact sheets show frames of one look.
#include "output/pictures/frame_looks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "scenes/small_scenes.h"
#include "supple/core/io/atomic_file.h"
#include "supple/render/image.h"
#include "supple/scenes/inspect.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Sets = std::vector<std::string>;

const std::string kFilmed = std::string(small::kTwoDrops) + R"(
duration: 0.5 s
output: {images: {size: [96, 64], samples: 1}, film: true}
)";
const Sets kRed{"objects.left.colour=[1, 0, 0]"};
const Sets kSmall{"output.images.size=[48, 32]"};

std::vector<std::byte> bytes_of(const fs::path& path) { return io::read_file(path, std::size_t{1} << 24); }

class LooksOfFrames : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    const RunResult whole = run_scene(scene(), options());
    ASSERT_EQ(whole.outcome, "done") << whole.reason;
    ASSERT_TRUE(fs::exists(film()));
  }
  void TearDown() override { fs::remove_all(folder_); }

  static Scene scene(const Sets& sets = {}) { return parse_scene(kFilmed, "drops.yaml", ".", sets); }
  [[nodiscard]] RunOptions options(const std::set<int>& frames = {}) const { return {.folder = folder_, .frames = frames, .threads = 1}; }
  [[nodiscard]] fs::path film() const { return folder_ / "drops.mp4"; }
  [[nodiscard]] fs::path sheet() const { return folder_ / "drops_sheet.png"; }

  fs::path folder_;
};

TEST_F(LooksOfFrames, OnASheetHaveTheNumbersOfTheirFrames) {
  // A number is in the upper left corner of each picture, and nowhere else; the numbers differ.
  const render::Image all = render::read_png(sheet());
  std::set<std::vector<std::uint8_t>> corners;
  for (const int frame : {1, 2, 3}) {
    const render::Image alone = render::read_png(folder_ / ("frames/drops.000" + std::to_string(frame) + ".png"));
    ASSERT_EQ(alone.width, 96);
    std::vector<std::uint8_t> corner;
    int beside = 0;
    for (int y = 0; y < alone.height; ++y) {
      for (int x = 0; x < 3 * alone.width; ++x) {
        const std::uint8_t now = all.pixels[3 * static_cast<std::size_t>((4 + y) * all.width + 4 + (frame - 1) * (96 + 4)) + static_cast<std::size_t>(x)];
        const int changed = std::abs(now - alone.pixels[static_cast<std::size_t>(3 * y * alone.width + x)]);
        if (x < 3 * 16 && y < 14) corner.push_back(changed > 60 ? 1 : 0);
        else beside += changed;
      }
    }
    EXPECT_EQ(beside, 0) << frame;
    EXPECT_GT(std::count(corner.begin(), corner.end(), 1), 20) << frame;
    corners.insert(corner);
  }
  EXPECT_EQ(corners.size(), 3u);
}

TEST_F(LooksOfFrames, OfTwoKindsMakeNoFilmAndRemoveTheEarlierOne) {
  const RunResult mixed = render_run(scene(kRed), options({4}));
  EXPECT_EQ(mixed.outcome, "done") << mixed.reason;
  EXPECT_TRUE(mixed.film.empty());
  EXPECT_FALSE(fs::exists(film()));
  EXPECT_EQ(mixed.warnings,
            Sets{"no film: frame 4 of drops has another look than the others; an earlier drops.mp4 of other pictures is removed"});
  // The sheet is of the four that have one.
  EXPECT_EQ(render::read_png(sheet()).width, 4 * 96 + 5 * 4);
  EXPECT_EQ(render::read_png(sheet()).height, 64 + 2 * 4);
  EXPECT_EQ(look_in(render::png_fingerprint(sheet())), look_in(render::png_fingerprint(folder_ / "frames/drops.0001.png")));
  // Neither does another command make one of them.
  EXPECT_EQ(run_scene(scene(kRed), [&] {
              RunOptions o = options({4});
              o.resume = true;
              return o;
            }()).warnings,
            Sets{"no film: frame 4 of drops has another look than the others"});
  // One look again, one film again.
  const RunResult red = render_run(scene(kRed), options());
  EXPECT_EQ(red.pictures_drawn, 4);
  EXPECT_EQ(red.film, film());
  EXPECT_TRUE(red.warnings.empty());
}

TEST_F(LooksOfFrames, ThatCameBackMakeTheSameFilm) {
  const std::vector<std::byte> before = bytes_of(film());
  ASSERT_TRUE(render_run(scene(kRed), options({2})).film.empty());
  EXPECT_EQ(render_run(scene(), options({2})).film, film());
  EXPECT_EQ(bytes_of(film()), before);
}

TEST_F(LooksOfFrames, DrawnAgainInAnotherSizeLeaveTheSheetOfTheOthersAndNoFilm) {
  RunResult drawn = render_run(scene(kSmall), options({1, 2}));
  ASSERT_EQ(drawn.outcome, "done") << drawn.reason;
  EXPECT_EQ(drawn.pictures_drawn, 2);
  EXPECT_TRUE(drawn.film.empty());
  EXPECT_EQ(drawn.warnings,
            Sets{"no film: frames 1-2 of drops have another size than the others; an earlier drops.mp4 of other pictures is removed"});
  EXPECT_EQ(render::read_png(folder_ / "frames/drops.0001.png").width, 48);
  EXPECT_EQ(render::read_png(sheet()).width, 3 * 96 + 4 * 4);  // of three frames, 4 pixels between
  EXPECT_FALSE(render_run(scene(kSmall), options()).film.empty());
}

TEST_F(LooksOfFrames, OfAnotherSizeLeaveNoFilmWhereNoneIsAskedFor) {
  const RunResult drawn = render_run(scene({kSmall[0], "output.film=false"}), options());
  EXPECT_EQ(drawn.warnings, Sets{"drops.mp4 is removed: it shows other pictures than frames/ holds"});
  EXPECT_FALSE(fs::exists(film()));
  EXPECT_EQ(render::read_png(sheet()).width, 4 * 48 + 5 * 4);
}

TEST_F(LooksOfFrames, ThatAreTheSameKeepTheFilmWhereNoneIsAskedFor) {
  fs::remove(folder_ / "frames/drops.0003.png");
  const RunResult drawn = render_run(scene({"output.film=false"}), options());
  EXPECT_EQ(drawn.pictures_drawn, 1);
  EXPECT_TRUE(drawn.warnings.empty());
  EXPECT_TRUE(fs::exists(film()));
}

TEST_F(LooksOfFrames, OfFramesThatAreAbsentAreNoReasonToRemoveAFilm) {
  for (const char* lost : {"frames/drops.0001.png", "frames/drops.0002.png"}) fs::remove(folder_ / lost);
  const RunResult drawn = render_run(scene(), options({3}));
  EXPECT_EQ(drawn.warnings, Sets{"no film: frames 1-2 of drops have no picture"});
  EXPECT_TRUE(fs::exists(film()));
}

TEST_F(LooksOfFrames, OfAFilmThatThisProgramDidNotMakeAreNotItsToRemove) {
  std::ofstream(film()) << "cut by hand";
  (void)render_run(scene({kRed[0], "output.film=false"}), options());
  EXPECT_TRUE(fs::exists(film()));
}

TEST_F(LooksOfFrames, LeaveNoStaleFilmWhereASignalEndsTheDrawing) {
  std::atomic<int> signal{0};
  RunOptions o = options();
  o.interrupt = &signal;
  o.progress = [&](const Progress& p) { signal = p.frame >= 2 ? 15 : 0; };
  const RunResult stopped = render_run(scene(kRed), o);
  EXPECT_EQ(stopped.outcome, "interrupted");
  EXPECT_FALSE(fs::exists(film()));
  EXPECT_FALSE(fs::exists(sheet()));
}

TEST_F(LooksOfFrames, OfALongerRunMakeALongerFilm) {
  RunOptions first = options({1, 2, 3});
  first.overwrite = true;
  const RunResult part = run_scene(scene(), first);
  EXPECT_EQ(part.film, film());
  EXPECT_EQ(part.frames, 3);
  const std::vector<std::byte> of_three = bytes_of(film());
  RunOptions on = options({5});
  on.resume = true;
  const RunResult gap = run_scene(scene(), on);
  EXPECT_EQ(gap.warnings, Sets{"no film: frame 4 of drops has no picture; an earlier drops.mp4 of other pictures is removed"});
  on.frames = {};
  EXPECT_EQ(run_scene(scene(), on).film, film());
  EXPECT_NE(bytes_of(film()), of_three);
}

TEST_F(LooksOfFrames, OfAComparisonLeaveNoFilmOfAnEarlierOne) {
  const ComparisonOptions two{.first = folder_, .second = folder_, .folder = folder_ / "same"};
  ASSERT_TRUE(fs::exists(compare_runs(two).film));
  fs::remove(folder_ / "frames/drops.0002.png");
  EXPECT_TRUE(compare_runs(two).film.empty());
  EXPECT_FALSE(fs::exists(folder_ / "same/compare.mp4"));
}

}  // namespace
}  // namespace supple::scenes
