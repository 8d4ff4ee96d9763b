// Lombardo & Puech 1995, sec. 3: the cohesion force. Numbers in units F0 = r0 = 1 unless said otherwise.
#include <gtest/gtest.h>

#include <cmath>

#include "supple/core/error.h"
#include "supple/core/pair_laws.h"

namespace {

using supple::core::Cohesion;

Cohesion unit_law(double a) { return {.r0 = 1.0, .f0 = 1.0, .a = a}; }

/// int of t^3 / (1 + t) exp(-a t^2) over [0, end] by Simpson's rule: independent of the rule under test.
double simpson_energy(double a, double end, int intervals) {
  const auto g = [a](double t) { return t * t * t / (1.0 + t) * std::exp(-a * t * t); };
  const double h = end / intervals;
  double sum = g(0.0) + g(end);
  for (int k = 1; k < intervals; ++k) sum += (k % 2 == 1 ? 4.0 : 2.0) * g(k * h);
  return sum * h / 3.0;
}

TEST(CohesionForce, HasItsPrintedValues) {
  const Cohesion law = unit_law(4.0);
  EXPECT_NEAR(law.force(0.5), 0.0919698603, 1e-10);
  EXPECT_NEAR(law.force(0.8), 0.0085214379, 1e-10);
  EXPECT_NEAR(law.force(1.25), -0.0097350098, 1e-10);
  EXPECT_NEAR(law.force(1.5), -0.0306566201, 1e-10);
  EXPECT_NEAR(law.force(2.0), -0.0091578194, 1e-10);
  EXPECT_EQ(law.force(1.0), 0.0);
  EXPECT_NEAR(unit_law(2.0).force(2.0), -0.0676676416, 1e-10);
}

TEST(CohesionForce, IsTheSameInThePapersUnits) {
  const double gain = 3.0, alpha = 0.7, r0 = 1.4, r = 1.9;
  const Cohesion law = Cohesion::from_gain(r0, gain, alpha);
  const double expected = gain * std::pow(r0 - r, 3) / r * std::exp(-alpha * (r0 - r) * (r0 - r));
  EXPECT_NEAR(law.force(r), expected, 1e-15);
}

TEST(CohesionForce, HasItsSlope) {
  const double h = 1e-6;
  for (const double a : {0.5, 4.0, 12.0}) {
    const Cohesion law{.r0 = 0.7, .f0 = 1.3, .a = a};
    for (const double r : {0.1, 0.4, 0.69, 0.71, 0.9, 1.3, 2.0}) {
      const double difference = (law.force(r + h) - law.force(r - h)) / (2.0 * h);
      EXPECT_NEAR(law.slope(r), difference, 1e-8 * (1.0 + std::abs(law.slope(r)))) << a << ' ' << r;
    }
  }
}

TEST(CohesionForce, IsStrongestWhereItsCubicHasItsRoot) {
  EXPECT_NEAR(unit_law(16.0 / 3.0).maximum_distance(), 1.5, 1e-15);
  EXPECT_NEAR(unit_law(2.0).maximum_distance(), 1.7993, 5e-5);
  EXPECT_NEAR(unit_law(0.25).maximum_distance(), 3.1528, 5e-5);
  EXPECT_NEAR(unit_law(50.0).maximum_distance(), 1.1690, 5e-5);
  for (const double a : {0.01, 1.0, 7.0, 400.0}) {
    const Cohesion law = unit_law(a);
    const double r_m = law.maximum_distance();
    EXPECT_NEAR(law.slope(r_m), 0.0, 1e-13 * std::abs(law.force(r_m)) * (1.0 + a)) << a;
  }
}

TEST(CohesionForce, IsGivenByTheDistanceAndSizeOfItsMaximum) {
  const struct {
    double v_m, a;
  } cases[] = {{0.2, 35.416667}, {0.3, 15.384615}, {0.4, 8.482143}, {1.0, 1.25}};
  for (const auto& c : cases) {
    const Cohesion law = Cohesion::from_maximum(2.0, 2.0 * (1.0 + c.v_m), 0.35);
    EXPECT_NEAR(law.a, c.a, 5e-7);
    EXPECT_NEAR(law.maximum_distance(), 2.0 * (1.0 + c.v_m), 1e-14);
    EXPECT_NEAR(law.force(law.maximum_distance()), -0.35, 1e-15);
  }
}

TEST(CohesionForce, RepelsMonotonicallyUpToSixteenThirds) {
  const auto rising_points = [](double a) {
    int count = 0;
    for (int k = 1; k < 10000; ++k) count += unit_law(a).slope(k * 1e-4) > 0.0 ? 1 : 0;
    return count;
  };
  EXPECT_EQ(rising_points(5.3), 0);
  EXPECT_GT(rising_points(5.5), 0);
}

TEST(CohesionEnergy, HasItsPrintedValues) {
  EXPECT_NEAR(unit_law(2.0).energy(1.5), 0.0081443206, 1e-10);
  EXPECT_NEAR(unit_law(2.0).energy(0.6), 0.0076382193, 1e-10);
  EXPECT_NEAR(unit_law(16.0 / 3.0).energy(1.5), 0.0049549603, 1e-10);
  EXPECT_NEAR(unit_law(16.0 / 3.0).energy(0.5), 0.0109909391, 1e-10);
  EXPECT_NEAR(unit_law(1.0).binding_energy(), 0.22421, 5e-6);
  EXPECT_NEAR(unit_law(10.0).binding_energy(), 0.0035604, 5e-8);
  EXPECT_EQ(unit_law(3.0).energy(1.0), 0.0);
}

TEST(CohesionEnergy, IsExactToItsStatedError) {
  // Simpson with 20000 intervals: error below (v / 20000)^4 v / 180 max|g''''| < 1e-15 for these a and v >= -0.9.
  for (const double a : {0.5, 4.0, 16.0}) {
    for (const double v : {-0.9, -0.5, -0.1, 0.05, 0.7, 2.0}) {
      EXPECT_NEAR(unit_law(a).energy(1.0 + v), simpson_energy(a, v, 20000), 1e-13) << a << ' ' << v;
    }
  }
  // Near the core U = -exp(-a) ln s + const: the difference over a halved distance tends to exp(-a) ln 2.
  EXPECT_NEAR(unit_law(4.0).energy(1e-9) - unit_law(4.0).energy(2e-9), std::exp(-4.0) * std::log(2.0), 1e-9);
}

TEST(CohesionEnergy, HasTheForceAsItsGradient) {
  const double h = 1e-6;
  for (const double a : {0.5, 4.0, 12.0}) {
    const Cohesion law{.r0 = 1.3, .f0 = 0.8, .a = a};
    for (double r = 0.2; r < 4.0; r += 0.13) {
      EXPECT_NEAR(-(law.energy(r + h) - law.energy(r - h)) / (2.0 * h), law.force(r), 1e-8) << a << ' ' << r;
    }
  }
}

TEST(CohesionEnergy, IsFiniteHoweverNearThePole) {
  const Cohesion law = unit_law(4.0);
  const double near = law.energy(1e-11);
  for (const double d : {1e-15, 1e-17, 1e-300, 0.0}) {
    EXPECT_GT(law.energy(d), near) << d;
    EXPECT_LT(law.energy(d), 2.0 * near) << d;  // it grows as -log d
  }
}

TEST(CohesionEnergy, OfANarrowForceTakesFewPanels) {
  // The force ends within 1e-9 of the rest distance; panels as narrow as that do not go on to the pole.
  const Cohesion narrow{.r0 = 1.0, .f0 = 1.0, .a = 1e20};
  EXPECT_EQ(narrow.energy(1e-9), narrow.energy(0.5));
  EXPECT_GT(narrow.energy(0.5), 0.0);
}

TEST(CohesionEnergy, TendsToTheBindingEnergy) {
  for (const double a : {0.1, 1.0, 16.0 / 3.0, 20.0, 39.0, 41.0, 120.0}) {
    const Cohesion law{.r0 = 2.0, .f0 = 5.0, .a = a};
    EXPECT_NEAR(law.energy(200.0), law.binding_energy(), 1e-10 * law.binding_energy()) << a;
  }
}

TEST(CohesionRange, IsWhereTheAttractionHasFallenToItsShare) {
  const Cohesion law = unit_law(4.0);
  EXPECT_NEAR(law.influence_radius(1e-2), 2.4349, 5e-5);
  EXPECT_NEAR(law.influence_radius(1e-3), 2.6485, 5e-5);
  EXPECT_NEAR(law.influence_radius(1e-6), 3.1445, 5e-5);
  for (const double a : {0.25, 4.0, 50.0}) {
    for (const double epsilon : {0.9, 1e-3, 1e-12}) {
      const Cohesion c = unit_law(a);
      const double r = c.influence_radius(epsilon);
      EXPECT_GT(r, c.maximum_distance());
      EXPECT_NEAR(c.force(r) / c.force(c.maximum_distance()) / epsilon, 1.0, 1e-11) << a << ' ' << epsilon;
    }
  }
}

TEST(CohesionLaw, RefusesAMaximumInsideTheRestDistance) {
  EXPECT_THROW(static_cast<void>(Cohesion::from_maximum(1.0, 0.9, 1.0)), supple::ContractViolation);
}

}  // namespace
