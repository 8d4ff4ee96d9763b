// Lists of near particles: what they hold, when they are kept, and that nothing but positions decides it.
#include "neighbours/pair_lists.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/support.h"
#include "supple/core/neighbours.h"
#include "support/allocations.h"

namespace supple::core {
namespace {

using test::Draw;

constexpr double kRange = 1.0;

std::vector<Vec3> make_cloud(std::size_t count, std::uint64_t seed) {
  Draw draw(seed);
  const double size = std::max(3.0, std::cbrt(static_cast<double>(count) / 5.0));
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < count; ++i) points.push_back(draw.vector(0.5 * size));
  return points;
}

std::vector<std::uint32_t> all_of(std::size_t count) {
  std::vector<std::uint32_t> particles(count);
  for (std::uint32_t i = 0; i < count; ++i) particles[i] = i;
  return particles;
}

PairLists make_lists(std::size_t count, PairLists::Takes takes = {}) {
  return PairLists(kRange, all_of(count), static_cast<std::uint32_t>(count), std::move(takes));
}

/// Each pair once for each of its particles, sorted; what else is wrong with the lists is a failure.
std::vector<IndexPair> entries_of(const PairLists& lists, std::uint32_t filler) {
  std::vector<IndexPair> entries;
  for (const PairLists::Block& block : lists.blocks()) {
    const std::size_t before = entries.size();
    for (const PairGroup& group : block.group) {
      for (std::uint32_t k = 0; k < kGroup; ++k) {
        EXPECT_EQ(group.owner[k] == filler + 1, k >= group.owners);
        std::vector<std::uint32_t> list;
        for (std::uint32_t s = 0; s < group.steps; ++s) list.push_back(block.entry[group.begin + kGroup * s + k]);
        const auto end = std::find(list.begin(), list.end(), filler);
        EXPECT_TRUE(std::all_of(end, list.end(), [&](std::uint32_t j) { return j == filler; }));
        EXPECT_TRUE(std::is_sorted(list.begin(), end));
        for (auto j = list.begin(); j != end; ++j) entries.push_back({group.owner[k], *j});
      }
    }
    EXPECT_EQ(block.pairs, entries.size() - before);
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

std::vector<IndexPair> from_both_sides(const std::vector<IndexPair>& pairs) {
  std::vector<IndexPair> entries;
  for (const IndexPair& pair : pairs) {
    entries.push_back(pair);
    entries.push_back({pair.second, pair.first});
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

/// @param found  holds all pairs nearer than the range; none is farther than it needs to be
void expect_near(const std::vector<IndexPair>& found, const std::vector<Vec3>& points) {
  const std::vector<IndexPair> least = from_both_sides(find_neighbours_brute_force(points, kRange));
  const std::vector<IndexPair> most = from_both_sides(find_neighbours_brute_force(points, 1.2 * kRange));
  EXPECT_TRUE(std::includes(found.begin(), found.end(), least.begin(), least.end()));
  EXPECT_TRUE(std::includes(most.begin(), most.end(), found.begin(), found.end()));
}

TEST(PairLists, HoldThePairsInReachAndNoOthers) {
  for (const std::size_t count : {0U, 1U, 2U, 9U, 65U, 700U, 3000U}) {
    const std::vector<Vec3> points = make_cloud(count, 50 + count);
    PairLists lists = make_lists(count);
    lists.update(points, Executor(1));
    expect_near(entries_of(lists, static_cast<std::uint32_t>(count)), points);
  }
}

TEST(PairLists, HoldThePairsOfCloudsFarApartThatShareCells) {
  for (const double far : {1e3, 1e6, 1e12, 1e15}) {
    std::vector<Vec3> points = make_cloud(300, 61);
    for (std::size_t i = 0; i < points.size(); i += 3) points[i] += Vec3(far, -far, 2.0 * far);
    for (std::size_t i = 1; i < points.size(); i += 3) points[i] *= 0.3;
    PairLists lists = make_lists(points.size());
    lists.update(points, Executor(1));
    expect_near(entries_of(lists, 300), points);
  }
}

TEST(PairLists, LeaveOutWhatDoesNotCount) {
  const std::vector<Vec3> points = make_cloud(200, 62);
  std::vector<std::uint32_t> odd;
  std::vector<Vec3> theirs;
  for (std::uint32_t i = 1; i < 200; i += 2) {
    odd.push_back(i);
    theirs.push_back(points[i]);
  }
  PairLists lists(kRange, odd, 200, [](std::uint32_t i, std::uint32_t j) { return (i + j) % 2 == 1; });
  lists.update(points, Executor(1));
  std::vector<IndexPair> least;
  for (const IndexPair& pair : find_neighbours_brute_force(theirs, kRange)) {
    if ((pair.first + pair.second) % 2 == 1) least.push_back({odd[pair.first], odd[pair.second]});
  }
  const std::vector<IndexPair> found = entries_of(lists, 200), expected = from_both_sides(least);
  EXPECT_TRUE(std::includes(found.begin(), found.end(), expected.begin(), expected.end()));
  for (const IndexPair& pair : found) EXPECT_EQ((pair.first / 2 + pair.second / 2) % 2, 1U);
}

TEST(PairLists, AreKeptUntilAParticleHasMovedHalfTheSkin) {
  std::vector<Vec3> points = make_cloud(300, 51);
  const std::vector<Vec3> start = points;
  const Executor executor(1);
  PairLists lists = make_lists(300);
  EXPECT_GT(lists.update(points, executor), 0U);
  const std::vector<IndexPair> before = entries_of(lists, 300);
  Draw draw(52);
  for (Vec3& x : points) x += 0.0749 * draw.direction();
  EXPECT_EQ(lists.update(points, executor), 0U);
  EXPECT_EQ(entries_of(lists, 300), before);
  expect_near(entries_of(lists, 300), start);
  const std::vector<IndexPair> now = from_both_sides(find_neighbours_brute_force(points, kRange));
  EXPECT_TRUE(std::includes(before.begin(), before.end(), now.begin(), now.end()));
  points[299] = start[299] + Vec3(0.0, 0.0751, 0.0);
  EXPECT_GT(lists.update(points, executor), 0U);
  EXPECT_EQ(lists.update(points, executor), 0U);
}

TEST(PairLists, ThatAnExceptionBreaksOffAreFoundAgain) {
  const std::vector<Vec3> points = make_cloud(700, 63);
  bool fails = true;
  int asked = 0;
  PairLists lists = make_lists(700, [&](std::uint32_t, std::uint32_t) {
    if (fails && ++asked == 1000) throw std::runtime_error("broken off");
    return true;
  });
  EXPECT_THROW(lists.update(points, Executor(1)), std::runtime_error);
  fails = false;
  EXPECT_GT(lists.update(points, Executor(1)), 0U);
  expect_near(entries_of(lists, 700), points);
}

TEST(PairLists, AreTheSameForEveryNumberOfThreadsAndEveryVectorWidth) {
  const std::vector<Vec3> points = make_cloud(5000, 57);
  const auto entries = [&](int threads) {
    PairLists lists = make_lists(points.size());
    lists.update(points, Executor(threads));
    std::vector<std::uint32_t> all;
    for (const PairLists::Block& block : lists.blocks()) all.insert(all.end(), block.entry.begin(), block.entry.end());
    return all;
  };
  const std::vector<std::uint32_t> one = entries(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(entries(threads), one) << threads;
  for (const auto target : {HWY_AVX2, HWY_AVX3}) {
    if ((hwy::SupportedTargets() & target) == 0) continue;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
    EXPECT_EQ(entries(1), one) << hwy::TargetName(target);
    hwy::SetSupportedTargetsForTest(0);
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(PairLists, AllocateNothingWhereTheyHeldAsMuchBefore) {
  const std::vector<Vec3> points = make_cloud(5000, 58);
  std::vector<Vec3> moved = points;
  for (Vec3& x : moved) x += Vec3(0.15, 0.0, 0.0);
  const Executor executor(1);
  PairLists lists = make_lists(points.size());
  lists.update(points, executor);
  lists.update(moved, executor);
  const std::uint64_t before = supple::test::allocation_count();
  EXPECT_GT(lists.update(points, executor), 0U);
  EXPECT_GT(lists.update(moved, executor), 0U);
  EXPECT_EQ(supple::test::allocation_count(), before);
}

}  // namespace
}  // namespace supple::core
