// Cohesion with linear stiffness, with a rest distance that depends on direction, and from a table.
#include "supple/core/cohesion_variants.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/two_bodies.h"
#include "supple/core/error.h"
#include "supple/core/pair_hessian.h"

namespace supple::core {
namespace {

using test::Draw;
using test::TwoBodies;

TEST(ScaleFreeCohesion, IsOneCurveForEveryRestDistance) {
  const Cohesion small = Cohesion::from_ratio(0.01, 1.5, 3.0), large = Cohesion::from_ratio(7.0, 1.5, 3.0);
  EXPECT_NEAR(small.a, 16.0 / 3.0, 1e-14);
  for (const double s : {0.3, 0.8, 1.2, 1.9}) {
    EXPECT_NEAR(small.force(0.01 * s), large.force(7.0 * s), 1e-14);
  }
  EXPECT_NEAR(large.maximum_distance(), 10.5, 1e-13);
}

TEST(LinearCohesionLaw, HasForceSlopeAndEnergyThatAgree) {
  const double h = 1e-6;
  for (const double eta : {0.0, 0.3, 2.0}) {
    const LinearCohesion law{.r0 = 0.7, .f0 = 1.3, .a = 3.0, .eta = eta};
    for (double d = 0.05; d < 3.0; d += 0.0317) {
      EXPECT_NEAR(-(law.energy(d + h) - law.energy(d - h)) / (2.0 * h), law.force(d), 1e-9) << d;
      EXPECT_NEAR((law.force(d + h) - law.force(d - h)) / (2.0 * h), law.slope(d), 1e-8) << d;
    }
  }
}

TEST(LinearCohesionLaw, HasTheStiffnessThatCohesionLacks) {
  const LinearCohesion soft{.r0 = 2.0, .f0 = 3.0, .a = 4.0, .eta = 0.0};
  EXPECT_EQ(soft.slope(2.0), 0.0);
  const LinearCohesion stiff{.r0 = 2.0, .f0 = 3.0, .a = 4.0, .eta = 0.5};
  EXPECT_DOUBLE_EQ(stiff.slope(2.0), -3.0 * 0.5 / 2.0);
  EXPECT_EQ(stiff.energy(2.0), 0.0);
  EXPECT_TRUE(std::isfinite(stiff.force(0.0)));
}

TEST(LinearCohesionLaw, TendsToItsBindingEnergy) {
  const LinearCohesion law{.r0 = 2.0, .f0 = 3.0, .a = 4.0, .eta = 0.5};
  EXPECT_NEAR(law.binding_energy(), 3.0 * 2.0 * (0.5 / 8.0 + 1.0 / 32.0), 1e-15);
  EXPECT_NEAR(law.energy(30.0), law.binding_energy(), 1e-15);
}

TEST(LinearCohesionLaw, HasAnEnergyWithoutCancellationNearRest) {
  // Small v: U = F0 r0 (eta v^2 / 2 + (1 - 2 a eta) v^4 / 4 + ...); the two forms meet at a v^2 = 0.01.
  const LinearCohesion law{.r0 = 1.0, .f0 = 1.0, .a = 4.0, .eta = 0.0};
  EXPECT_NEAR(law.energy(1.0 + 1e-3) / 0.25e-12, 1.0, 1e-5);
  const double seam = 1.0 + 0.05;
  EXPECT_NEAR(law.energy(seam - 1e-9), law.energy(seam + 1e-9), 1e-12);
  // v^4 changes by 4 * 2e-9 / 0.05 of itself.
  EXPECT_NEAR(law.energy(seam - 1e-9) / law.energy(seam + 1e-9), 1.0 - 1.6e-7, 1e-9);
}

TEST(LinearCohesionLaw, KnowsWhereItAttractsMostAndWhereItEnds) {
  for (const double eta : {0.0, 0.1, 3.0}) {
    const LinearCohesion law{.r0 = 1.5, .f0 = 1.0, .a = 4.0, .eta = eta};
    const double r_m = law.maximum_distance();
    EXPECT_NEAR(law.slope(r_m), 0.0, 1e-14);
    EXPECT_GT(r_m, 1.5);
    EXPECT_NEAR(law.force(law.influence_radius(1e-3)) / law.force(r_m), 1e-3, 1e-12);
  }
  EXPECT_NEAR((LinearCohesion{.r0 = 1.0, .f0 = 1.0, .a = 1.5, .eta = 0.0}.maximum_distance()), 2.0, 1e-15);
}

TEST(DirectedCohesionLaw, IsCohesionBetweenBalls) {
  Draw draw(71);
  for (int k = 0; k < 20; ++k) {
    const PairPose pose = TwoBodies::random(draw).pose();
    const DirectedCohesion law{
        .scale = 1.2, .a = 4.0, .semi_axes_a = Vec3::Constant(0.5), .semi_axes_b = Vec3::Constant(0.3)};
    const Cohesion ball{.r0 = 0.8, .f0 = 1.5, .a = 4.0};
    const PairLoad here = evaluate(law, pose), there = evaluate(ball, pose);
    EXPECT_NEAR(here.energy, there.energy, 1e-15);
    EXPECT_LE((here.force_b - there.force_b).norm(), 2e-15);
    EXPECT_LE(here.torque_a.norm() + here.torque_b.norm(), 1e-15);
    const PairHessian difference =
        hessian(law, pose, HessianKind::Exact) - hessian(ball, pose, HessianKind::Exact);
    EXPECT_LE(difference.cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(DirectedCohesionLaw, RestsWhereTheEllipsoidsTouch) {
  const DirectedCohesion law{
      .scale = 1.0, .a = 4.0, .semi_axes_a = Vec3(0.5, 0.2, 0.2), .semi_axes_b = Vec3(0.3, 0.3, 0.4)};
  PairPose pose{.r = Vec3(0.8, 0, 0)};
  EXPECT_DOUBLE_EQ(law.rest_distance(pose), 0.8);
  EXPECT_LE(evaluate(law, pose).force_b.norm(), 1e-30);
  pose.r = Vec3(0, 0, 0.6);
  EXPECT_DOUBLE_EQ(law.rest_distance(pose), 0.6);
  // Too far for its long axis across r, A turns towards B; the torque on it is about y, from z to x.
  pose.r = Vec3(0.3, 0, 0.8);
  EXPECT_LT(law.rest_distance(pose), pose.r.norm());
  EXPECT_LT(evaluate(law, pose).torque_a.y(), 0.0);
}

TEST(DirectedCohesionLaw, HasABoundedStiffness) {
  Draw draw(72);
  for (int k = 0; k < 50; ++k) {
    DirectedCohesion law{.scale = 1.0, .a = 4.0, .semi_axes_a = {}, .semi_axes_b = {}};
    law.semi_axes_a = Vec3(draw.uniform(0.2, 0.6), draw.uniform(0.2, 0.6), draw.uniform(0.2, 0.6));
    law.semi_axes_b = Vec3(draw.uniform(0.2, 0.6), draw.uniform(0.2, 0.6), draw.uniform(0.2, 0.6));
    PairPose pose = TwoBodies::random(draw).pose();
    // The largest stiffness within the range for which the bound holds, a quarter of the rest distance about rest.
    pose.r *= draw.uniform(0.75, 1.25) * law.rest_distance(pose) / pose.r.norm();
    const PairHessian h = hessian(law, pose, HessianKind::PositiveSemiDefinite);
    const Stiffness bound = stiffness(law);
    // By s = d / r0 up to 1.25 the lever of the tangential part grows in proportion.
    EXPECT_LE((h.block<3, 3>(0, 0).trace()), 1.25 * 1.25 * bound.translation);
    EXPECT_LE((h.block<3, 3>(3, 3).trace() + h.block<3, 3>(9, 9).trace()), 1.25 * 1.25 * 2.0 * bound.rotation);
  }
}

constexpr double kShape = 4.0;

double largest_error(const CohesionTable& table, double from, double to) {
  const Cohesion law{.r0 = 1.0, .f0 = 1.0, .a = kShape};
  double largest = 0.0;
  for (int k = 0; k <= 100000; ++k) {
    const double s = from + (to - from) * k / 100000.0;
    largest = std::max(largest, std::abs(table.force(s) - law.force(s)));
  }
  return largest / std::abs(law.force(law.maximum_distance()));
}

TEST(CohesionTableError, FallsWithTheOrderOfItsInterpolation) {
  // Relative to F_max on [0.25, 3.1445]: the printed figures of both tables, and their orders 2 and 4.
  const auto error = [](int intervals, CohesionTable::Interpolation kind) {
    return largest_error(CohesionTable::with_intervals(kShape, 3.1445, intervals, kind), 0.25, 3.1445);
  };
  using enum CohesionTable::Interpolation;
  EXPECT_NEAR(error(128, Linear), 2.4e-3, 5e-5);
  EXPECT_NEAR(error(256, Linear), 6.0e-4, 5e-6);
  EXPECT_NEAR(error(128, CubicHermite), 8.4e-6, 5e-8);
  EXPECT_NEAR(error(256, Linear) / error(512, Linear), 4.0, 0.1);
  const double hermite = error(64, CubicHermite) / error(128, CubicHermite);
  EXPECT_GT(hermite, 13.0);
  EXPECT_LT(hermite, 16.0);
}

TEST(CohesionTableError, IsBelowThePromisedOne) {
  for (const double error : {1e-1, 1e-2, 1e-4, 1e-7}) {
    const CohesionTable table = CohesionTable::with_error(kShape, error);
    EXPECT_LE(largest_error(table, 0.01, 6.0), error) << table.intervals();
    if (table.intervals() > 8) {
      const auto half = CohesionTable::with_intervals(kShape, table.end(), table.intervals() / 2,
                                                      CohesionTable::Interpolation::CubicHermite);
      EXPECT_GT(largest_error(half, 0.25, 6.0), 0.5 * error);  // no finer than needed
    }
  }
  const CohesionTable linear = CohesionTable::with_error(kShape, 1e-3, CohesionTable::Interpolation::Linear);
  EXPECT_LE(largest_error(linear, 0.01, 6.0), 1e-3);
  EXPECT_GT(linear.intervals(), CohesionTable::with_error(kShape, 1e-3).intervals());
}

TEST(CohesionTableEnergy, IsTheIntegralOfItsForce) {
  for (const auto kind : {CohesionTable::Interpolation::Linear, CohesionTable::Interpolation::CubicHermite}) {
    const CohesionTable table = CohesionTable::with_intervals(kShape, 3.0, 16, kind);  // coarse on purpose
    EXPECT_EQ(table.energy(1.0), 0.0);
    const double h = 1e-6;
    for (double s = 0.0913; s < 3.2; s += 0.0377) {
      EXPECT_NEAR(-(table.energy(s + h) - table.energy(s - h)) / (2.0 * h), table.force(s), 1e-9) << s;
    }
    EXPECT_NEAR(table.energy(0.25 - 1e-12), table.energy(0.25 + 1e-12), 1e-11);
    for (int k = 1; k <= 16; ++k) {
      const double knot = 0.25 + 2.75 * k / 16;
      EXPECT_NEAR(table.energy(knot - 1e-12), table.energy(knot + 1e-12), 1e-12) << knot;  // |f| < 0.2
    }
    EXPECT_EQ(table.force(3.0), 0.0);
    EXPECT_EQ(table.energy(5.0), table.energy(3.0));
  }
  const CohesionTable fine = CohesionTable::with_error(kShape, 1e-7);
  const Cohesion law{.r0 = 1.0, .f0 = 1.0, .a = kShape};
  EXPECT_NEAR(fine.energy(5.0), law.binding_energy(), 1e-8 * 3.0 * 0.0322);  // the error of f times the range
}

TEST(CohesionTableSlope, IsTheDerivativeOfItsForce) {
  const CohesionTable table =
      CohesionTable::with_intervals(kShape, 3.0, 16, CohesionTable::Interpolation::CubicHermite);
  const double h = 1e-7;
  for (double s = 0.0913; s < 3.2; s += 0.0377) {
    EXPECT_NEAR((table.force(s + h) - table.force(s - h)) / (2.0 * h), table.slope(s), 1e-5) << s;
  }
}

TEST(TabulatedCohesionLaw, IsAPairLawLikeTheOthers) {
  Draw draw(73);
  const auto table = std::make_shared<const CohesionTable>(CohesionTable::with_error(kShape, 1e-6));
  const TabulatedCohesion law{.r0 = 0.8, .f0 = 1.5, .table = table};
  const Cohesion exact{.r0 = 0.8, .f0 = 1.5, .a = kShape};
  for (int k = 0; k < 20; ++k) {
    const TwoBodies at = TwoBodies::random(draw);
    test::expect_gradient(law, at, "tabulated cohesion");
    test::expect_no_moment(law, at, "tabulated cohesion");
    EXPECT_LE((evaluate(law, at.pose()).force_b - evaluate(exact, at.pose()).force_b).norm(), 1e-6 * 1.5 * 0.0322);
    const PairHessian difference =
        hessian(law, at.pose(), HessianKind::Exact) - hessian(exact, at.pose(), HessianKind::Exact);
    EXPECT_LE(difference.cwiseAbs().maxCoeff(), 1e-4);
  }
}

TEST(CohesionTableLimits, AreChecked) {
  EXPECT_THROW(static_cast<void>(CohesionTable::with_error(4.0, 0.2)), supple::ContractViolation);
}

}  // namespace
}  // namespace supple::core
