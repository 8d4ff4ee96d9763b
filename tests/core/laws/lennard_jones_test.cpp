// The Lennard-Jones law; numbers in units E = r0 = 1.
#include "supple/core/lennard_jones.h"

#include <gtest/gtest.h>

#include <cmath>

#include "supple/core/error.h"

namespace supple::core {
namespace {

TEST(LennardJonesForce, HasItsPrintedValues) {
  const LennardJones law = LennardJones::from_gain(1.0, 1.0, 4);
  EXPECT_NEAR(law.force(0.8), 4.398822784, 1e-9);
  EXPECT_NEAR(law.force(0.8), std::pow(0.8, -9) - std::pow(0.8, -5), 1e-14);
  EXPECT_EQ(law.force(1.0), 0.0);
  EXPECT_NEAR(law.slope(1.0), -4.0, 1e-14);
  EXPECT_NEAR(law.energy(1.0), -0.125, 1e-16);
}

TEST(LennardJonesForce, IsStrongestAtItsStatedDistance) {
  const struct {
    int n;
    double r_m, f_max;
  } cases[] = {{2, 1.290994, 0.185903}, {3, 1.205071, 0.203223}, {4, 1.158292, 0.213170}, {6, 1.108683, 0.224158},
               {8, 1.082744, 0.230096}};
  for (const auto& c : cases) {
    const LennardJones law = LennardJones::from_gain(1.0, 1.0, c.n);
    EXPECT_NEAR(law.maximum_distance(), c.r_m, 5e-7);
    EXPECT_NEAR(law.force(law.maximum_distance()), -c.f_max, 5e-7);
    EXPECT_NEAR(law.slope(law.maximum_distance()), 0.0, 1e-13);
  }
}

TEST(LennardJonesForce, StoresItsBindingEnergyWhereItsPotentialVanishes) {
  for (const int n : {2, 3, 4, 8}) {
    const LennardJones law = LennardJones::from_gain(1.0, 1.0, n);
    EXPECT_NEAR(law.energy(std::pow(2.0, -1.0 / n)), 0.0, 1e-14);
    EXPECT_NEAR(law.energy(1.0), -0.5 / n, 1e-15);
  }
}

// As printed in footnote 2 of Lombardo & Puech 1995 the longer-ranged term repels: no rest at r0, and none that is
// stable. The general form shows it with the exponents swapped.
TEST(LennardJonesForce, IsNotThatOfThePrintedConstants) {
  const int n = 4;
  const auto printed = [](double r) { return std::pow(r, -(n + 1)) - 2.0 * std::pow(r, -(2 * n + 1)); };
  EXPECT_DOUBLE_EQ(printed(1.0), -1.0);
  const double zero = std::pow(2.0, 1.0 / n);
  EXPECT_NEAR(printed(zero), 0.0, 1e-15);
  EXPECT_GT(printed(zero + 1e-3), 0.0);  // pushed further out
  EXPECT_LT(printed(zero - 1e-3), 0.0);
  const LennardJones law = LennardJones::from_gain(1.0, 1.0, n);
  EXPECT_LT(law.force(1.0 + 1e-3), 0.0);
  EXPECT_GT(law.force(1.0 - 1e-3), 0.0);
}

TEST(LennardJonesForce, TakesTwoExponents) {
  const LennardJones law{.r0 = 1.5, .depth = 0.7, .repulsive = 12, .attractive = 6};
  const double x = 1.5 / 1.8;
  EXPECT_NEAR(law.energy(1.8), 0.7 * (std::pow(x, 12) - 2.0 * std::pow(x, 6)), 1e-15);
  EXPECT_NEAR(law.slope(1.5), -12.0 * 6.0 * 0.7 / (1.5 * 1.5), 1e-12);
}

/// Both ways to end at 2.5 r0.
std::array<LennardJones, 2> with_cut_off() {
  LennardJones shifted{.r0 = 1.0, .depth = 1.0, .repulsive = 12, .attractive = 6, .cut_off = 2.5};
  LennardJones switched = shifted;
  switched.switch_from = 2.0;
  return {shifted, switched};
}

TEST(LennardJonesCutOff, LeavesNoJumpInForceOrEnergy) {
  for (const LennardJones& law : with_cut_off()) {
    const double gap = 1e-7, steepest = 0.5;  // |f'| near 2.5 is below 0.5 depth / r0^2
    EXPECT_LE(std::abs(law.force(law.cut_off - gap)), steepest * gap);
    EXPECT_LE(std::abs(law.energy(law.cut_off - gap)), steepest * gap * gap);
    EXPECT_EQ(law.force(law.cut_off), 0.0);
    EXPECT_EQ(law.energy(law.cut_off + 1.0), 0.0);
  }
}

TEST(LennardJonesCutOff, KeepsForceAndSlopeDerivativesOfTheEnergy) {
  const double h = 1e-6;
  for (const LennardJones& law : with_cut_off()) {
    for (double d = 0.85; d < 2.7; d += 0.0171) {
      const double scale = 1.0 + std::abs(law.slope(d));
      EXPECT_NEAR(-(law.energy(d + h) - law.energy(d - h)) / (2.0 * h), law.force(d), 1e-8 * scale) << d;
      EXPECT_NEAR((law.force(d + h) - law.force(d - h)) / (2.0 * h), law.slope(d), 1e-7 * scale) << d;
    }
  }
}

TEST(LennardJonesCutOff, LeavesTheLawAloneBeforeASwitch) {
  const auto [shifted, switched] = with_cut_off();
  LennardJones whole = shifted;
  whole.cut_off = 0.0;
  EXPECT_EQ(switched.force(1.9), whole.force(1.9));
  EXPECT_NE(switched.force(2.2), whole.force(2.2));
  EXPECT_NEAR(shifted.force(1.2) - whole.force(1.2), -whole.force(2.5), 1e-15);
}

TEST(LennardJonesLaw, RefusesAnExponentItCannotPack) {
  EXPECT_THROW(static_cast<void>(LennardJones::from_gain(1.0, 1.0, 32)), supple::ContractViolation);
}

}  // namespace
}  // namespace supple::core
