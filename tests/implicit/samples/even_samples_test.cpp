#include "supple/implicit/even_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
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

void expect_even(const EvenSampleSet& set, const Body& body, double spacing = kSpacing, double cell = 0.25 * kSpacing) {
  std::vector<double> values(set.size());
  body.field.evaluate(set.point, values);
  for (std::size_t s = 0; s < set.size(); ++s) {
    ASSERT_NEAR(values[s], 0.0, 1e-5);
    const Pose& pose = body.parts[set.part[s]];
    ASSERT_LT((pose.position + pose.orientation * set.local[s] - set.point[s]).norm(), 1e-14);
    for (std::size_t t = 0; t < s; ++t) {
      if (set.normal[s].dot(set.normal[t]) > 0.0) {
        ASSERT_GE((set.point[s] - set.point[t]).norm(), 0.5 * spacing - 1e-12);
      }
    }
  }
  const Mesh fine = march_cubes(body.field, {.lattice = {.origin = Vec3(0.01, 0.02, 0.03), .cell = cell}}, Executor(1));
  for (std::size_t v = 0; v < fine.vertex_count(); ++v) {
    double nearest = 1e9;
    for (std::size_t s = 0; s < set.size(); ++s) {
      if (set.normal[s].dot(fine.normal[v]) > 0.0) nearest = std::min(nearest, (fine.position[v] - set.point[s]).norm());
    }
    ASSERT_LT(nearest, spacing);
  }
  EXPECT_TRUE(std::is_sorted(set.id.begin(), set.id.end()));
  EXPECT_EQ(std::set<std::uint64_t>(set.id.begin(), set.id.end()).size(), set.size());
}

TEST(EvenSamples, AreNeitherNearNorFarFromEachOther) {
  for (const double apart : {0.3, 0.6}) {
    const Body body = row(apart);
    EvenSampler sampler(kSpacing);
    EvenSampleSet set;
    const EvenSampleCounts counts = sampler.update(body.field, body.parts, Executor(2), set);
    expect_even(set, body);
    EXPECT_EQ(counts.added, set.size());
    EXPECT_FALSE(counts.remade);
  }
}

TEST(EvenSamples, RideOnTheirPartsWhenABodyMovesAsAWhole) {
  Body body = row(0.5);
  EvenSampler sampler(kSpacing);
  EvenSampleSet before;
  (void)sampler.update(body.field, body.parts, Executor(1), before);
  const Quat turn(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  for (Pose& pose : body.parts) pose = {turn * pose.position + Vec3(0.3, -0.2, 5.0), turn * pose.orientation};
  body.place();
  EvenSampleSet after = before;
  const EvenSampleCounts counts = sampler.update(body.field, body.parts, Executor(1), after);
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
  EvenSampleSet set;
  Body body = row(0.3);
  (void)sampler.update(body.field, body.parts, Executor(1), set);
  const std::size_t small = set.size();
  std::uint64_t added = 0, removed = 0;
  const auto go = [&](double from, double to) {
    added = removed = 0;
    for (int step = 1; step <= 10; ++step) {
      body = row(from + (to - from) * step / 10);
      const EvenSampleCounts counts = sampler.update(body.field, body.parts, Executor(1), set);
      EXPECT_FALSE(counts.remade);
      EXPECT_GT(2 * counts.kept, set.size());
      added += counts.added;
      removed += counts.removed;
    }
  };
  go(0.3, 0.7);
  const EvenSampleCounts still = sampler.update(body.field, body.parts, Executor(1), set);
  EXPECT_EQ(still.added + still.removed, 0u);  // nothing moved
  EXPECT_GT(set.size(), small + 20);
  EXPECT_GT(added, removed);
  go(0.7, 0.3);
  EXPECT_GT(removed, added);
  expect_even(set, body);
}

TEST(EvenSamples, AreMadeAnewWhenTheSurfaceParts) {
  EvenSampler sampler(kSpacing);
  EvenSampleSet set;
  Body body = row(0.6);
  (void)sampler.update(body.field, body.parts, Executor(1), set);
  const std::uint64_t last = set.id.back();
  body = row(1.3);  // four balls
  const EvenSampleCounts counts = sampler.update(body.field, body.parts, Executor(1), set);
  EXPECT_TRUE(counts.remade);
  EXPECT_EQ(counts.kept, 0u);
  EXPECT_GT(set.id.front(), last);
  expect_even(set, body);
}

TEST(EvenSamples, HaveIdsOfTheirOwnAmongBodiesOfOneSampler) {
  EvenSampler sampler(kSpacing);
  const Body first = row(0.5), second = row(0.6);
  EvenSampleSet a, b;
  (void)sampler.update(first.field, first.parts, Executor(1), a);
  (void)sampler.update(second.field, second.parts, Executor(1), b);
  EXPECT_GT(b.id.front(), a.id.back());
  const EvenSampleCounts again = sampler.update(first.field, first.parts, Executor(1), a);
  EXPECT_EQ(again.added + again.removed, 0u);
}

/// A disc much thinner than the spacing.
Primitive thin_plate() {
  Primitive plate;
  plate.shape = ShapeKind::Disc;
  plate.size = Vec3::Constant(0.6);
  plate.kernel = Kernel::wyvill(0.05);
  return plate;
}

TEST(EvenSamples, LieOnBothSidesOfASheet) {
  const Body body = body_of({{thin_plate(), Vec3::Zero()}});
  EvenSampleSet set;
  (void)EvenSampler(kSpacing).update(body.field, body.parts, Executor(1), set);
  expect_even(set, body);
  // The middle of the upper side by counting points: each belongs to the nearest sample of that side.
  std::vector<double> area(set.size(), 0.0);
  for (int i = -100; i < 100; ++i) {
    for (int j = -100; j < 100; ++j) {
      const Vec3 p(0.005 * i, 0.005 * j, 0.0);
      std::size_t nearest = set.size();
      for (std::size_t s = 0; s < set.size(); ++s) {
        if (set.normal[s].z() < 0.9) continue;
        if (nearest == set.size() || (set.point[s] - p).head<2>().norm() < (set.point[nearest] - p).head<2>().norm()) nearest = s;
      }
      area[nearest] += 0.005 * 0.005;
    }
  }
  int compared = 0;
  for (std::size_t s = 0; s < set.size(); ++s) {
    if (set.normal[s].z() < 0.9 || set.point[s].head<2>().norm() > 0.5 - 1.5 * kSpacing) continue;
    EXPECT_NEAR(set.area[s], area[s], 0.15 * kSpacing * kSpacing);  // a triangle is 1/72 spacing^2
    ++compared;
  }
  EXPECT_GT(compared, 30);
}

// Sheets and balls far thinner than a sixth of the spacing, wherever they lie between the nodes of a lattice.
TEST(EvenSamples, SeeWhatIsThinnerThanTheirSpacing) {
  constexpr double kFar = 0.9;
  const Primitive plate = thin_plate();
  const double e = iso_distance(plate.kernel, 0.5);
  const double area = 2.0 * std::numbers::pi * 0.36 + 2.0 * std::numbers::pi * e * (std::numbers::pi * 0.6 + 2.0 * e);
  Random random(4);
  for (int i = 0; i < 4; ++i) {
    Body body = body_of({{plate, random.in_box(0.2)}, {wyvill_point(0.12), Vec3(0.1, 0.2, 1.0) + random.in_box(0.1)}});
    body.parts[0].orientation = random.rotation();
    body.place();
    EvenSampleSet set;
    (void)EvenSampler(kFar).update(body.field, body.parts, Executor(1), set);
    EXPECT_EQ(set.components, 2u);
    expect_even(set, body, kFar, 0.015);
    const double r = iso_distance(wyvill_point(0.12).kernel, 0.5);
    const double sum = std::accumulate(set.area.begin(), set.area.end(), 0.0);
    EXPECT_NEAR(sum, area + 4.0 * std::numbers::pi * r * r, 0.02 * area);
  }
}

TEST(EvenSamples, ShareTheAreaOfTheSurface) {
  const double r = iso_distance(wyvill_point(1.0).kernel, 0.5);
  const Primitive plate = thin_plate();
  const double e = iso_distance(plate.kernel, 0.5);
  const double ball_area = 4.0 * std::numbers::pi * r * r;
  const double plate_area = 2.0 * std::numbers::pi * 0.36 + 2.0 * std::numbers::pi * e * (std::numbers::pi * 0.6 + 2.0 * e);
  for (const auto& [body, area] : {std::pair(body_of({{wyvill_point(1.0), Vec3(0.1, 0, 0)}}), ball_area),
                                   std::pair(body_of({{plate, Vec3::Zero()}}), plate_area)}) {
    EvenSampleSet set;
    (void)EvenSampler(kSpacing).update(body.field, body.parts, Executor(2), set);
    const double sum = std::accumulate(set.area.begin(), set.area.end(), 0.0);
    EXPECT_NEAR(sum, area, 0.01 * area);
    Vec3 closed = Vec3::Zero();
    for (std::size_t s = 0; s < set.size(); ++s) {
      ASSERT_GT(set.area[s], 0.0);
      ASSERT_LT(set.area[s], std::numbers::pi * kSpacing * kSpacing);  // all of it lies within a spacing
      closed += set.area[s] * set.normal[s];
    }
    EXPECT_LT(closed.norm(), 0.02 * area);
  }
}

TEST(EvenSamples, HaveTheDensityAskedFor) {
  const Body body = body_of({{wyvill_point(1.0), Vec3(0.02, 0.01, 0)}});
  const double r = iso_distance(wyvill_point(1.0).kernel, 0.5);
  for (const double density : {50.0, 200.0, 800.0}) {
    EvenSampleSet set;
    (void)EvenSampler(even_spacing(density)).update(body.field, body.parts, Executor(2), set);
    EXPECT_NEAR(static_cast<double>(set.size()) / (4.0 * std::numbers::pi * r * r), density, 0.1 * density);
  }
}

TEST(EvenSamples, DoNotDependOnThreads) {
  const Body body = row(0.5), moved = row(0.55);
  const auto samples = [&](int threads) {
    EvenSampler sampler(kSpacing);
    EvenSampleSet set;
    (void)sampler.update(body.field, body.parts, Executor(threads), set);
    (void)sampler.update(moved.field, moved.parts, Executor(threads), set);
    return set;
  };
  const EvenSampleSet one = samples(1), four = samples(4);
  EXPECT_EQ(one.point, four.point);
  EXPECT_EQ(one.area, four.area);
}

}  // namespace
}  // namespace supple::implicit
