// One step: velocity Verlet, its order, limits, books and restart.
#include "supple/core/integrate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/support.h"
#include "supple/core/error.h"
#include "support/allocations.h"

namespace supple::core {
namespace {

using test::Draw;
using test::Particles;

/// A system that steps: particles, their interactions and the ledger of what was done to them.
struct System {
  Particles p;
  Interactions interactions;
  KickState kick;
  Ledger ledger;
  double time = 0.0;

  /// Steps with the pair laws and external loads alone.
  void run(double dt, int steps, int threads = 1) {
    const Executor executor(threads);
    InteractionWorkspace workspace(p.set, interactions);
    const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
      accumulate_interactions(p.set, state, interactions, executor, workspace, out.internal);
      add_external_loads(p.set, interactions, t, out.external);
    };
    run(forces, dt, steps);
  }
  void run(const ForceModel& forces, double dt, int steps) {
    for (int k = 0; k < steps; ++k) {
      advance({p.set, interactions, forces}, time, dt, {p.state, kick, ledger});
      time += dt;
    }
  }
  [[nodiscard]] double energy() const {
    return measure_motion(p.set, p.state).kinetic_energy + potential_energy(p.set, p.state, interactions);
  }
  [[nodiscard]] std::uint64_t hash() const {
    Hasher hasher;
    p.state.hash(hasher);
    kick.hash(hasher);
    ledger.hash(hasher);
    return hasher.value();
  }
};

System make_moving_spiral(std::uint64_t seed = 51) {
  System s;
  s.p = test::make_spiral();
  s.interactions.bond_frame.push_back(test::bond_frames(s.p, 40.0, 0.5));
  Draw draw(seed);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    s.p.state.velocity[i] = Vec3(0.3, -0.2, 0.1) + draw.vector(0.2);
    s.p.state.angular_momentum[i] = draw.vector(5e-4);
  }
  return s;
}

/// A single particle of mass 1 at (x, 0, 0) under the force f(x) along x.
template <class Force>
struct Oscillator {
  Force force;
  System s;
  Oscillator(double x, Force f) : force(f) { s.p.add(Vec3(x, 0, 0)); }
  void run(double dt, int steps) {
    s.run([this](const ParticleState& state, double,
                 ForceSample& out) { out.internal.force[0].x() += force(state.position[0].x()); },
          dt, steps);
  }
  [[nodiscard]] double x() const { return s.p.state.position[0].x(); }
};

TEST(VectorSum, HasTheRoundingOfOneTermAfterAMillion) {
  const Vec3 term(9.81 / 30720.0, 0.1, -1.0 / 3.0);
  constexpr int kTerms = 1'000'000;
  VectorSum sum;
  for (int i = 0; i < kTerms; ++i) sum += term;
  for (int k = 0; k < 3; ++k) {
    // Exact to the last bit but one: a product of the rounded term and a whole number.
    const double exact = term[k] * kTerms;
    EXPECT_LE(std::abs(sum[k] - exact), 2.0 * std::numeric_limits<double>::epsilon() * std::abs(exact)) << k;
  }
  for (int i = 0; i < kTerms; ++i) sum -= term;
  EXPECT_LE((sum + sum.rest).norm(), 1e-15);
}

TEST(QuarticWell, HasItsAmplitudeDependentPeriod) {
  // T = Gamma(1/4)^2 / sqrt(pi) sqrt(mu / k_3) / A = 74.163 for mu = k_3 = 1, A = .1.
  Oscillator well(0.1, [](double x) { return -x * x * x; });
  const double dt = 0.01;
  double before = 0.1, crossing = 0.0;
  int crossings = 0;
  while (crossings < 3) {
    well.run(dt, 1);
    if ((before > 0.0) != (well.x() > 0.0)) {
      crossing = well.s.time - dt + dt * before / (before - well.x());
      ++crossings;
    }
    before = well.x();
  }
  // The third zero is at 5/4 T. Relative error of order (omega dt)^2 / 24 = 3e-8.
  EXPECT_NEAR(crossing / 1.25, 74.162987, 1e-4);
}

TEST(QuarticWell, ReturnsAlgebraicallyInAMedium) {
  Oscillator well(0.3, [](double x) { return -x * x * x; });
  well.s.interactions.medium.push_back({.object = 0, .linear = 1.0, .angular = 0.0});
  well.run(0.02, 5000);
  EXPECT_NEAR(well.x(), 0.067637, 2e-6);
  well.run(0.02, 45000);
  EXPECT_NEAR(well.x(), 0.022220, 2e-6);
}

TEST(TriangleOfSprings, SwingsAtItsEigenfrequencies) {
  // m omega^2 / k = 3 for breathing, 1.5 for a pair of modes that keep no symmetry. Three harmonic springs, k = m = 1.
  const Vec3 corner[3] = {Vec3(0, 1, 0), Vec3(-std::sqrt(0.75), -0.5, 0), Vec3(std::sqrt(0.75), -0.5, 0)};
  const ForceModel springs = [](const ParticleState& state, double, ForceSample& out) {
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t b = (a + 1) % 3;
      const Vec3 r = state.position[b] - state.position[a];
      const Vec3 pull = (1.0 - std::sqrt(3.0) / r.norm()) * r;
      out.internal.force[a] += pull;
      out.internal.force[b] -= pull;
    }
  };
  const Vec3 breathing[3] = {corner[0], corner[1], corner[2]};
  const auto mirrored = [](const Vec3& v) { return Vec3(-v.x(), v.y(), 0); };
  const Vec3 skew[3] = {mirrored(corner[0]), mirrored(corner[1]), mirrored(corner[2])};
  for (const auto& [mode, eigenvalue] : {std::pair{breathing, 3.0}, std::pair{skew, 1.5}}) {
    System s;
    const double amplitude = 1e-5;  // anharmonic frequency change of order amplitude^2
    for (int i = 0; i < 3; ++i) s.p.add(corner[i] + amplitude * mode[i]);
    const double period = 2.0 * std::numbers::pi / std::sqrt(eigenvalue);
    s.run(springs, period / 2000, 2000);
    for (std::size_t i = 0; i < 3; ++i) {
      // Phase error 2 pi (omega dt)^2 / 24 = 2.6e-6 and the square of the amplitude.
      EXPECT_LE((s.p.state.position[i] - corner[i] - amplitude * mode[i]).norm(), 1e-4 * amplitude) << eigenvalue;
    }
    s.run(springs, period / 2000, 1000);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_LE((s.p.state.position[i] - corner[i] + amplitude * mode[i]).norm(), 1e-4 * amplitude) << eigenvalue;
    }
  }
}

TEST(HarmonicLimit, IsTwoWithAndWithoutDamping) {
  // With damping by its exact exponential the limit omega dt < 2 of velocity Verlet stays.
  for (const double zeta : {0.0, 0.1, 0.5, 1.0}) {
    for (const double step : {1.99, 2.01}) {
      Oscillator spring(1.0, [](double x) { return -x; });
      if (zeta > 0.0) spring.s.interactions.medium.push_back({.object = 0, .linear = 2.0 * zeta, .angular = 0.0});
      double largest = 0.0;
      for (int k = 0; k < 2000; ++k) {
        spring.run(step, 1);
        largest = std::max(largest, std::abs(spring.x()));
        if (largest > 1e12) break;
      }
      if (step < 2.0) {
        EXPECT_LT(largest, 20.0) << zeta;
      } else {
        EXPECT_GT(largest, 1e12) << zeta;
      }
    }
  }
}

TEST(HarmonicLimit, HasTheStatedPhaseError) {
  // omega_num dt = 2 asin(omega dt / 2): 0.505361 for omega dt = .5.
  Oscillator spring(1.0, [](double x) { return -x; });
  spring.run(0.5, 40);
  EXPECT_NEAR(spring.x(), std::cos(40 * 0.505360510284), 1e-9);
}

TEST(FreeSpiral, KeepsMomentumAndAngularMomentumAtEveryStep) {
  System s = make_moving_spiral();
  const Motion start = measure_motion(s.p.set, s.p.state);
  double momentum_scale = start.momentum_scale, angular_scale = start.angular_momentum_scale;
  for (int k = 0; k < 1000; ++k) {
    s.run(2e-3, 1);
    const Motion now = measure_motion(s.p.set, s.p.state);
    momentum_scale = std::max(momentum_scale, now.momentum_scale);
    angular_scale = std::max(angular_scale, now.angular_momentum_scale);
    ASSERT_LE((now.momentum - start.momentum).norm(), 1e-12 * momentum_scale) << k;
    ASSERT_LE((now.angular_momentum - start.angular_momentum).norm(), 1e-12 * angular_scale) << k;
  }
}

TEST(FreeSpiral, DriftsInEnergyWithTheSquareOfTheStep) {
  const auto energy_error = [](double dt) {
    System s = make_moving_spiral();
    const double start = s.energy();
    double worst = 0.0;
    const int steps = static_cast<int>(std::lround(0.5 / dt));
    for (int k = 0; k < steps; ++k) {
      s.run(dt, 1);
      worst = std::max(worst, std::abs(s.energy() - start));
    }
    return worst / start;
  };
  // omega_max is about 400 rad/s: omega dt = .16, .08, .04, and the next term of the error is (omega dt)^2 of it.
  const double coarse = energy_error(4e-4), middle = energy_error(2e-4), fine = energy_error(1e-4);
  EXPECT_LT(coarse, 1e-2);
  EXPECT_NEAR(coarse / middle, 4.0, 0.2);
  EXPECT_NEAR(middle / fine, 4.0, 0.05);
}

TEST(FreeSpiral, RunsBackwardsToItsStart) {
  System s = make_moving_spiral();
  for (std::size_t i = 0; i < s.p.set.size(); ++i) s.p.set.inertia[i] = Vec3(1e-4, 2e-4, 1.5e-4);
  const ParticleState start = s.p.state;
  s.run(2e-3, 300);
  for (Vec3& v : s.p.state.velocity) v = -v;
  for (Vec3& l : s.p.state.angular_momentum) l = -l;
  s.run(2e-3, 300);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    EXPECT_LE((s.p.state.position[i] - start.position[i]).norm(), 1e-11);
    EXPECT_LE((s.p.state.velocity[i] + start.velocity[i]).norm(), 1e-10);
  }
}

TEST(FreeSpiral, HasTheSameBitsForEveryNumberOfThreads) {
  const auto hash_after = [](int threads) {
    System s = make_moving_spiral();
    s.run(2e-3, 50, threads);
    return s.hash();
  };
  const std::uint64_t one = hash_after(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(hash_after(threads), one);
}

TEST(Steps, ContinueFromASavedStateWithTheSameBits) {
  System s = make_moving_spiral();
  s.interactions.friction.push_back({.name = "f", .first = {0, 3}, .second = {1, 4}, .linear = 0.1, .angular = 1e-4});
  s.interactions.gravity = Vec3(0, 0, -1);
  s.run(2e-3, 20);
  System copy = make_moving_spiral(99);
  copy.interactions = s.interactions;
  EXPECT_TRUE(test::restart(s, copy));
  EXPECT_EQ(copy.hash(), s.hash());
  s.run(2e-3, 20);
  copy.run(2e-3, 20);
  EXPECT_EQ(copy.hash(), s.hash());
}

TEST(Steps, AskForTheForcesOnceAndTwiceAtTheStart) {
  System s;
  s.p.add(Vec3::Zero());
  std::vector<double> times;
  const ForceModel forces = [&](const ParticleState&, double t, ForceSample&) { times.push_back(t); };
  s.run(forces, 0.5, 3);
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.5, 1.0, 1.5}));
}

TEST(Steps, AllocateNothingAfterTheFirst) {
  System s = make_moving_spiral();
  s.interactions.coplanarity.push_back(test::coplanarities(s.p, 2.0));
  s.interactions.friction.push_back({.name = "f", .first = {0, 3}, .second = {1, 4}, .linear = 0.1, .angular = 1e-4});
  s.interactions.medium.push_back({.object = 0, .linear = 0.1, .angular = 0.1});
  s.interactions.external.push_back(
      {.particle = 0, .force = Vec3::UnitX(), .torque = 1e-3 * Vec3::UnitZ(), .end = 1.0});
  const Executor executor(1);
  InteractionWorkspace workspace(s.p.set, s.interactions);
  const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
    accumulate_interactions(s.p.set, state, s.interactions, executor, workspace, out.internal);
    add_external_loads(s.p.set, s.interactions, t, out.external);
  };
  s.run(forces, 1e-3, 1);
  const std::uint64_t before = supple::test::allocation_count();
  s.run(forces, 1e-3, 10);
  EXPECT_EQ(supple::test::allocation_count(), before);
}

TEST(Steps, RefuseAStepThatIsNotPositive) {
  System s;
  s.p.add(Vec3::Zero());
  EXPECT_THROW(s.run([](const ParticleState&, double, ForceSample&) {}, 0.0, 1), ContractViolation);
}

TEST(Gravity, IsExactAndBookedAsWorkAndImpulse) {
  System s;
  s.p.add(Vec3(1, 0, 0), 2.0);
  s.p.state.velocity[0] = Vec3(3, 0, 4);
  s.interactions.gravity = Vec3(0, 0, -9.81);
  const double start = s.energy();
  const Motion before = measure_motion(s.p.set, s.p.state);
  s.run(0.01, 100);
  EXPECT_NEAR(s.p.state.position[0].z(), 4.0 - 0.5 * 9.81, 1e-12);
  const Motion after = measure_motion(s.p.set, s.p.state);
  EXPECT_NEAR(s.energy() - start, s.ledger.external_work, 1e-12 * start);
  EXPECT_LE((after.momentum - before.momentum - s.ledger.external_impulse).norm(), 1e-12);
  EXPECT_LE((after.angular_momentum - before.angular_momentum - s.ledger.external_angular_impulse).norm(), 1e-11);
}

TEST(ExternalTorque, DoesItsWorkOnASpinningBody) {
  // About a principal axis the angle is exact, and so is the work of a constant torque.
  for (const Vec3& inertia : {Vec3(2, 2, 2), Vec3(1, 3, 2)}) {
    System s;
    s.p.add(Vec3::Zero());
    s.p.set.inertia[0] = inertia;
    s.p.state.angular_momentum[0] = Vec3(0, 0, 0.4);
    s.interactions.external.push_back({.particle = 0, .torque = Vec3(0, 0, 0.3), .begin = 0.0, .end = 10.0});
    const double start = s.energy();
    s.run(0.01, 200);
    EXPECT_NEAR(s.p.state.angular_momentum[0].z(), 0.4 + 0.3 * 2.0, 1e-13);
    EXPECT_NEAR(s.energy() - start, s.ledger.external_work, 1e-13);
    EXPECT_LE((s.ledger.external_angular_impulse - Vec3(0, 0, 0.6)).norm(), 1e-13);
  }
}

TEST(ExternalWork, OfALoadThatBeginsWithinAStepIsWhatAFreeBodyGains) {
  for (const double begin : {0.113, 0.117, 0.12}) {  // in the first and the second half of a step, and where one begins
    System s;
    s.p.add(Vec3::Zero(), 2.0);
    s.interactions.external.push_back({.particle = 0, .force = Vec3(3, 0, 0), .torque = Vec3(0, 0, 0.3), .begin = begin, .end = 0.657, .ramp = 0.1});
    s.run(0.01, 100);
    EXPECT_NEAR(s.p.state.velocity[0].x(), 1.5 * (0.657 - begin - 0.1), 1e-14);
    EXPECT_NEAR(s.energy(), s.ledger.external_work, 1e-13 * s.energy()) << begin;
  }
}

TEST(ExternalWork, ClosesTheEnergyBalanceToSecondOrder) {
  const auto imbalance = [](double dt) {
    System s = make_moving_spiral();
    s.interactions.external.push_back({.particle = 9, .force = Vec3(0.3, 0.1, 0.2), .torque = Vec3(1, -2, 1) * 1e-3,
                                       .begin = 0.1, .end = 0.7, .ramp = 0.2});
    const double start = s.energy();
    s.run(dt, static_cast<int>(std::lround(1.0 / dt)));
    return std::abs(s.energy() - start - s.ledger.external_work) / s.energy();
  };
  EXPECT_LT(imbalance(2e-3), 1e-2);
  EXPECT_LT(imbalance(2.5e-4), imbalance(2e-3) / 16.0);
}

TEST(FixedBodies, TakeTheImpulseOfTheForceOnThem) {
  System s;
  s.p.add(Vec3(0, 0, 1));
  const ForceModel forces = [](const ParticleState&, double, ForceSample& out) {
    out.internal.force[0] += Vec3(0, 0, 5);
    out.force_on_fixed = Vec3(0, 0, -5);
    out.moment_on_fixed = Vec3(0.5, 0, 0);
  };
  s.run(forces, 0.1, 10);
  EXPECT_LE((s.ledger.external_impulse - Vec3(0, 0, 5)).norm(), 1e-14);
  EXPECT_LE((s.ledger.external_angular_impulse - Vec3(-0.5, 0, 0)).norm(), 1e-14);
  EXPECT_EQ(s.ledger.dissipated, 0.0);
  EXPECT_EQ(s.ledger.external_work, 0.0);
}

TEST(Ledger, BooksTheWorkOfDissipativeLoadsExactly) {
  // All loads are dissipative drags here, so every joule lost is booked, to round-off, whatever the step.
  System s;
  s.p.add(Vec3(0, 0, 1));
  s.p.state.velocity[0] = Vec3(1, -2, 0.5);
  s.p.state.angular_momentum[0] = Vec3(0.02, 0.01, -0.03);
  const double start = measure_motion(s.p.set, s.p.state).kinetic_energy;
  const ForceModel forces = [](const ParticleState& state, double, ForceSample& out) {
    out.dissipative.reset(1);
    out.dissipative.force[0] = -0.7 * state.velocity[0];
    out.dissipative.torque[0] = -0.4 * state.angular_momentum[0];
    out.internal.force[0] += out.dissipative.force[0];
    out.internal.torque[0] += out.dissipative.torque[0];
  };
  s.run(forces, 0.05, 20);
  const double lost = start - measure_motion(s.p.set, s.p.state).kinetic_energy;
  EXPECT_GT(lost, 0.3 * start);
  EXPECT_NEAR(s.ledger.dissipated, lost, 1e-14 * start);
}

TEST(Pins, HoldAndBookTheirImpulse) {
  System s = make_moving_spiral();
  s.interactions.gravity = Vec3(0.5, 0, -2);
  s.interactions.friction.push_back({.name = "f", .first = {0, 1}, .second = {1, 2}, .linear = 0.3, .angular = 1e-3});
  s.p.set.pinned[0] = kPinPosition | kPinOrientation;
  s.p.set.pinned[4] = kPinPosition;
  s.p.set.pinned[7] = kPinOrientation;
  for (const std::size_t i : {0U, 4U, 7U}) {
    if (s.p.set.pinned[i] & kPinPosition) s.p.state.velocity[i].setZero();
    if (s.p.set.pinned[i] & kPinOrientation) s.p.state.angular_momentum[i].setZero();
  }
  const ParticleState start = s.p.state;
  const Motion before = measure_motion(s.p.set, start);
  const double energy = s.energy();
  s.run(1e-3, 500);
  EXPECT_EQ(s.p.state.position[0], start.position[0]);
  EXPECT_EQ(s.p.state.orientation[0].coeffs(), start.orientation[0].coeffs());
  EXPECT_EQ(s.p.state.position[4], start.position[4]);
  EXPECT_NE(s.p.state.orientation[4].coeffs(), start.orientation[4].coeffs());
  EXPECT_NE(s.p.state.position[7], start.position[7]);
  EXPECT_EQ(s.p.state.orientation[7].coeffs(), start.orientation[7].coeffs());

  const Motion after = measure_motion(s.p.set, s.p.state);
  const Ledger& ledger = s.ledger;
  EXPECT_GT(ledger.pin_impulse.norm(), 1e-3);
  EXPECT_LE((after.momentum - before.momentum - ledger.external_impulse - ledger.pin_impulse).norm(),
            1e-12 * after.momentum_scale);
  EXPECT_LE((after.angular_momentum - before.angular_momentum - ledger.external_angular_impulse -
             ledger.pin_angular_impulse).norm(),
            1e-12 * (after.angular_momentum_scale + ledger.pin_angular_impulse.norm()));
  // Pins do no work: the energy balance closes as without them.
  EXPECT_NEAR(s.energy(), energy + ledger.external_work - ledger.dissipated, 1e-2 * s.energy());
}

TEST(Planar, KeepsHeightToTheBitAndTurnsAboutTheVerticalOnly) {
  System s = make_moving_spiral();
  s.interactions.gravity = Vec3(0.5, 0, -2);
  s.interactions.friction.push_back({.name = "f", .first = {0, 1}, .second = {1, 2}, .linear = 0.3, .angular = 1e-3});
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    s.p.set.pinned[i] = kPlanar;
    s.p.state.position[i].z() = 0.3;
    s.p.state.velocity[i] = free_translation(kPlanar, s.p.state.velocity[i]);
    s.p.state.angular_momentum[i] = free_rotation(kPlanar, s.p.state.angular_momentum[i]);
  }
  const ParticleState start = s.p.state;
  const Motion before = measure_motion(s.p.set, start);
  const double energy = s.energy();
  s.run(1e-3, 500);
  for (std::size_t i = 0; i < s.p.set.size(); ++i) {
    EXPECT_EQ(s.p.state.position[i].z(), 0.3);
    const Vec3 turn = rotation_log(s.p.state.orientation[i] * start.orientation[i].conjugate());
    EXPECT_LE(turn.head<2>().norm(), 1e-13);
  }
  EXPECT_GT((s.p.state.position[3] - start.position[3]).norm(), 0.01);

  const Motion after = measure_motion(s.p.set, s.p.state);
  const Ledger& ledger = s.ledger;
  double mass = 0.0;
  for (const double m : s.p.set.mass) mass += m;
  EXPECT_NEAR(ledger.pin_impulse.z(), mass * 2.0 * 0.5, 1e-12);  // what gravity pulls into the plane
  EXPECT_LE((after.momentum - before.momentum - ledger.external_impulse - ledger.pin_impulse).norm(),
            1e-12 * (after.momentum_scale + ledger.pin_impulse.norm()));
  EXPECT_LE((after.angular_momentum - before.angular_momentum - ledger.external_angular_impulse -
             ledger.pin_angular_impulse).norm(),
            1e-12 * (after.angular_momentum_scale + ledger.pin_angular_impulse.norm()));
  EXPECT_NEAR(s.energy(), energy + ledger.external_work - ledger.dissipated, 1e-2 * s.energy());
}

TEST(FreeDrift, GivesEachParticleTheBitsThatItHasAlone) {
  // Particles drift by fours where all four turn evenly and slowly: rows with fast, resting, pinned and uneven ones too.
  Draw draw(401);
  System all;
  for (int i = 0; i < 23; ++i) {
    all.p.add(draw.vector(1.0), draw.uniform(0.5, 2.0), draw.uniform(0.5, 2.0));
    all.p.state.velocity.back() = draw.vector(1.0);
    all.p.state.orientation.back() = draw.rotation();
    all.p.state.angular_momentum.back() = draw.vector(i == 9 ? 40.0 : 1.0);
  }
  all.p.state.angular_momentum[13].setZero();
  all.p.set.pinned[16] = kPinPosition;
  all.p.set.inertia[20].x() *= 1.5;
  std::vector<System> alone(23);
  for (std::size_t i = 0; i < alone.size(); ++i) {
    Particles& one = alone[i].p;
    one.add(all.p.state.position[i], all.p.set.mass[i]);
    one.set.inertia[0] = all.p.set.inertia[i];
    one.set.pinned[0] = all.p.set.pinned[i];
    one.state.velocity[0] = all.p.state.velocity[i];
    one.state.orientation[0] = all.p.state.orientation[i];
    one.state.angular_momentum[0] = all.p.state.angular_momentum[i];
    alone[i].run(0.1, 20);
  }
  all.run(0.1, 20);
  for (std::size_t i = 0; i < alone.size(); ++i) {
    EXPECT_EQ(all.p.state.position[i], alone[i].p.state.position[0]) << i;
    EXPECT_EQ(all.p.state.orientation[i].coeffs(), alone[i].p.state.orientation[0].coeffs()) << i;
  }
}

TEST(Kicks, GiveEachParticleTheBitsThatItHasAlone) {
  // Particles are kicked by fours where no load from outside acts: fours with a pinned, a loaded and no odd particle.
  Draw draw(402);
  System all;
  std::vector<double> stiffness;
  std::vector<Vec3> outside(14, Vec3::Zero());
  for (int i = 0; i < 14; ++i) {
    all.p.add(draw.vector(1.0), draw.uniform(0.5, 2.0), draw.uniform(0.5, 2.0));
    all.p.state.velocity.back() = draw.vector(1.0);
    all.p.state.angular_momentum.back() = draw.vector(1.0);
    stiffness.push_back(draw.uniform(0.5, 2.0));
  }
  all.p.set.pinned[2] = kPinPosition;
  outside[9] = Vec3(0.3, -0.2, 0.1);
  const auto forces = [&](std::size_t first) {
    return [&, first](const ParticleState& state, double, ForceSample& out) {
      for (std::size_t i = 0; i < state.size(); ++i) {
        out.internal.force[i] = -stiffness[first + i] * state.position[i];
        out.internal.torque[i] = stiffness[first + i] * Vec3(0.1, 0.2, -0.3).cross(state.position[i]);
        out.external.force[i] = outside[first + i];
        out.external.torque[i] = -outside[first + i];
      }
    };
  };
  std::vector<System> alone(14);
  double external_work = 0.0;
  for (std::size_t i = 0; i < alone.size(); ++i) {
    Particles& one = alone[i].p;
    one.add(all.p.state.position[i], all.p.set.mass[i]);
    one.set.inertia[0] = all.p.set.inertia[i];
    one.set.pinned[0] = all.p.set.pinned[i];
    one.state.velocity[0] = all.p.state.velocity[i];
    one.state.angular_momentum[0] = all.p.state.angular_momentum[i];
    alone[i].run(forces(i), 0.05, 40);
    external_work += alone[i].ledger.external_work;
  }
  all.run(forces(0), 0.05, 40);
  for (std::size_t i = 0; i < alone.size(); ++i) {
    EXPECT_EQ(all.p.state.velocity[i], alone[i].p.state.velocity[0]) << i;
    EXPECT_EQ(all.p.state.angular_momentum[i], alone[i].p.state.angular_momentum[0]) << i;
  }
  EXPECT_EQ(all.ledger.external_impulse, alone[9].ledger.external_impulse);
  EXPECT_EQ(all.ledger.external_work, external_work);
}

TEST(StableStep, IsTheSmallestOfItsLimits) {
  EXPECT_EQ(stable_step({}), std::numeric_limits<double>::infinity());
  EXPECT_DOUBLE_EQ(stable_step({.frequency = 100.0}), 0.003);
  EXPECT_DOUBLE_EQ(stable_step({.frequency = 1.0, .length = 0.2, .speed = 10.0}), 0.002);
  EXPECT_DOUBLE_EQ(stable_step({.frequency = 1.0, .length = 0.2, .speed = 0.1, .angular_speed = 30.0}), 0.01);
  EXPECT_EQ(halvings(0.04, 0.04), 0);
  EXPECT_EQ(halvings(0.04, 0.039), 1);
  EXPECT_EQ(halvings(0.04, 0.0051), 3);
  EXPECT_EQ(halvings(0.04, std::numeric_limits<double>::infinity()), 0);
}

TEST(StableStep, KeepsTheSpiralWithinOnePercentOfItsEnergy) {
  System s = make_moving_spiral();
  const double dt = stable_step({.frequency = largest_frequency(s.p.set, s.p.state, s.interactions)});
  const double start = s.energy();
  double worst = 0.0;
  for (int k = 0; k < 2000; ++k) {
    s.run(dt, 1);
    worst = std::max(worst, std::abs(s.energy() - start));
  }
  EXPECT_LE(worst, 0.01 * start);
}

}  // namespace
}  // namespace supple::core
