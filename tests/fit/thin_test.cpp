// Fewer primitives: what is put in the place of two, and thin parts of data.
#include "fit/thin.h"

#include <gtest/gtest.h>

#include "fit/find_skeleton.h"
#include "fit/shapes.h"

namespace supple::fit {
namespace {

class Rod : public ::testing::Test {
 protected:
  static constexpr double kHalf = 0.4, kRadius = 0.05;
  Rod() : mesh(test::rod(kHalf, kRadius)), data(mesh, 0.5, 0.02, Executor(2)) {}

  /// Both halves, with a gap at which each has half of the field that one has beside it.
  static std::vector<Blob> halves() {
    const double support = kRadius / kPointRadius, gap = 0.4046 * support;
    std::vector<Blob> out(2, Blob{.axes = Vec3(0.5 * (kHalf - gap), support, support), .form = Form::Segment});
    out[0].centre.x() = -0.5 * (kHalf + gap);
    out[1].centre.x() = 0.5 * (kHalf + gap);
    return out;
  }

  const Mesh mesh;
  const Data data;
  const SolveOptions solving{.iterations = 8, .smallest = 0.01, .largest = 2.0};
};

TEST_F(Rod, HalvesBecomeOneSegment) {
  const std::vector<Change> changes = changes_of(halves(), data, solving, Executor(2));
  ASSERT_EQ(changes.size(), 3U);  // either goes, or one comes for both
  const Change& first = changes.front();
  EXPECT_EQ(first.gone, (std::vector<std::uint32_t>{0, 1}));
  ASSERT_EQ(first.come.size(), 1U);
  EXPECT_EQ(first.come[0].form, Form::Segment);
  EXPECT_NEAR(first.come[0].axes.x(), kHalf, 0.1 * kHalf);
}

TEST_F(Rod, TakesOneSegment) {
  std::vector<Blob> blobs = halves();
  Targets targets = targets_of(data);
  Faults limit;
  limit.largest = 0.015;
  limit.rms = 0.004;
  limit.topology = 0;
  thin(data, limit, 1.0 / 128.0, 5, solving, Executor(2), targets, blobs);
  ASSERT_EQ(blobs.size(), 1U);
  EXPECT_EQ(blobs[0].form, Form::Segment);
  EXPECT_NEAR(blobs[0].axes.x(), kHalf, 0.01);
  EXPECT_NEAR(blobs[0].axes.y(), kRadius / kPointRadius, 0.01);
}

TEST_F(Rod, IsThinnerThanBallsThatAreThicker) {
  EXPECT_EQ(share_thinner_than(data, 0.9 * kRadius), 0.0);
  EXPECT_EQ(share_thinner_than(data, 1.1 * kRadius), 1.0);
}

TEST(LevelOf, IsTheNextLowerOne) {
  EXPECT_EQ(level_of(0.005), 0.005);
  EXPECT_EQ(level_of(0.02), 0.02);
  EXPECT_EQ(level_of(0.029), 0.02);
  EXPECT_EQ(level_of(0.05), 0.05);
  EXPECT_EQ(level_of(0.07), 0.06);
  EXPECT_EQ(level_of(0.1), 0.1);
}

}  // namespace
}  // namespace supple::fit
