// A small share of what the stress program tries.
#include "scenes/contact_stress.h"

#include <gtest/gtest.h>

namespace supple::scenes {
namespace {

using stress::Outcome;
using stress::Result;

TEST(ContactStress, BallsMeetAtAnyStiffnessMassRatioAndSpeed) {
  int held = 0, told = 0;
  for (const double E : {1e2, 1e5, 1e9}) {
    for (const double ratio : {1.0, 1e6}) {
      const Result r = stress::meet(E, ratio, 50.0);
      EXPECT_EQ(r.outcome, r.valid ? Outcome::Held : Outcome::Overloaded) << E << ' ' << ratio << ' ' << r.reason;
      (r.valid ? held : told) += 1;
    }
  }
  EXPECT_EQ(held, 4);
  EXPECT_EQ(told, 2);
}

TEST(ContactStress, StacksOfTenCarryMassesThatGrowUpward) {
  EXPECT_EQ(stress::stack(1e6, 1e2).outcome, Outcome::Held);
  EXPECT_EQ(stress::stack(1e6, 1e4).outcome, Outcome::Held);
}

TEST(ContactStress, ShotsDoNotPassHardCoresHoweverHardTheyPress) {
  for (const double speed : {40.0, 600.0}) {
    const Result r = stress::shoot(speed, 0.13, "contact: {core: barrier, error: 0.01}\n", 1e4);
    EXPECT_EQ(r.outcome, Outcome::Overloaded) << speed;
  }
}

TEST(ContactStress, ABallIsSqueezedToHalfItsDiameter) {
  for (const double E : {1e2, 1e9}) {
    const Result r = stress::squeeze(E, 1.0);
    EXPECT_EQ(r.outcome, Outcome::Held) << r.reason;
  }
}

}  // namespace
}  // namespace supple::scenes
