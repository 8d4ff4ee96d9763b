#include "surface/kept_results.h"

#include <gtest/gtest.h>

#include <vector>

namespace supple::collision {
namespace {

PairResult of_points(std::size_t count) {
  PairResult result;
  result.summary.force = Vec3(1.0, 2.0, 3.0);
  result.points.volume_point.resize(count);
  result.points.volume_weight.resize(count);
  return result;
}

TEST(KeptResults, CountTheRoomOfAllArrays) {
  EXPECT_EQ(room_of(PatchPoints{}), 0U);
  PatchPoints points;
  points.point.reserve(10);
  points.normal.reserve(20);
  points.area.reserve(30);
  points.pressure.reserve(40);
  points.volume_point.reserve(50);
  points.volume_weight.reserve(60);
  points.volume_side.reserve(70);
  EXPECT_EQ(room_of(points), (10 + 20 + 50) * sizeof(Vec3) + (30 + 40 + 60) * sizeof(double) + 70U);
}

TEST(KeptResults, HoldNoMoreThanTheMostThereIs) {
  constexpr std::size_t kPoint = sizeof(Vec3) + sizeof(double), kMost = 1000 * kPoint;
  std::vector<PairResult> results;
  for (const std::size_t count : {400U, 5000U, 500U, 200U, 0U, 100U}) results.push_back(of_points(count));
  keep_room(results, kMost);
  std::vector<std::size_t> kept;
  for (const PairResult& result : results) kept.push_back(room_of(result.points) / kPoint);
  EXPECT_EQ(kept, (std::vector<std::size_t>{400, 0, 500, 0, 0, 100}));
  for (const PairResult& result : results) EXPECT_EQ(result.summary.force.y(), 2.0);
  keep_room(results, kMost);
  EXPECT_EQ(room_of(results[2].points), 500 * kPoint);
}

}  // namespace
}  // namespace supple::collision
