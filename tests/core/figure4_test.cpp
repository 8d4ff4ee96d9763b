// Figure 4 of Lombardo & Puech 1995: three particles in an equilateral triangle are let go at p times their rest
// distance, under a Lennard-Jones law and under cohesion. The paper does not give its parameters. These reproduce its
// statements: n = 4, E = 1 against a = 12 with the same binding energy 1/8, masses and rest distance 1, a medium of
// damping ratio .02 at the Lennard-Jones breathing frequency omega = sqrt(3 n), omega dt = .05. A side longer than 3 at
// the end, omega t = 300, is called diverged.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "core/support.h"
#include "supple/core/integrate.h"

namespace supple::core {
namespace {

using RadialForce = std::function<double(double)>;  // of the distance; > 0 repels

RadialForce lennard_jones(int n) {
  return [n](double d) {
    double power = d;
    for (int k = 0; k < n; ++k) power *= d;
    return (std::pow(d, -n) - 1.0) / power;
  };
}

RadialForce cohesion(double a, double f0) {
  return [law = Cohesion{.r0 = 1.0, .f0 = f0, .a = a}](double d) { return law.force(d); };
}

constexpr double kCohesionGain = 49.3212;  // of the binding energy 1/8 for a = 12
const double kOmega = std::sqrt(12.0);

/// The triangle of side p at the start; or, to keep its symmetry against rounding errors, two particles of mass 2/3, whose
/// distance moves like the side: d'' = 3 f(d) / m.
enum class Shape { Triangle, Pair };
struct Triangle {
  test::Particles p;
  Interactions interactions;
  KickState kick;
  Ledger ledger;
  RadialForce force;
  double time = 0.0;
  double largest_side = 0.0;

  Triangle(RadialForce f, double side, double gamma, Shape shape = Shape::Triangle) : force(std::move(f)) {
    if (shape == Shape::Triangle) {
      for (int k = 0; k < 3; ++k) {
        const double angle = 2.0 / 3.0 * std::numbers::pi * k;
        p.add(side / std::sqrt(3.0) * Vec3(std::cos(angle), std::sin(angle), 0.0));
      }
    } else {
      p.add(Vec3::Zero(), 2.0 / 3.0);
      p.add(Vec3(side, 0, 0), 2.0 / 3.0);
    }
    if (gamma > 0.0) interactions.medium.push_back({.object = 0, .linear = gamma, .angular = 0.0});
  }
  void step(double dt) {
    const ForceModel model = [this](const ParticleState& state, double, ForceSample& out) {
      const std::size_t n = state.size();
      for (std::size_t a = 0; a < (n == 2 ? 1 : n); ++a) {
        const std::size_t b = (a + 1) % n;
        const Vec3 r = state.position[b] - state.position[a];
        const double d = r.norm();
        const Vec3 push = force(d) / d * r;
        out.internal.force[a] -= push;
        out.internal.force[b] += push;
      }
    };
    advance({p.set, interactions, model}, time, dt, {p.state, kick, ledger});
    time += dt;
    largest_side = std::max(largest_side, side());
  }
  [[nodiscard]] double side() const { return (p.state.position[1] - p.state.position[0]).norm(); }
};

struct Setting {
  double gamma = 0.04 * kOmega;
  double omega_dt = 0.05;
  double omega_end = 300.0;
  double omega = kOmega;
  double too_long = 3.0;
  bool ever = false;  // whether a side that was too long once counts as diverged
  Shape shape = Shape::Triangle;
};

bool diverges(const RadialForce& force, double p, const Setting& s) {
  Triangle triangle(force, p, s.gamma, s.shape);
  const auto steps = static_cast<int>(std::lround(s.omega_end / s.omega_dt));
  for (int k = 0; k < steps; ++k) {
    triangle.step(s.omega_dt / s.omega);
    if (s.ever && triangle.largest_side > s.too_long) return true;
  }
  return triangle.side() > s.too_long;
}

/// The release ratio above which the triangle comes back, to 2^-10 of the bracket.
double threshold(const RadialForce& force, double low, double high, const Setting& setting) {
  EXPECT_TRUE(diverges(force, low, setting));
  EXPECT_FALSE(diverges(force, high, setting));
  for (int k = 0; k < 10; ++k) {
    const double middle = 0.5 * (low + high);
    (diverges(force, middle, setting) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

TEST(Oscillation, IsBlindToTranslationAndCountsTheRest) {
  const std::array<Vec3, 3> start{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
  std::array<Vec3, 3> moved = start;
  for (Vec3& x : moved) x += Vec3(0.1, 0, 0);
  // The printed formula has -.06 under its root here.
  EXPECT_NEAR(oscillation(start, moved), 0.0, 1e-16);
  moved[0].x() += 0.3;
  EXPECT_NEAR(oscillation(start, moved), 0.3 * std::sqrt(2.0 / 3.0), 1e-15);
}

TEST(Figure4, TheTwoLawsHaveTheSameBindingEnergy) {
  EXPECT_NEAR((Cohesion{.r0 = 1.0, .f0 = kCohesionGain, .a = 12.0}.binding_energy()), 0.125, 1e-6);
  EXPECT_NEAR(lennard_jones(4)(0.8), 4.398822784, 1e-9);
}

TEST(Figure4, DivergesWhereTheStudyFoundIt) {
  EXPECT_NEAR(threshold(lennard_jones(4), 0.75, 0.9, {}), 0.817, 0.003);
  EXPECT_NEAR(threshold(cohesion(12.0, kCohesionGain), 0.5, 0.65, {}), 0.562, 0.003);
}

TEST(Figure4, LennardJonesReachesBeyondAndIsDrawnBackNearItsThreshold) {
  EXPECT_NEAR(threshold(lennard_jones(4), 0.75, 0.9, {.ever = true}), 0.826, 0.003);
  EXPECT_NEAR(threshold(cohesion(12.0, kCohesionGain), 0.5, 0.65, {.ever = true}), 0.562, 0.003);
}

TEST(Figure4, HasTheColumnsOfThePaper) {
  // 1 - .85: both converge; .80: Lennard-Jones diverges; .60: cohesion still converges; .50: both diverge.
  struct Column {
    double p;
    bool lennard_jones, cohesion;
  };
  for (const Column& c : {Column{0.95, false, false}, {0.85, false, false}, {0.80, true, false}, {0.75, true, false},
                          {0.60, true, false}, {0.58, true, false}, {0.55, true, true}, {0.50, true, true}}) {
    EXPECT_EQ(diverges(lennard_jones(4), c.p, {}), c.lennard_jones) << c.p;
    EXPECT_EQ(diverges(cohesion(12.0, kCohesionGain), c.p, {}), c.cohesion) << c.p;
  }
}

TEST(Figure4, MeasuresEnergyOfEscapeRatherThanTheStep) {
  for (const double omega_dt : {0.02, 0.1}) {
    const Setting setting{.omega_dt = omega_dt};
    EXPECT_TRUE(diverges(lennard_jones(4), 0.814, setting)) << omega_dt;
    EXPECT_FALSE(diverges(lennard_jones(4), 0.820, setting)) << omega_dt;
    EXPECT_TRUE(diverges(cohesion(12.0, kCohesionGain), 0.559, setting)) << omega_dt;
    EXPECT_FALSE(diverges(cohesion(12.0, kCohesionGain), 0.565, setting)) << omega_dt;
  }
}

TEST(Figure4, WithoutDampingEscapesWhereTheReleasedEnergyIsTheBindingEnergy) {
  // 2^(-1/n) for Lennard-Jones; for cohesion the root of U(p) = U(inf).
  // A triangle without damping is chaotic: once its symmetry is lost, two particles may bind and throw out the third.
  // The steps are short, because an energy error of 1 % moves the root by .002.
  const Setting setting{.gamma = 0.0, .omega_dt = 0.01, .omega_end = 3000.0, .too_long = 10.0, .ever = true,
                        .shape = Shape::Pair};
  const auto check = [&](const RadialForce& force, double escape, double omega, const char* name, double parameter) {
    Setting s = setting;
    s.omega = omega;
    EXPECT_TRUE(diverges(force, escape - 0.004, s)) << name << ' ' << parameter;
    s.omega_end = 300.0;
    EXPECT_FALSE(diverges(force, escape + 0.004, s)) << name << ' ' << parameter;
  };
  for (const int n : {3, 4, 6, 8}) {
    check(lennard_jones(n), std::pow(2.0, -1.0 / n), std::sqrt(3.0 * n), "Lennard-Jones", n);
  }
  struct Row {
    double a, escape;
  };
  for (const Row& row : {Row{2.0, 0.316}, {16.0 / 3.0, 0.495}, {8.0, 0.559}, {10.0, 0.592}, {12.0, 0.618}, {15.0, 0.647},
                         {20.0, 0.683}}) {
    const Cohesion unit{.r0 = 1.0, .f0 = 1.0, .a = row.a};
    const Cohesion law{.r0 = 1.0, .f0 = 0.125 / unit.binding_energy(), .a = row.a};
    EXPECT_NEAR(law.energy(row.escape) / law.binding_energy(), 1.0, 0.02) << row.a;
    check(cohesion(row.a, law.f0), row.escape, kOmega, "cohesion", row.a);
  }
}

TEST(Figure4, ABoundedRepulsionOfTheSameStiffnessNeverEscapes) {
  // The control: f = k (1 - s) exp(-4 (1 - s)^2) has the slope of Lennard-Jones at rest, so the flat well of cohesion is
  // not what makes it robust: the work of its repulsion is.
  const RadialForce control = [](double d) {
    const double v = 1.0 - d;
    return 4.0 * v * std::exp(-4.0 * v * v);
  };
  for (const double omega_dt : {0.05, 0.5}) {
    for (double p = 0.40; p < 0.96; p += 0.05) EXPECT_FALSE(diverges(control, p, {.omega_dt = omega_dt})) << p;
  }
}

TEST(Figure4, CohesionAtSixtyPercentComesToShakeAsLittleAsLennardJonesAtNinetyFive) {
  // Largest O / dt within one period of 5.8 about t = 2 and t = 80.
  struct Envelope {
    double early, late;
  };
  const auto envelope = [](const RadialForce& force, double p) {
    Triangle triangle(force, p, 0.04 * kOmega);
    const double dt = 0.05 / kOmega;
    Envelope e{0.0, 0.0};
    while (triangle.time < 85.8) {
      const std::vector<Vec3> before = triangle.p.state.position;
      triangle.step(dt);
      const double o = oscillation(before, triangle.p.state.position) / dt;
      if (std::abs(triangle.time - 2.0) < 5.8) e.early = std::max(e.early, o);
      if (std::abs(triangle.time - 80.0) < 5.8) e.late = std::max(e.late, o);
    }
    return e;
  };
  const Envelope lj = envelope(lennard_jones(4), 0.95), coh = envelope(cohesion(12.0, kCohesionGain), 0.60);
  EXPECT_NEAR(lj.early, 1.9e-1, 0.05e-1);
  EXPECT_NEAR(coh.early, 8.8e-1, 0.05e-1);
  EXPECT_NEAR(lj.late, 1.1e-3, 0.1e-3);
  EXPECT_NEAR(coh.late, 1.1e-3, 0.1e-3);
}

}  // namespace
}  // namespace supple::core
