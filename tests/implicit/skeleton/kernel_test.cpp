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

struct TableRow {
  const char* name;
  Kernel kernel;
  double iso_distance, iso_slope, lipschitz, steepest;  ///< R = 1, iso 0.5
  double bend;  ///< largest |d2f/dd2|; 0: not in the table
};

class KernelTable : public ::testing::TestWithParam<TableRow> {};

TEST_P(KernelTable, HasItsIsoDistanceSlopeAndSteepestSlope) {
  const TableRow& row = GetParam();
  EXPECT_NEAR(iso_distance(row.kernel, 0.5), row.iso_distance, 5e-10);  // printed to nine digits, slopes to six
  EXPECT_NEAR(iso_slope(row.kernel, 0.5), row.iso_slope, 5e-7);
  EXPECT_NEAR(lipschitz(row.kernel), row.lipschitz, 5e-7);
  EXPECT_NEAR(row.kernel.steepest, row.steepest, 5e-7);
  double bend = 0.0;
  for (int i = 0; i <= 3000; ++i) {
    const double d = i / 3000.0, q = std::min(d * d, 1.0 - 1e-12);
    bend = std::max(bend, std::abs(4.0 * q * second_slope(row.kernel, q) + 2.0 * evaluate(row.kernel, q).slope));
  }
  if (row.bend > 0.0) {
    EXPECT_NEAR(bend, row.bend, 5e-7);
  }
  EXPECT_EQ(peak(row.kernel), 1.0);
  EXPECT_NEAR(at(row.kernel, 0.0), 1.0, 1e-15);
}

INSTANTIATE_TEST_SUITE_P(
    Kernels, KernelTable,
    ::testing::Values(
        TableRow{"wyvill", Kernel::wyvill(1.0), 0.454202019, 1.716776, 1.717300, 1.0 / std::sqrt(5.0), 6.0},
        TableRow{"soft_object", Kernel::soft_object(1.0), 0.5, 1.583333, 1.583430, 0.503470, 4.888889},
        TableRow{"murakami", Kernel::murakami(1.0), 0.541196100, 1.530734, 1.539601, 1.0 / std::sqrt(3.0), 8.0},
        TableRow{"nishimura", Kernel::nishimura(1.0), 1.0 - 1.0 / std::sqrt(3.0), 1.732051, 2.0, 1.0 / 3.0, 6.0},
        // Slope 2 + 16 p / 9 at rho = 1/2 for every hardness, and steepest there.
        TableRow{"blanc_schlick", Kernel::blanc_schlick(1.0, 0.1), 0.5, 2.0 + 1.6 / 9.0, 2.0 + 1.6 / 9.0, 0.5, 0.0},
        TableRow{"blanc_schlick_hard", Kernel::blanc_schlick(1.0, 9.0), 0.5, 18.0, 18.0, 0.5, 0.0}),
    [](const auto& row) { return row.param.name; });

TEST(BlinnKernel, IsAGaussianLessItsTangentAtTheSupport) {
  // exp(-a u) - e^-a (1 + a (1 - u)) over its value at 0, a = s^2; written out for s = 2, R = 2, d = 1.
  const double e4 = std::exp(-4.0);
  const double expected = (std::exp(-1.0) - e4 * (1.0 + 4.0 * 0.75)) / (1.0 - 5.0 * e4);
  EXPECT_NEAR(at(Kernel::blinn(2.0, 2.0), 1.0), expected, 2e-16);
  // Sharp ones are Gaussians: steepest sqrt(2 a / e) at 1 / sqrt(2 a), surface at sqrt(ln 2 / a); the rest is e^-100.
  const Kernel sharp = Kernel::blinn(1.0, 10.0);
  EXPECT_NEAR(iso_distance(sharp, 0.5), std::sqrt(std::log(2.0)) / 10.0, 1e-15);
  EXPECT_NEAR(lipschitz(sharp), std::sqrt(200.0 / std::exp(1.0)), 1e-13);
  EXPECT_NEAR(sharp.steepest, 1.0 / std::sqrt(200.0), 1e-14);
}

TEST(CauchyKernel, IsAnInversePowerLessItsTangentAtTheSupport) {
  const double end = 1.0 / 25.0;  // (1 + s^2)^-2 for s = 2
  const double tilt = 8.0 / 5.0;
  const double expected = (0.25 - end * (1.0 + tilt * 0.75)) / (1.0 - end * (1.0 + tilt));  // u = 1/4: 1 + s^2 u = 2
  EXPECT_NEAR(at(Kernel::cauchy(2.0, 2.0), 1.0), expected, 2e-16);
  // Untruncated: sqrt(sqrt 2 - 1) / s and 1.0352 s at 1 / (s sqrt 5); the floor is (1 + s^2)^-2 = 1e-4 for s = 10.
  const Kernel sharp = Kernel::cauchy(1.0, 10.0);
  EXPECT_NEAR(10.0 * iso_distance(sharp, 0.5), 0.643594, 5e-4);
  EXPECT_NEAR(lipschitz(sharp) / 10.0, 1.0352, 1e-3);
  EXPECT_NEAR(10.0 * sharp.steepest, 1.0 / std::sqrt(5.0), 1e-3);
}

TEST(BlancSchlickKernel, JoinsItsPiecesWithOneSlope) {
  for (const double p : {0.02, 0.5, 1.125, 20.0}) {
    const Kernel kernel = Kernel::blanc_schlick(1.0, p);
    EXPECT_NEAR(evaluate(kernel, 0.25).value, evaluate(kernel, std::nextafter(0.25, 1.0)).value, 4e-15);
    // Slopes of up to 38, whose derivatives reach five thousand, over half an ulp of 1/4.
    EXPECT_NEAR(evaluate(kernel, 0.25).slope, evaluate(kernel, std::nextafter(0.25, 1.0)).slope, 1e-12);
    EXPECT_NEAR(evaluate(kernel, 0.25).slope, -2.0 - 16.0 / 9.0 * p, 1e-13);
  }
}

TEST(Kernels, RefuseShapesOutOfRange) {
  for (const double bad : {0.5, 11.0, -2.0, std::nan("")}) {
    EXPECT_THROW(static_cast<void>(Kernel::blinn(1.0, bad)), Error);
    EXPECT_THROW(static_cast<void>(Kernel::cauchy(1.0, bad)), Error);
  }
  for (const double bad : {0.0, 21.0, std::nan("")}) EXPECT_THROW(static_cast<void>(Kernel::blanc_schlick(1.0, bad)), Error);
  for (const double bad : {0.0, -1.0, std::nan(""), double(INFINITY)}) {
    EXPECT_THROW(static_cast<void>(Kernel::soft_object(bad)), Error);
    EXPECT_THROW(static_cast<void>(Kernel::murakami(bad)), Error);
    EXPECT_THROW(static_cast<void>(Kernel::nishimura(bad)), Error);
    EXPECT_THROW(static_cast<void>(Kernel::blinn(bad, 2.0)), Error);
    EXPECT_THROW(static_cast<void>(Kernel::cauchy(bad, 2.0)), Error);
    EXPECT_THROW(static_cast<void>(Kernel::blanc_schlick(bad, 1.0)), Error);
  }
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
    // The second derivative jumps where pieces join: at e, at 1/3 (Nishimura), at 1/2 (Blanc & Schlick).
    bool at_joint = false;
    for (const double joint : {kernel.thickness * kernel.thickness, 1.0 / 9.0, 0.25}) {
      at_joint = at_joint || std::abs(q - joint) < 2.0 * h;
    }
    if (at_joint) continue;
    const KernelSample plus = evaluate(kernel, q + h);
    const KernelSample minus = evaluate(kernel, q - h);
    const double scale = std::max(1.0, std::pow(lipschitz(kernel) / 4.0, 4.0));  // of higher derivatives of steep kernels
    EXPECT_NEAR(evaluate(kernel, q).slope, (plus.value - minus.value) / (2 * h), 1e-6 * scale) << q;
    EXPECT_NEAR(second_slope(kernel, q), (plus.slope - minus.slope) / (2 * h), 1e-6 * scale) << q;
  }
}

TEST_P(AnyKernel, CurvatureRangeHoldsBothSecondDerivatives) {
  const Kernel kernel = GetParam();
  const int n = 40;
  for (int a = 0; a <= n; a += 3) {
    for (int b = a; b <= n; b += 3) {
      const CurvatureRange range = curvature_range(kernel, static_cast<double>(a) / n, static_cast<double>(b) / n);
      for (int i = 5 * a; i <= 5 * b; ++i) {
        const double d = i / (5.0 * n), q = d * d;
        const double across = 2.0 * evaluate(kernel, q).slope, along = across + 4.0 * q * second_slope(kernel, q);
        EXPECT_LE(range.lower, std::min({across, along, 0.0}) + 1e-12) << d;
        EXPECT_GE(range.upper, std::max({across, along, 0.0}) - 1e-12) << d;
        if (a == b && a > 0 && std::abs(d - kernel.thickness) > 1e-9) {
          EXPECT_GE(range.lower, std::min({across, along, 0.0}) - 1e-9) << d;
          EXPECT_LE(range.upper, std::max({across, along, 0.0}) + 1e-9) << d;
        }
      }
    }
  }
}

TEST_P(AnyKernel, FallsToZeroAtItsSupport) {
  const Kernel kernel = GetParam();
  double last = at(kernel, 0.0);
  for (int i = 1; i <= 1000; ++i) {
    const double now = at(kernel, 0.001 * i);
    EXPECT_LE(now, last);
    EXPECT_GE(now, 0.0);
    last = now;
  }
  for (const double q : {1.0, 1.5, 1e9}) {
    EXPECT_EQ(evaluate(kernel, q).value, 0.0);
    EXPECT_EQ(evaluate(kernel, q).slope, 0.0);
    EXPECT_EQ(second_slope(kernel, q), 0.0);
  }
  EXPECT_LT(evaluate(kernel, 0.999 * 0.999).value, 1e-3);
  EXPECT_GT(evaluate(kernel, 0.999 * 0.999).slope, -0.02);  // C^1: |d2f/dq2| <= 5 there
}

TEST_P(AnyKernel, IsoDistanceInvertsTheKernel) {
  const Kernel kernel = GetParam();
  for (int i = 1; i < 40; ++i) {
    const double iso = at(kernel, 0.0) * i / 40.0;
    EXPECT_NEAR(at(kernel, iso_distance(kernel, iso)), iso,
                4e-16 * (4.0 + lipschitz(kernel)));  // distance to an ulp of R
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
      EXPECT_GE(bound, steepest - 2e-7);  // of the shift by 1e-9 where |f''| <= 120
      // |f''| <= 10 over half a sampling step; of the steepest kernel here it reaches 2 a = 50.
      EXPECT_LE(bound, steepest + 0.1 * std::max(1.0, lipschitz(kernel))) << a << ' ' << b;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, AnyKernel,
                         ::testing::Values(Kernel::wyvill(1.0), Kernel::gascuel(0.4, 1.0, 1.0),
                                           Kernel::gascuel(0.5, 1.0, 3.0), Kernel::gascuel(0.3, 1.0, 0.1),
                                           Kernel::gascuel(0.5, 1.0, 2.0), Kernel::soft_object(1.0),
                                           Kernel::murakami(1.0), Kernel::nishimura(1.0), Kernel::blinn(1.0, 1.0),
                                           Kernel::blinn(1.0, 5.0), Kernel::cauchy(1.0, 1.5), Kernel::cauchy(1.0, 5.0),
                                           Kernel::blanc_schlick(1.0, 0.2), Kernel::blanc_schlick(1.0, 2.0)));

}  // namespace
}  // namespace supple::implicit
