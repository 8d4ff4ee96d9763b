#include "supple/collision/sleep.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace supple::collision {
namespace {

const BodyMotion kStill{}, kFast{.energy = 1.0};  // [J/kg]; quiet is below 0.5 * 0.1^2
const SleepRule kRule{.speed = 0.1, .time = 0.25};

SleepState awake(std::size_t bodies) {
  SleepState state;
  state.reset(bodies);
  return state;
}

using Bodies = std::vector<std::uint32_t>;

TEST(Islands, FallAsleepWhenAllOfThemHaveBeenQuietLongEnough) {
  SleepState state = awake(5);  // 0-2-4 touch in a row, 1 and 3 are alone
  const std::vector<BodyPair> joined{{0, 2}, {2, 4}};
  const std::vector<BodyMotion> late{kStill, kStill, kStill, kStill, kFast};
  EXPECT_TRUE(fall_asleep(kRule, 0.125, late, joined, state).empty());
  EXPECT_EQ(fall_asleep(kRule, 0.125, late, joined, state), (Bodies{1, 3}));
  const std::vector<BodyMotion> still(5, kStill);
  EXPECT_TRUE(fall_asleep(kRule, 0.125, still, joined, state).empty());
  EXPECT_EQ(fall_asleep(kRule, 0.125, still, joined, state), (Bodies{0, 2, 4}));
  EXPECT_EQ(state.island, (Bodies{0, 1, 0, 3, 0}));
}

TEST(Islands, AreNotQuietAtOrAboveTheSpeed) {
  SleepState state = awake(2);
  const double limit = 0.5 * kRule.speed * kRule.speed;
  const std::vector<BodyMotion> motion{{.energy = 0.99 * limit}, {.energy = limit}};
  fall_asleep(kRule, 0.125, motion, {}, state);
  EXPECT_EQ(fall_asleep(kRule, 0.125, motion, {}, state), (Bodies{0}));
}

TEST(Islands, DoNotRestWhileTheyGiveWayToTheirLoad) {
  // Both are slow all the time; the first falls from rest, the second turns back at the top, the third is carried but swings.
  const double dt = 0.025, weight = 0.2;
  SleepState state = awake(3);
  Bodies slept;
  for (int step = 1; step <= 12; ++step) {
    const Vec3 load(0.0, 0.0, -weight);
    const auto moving = [&](double v) { return BodyMotion{.energy = 0.5 * v * v, .velocity = Vec3(0.0, 0.0, v), .load = load}; };
    const std::vector<BodyMotion> motion{moving(-weight * dt * step), moving(0.03 - weight * dt * step), moving(step % 2 == 0 ? 0.02 : -0.02)};
    for (const std::uint32_t i : fall_asleep(kRule, dt, motion, {}, state)) slept.push_back(i);
  }
  EXPECT_EQ(slept, (Bodies{2}));
}

TEST(Islands, FallForAWholeStepAtLeastBeforeTheyAreTakenToRest) {
  // Steps longer than the rule's time: the first body falls slowly and is never held, the second is carried.
  SleepState state = awake(2);
  const double dt = 1.0, weight = 0.01;
  const Vec3 load(0, 0, -weight);
  Bodies slept;
  for (int step = 1; step <= 8; ++step) {
    const double v = weight * dt * step;
    const std::vector<BodyMotion> motion{{.energy = 0.5 * v * v, .velocity = Vec3(0, 0, -v), .load = load}, {.load = load}};
    for (const std::uint32_t i : fall_asleep(kRule, dt, motion, {}, state)) slept.push_back(i);
    EXPECT_EQ(slept.size(), step < 2 ? 0u : 1u) << step;
  }
  EXPECT_EQ(slept, (Bodies{1}));
}

TEST(Islands, AreNotJoinedByWhatIsFixed) {
  SleepState state = awake(2);
  const std::vector<BodyPair> joined{{0, 2}, {1, 2}};  // 2: the ground
  const std::vector<BodyMotion> motion{kStill, kFast};
  fall_asleep(kRule, 1.0, motion, joined, state);
  EXPECT_EQ(fall_asleep(kRule, 1.0, motion, joined, state), (Bodies{0}));
}

TEST(Islands, WakeWhole) {
  SleepState state = awake(4);
  for (int step = 0; step < 2; ++step) fall_asleep(kRule, 1.0, std::vector<BodyMotion>(4, kStill), std::vector<BodyPair>{{1, 3}}, state);
  EXPECT_EQ(wake(Bodies{3}, state), (Bodies{1, 3}));
  EXPECT_FALSE(state.asleep(1));
  EXPECT_TRUE(state.asleep(0));
  EXPECT_TRUE(state.asleep(2));
  EXPECT_EQ(state.quiet_for[3], 0.0);
  EXPECT_TRUE(wake(Bodies{3}, state).empty());
}

TEST(SleepState, IsSavedLoadedAndHashed) {
  SleepState state = awake(3);
  fall_asleep(kRule, 0.125, std::vector<BodyMotion>{kStill, kFast, kStill}, {}, state);
  fall_asleep(kRule, 0.125, std::vector<BodyMotion>{kStill, kStill, kFast}, {}, state);
  StateWriter out;
  state.save(out);
  SleepState copy;
  StateReader in(out.bytes());
  copy.load(in);
  EXPECT_TRUE(in.at_end());
  const auto hash_of = [](const SleepState& s) {
    Hasher hasher;
    s.hash(hasher);
    return hasher.value();
  };
  EXPECT_EQ(hash_of(copy), hash_of(state));
  copy.quiet_for[1] += 0.125;
  EXPECT_NE(hash_of(copy), hash_of(state));
  copy = state;
  wake(Bodies{0}, copy);
  EXPECT_NE(hash_of(copy), hash_of(state));
}

TEST(BoxTree, FindsWhatOverlaps) {
  std::vector<Box> boxes;
  const auto uneven = [](double step, int k) { return std::fmod(step * (k + 1), 1.0); };
  for (int k = 0; k < 300; ++k) {
    const Vec3 at(uneven(0.618034, k), uneven(0.414214, k), uneven(0.732051, k));
    const double half = k % 50 == 0 ? 0.4 : 0.03 * uneven(0.236068, k);
    boxes.push_back(k % 7 == 3 ? Box{} : Box{at - Vec3::Constant(half), at + Vec3::Constant(half)});
  }
  std::vector<std::uint32_t> which;
  for (std::uint32_t k = 0; k < 300; k += k % 3 == 0 ? 1 : 2) which.push_back(k);
  BoxTree tree;
  tree.build(boxes, which);
  std::size_t total = 0;
  for (const Box& box : boxes) {
    std::vector<std::uint32_t> found, expected;
    tree.find(box, found);
    std::sort(found.begin(), found.end());
    for (const std::uint32_t k : which) {
      if (!boxes[k].empty() && boxes[k].overlaps(box)) expected.push_back(k);
    }
    if (box.empty()) expected.clear();
    EXPECT_EQ(found, expected);
    total += found.size();
  }
  EXPECT_GT(total, 300u);
  tree.build(boxes, {});
  std::vector<std::uint32_t> found;
  tree.find(boxes[0], found);
  EXPECT_TRUE(found.empty());
}

}  // namespace
}  // namespace supple::collision
