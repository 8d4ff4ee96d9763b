#include "supple/implicit/kernel.h"

#include <gtest/gtest.h>

#include <cmath>

#include "supple/core/error.h"

namespace supple::implicit {
namespace {

double at(const Kernel& kernel, double d) { return evaluate(kernel, d * d).value; }

TEST(WyvillKernel, HasTheRadiusSlopeAndSteepestSlopeOfItsTable) {
  const Kernel kernel = Kernel::wyvill(1.0);  // (1 - rho^2)^3, R = 1, iso 0.5; values printed to nine digits
  EXPECT_NEAR(iso_distance(kernel, 0.5), 0.454202019, 5e-10);
  EXPECT_NEAR(iso_slope(kernel, 0.5), 1.716776, 5e-7);
  EXPECT_NEAR(lipschitz(kernel), 1.717300207, 5e-10);
  EXPECT_DOUBLE_EQ(lipschitz(kernel), 96.0 / (25.0 * std::sqrt(5.0)));
  EXPECT_DOUBLE_EQ(iso_distance(Kernel::wyvill(3.0), 0.5), 3.0 * iso_distance(kernel, 0.5));
}

TEST(WyvillKernel, VanishesWithItsDerivativesAtTheSupport) {
  const Kernel kernel = Kernel::wyvill(0.7);
  for (const double q : {0.7 * 0.7, 0.5, 1e9}) {
    EXPECT_EQ(evaluate(kernel, q).value, 0.0);
    EXPECT_EQ(evaluate(kernel, q).slope, 0.0);
    EXPECT_EQ(second_slope(kernel, q), 0.0);
  }
}

TEST(GascuelKernel, TakesTheValuesOfItsWorkedExample) {
  const Kernel kernel = Kernel::gascuel(1.0, 2.0, 2.0, 1.0);  // Gascuel 1993; e = 1, R = 2, k = 2, iso 1
  EXPECT_DOUBLE_EQ(at(kernel, 1.25), 0.5625);
  EXPECT_DOUBLE_EQ(at(kernel, 1.5), 0.25);
  EXPECT_DOUBLE_EQ(at(kernel, 1.75), 0.0625);
  EXPECT_DOUBLE_EQ(at(kernel, 1.0), 1.0);
  EXPECT_DOUBLE_EQ(at(kernel, 0.5), 2.0);
  EXPECT_EQ(at(kernel, 2.0), 0.0);
}

TEST(GascuelKernel, ScalesToTheIsoValueOfItsObject) {
  const Kernel kernel = Kernel::gascuel(0.2, 0.5, 4.0, 0.5);
  EXPECT_DOUBLE_EQ(at(kernel, 0.2), 0.5);
  EXPECT_DOUBLE_EQ(iso_distance(kernel, 0.5), 0.2);
  EXPECT_DOUBLE_EQ(iso_slope(kernel, 0.5), 4.0);
  EXPECT_NEAR(at(kernel, 0.1), 0.5 + 4.0 * 0.1, 1e-15);
}

TEST(GascuelKernel, HasOneSlopeOnBothSidesOfItsThickness) {
  for (const double iso : {0.25, 0.5, 1.0}) {
    const Kernel kernel = Kernel::gascuel(0.4, 1.0, 4.0 * iso, iso);
    const double h = 1e-7;
    const auto slope_at = [&](double d) { return 2.0 * d * evaluate(kernel, d * d).slope; };
    EXPECT_NEAR(slope_at(0.4 - h), -4.0 * iso, 1e-12);
    EXPECT_NEAR(slope_at(0.4 + h), -4.0 * iso, 1e-5);  // |f''| <= 30
    EXPECT_NEAR(at(kernel, 0.4 + h), iso - 4.0 * iso * h, 1e-12);
  }
}

TEST(GascuelKernel, MidValueFollowsFromTheStiffness) {
  for (const double k : {0.5, 2.0, 3.0}) {  // g((e + R) / 2) = 1/2 - k w / 8, w = R - e
    EXPECT_NEAR(at(Kernel::gascuel(1.0, 2.0, k, 1.0), 1.5), 0.5 - k / 8.0, 1e-15);
  }
}

TEST(GascuelKernel, StaysPositiveAndFallsUpToTheLimitOfItsValidity) {
  const Kernel kernel = Kernel::gascuel(1.0, 2.0, 3.0, 1.0);  // k (R - e) = 3 exactly
  double last = at(kernel, 0.0);
  for (int i = 1; i < 2000; ++i) {
    const double now = at(kernel, 0.001 * i);
    EXPECT_LT(now, last);
    EXPECT_GE(now, 0.0);
    last = now;
  }
}

TEST(GascuelKernel, RefusesASlopeThatWouldMakeTheFieldDipBelowZero) {
  try {
    static_cast<void>(Kernel::gascuel(1.0, 2.0, 3.5, 1.0));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Scene);
    ASSERT_EQ(error.faults().size(), 1u);
    const Fault& fault = error.faults()[0];
    EXPECT_EQ(fault.key, "kernel.slope");
    EXPECT_EQ(fault.expected,
              "expected slope (radius - thickness) <= 3 iso = 3, so that the field does not dip below zero");
    EXPECT_EQ(fault.found, "3.5");
    EXPECT_EQ(fault.hint, "use a slope of at most 3 or a radius of at most 1.85714");
  }
}

TEST(GascuelKernel, RefusesLengthsOutOfOrder) {
  EXPECT_THROW(static_cast<void>(Kernel::gascuel(2.0, 2.0, 1.0)), Error);
  EXPECT_THROW(static_cast<void>(Kernel::gascuel(0.0, 2.0, 1.0)), Error);
  EXPECT_THROW(static_cast<void>(Kernel::gascuel(1.0, 2.0, 0.0)), Error);
  EXPECT_THROW(static_cast<void>(Kernel::gascuel(1.0, 2.0, 1.0, -0.5)), Error);
  EXPECT_THROW(static_cast<void>(Kernel::gascuel(1.0, std::nan(""), 1.0)), Error);
  EXPECT_THROW(static_cast<void>(Kernel::wyvill(0.0)), Error);
  EXPECT_THROW(static_cast<void>(Kernel::wyvill(std::nan(""))), Error);
}

class AnyKernel : public ::testing::TestWithParam<Kernel> {};

TEST_P(AnyKernel, SlopesMatchCentralDifferences) {
  const Kernel kernel = GetParam();
  const double h = 1e-5;
  // Truncation h^2 / 6 times the fourth derivative in q (of sqrt(q): at most 15/16 k q^-3.5 = 9000) and round-off
  // 1e-16 slope / h: both below 2e-7.
  for (int i = 10; i < 98; ++i) {
    const double q = 0.01 * i;
    const double e2 = kernel.thickness * kernel.thickness;
    if (std::abs(q - e2) < 2.0 * h) continue;  // the second derivative jumps at e
    const KernelSample plus = evaluate(kernel, q + h);
    const KernelSample minus = evaluate(kernel, q - h);
    EXPECT_NEAR(evaluate(kernel, q).slope, (plus.value - minus.value) / (2 * h), 1e-6) << q;
    EXPECT_NEAR(second_slope(kernel, q), (plus.slope - minus.slope) / (2 * h), 1e-6) << q;
  }
}

TEST_P(AnyKernel, IsoDistanceInvertsTheKernel) {
  const Kernel kernel = GetParam();
  for (int i = 1; i < 40; ++i) {
    const double iso = at(kernel, 0.0) * i / 40.0;
    EXPECT_NEAR(at(kernel, iso_distance(kernel, iso)), iso, 4e-16 * 4);  // slope <= 4, distance to an ulp of R
  }
  EXPECT_THROW(static_cast<void>(iso_distance(kernel, 0.0)), ContractViolation);
  EXPECT_THROW(static_cast<void>(iso_distance(kernel, at(kernel, 0.0))), ContractViolation);
}

TEST_P(AnyKernel, LipschitzConstantOfAnIntervalBoundsItsSlopes) {
  const Kernel kernel = GetParam();
  const int n = 60;
  for (int a = 0; a <= n; ++a) {
    for (int b = a; b <= n; ++b) {
      double steepest = 0.0;
      for (int i = 4 * a; i <= 4 * b; ++i) {
        const double d = i / (4.0 * n);
        const double off = std::max(d, 1e-9);  // the slope at the tip of a cone is given as 0
        steepest = std::max(steepest, std::abs(2.0 * off * evaluate(kernel, off * off).slope));
      }
      const double bound = lipschitz(kernel, static_cast<double>(a) / n, static_cast<double>(b) / n);
      EXPECT_GE(bound, steepest - 1e-8);  // of the shift by 1e-9
      EXPECT_LE(bound, steepest + 0.1) << a << ' ' << b;  // |f''| <= 10 over half a sampling step
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, AnyKernel,
                         ::testing::Values(Kernel::wyvill(1.0), Kernel::gascuel(0.4, 1.0, 1.0),
                                           Kernel::gascuel(0.5, 1.0, 3.0), Kernel::gascuel(0.3, 1.0, 0.1),
                                           Kernel::gascuel(0.5, 1.0, 2.0)));

}  // namespace
}  // namespace supple::implicit
