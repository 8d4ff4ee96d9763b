// The integrators by name: their orders, limits, books and restarts.
#include "supple/core/integrators.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/support.h"
#include "supple/core/error.h"
#include "support/allocations.h"

namespace supple::core {
namespace {

using test::Draw;
using test::Particles;

/// A system that steps by a named method under its pair laws, loads and damping.
struct System {
  Particles p;
  Interactions interactions;
  IntegratorSettings settings;
  KickState kick;
  Ledger ledger;
  IntegratorWorkspace workspace;
  ImplicitContact* contact = nullptr;
  double time = 0.0;
  StepReport report;  ///< sums over all steps

  void run(double dt, int steps, int threads = 1) {
    const Executor executor(threads);
    InteractionWorkspace pairs(p.set, interactions);
    const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
      accumulate_interactions(p.set, state, interactions, executor, pairs, out.internal);
      add_external_loads(p.set, interactions, t, out.external);
    };
    run(forces, dt, steps, executor, pairs);
  }
  void run(const ForceModel& forces, double dt, int steps) {
    InteractionWorkspace pairs(p.set, interactions);
    run(forces, dt, steps, Executor(1), pairs);
  }
  void run(const ForceModel& forces, double dt, int steps, const Executor& executor, InteractionWorkspace& pairs) {
    for (int k = 0; k < steps; ++k) {
      const StepReport step =
          advance(settings, {p.set, interactions, forces, contact}, time, dt, {p.state, kick, ledger}, {executor, pairs, workspace});
      report.substeps += step.substeps;
      report.rejected += step.rejected;
      report.force_evaluations += step.force_evaluations;
      report.within_tolerance = report.within_tolerance && step.within_tolerance;
      report.newton_iterations += step.newton_iterations;
      report.gradient_iterations += step.gradient_iterations;
      time += dt;
    }
  }
  void run_until(double end, double dt) { run(dt, static_cast<int>(std::lround(end / dt))); }
  [[nodiscard]] double energy() const {
    return measure_motion(p.set, p.state).kinetic_energy + potential_energy(p.set, p.state, interactions);
  }
  /// What the energy balance lacks.
  [[nodiscard]] double imbalance(double start) const {
    return energy() - start - ledger.external_work + ledger.dissipated;
  }
  [[nodiscard]] std::uint64_t hash() const {
    Hasher hasher;
    p.state.hash(hasher);
    kick.hash(hasher);
    ledger.hash(hasher);
    return hasher.value();
  }
};

struct Method {
  const char* name;
  Integrator method;
  RotationUpdate rotation;
  double order;
};
const Method kSplitting{"Splitting", Integrator::Symplectic, RotationUpdate::Splitting, 2.0};
const Method kExponential{"Exponential", Integrator::Symplectic, RotationUpdate::Exponential, 2.0};
const Method kRungeKutta4{"RungeKutta4", Integrator::RungeKutta4, RotationUpdate::Splitting, 4.0};
const Method kAdaptive{"Adaptive", Integrator::Adaptive, RotationUpdate::Splitting, 5.0};

const Method kBackwardEuler{"BackwardEuler", Integrator::BackwardEuler, RotationUpdate::Splitting, 1.0};
const Method kMidpoint{"ImplicitMidpoint", Integrator::ImplicitMidpoint, RotationUpdate::Splitting, 2.0};

void choose(const Method& method, System& s) {
  s.settings.method = method.method;
  s.settings.rotation = method.rotation;
}

/// Exact slope of an error that falls from `coarse` to `fine` when the step is halved.
double order_of(double coarse, double fine) { return std::log2(coarse / fine); }

/// Two particles of mass 1 on a spring without rest length, U = |r|^2 / 2: omega^2 = 2, energy 1/2 |r|^2 at rest.
System make_spring(const Method& method) {
  System s;
  choose(method, s);
  s.p.add(Vec3(-0.5, 0, 0));
  s.p.add(Vec3(0.5, 0, 0));
  s.p.state.velocity[0] = Vec3(0.1, -0.2, 0.3);
  s.p.state.velocity[1] = Vec3(0.1, 0.6, 0.3);
  s.interactions.form_radius.push_back({"spring", {0}, {1}, {{.strength = 0.5, .radius = 0.0, .weight = {}}}});
  return s;
}

/// The exact separation of `make_spring` at a time.
Vec3 exact_separation(double t) {
  const double omega = std::numbers::sqrt2;
  return std::cos(omega * t) * Vec3(1, 0, 0) + std::sin(omega * t) / omega * Vec3(0, 0.8, 0);
}

double spring_error(const Method& method, double dt) {
  System s = make_spring(method);
  s.run_until(4.0, dt);
  return (s.p.state.position[1] - s.p.state.position[0] - exact_separation(4.0)).norm();
}

System make_spiral(const Method& method, std::uint64_t seed = 51) {
  System s;
  choose(method, s);
  s.p = test::make_spiral();
  s.interactions.bond_frame.push_back(test::bond_frames(s.p, 40.0, 0.5));
  Draw draw(seed);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    s.p.set.inertia[i] = Vec3(1e-4, 2e-4, 1.5e-4);
    s.p.state.velocity[i] = Vec3(0.3, -0.2, 0.1) + draw.vector(0.2);
    s.p.state.angular_momentum[i] = draw.vector(5e-4);
  }
  return s;
}

class EveryMethod : public testing::TestWithParam<Method> {};
class ExplicitMethod : public testing::TestWithParam<Method> {};
class FixedStep : public testing::TestWithParam<Method> {};
class ImplicitMethod : public testing::TestWithParam<Method> {};
const auto kNameOf = [](const auto& info) { return std::string(info.param.name); };
INSTANTIATE_TEST_SUITE_P(Methods, EveryMethod,
                         testing::Values(kSplitting, kExponential, kRungeKutta4, kAdaptive, kBackwardEuler, kMidpoint),
                         kNameOf);
INSTANTIATE_TEST_SUITE_P(Methods, ExplicitMethod, testing::Values(kSplitting, kExponential, kRungeKutta4, kAdaptive),
                         kNameOf);
INSTANTIATE_TEST_SUITE_P(Methods, FixedStep,
                         testing::Values(kSplitting, kExponential, kRungeKutta4, kBackwardEuler, kMidpoint), kNameOf);
INSTANTIATE_TEST_SUITE_P(Methods, ImplicitMethod, testing::Values(kBackwardEuler, kMidpoint), kNameOf);

TEST_P(FixedStep, HasItsOrderOnAHarmonicBond) {
  // The next term of the error is smaller by omega dt (backward Euler) or its square.
  const double coarse = spring_error(GetParam(), 0.02), fine = spring_error(GetParam(), 0.01);
  EXPECT_NEAR(order_of(coarse, fine), GetParam().order, 0.05);
}

TEST_P(FixedStep, HasTheStatedErrorOnTheAsymmetricTop) {
  // |R - R_exact| (Frobenius) at t = 10 for I = (1, 2, 3), omega_0 = (.1, 1, .1), steps of .1, .05 and .025.
  const auto orientation = [](const Method& method, double h) {
    System s;
    choose(method, s);
    s.p.add(Vec3::Zero());
    s.p.set.inertia[0] = Vec3(1, 2, 3);
    s.p.state.angular_momentum[0] = Vec3(0.1, 2.0, 0.3);
    s.run_until(10.0, h);
    return s.p.state.orientation[0].toRotationMatrix();
  };
  const Mat3 exact = orientation(kRungeKutta4, 5e-4);  // error 1e-15 by its order
  const auto error = [&](double h) { return (orientation(GetParam(), h) - exact).norm(); };
  if (GetParam().method == Integrator::RungeKutta4) {
    // Below what stages off unit length would give: 4.5e-6, 2.7e-7, 1.7e-8.
    EXPECT_LT(error(0.1), 4.5e-6);
    EXPECT_NEAR(order_of(error(0.1), error(0.05)), 4.0, 0.2);
    EXPECT_NEAR(order_of(error(0.05), error(0.025)), 4.0, 0.1);
    return;
  }
  if (GetParam().method == Integrator::ImplicitMidpoint) {
    // A free body turns by two splittings of half the step.
    EXPECT_NEAR(error(0.1), 5.4e-4, 5e-6);
    EXPECT_NEAR(error(0.05), 1.4e-4, 5e-6);
    return;
  }
  const bool exponential = GetParam().rotation == RotationUpdate::Exponential;
  EXPECT_NEAR(error(0.1), exponential ? 2.0e-3 : 2.2e-3, 5e-5);
  EXPECT_NEAR(error(0.05), exponential ? 5.1e-4 : 5.4e-4, 5e-6);
  EXPECT_NEAR(error(0.025), exponential ? 1.3e-4 : 1.4e-4, 5e-6);
}

TEST_P(EveryMethod, KeepsTheMomentumOfAFreeSpiral) {
  System s = make_spiral(GetParam());
  const Motion start = measure_motion(s.p.set, s.p.state);
  double scale = start.momentum_scale;
  for (int k = 0; k < 200; ++k) {
    s.run(1e-3, 1);
    const Motion now = measure_motion(s.p.set, s.p.state);
    scale = std::max(scale, now.momentum_scale);
    ASSERT_LE((now.momentum - start.momentum).norm(), 1e-12 * scale) << k;
  }
}

TEST(SymplecticMethod, KeepsTheAngularMomentumWithBothRotations) {
  for (const Method& method : {kSplitting, kExponential}) {
    System s = make_spiral(method);
    const Motion start = measure_motion(s.p.set, s.p.state);
    s.run(1e-3, 500);
    const Motion now = measure_motion(s.p.set, s.p.state);
    EXPECT_LE((now.angular_momentum - start.angular_momentum).norm(), 1e-12 * now.angular_momentum_scale)
        << method.name;
  }
}

TEST(SymplecticMethod, RunsBackwardsWithTheExponential) {
  System s = make_spiral(kExponential);
  const ParticleState start = s.p.state;
  s.run(1e-3, 300);
  EXPECT_GT((s.p.state.position[9] - start.position[9]).norm(), 0.05);
  for (Vec3& v : s.p.state.velocity) v = -v;
  for (Vec3& l : s.p.state.angular_momentum) l = -l;
  s.run(1e-3, 300);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    EXPECT_LE((s.p.state.position[i] - start.position[i]).norm(), 1e-11);
  }
}

TEST(SymplecticMethod, IsVelocityVerletToTheBitByDefault) {
  System s = make_spiral(kSplitting);
  s.interactions.friction.push_back({.name = "f", .first = {0}, .second = {1}, .linear = 0.1, .angular = 1e-4});
  System plain = make_spiral(kSplitting);
  plain.interactions = s.interactions;
  s.run(1e-3, 50);
  const Executor executor(1);
  InteractionWorkspace pairs(plain.p.set, plain.interactions);
  const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
    accumulate_interactions(plain.p.set, state, plain.interactions, executor, pairs, out.internal);
    add_external_loads(plain.p.set, plain.interactions, t, out.external);
  };
  for (int k = 0; k < 50; ++k) {
    advance({plain.p.set, plain.interactions, forces}, k * 1e-3, 1e-3, {plain.p.state, plain.kick, plain.ledger});
  }
  EXPECT_EQ(s.hash(), plain.hash());
  System other = make_spiral(kExponential);
  other.interactions = s.interactions;
  other.run(1e-3, 50);
  EXPECT_NE(other.hash(), s.hash());
}

TEST(RungeKutta4, LosesAngularMomentumAndEnergyOnlyToItsOrder) {
  struct Lost {
    double angular, energy;
  };
  const auto lost = [](double dt) {
    System s = make_spiral(kRungeKutta4);
    const Motion start = measure_motion(s.p.set, s.p.state);
    const double energy = s.energy();
    s.run_until(0.1, dt);
    const Motion now = measure_motion(s.p.set, s.p.state);
    return Lost{(now.angular_momentum - start.angular_momentum).norm() / now.angular_momentum_scale,
                std::abs(s.energy() - energy) / energy};
  };
  // The error of an invariant falls by dt^4 at least (dt^5 where the leading term cancels over a period).
  const Lost coarse = lost(1e-3), fine = lost(5e-4);
  EXPECT_LT(coarse.energy, 2e-2);  // omega dt = .4
  EXPECT_GT(order_of(coarse.angular, fine.angular), 3.8);
  EXPECT_GT(order_of(coarse.energy, fine.energy), 3.8);
}

TEST(RungeKutta4, KeepsItsOrderWithDampingOfBothKinds) {
  // Relative motion x'' = -2 x - (gamma + 2 c) x' along the bond: analytic.
  const double gamma = 0.3, c = 0.2, damping = 0.5 * (gamma + 2.0 * c), omega = std::sqrt(2.0 - damping * damping);
  const auto error = [&](double dt) {
    System s = make_spring(kRungeKutta4);
    s.p.state.velocity = {Vec3::Zero(), Vec3::Zero()};
    s.interactions.medium.push_back({.object = 0, .linear = gamma, .angular = 0.1});
    s.interactions.friction.push_back({.name = "f", .first = {0}, .second = {1}, .linear = c, .angular = 0.1});
    s.run_until(4.0, dt);
    const double exact =
        std::exp(-damping * 4.0) * (std::cos(omega * 4.0) + damping / omega * std::sin(omega * 4.0));
    return std::abs(s.p.state.position[1].x() - s.p.state.position[0].x() - exact);
  };
  EXPECT_NEAR(order_of(error(0.01), error(0.005)), 4.0, 0.1);
  EXPECT_LT(error(0.01), 1e-8);
}

TEST(RungeKutta4, HasTheLimitOfItsStabilityPolynomial) {
  // |1 + z + z^2/2 + z^3/6 + z^4/24| = 1 at z = i 2 sqrt 2.
  for (const double product : {2.82, 2.84}) {
    System s = make_spring(kRungeKutta4);
    double largest = 0.0;
    for (int k = 0; k < 4000 && largest < 1e6; ++k) {
      s.run(product / std::numbers::sqrt2, 1);
      largest = std::max(largest, (s.p.state.position[1] - s.p.state.position[0]).norm());
    }
    if (product < 2.0 * std::numbers::sqrt2) {
      EXPECT_LT(largest, 2.0);
    } else {
      EXPECT_GT(largest, 1e6);
    }
  }
}

/// Everything at once: laws, friction, medium, gravity, a ramped load with a torque, and pins.
System make_driven(const Method& method) {
  System s = make_spiral(method);
  s.interactions.friction.push_back({.name = "f", .first = {0, 1, 5}, .second = {1, 2, 6}, .linear = 0.3, .angular = 1e-4});
  s.interactions.medium.push_back({.object = 0, .linear = 0.4, .angular = 0.7});
  s.interactions.gravity = Vec3(0.5, 0, -2);
  s.interactions.external.push_back({.particle = 9, .force = Vec3(0.3, 0.1, 0.2), .torque = Vec3(1, -2, 1) * 1e-3,
                                     .begin = 0.0, .end = 1.0, .ramp = 0.02});
  s.p.set.pinned[0] = kPinPosition | kPinOrientation;
  s.p.set.pinned[4] = kPinPosition;
  s.p.set.pinned[7] = kPinOrientation;
  s.p.state.velocity[0] = s.p.state.velocity[4] = Vec3::Zero();
  s.p.state.angular_momentum[0] = s.p.state.angular_momentum[7] = Vec3::Zero();
  return s;
}

TEST_P(EveryMethod, HoldsPinsAndBooksEveryImpulse) {
  System s = make_driven(GetParam());
  const ParticleState start = s.p.state;
  const Motion before = measure_motion(s.p.set, start);
  s.run(5e-4, 100);
  EXPECT_EQ(s.p.state.position[0], start.position[0]);
  EXPECT_EQ(s.p.state.orientation[0].coeffs(), start.orientation[0].coeffs());
  EXPECT_EQ(s.p.state.position[4], start.position[4]);
  EXPECT_NE(s.p.state.orientation[4].coeffs(), start.orientation[4].coeffs());
  EXPECT_NE(s.p.state.position[7], start.position[7]);
  EXPECT_EQ(s.p.state.orientation[7].coeffs(), start.orientation[7].coeffs());
  const Motion after = measure_motion(s.p.set, s.p.state);
  EXPECT_GT(s.ledger.pin_impulse.norm(), 1e-3);
  EXPECT_LE((after.momentum - before.momentum - s.ledger.external_impulse - s.ledger.pin_impulse).norm(),
            1e-12 * after.momentum_scale);
}

TEST(Books, CloseToTheOrderOfTheMethod) {
  for (const Method& method : {kSplitting, kRungeKutta4}) {
    const auto open = [&](double dt) {
      System s = make_driven(method);
      const double start = s.energy();
      const Motion before = measure_motion(s.p.set, s.p.state);
      s.run_until(0.1, dt);
      const Motion after = measure_motion(s.p.set, s.p.state);
      const Vec3 angular = after.angular_momentum - before.angular_momentum - s.ledger.external_angular_impulse -
                           s.ledger.pin_angular_impulse;
      EXPECT_GT(s.ledger.dissipated, 0.01 * start);
      return std::pair{std::abs(s.imbalance(start)) / start, angular.norm() / after.angular_momentum_scale};
    };
    const auto [coarse_energy, coarse_angular] = open(5e-4);
    const auto [fine_energy, fine_angular] = open(1.25e-4);
    EXPECT_GT(order_of(coarse_energy, fine_energy) / 2.0, method.order - 0.3) << method.name;
    if (method.method == Integrator::Symplectic) {
      EXPECT_LE(fine_angular, 1e-12);
    } else {
      EXPECT_GT(order_of(coarse_angular, fine_angular) / 2.0, method.order - 0.3) << method.name;
    }
  }
}

TEST_P(EveryMethod, KeepsPlanarParticlesAtTheirHeight) {
  System s = make_spiral(GetParam());
  s.interactions.gravity = Vec3(0.5, 0, -2);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    s.p.set.pinned[i] = kPlanar;
    s.p.set.inertia[i] = Vec3::Constant(1e-4);
    s.p.state.position[i].z() = 0.3;
  }
  const ParticleState start = s.p.state;
  s.run(5e-4, 100);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    EXPECT_EQ(s.p.state.position[i].z(), 0.3);
    EXPECT_LE(rotation_log(s.p.state.orientation[i] * start.orientation[i].conjugate()).head<2>().norm(), 1e-13);
    EXPECT_NE(s.p.state.position[i].x(), start.position[i].x());
  }
}

TEST_P(EveryMethod, ContinuesFromASavedStateWithTheSameBits) {
  System s = make_driven(GetParam());
  s.run(2e-3, 10);
  System copy = make_driven(GetParam());
  EXPECT_TRUE(test::restart(s, copy));
  EXPECT_EQ(copy.hash(), s.hash());
  s.run(2e-3, 10);
  copy.run(2e-3, 10);
  EXPECT_EQ(copy.hash(), s.hash());
}

TEST_P(EveryMethod, HasTheSameBitsForEveryNumberOfThreads) {
  const auto hash_after = [](int threads) {
    System s = make_driven(GetParam());
    s.run(2e-3, 20, threads);
    return s.hash();
  };
  const std::uint64_t one = hash_after(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(hash_after(threads), one);
}

TEST_P(ExplicitMethod, AllocatesNothingAfterTheFirstStep) {
  System s = make_driven(GetParam());
  const Executor executor(1);
  InteractionWorkspace pairs(s.p.set, s.interactions);
  const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
    accumulate_interactions(s.p.set, state, s.interactions, executor, pairs, out.internal);
    add_external_loads(s.p.set, s.interactions, t, out.external);
  };
  s.run(forces, 1e-3, 1, executor, pairs);
  const std::uint64_t before = supple::test::allocation_count();
  s.run(forces, 1e-3, 10, executor, pairs);
  EXPECT_EQ(supple::test::allocation_count(), before);
}

TEST_P(EveryMethod, RefusesAStepThatIsNotPositive) {
  System s = make_spring(GetParam());
  EXPECT_THROW(s.run(0.0, 1), ContractViolation);
}

TEST(Adaptive, ErrsInProportionToItsTolerance) {
  const auto run = [](double tolerance) {
    System s = make_spring(kAdaptive);
    s.settings.tolerance = tolerance;
    s.run(1.0, 4);
    EXPECT_TRUE(s.report.within_tolerance);
    const double error = (s.p.state.position[1] - s.p.state.position[0] - exact_separation(4.0)).norm();
    return std::pair{error, s.report.substeps};
  };
  // The estimate is of order 5, so the steps grow by tolerance^(1/5); local errors add up over at most omega t = 6 rad.
  for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
    const auto [error, substeps] = run(tolerance);
    EXPECT_LT(error, 6.0 * tolerance) << tolerance;
    EXPECT_GT(error, 1e-3 * tolerance) << tolerance;
  }
  const double growth = static_cast<double>(run(1e-10).second) / static_cast<double>(run(1e-5).second);
  EXPECT_NEAR(growth, 10.0, 2.5);
}

TEST(Adaptive, TakesSmallStepsOnlyWhereTheyAreNeeded) {
  // A particle that falls past a centre of 1/r^2 attraction: period and energy of a Kepler ellipse, e = .9.
  const double e = 0.9;
  System s;
  choose(kAdaptive, s);
  s.settings.tolerance = 1e-9;
  s.p.add(Vec3(1.0 + e, 0, 0));
  s.p.state.velocity[0] = Vec3(0, std::sqrt((1.0 - e) / (1.0 + e)), 0);
  const ForceModel attraction = [](const ParticleState& state, double, ForceSample& out) {
    const Vec3& x = state.position[0];
    out.internal.force[0] -= std::pow(x.squaredNorm(), -1.5) * x;
  };
  const double period = 2.0 * std::numbers::pi;
  double smallest = period, largest = 0.0;
  for (int k = 0; k < 64; ++k) {
    s.run(attraction, period / 64, 1);
    smallest = std::min(smallest, s.kick.next_step);
    largest = std::max(largest, s.kick.next_step);
  }
  // An error made at the near point is carried round the orbit and grows by about 1 / (1 - e)^2.
  EXPECT_LE((s.p.state.position[0] - Vec3(1.0 + e, 0, 0)).norm(), 1e-6);
  EXPECT_GT(largest / smallest, 5.0);
  EXPECT_GT(s.report.rejected, 0);
}

TEST(Adaptive, SaysWhenItsSmallestStepIsTooLarge) {
  System s = make_spring(kAdaptive);
  s.settings.tolerance = 1e-12;
  s.settings.max_substeps = 4;
  s.run(1.0, 1);
  EXPECT_EQ(s.report.substeps, 4);
  EXPECT_FALSE(s.report.within_tolerance);
}

TEST(Adaptive, EndsWithForcesThatAreNotNumbers) {
  System s = make_spring(kAdaptive);
  s.settings.max_substeps = 16;
  s.run([](const ParticleState&, double, ForceSample& out) { out.internal.force[0].x() = std::nan(""); }, 1.0, 1);
  EXPECT_FALSE(s.report.within_tolerance);
  EXPECT_FALSE(s.p.state.position[0].allFinite());
}

TEST(BackwardEuler, IsItsRecurrenceOnAHarmonicBond) {
  // r_1 (1 + (omega dt)^2) = r_0 + dt v_0: amplitude (1 + (omega dt)^2)^(-1/2) and phase atan(omega dt) a step.
  const double omega = std::numbers::sqrt2;
  for (const double product : {0.1, 1.0, 50.0}) {
    System s = make_spring(kBackwardEuler);
    s.p.state.velocity = {Vec3::Zero(), Vec3::Zero()};
    s.settings.tolerance = 1e-12;
    const int steps = 10;
    s.run(product / omega, steps);
    const double expected = std::pow(1.0 + product * product, -0.5 * steps) * std::cos(steps * std::atan(product));
    EXPECT_NEAR(s.p.state.position[1].x() - s.p.state.position[0].x(), expected, 1e-13) << product;
    EXPECT_LE(s.report.newton_iterations, 2 * steps) << product;  // one finds the minimum, one sees that it did
  }
}

TEST(BackwardEuler, DampsByHalfTheProductOfFrequencyAndStep) {
  // ln(amplitude) per radian of phase: ln sqrt(1 + p^2) / atan(p) = p / 2 - p^3 / 12 ...
  const double omega = std::numbers::sqrt2, product = 0.05;
  System s = make_spring(kBackwardEuler);
  s.p.state.velocity = {Vec3::Zero(), Vec3::Zero()};
  const double start = s.energy();
  const int steps = 200;
  s.run(product / omega, steps);
  // Energy over a whole phase, of which the amplitude is the root.
  const double ratio = -0.5 * std::log(s.energy() / start) / (steps * std::atan(product));
  EXPECT_NEAR(ratio, 0.5 * product, 0.01 * product);
}

TEST(ImplicitMidpoint, IsItsRecurrenceOnAHarmonicBond) {
  // The Cayley transform: no damping, phase 2 atan(omega dt / 2) a step.
  const double omega = std::numbers::sqrt2;
  for (const double product : {0.1, 1.0, 50.0}) {
    System s = make_spring(kMidpoint);
    s.p.state.velocity = {Vec3::Zero(), Vec3::Zero()};
    s.settings.tolerance = 1e-12;
    s.run(product / omega, 10);
    EXPECT_NEAR(s.p.state.position[1].x() - s.p.state.position[0].x(), std::cos(20 * std::atan(0.5 * product)), 1e-12)
        << product;
    EXPECT_NEAR(s.energy(), 0.5, 1e-12) << product;
  }
}

class AgreesWithRungeKutta4 : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(Methods, AgreesWithRungeKutta4,
                         testing::Values(kSplitting, kExponential, kBackwardEuler, kMidpoint), kNameOf);
TEST_P(AgreesWithRungeKutta4, InTheLimitAtItsOrder) {
  // Large rotations of anisotropic bodies with friction, drag, pins and driving loads.
  const auto end = [](const Method& method, double dt) {
    System s = make_driven(method);
    s.settings.tolerance = 1e-10;
    s.run_until(0.04, dt);
    EXPECT_TRUE(s.report.within_tolerance);
    return s.p.state;
  };
  const ParticleState exact = end(kRungeKutta4, 2.5e-5);
  const auto error = [&](double dt) {
    const ParticleState state = end(GetParam(), dt);
    double largest = 0.0;
    for (std::size_t i = 0; i < state.size(); ++i) {
      largest = std::max({largest, (state.position[i] - exact.position[i]).norm(),
                          0.1 * rotation_log(state.orientation[i] * exact.orientation[i].conjugate()).norm()});
    }
    return largest;
  };
  const double dt = GetParam().order < 1.5 ? 1.25e-5 : 5e-5;
  const double coarse = error(2.0 * dt), fine = error(dt);
  EXPECT_LT(fine, GetParam().order < 1.5 ? 1e-4 : 1e-5);
  EXPECT_NEAR(order_of(coarse, fine), GetParam().order, 0.1);
}

TEST_P(ImplicitMethod, KeepsItsOrderWithForcesOutsideThePairLaws) {
  // The spring is pulled back by a force model of its own as well: omega^2 = 2 + 3.
  const auto error = [&](double dt) {
    System s = make_spring(GetParam());
    s.p.state.velocity = {Vec3::Zero(), Vec3::Zero()};
    const Executor executor(1);
    InteractionWorkspace pairs(s.p.set, s.interactions);
    const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
      accumulate_interactions(s.p.set, state, s.interactions, executor, pairs, out.internal);
      add_external_loads(s.p.set, s.interactions, t, out.external);
      const Vec3 pull = 1.5 * (state.position[1] - state.position[0]);
      out.internal.force[0] += pull;
      out.internal.force[1] -= pull;
    };
    s.run(forces, dt, static_cast<int>(std::lround(2.0 / dt)));
    return std::abs(s.p.state.position[1].x() - s.p.state.position[0].x() - std::cos(std::sqrt(5.0) * 2.0));
  };
  EXPECT_NEAR(order_of(error(0.005), error(0.0025)), GetParam().order, 0.1);
}

TEST_P(ImplicitMethod, StaysStableFarBeyondTheExplicitLimit) {
  System s = make_spiral(GetParam());
  for (BondFrame& law : s.interactions.bond_frame[0].law) {
    law.stretch = 4e5;
    law.rotation = 5e3;
  }
  const double dt = 1e-2;
  EXPECT_GT(dt * largest_frequency(s.p.set, s.p.state, s.interactions), 300.0);
  const double start = s.energy();
  const Motion before = measure_motion(s.p.set, s.p.state);
  for (int k = 0; k < 200; ++k) {
    s.run(dt, 1);
    ASSERT_LE(s.energy(), (GetParam().method == Integrator::BackwardEuler ? 1.0 : 1.5) * start + 1e-12) << k;
  }
  EXPECT_TRUE(s.report.within_tolerance);
  const Motion after = measure_motion(s.p.set, s.p.state);
  EXPECT_LE((after.momentum - before.momentum).norm(), 1e-9 * before.momentum_scale);
  const ShapeError shape = shape_error(test::make_spiral().state.position, s.p.state.position);
  EXPECT_LT(shape.largest, 0.02);
}

TEST(ImplicitMidpoint, KeepsMomentumAndAngularMomentum) {
  System s = make_spiral(kMidpoint);
  s.settings.tolerance = 1e-10;
  const Motion start = measure_motion(s.p.set, s.p.state);
  for (int k = 0; k < 200; ++k) {
    s.run(2e-3, 1);
    const Motion now = measure_motion(s.p.set, s.p.state);
    ASSERT_LE((now.momentum - start.momentum).norm(), 1e-12 * now.momentum_scale) << k;
    // x_1 = 2 x_m - x_0 holds the mean of the velocities as well as Newton's method ended: 1e-10 of a length a step.
    ASSERT_LE((now.angular_momentum - start.angular_momentum).norm(), 1e-9 * now.angular_momentum_scale) << k;
  }
}

/// A spiral at rest whose friction stops rotations far faster than they begin; its ends are pulled apart.
System make_sluggish_spiral(const Method& method) {
  System s = make_spiral(method);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    s.p.state.velocity[i] = Vec3::Zero();
    s.p.state.angular_momentum[i] = Vec3::Zero();
    s.p.set.inertia[i] = Vec3::Constant(1e-4);
  }
  Friction friction;
  friction.linear = 0.5;
  friction.angular = 1.0;
  for (std::uint32_t i = 0; i + 1 < s.p.set.size(); ++i) {
    friction.first.push_back(i);
    friction.second.push_back(i + 1);
  }
  s.interactions.friction.push_back(friction);
  return s;
}

/// Where the last particle of a sluggish spiral is after 0.4 s of a force on it.
Vec3 end_of_pulled_spiral(const Method& method, double dt) {
  System s = make_sluggish_spiral(method);
  InteractionWorkspace pairs(s.p.set, s.interactions);
  const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
    accumulate_interactions(s.p.set, state, s.interactions, Executor(1), pairs, out.internal);
    add_external_loads(s.p.set, s.interactions, t, out.external);
    out.external.force[0] = Vec3(0, -2, -1);
    out.external.force[s.p.set.size() - 1] = Vec3(0, 2, 1);
  };
  s.run(forces, dt, static_cast<int>(std::lround(0.4 / dt)));
  return s.p.state.position.back();
}

TEST(ImplicitMidpoint, FollowsMotionThatIsDampedFasterThanAStep) {
  EXPECT_GT(0.01 * largest_damping_rate(test::make_spiral().set, make_sluggish_spiral(kMidpoint).p.state, make_sluggish_spiral(kMidpoint).interactions), 100.0);
  const Vec3 fine = end_of_pulled_spiral(kMidpoint, 6.25e-4), start = test::make_spiral().state.position.back();
  const double way = (fine - start).norm();
  EXPECT_GT(way, 0.01);
  EXPECT_LT((end_of_pulled_spiral(kMidpoint, 0.01) - fine).norm(), 0.02 * way);
  // Explicit half steps of damping reach the same end, with far shorter steps: the two methods share no damping.
  EXPECT_LT((end_of_pulled_spiral(kSplitting, 1e-5) - fine).norm(), 0.02 * way);
  EXPECT_GT((end_of_pulled_spiral(kSplitting, 2e-3) - fine).norm(), 0.2 * way);
}

TEST(ImplicitMidpoint, IsOfSecondOrderWithDamping) {
  const auto pose = [](double dt) {
    System s = make_spiral(kMidpoint);
    s.interactions.friction = make_sluggish_spiral(kMidpoint).interactions.friction;
    s.interactions.friction[0].linear = 0.05;
    s.interactions.friction[0].angular = 1e-4;
    s.interactions.stiffness_damping.push_back({.object = 0, .time = 1e-3});
    s.settings.tolerance = 1e-11;
    s.run_until(0.1, dt);
    return s.p.state.position.back();
  };
  const Vec3 exact = pose(7.8125e-5);
  EXPECT_NEAR(order_of((pose(1.25e-3) - exact).norm(), (pose(6.25e-4) - exact).norm()), 2.0, 0.25);
}

TEST_P(ImplicitMethod, LosesTheEnergyThatDampingBooksAndNoMomentum) {
  System s = make_spiral(GetParam());
  s.interactions.friction = make_sluggish_spiral(GetParam()).interactions.friction;
  s.interactions.stiffness_damping.push_back({.object = 0, .time = 5e-3});
  s.settings.tolerance = 1e-10;
  const Motion start = measure_motion(s.p.set, s.p.state);
  double energy = s.energy(), dissipated = 0.0;
  for (int k = 0; k < 100; ++k) {
    s.run(4e-3, 1);
    const Motion now = measure_motion(s.p.set, s.p.state);
    ASSERT_LE((now.momentum - start.momentum).norm(), 1e-12 * start.momentum_scale) << k;
    if (GetParam().method == Integrator::ImplicitMidpoint) {  // the other one keeps no angular momentum
      ASSERT_LE((now.angular_momentum - start.angular_momentum).norm(), 1e-8 * start.angular_momentum_scale) << k;
    }
    ASSERT_LE(s.energy(), energy * (1.0 + 1e-6)) << k;
    ASSERT_GE(s.ledger.dissipated, dissipated) << k;
    energy = s.energy();
    dissipated = s.ledger.dissipated;
  }
  if (GetParam().method == Integrator::ImplicitMidpoint) {
    EXPECT_LT(std::abs(s.imbalance(make_spiral(kMidpoint).energy())), 0.02 * dissipated);
  }
}

TEST(ImplicitMidpoint, SpinsUpExactlyUnderAConstantTorque) {
  System s;
  choose(kMidpoint, s);
  s.p.add(Vec3::Zero());
  const double inertia = s.p.set.inertia[0].z(), torque = 0.3 * inertia, spin = 0.2;
  s.p.state.angular_momentum[0] = Vec3(0, 0, spin * inertia);
  const ForceModel forces = [&](const ParticleState&, double, ForceSample& out) {
    out.external.torque[0] = Vec3(0, 0, torque);
  };
  s.run(forces, 0.2, 10);
  const Vec3 turned = rotation_log(s.p.state.orientation[0]);
  EXPECT_LE((turned - Vec3(0, 0, spin * 2.0 + 0.5 * 0.3 * 2.0 * 2.0)).norm(), 1e-12);
}

TEST(BackwardEuler, EndsAtTheMinimumOfItsIncrementalPotential) {
  // One long step of an anisotropic body from rest: 1/(2 h^2) delta . I delta + U, delta the turn in body axes.
  System s;
  choose(kBackwardEuler, s);
  s.p.add(Vec3::Zero());
  s.p.add(Vec3(0.3, 0, 0));
  s.p.set.pinned[0] = kPinPosition | kPinOrientation;
  s.p.set.inertia[1] = Vec3(1e-4, 4e-4, 2.5e-4);
  s.interactions.bond_frame.push_back(test::bond_frames(s.p, 40.0, 0.05, 1));
  s.settings.tolerance = 1e-12;
  s.p.state.orientation[1] = rotation_exp(Vec3(0.9, -0.7, 0.8));
  const ParticleState start = s.p.state;
  const double h = 0.05;
  s.run(h, 1);
  EXPECT_TRUE(s.report.within_tolerance);
  const auto potential = [&](const Vec3& rotation) {
    ParticleState at = s.p.state;
    at.orientation[1] = rotation_exp(rotation) * at.orientation[1];
    const Vec3 delta = rotation_log(start.orientation[1].conjugate() * at.orientation[1]);
    const double moved2 = (at.position[1] - start.position[1]).squaredNorm();
    return 0.5 / (h * h) * (s.p.set.mass[1] * moved2 + delta.dot(s.p.set.inertia[1].cwiseProduct(delta))) +
           potential_energy(s.p.set, at, s.interactions);
  };
  const Vec3 turned = rotation_log(start.orientation[1].conjugate() * s.p.state.orientation[1]);
  EXPECT_GT(turned.norm(), 0.5);
  for (int k = 0; k < 3; ++k) {
    const double slope = (potential(1e-4 * Vec3::Unit(k)) - potential(-1e-4 * Vec3::Unit(k))) / 2e-4;
    EXPECT_NEAR(slope, 0.0, 1e-6 * potential(Vec3::Zero())) << k;  // central difference: third derivative 1e-8 / 6
  }
}

TEST(BackwardEuler, RestsWhereTheForcesBalance) {
  // A chain hung up at both ends comes to rest without velocity, and with the static force of the pins.
  System s;
  choose(kBackwardEuler, s);
  for (int i = 0; i < 6; ++i) s.p.add(Vec3(0.1 * i, 0, 0), 0.1, 1e-3);
  s.p.set.pinned[0] = s.p.set.pinned[5] = kPinPosition;
  s.interactions.bond_frame.push_back(test::bond_frames(s.p, 500.0, 2.0, 1));
  s.interactions.gravity = Vec3(0, 0, -9.81);
  s.settings.tolerance = 1e-13;
  s.run(0.5, 60);
  for (const Vec3& v : s.p.state.velocity) EXPECT_LE(v.norm(), 1e-10);
  const Vec3 before = s.ledger.pin_impulse;
  s.run(0.5, 1);
  EXPECT_NEAR((s.ledger.pin_impulse - before).z() / 0.5, 6 * 0.1 * 9.81, 1e-9);
}

TEST_P(ImplicitMethod, GivesTheSameByConjugateGradients) {
  System direct = make_driven(GetParam()), iterative = make_driven(GetParam());
  iterative.settings.direct_unknowns = 0;
  direct.settings.tolerance = iterative.settings.tolerance = 1e-10;
  direct.run(2e-3, 30);
  iterative.run(2e-3, 30);
  EXPECT_EQ(direct.report.gradient_iterations, 0);
  EXPECT_GT(iterative.report.gradient_iterations, 0);
  EXPECT_TRUE(iterative.report.within_tolerance);
  for (std::size_t i = 0; i < direct.p.set.size(); ++i) {
    EXPECT_LE((direct.p.state.position[i] - iterative.p.state.position[i]).norm(), 1e-7) << i;
  }
}

TEST_P(ImplicitMethod, ReportsWhatNewtonsMethodLeaves) {
  System s = make_spiral(GetParam());
  for (Vec3& v : s.p.state.velocity) v *= 30.0;
  s.settings.max_iterations = 1;
  s.run(0.05, 1);
  EXPECT_FALSE(s.report.within_tolerance);
  EXPECT_EQ(s.report.newton_iterations, 1);
  for (const Vec3& x : s.p.state.position) EXPECT_TRUE(x.allFinite());
}

}  // namespace
}  // namespace supple::core
