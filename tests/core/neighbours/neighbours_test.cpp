#include "supple/core/neighbours.h"

#include <gtest/gtest.h>

#include "core/support.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

using test::Draw;

std::vector<Vec3> cloud(Draw& draw, std::size_t count, double size, const Vec3& centre) {
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < count; ++i) points.push_back(centre + draw.vector(size));
  return points;
}

TEST(Neighbours, AreThoseThatVisitingEveryPairFinds) {
  Draw draw(21);
  for (const double range : {0.01, 0.1, 0.35, 1.0, 5.0}) {
    for (const double offset : {0.0, -3.7, 1e6}) {
      const std::vector<Vec3> points = cloud(draw, 300, 1.0, Vec3::Constant(offset));
      const std::vector<IndexPair> found = find_neighbours(points, range);
      EXPECT_EQ(found, find_neighbours_brute_force(points, range)) << range << ' ' << offset;
      EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    }
  }
}

TEST(Neighbours, AreFoundOnTheFacesOfCells) {
  // Points on a lattice of the range itself: distances are the range exactly (not nearer) and, within the rounding of
  // the coordinates, a little less.
  for (const double spacing : {0.3, 0.3 * (1.0 - 1e-15)}) {
    std::vector<Vec3> points;
    for (int i = -3; i <= 3; ++i) {
      for (int j = -3; j <= 3; ++j) points.emplace_back(spacing * i, spacing * j, 0.0);
    }
    EXPECT_EQ(find_neighbours(points, 0.3), find_neighbours_brute_force(points, 0.3));
  }
}

TEST(Neighbours, MayLieAnywhere) {
  Draw draw(22);
  for (const double far : {1e9, 1e13, 1e17, 1e300}) {
    std::vector<Vec3> points = cloud(draw, 60, 1.0, Vec3(far, -far, 0.0));
    const std::vector<Vec3> near = cloud(draw, 60, 1.0, Vec3::Zero());
    points.insert(points.end(), near.begin(), near.end());
    EXPECT_EQ(find_neighbours(points, 0.5), find_neighbours_brute_force(points, 0.5)) << far;
  }
}

TEST(Neighbours, OfFewPointsAreNone) {
  EXPECT_TRUE(find_neighbours({}, 1.0).empty());
  EXPECT_TRUE(find_neighbours(std::vector<Vec3>{Vec3::Zero()}, 1.0).empty());
  EXPECT_EQ(find_neighbours(std::vector<Vec3>(3, Vec3::Zero()), 1.0).size(), 3U);
  EXPECT_THROW(static_cast<void>(find_neighbours({}, 0.0)), ContractViolation);
}

}  // namespace
}  // namespace supple::core
