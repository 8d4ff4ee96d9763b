#include "supple/implicit/even_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "implicit/bodies.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

using namespace testing;

constexpr double kSpacing = 0.12;

/// A row of blobs that can be pulled apart.
Body row(double apart) {
  std::vector<std::pair<Primitive, Vec3>> blobs;
  for (int i = 0; i < 4; ++i) blobs.emplace_back(wyvill_point(1.0), Vec3(apart * i, 0.05 * i, 0));
  return body_of(blobs);
}

void expect_even(const EvenSampleSet& set, const Body& body) {
  std::vector<double> values(set.size());
  body.field.evaluate(set.point, values);
  for (std::size_t s = 0; s < set.size(); ++s) {
    ASSERT_NEAR(values[s], 0.0, 1e-5);
    const Pose& pose = body.parts[set.part[s]];
    ASSERT_LT((pose.position + pose.orientation * set.local[s] - set.point[s]).norm(), 1e-14);
    for (std::size_t t = 0; t < s; ++t) ASSERT_GE((set.point[s] - set.point[t]).norm(), 0.5 * kSpacing - 1e-12);
  }
  const Mesh fine = march_cubes(body.field, {.lattice = {.origin = Vec3(0.01, 0.02, 0.03), .cell = 0.25 * kSpacing}}, Executor(1));
  for (const Vec3& p : fine.position) {
    const double nearest =
        std::accumulate(set.point.begin(), set.point.end(), 1e9,
                        [&](double least, const Vec3& q) { return std::min(least, (p - q).norm()); });
    ASSERT_LT(nearest, kSpacing);
  }
  EXPECT_TRUE(std::is_sorted(set.id.begin(), set.id.end()));
  EXPECT_EQ(std::set<std::uint64_t>(set.id.begin(), set.id.end()).size(), set.size());
}

TEST(EvenSamples, AreNeitherNearNorFarFromEachOther) {
  for (const double apart : {0.3, 0.6}) {
    const Body body = row(apart);
    EvenSampler sampler(kSpacing);
    EvenSampleCounts counts;
    const EvenSampleSet& set = sampler.update(body.field, body.parts, Executor(2), &counts);
    expect_even(set, body);
    EXPECT_EQ(counts.added, set.size());
    EXPECT_FALSE(counts.remade);
  }
}

TEST(EvenSamples, RideOnTheirPartsWhenABodyMovesAsAWhole) {
  Body body = row(0.5);
  EvenSampler sampler(kSpacing);
  const EvenSampleSet before = sampler.update(body.field, body.parts, Executor(1));
  const Quat turn(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  for (Pose& pose : body.parts) pose = {turn * pose.position + Vec3(0.3, -0.2, 5.0), turn * pose.orientation};
  body.place();
  EvenSampleCounts counts;
  const EvenSampleSet& after = sampler.update(body.field, body.parts, Executor(1), &counts);
  // All stay, but for a place of the turned lattice that had been just less than 0.7 spacings away.
  EXPECT_EQ(counts.removed, 0u);
  EXPECT_LE(counts.added, before.size() / 20);
  for (std::size_t s = 0; s < before.size(); ++s) {
    ASSERT_EQ(after.id[s], before.id[s]);
    ASSERT_LT((after.point[s] - (turn * before.point[s] + Vec3(0.3, -0.2, 5.0))).norm(), 1e-5);
  }
  expect_even(after, body);
}

TEST(EvenSamples, FollowASurfaceThatStretchesAndShrinks) {
  EvenSampler sampler(kSpacing);
  Body body = row(0.3);
  const std::size_t small = sampler.update(body.field, body.parts, Executor(1)).size();
  EvenSampleCounts counts;
  std::uint64_t added = 0, removed = 0;
  const auto go = [&](double from, double to) {
    added = removed = 0;
    for (int step = 1; step <= 10; ++step) {
      body = row(from + (to - from) * step / 10);
      const EvenSampleSet& set = sampler.update(body.field, body.parts, Executor(1), &counts);
      EXPECT_FALSE(counts.remade);
      EXPECT_GT(2 * counts.kept, set.size());
      added += counts.added;
      removed += counts.removed;
    }
  };
  go(0.3, 0.7);
  const std::size_t large = sampler.update(body.field, body.parts, Executor(1), &counts).size();
  EXPECT_EQ(counts.added + counts.removed, 0u);  // nothing moved
  EXPECT_GT(large, small + 20);
  EXPECT_GT(added, removed);
  go(0.7, 0.3);
  EXPECT_GT(removed, added);
  expect_even(sampler.update(body.field, body.parts, Executor(1)), body);
}

TEST(EvenSamples, AreMadeAnewWhenTheSurfaceParts) {
  EvenSampler sampler(kSpacing);
  Body body = row(0.6);
  const std::uint64_t last = sampler.update(body.field, body.parts, Executor(1)).id.back();
  body = row(1.3);  // four balls
  EvenSampleCounts counts;
  const EvenSampleSet& set = sampler.update(body.field, body.parts, Executor(1), &counts);
  EXPECT_TRUE(counts.remade);
  EXPECT_EQ(counts.kept, 0u);
  EXPECT_GT(set.id.front(), last);
  expect_even(set, body);
}

TEST(EvenSamples, DoNotDependOnThreads) {
  const Body body = row(0.5), moved = row(0.55);
  const auto points = [&](int threads) {
    EvenSampler sampler(kSpacing);
    (void)sampler.update(body.field, body.parts, Executor(threads));
    return sampler.update(moved.field, moved.parts, Executor(threads)).point;
  };
  EXPECT_EQ(points(1), points(4));
}

}  // namespace
}  // namespace supple::implicit
