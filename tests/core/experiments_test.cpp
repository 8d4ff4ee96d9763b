// Experiments on whole structures: the bending of a cantilever and the energy of a long free run.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/support.h"
#include "supple/core/integrators.h"

namespace supple::core {
namespace {

/// Tip deflection of a clamped chain of `bonds` bonds of total length 1 under a transverse tip force, come to rest.
/// Form of strength EI L / 2 makes a beam of bending stiffness EI = 1. It leaves stretch and shear free: a bond frame
/// without torsion spring holds them, of shear stiffness GA = k_s L.
double tip_deflection(int bonds, double force, double shear_stiffness) {
  const double spacing = 1.0 / bonds;
  test::Particles p;
  for (int i = 0; i <= bonds; ++i) p.add(Vec3(i * spacing, 0, 0), spacing, spacing * spacing * spacing);
  p.set.pinned[0] = kPinPosition | kPinOrientation;
  Interactions interactions;
  BondedLaw<Form> form{.name = "form", .first = {}, .second = {}, .law = {}};
  test::along_chain(p.set.size(), 1, [&](std::uint32_t a, std::uint32_t b) {
    form.first.push_back(a);
    form.second.push_back(b);
    form.law.push_back({.strength = 0.5 * spacing, .curvature = 0.0, .weight = {}});
  });
  interactions.form.push_back(form);
  interactions.bond_frame.push_back(test::bond_frames(p, shear_stiffness / spacing, 0.0, 1));
  interactions.external.push_back({.particle = static_cast<std::uint32_t>(bonds), .force = Vec3(0, 0, force),
                                   .end = std::numeric_limits<double>::infinity()});

  // Steps of backward Euler far longer than any period are Newton's method for the static pose.
  const Executor executor(1);
  InteractionWorkspace pairs(p.set, interactions);
  const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
    accumulate_interactions(p.set, state, interactions, executor, pairs, out.internal);
    add_external_loads(p.set, interactions, t, out.external);
  };
  const IntegratorSettings settings{.method = Integrator::BackwardEuler, .tolerance = 1e-12};
  IntegratorWorkspace workspace;
  KickState kick;
  Ledger ledger;
  double before = -1.0;
  for (int k = 0; k < 40 && std::abs(p.state.position.back().z() - before) > 1e-9 * std::abs(before); ++k) {
    before = p.state.position.back().z();
    const StepReport report =
        advance(settings, {p.set, interactions, forces}, 10.0 * k, 10.0, {p.state, kick, ledger}, {executor, pairs, workspace});
    EXPECT_TRUE(report.within_tolerance) << bonds << " bonds, step " << k;
    for (Vec3& v : p.state.velocity) v.setZero();
    for (Vec3& l : p.state.angular_momentum) l.setZero();
  }
  return p.state.position.back().z();
}

TEST(Cantilever, BendsLikeTheBeamThatFormIsEquivalentTo) {
  // Timoshenko: w = F / (3 EI) + F / GA. Shear across a bent bond adds GA L^2 / 4 to EI: the error of the chain, .12 %
  // for 80 bonds. The load is small: geometric nonlinearity changes w by about its square, 1e-7.
  const double force = 1e-3, shear = 30.0;
  const double exact = force / 3.0 + force / shear;
  std::array<double, 4> error{};
  for (std::size_t k = 0; k < error.size(); ++k) {
    error[k] = std::abs(tip_deflection(10 << k, force, shear) / exact - 1.0);
    RecordProperty("relative_error_" + std::to_string(10 << k), std::to_string(error[k]));
  }
  for (std::size_t k = 0; k + 1 < error.size(); ++k) EXPECT_NEAR(std::log2(error[k] / error[k + 1]), 2.0, 0.1) << k;
  EXPECT_LT(error.back(), 2e-3);
}

/// Energy over area of form between a particle and its six neighbours in a hexagonal sheet of spacing L, bent from flat
/// to z = -(k_1 x^2 + k_2 y^2) / 2; the lattice is turned by `angle`.
double bending_energy_density(double strength, double spacing, double k_1, double k_2, double angle) {
  const auto pose = [&](double x, double y) {
    return std::pair(Vec3(x, y, -0.5 * (k_1 * x * x + k_2 * y * y)), Vec3(k_1 * x, k_2 * y, 1.0).normalized());
  };
  const Form form{.strength = strength, .curvature = 0.0, .weight = {}};
  double energy = 0.0;
  for (int k = 0; k < 6; ++k) {
    const double direction = angle + k * std::numbers::pi / 3.0;
    const auto [x, n] = pose(spacing * std::cos(direction), spacing * std::sin(direction));
    energy += 0.5 * evaluate(form, PairPose{.r = x, .normal_a = Vec3::UnitZ(), .normal_b = n}).energy;  // half is its own
  }
  return energy / (0.5 * std::sqrt(3.0) * spacing * spacing);
}

TEST(Sheet, BendsLikeThePlateThatFormIsEquivalentTo) {
  // Kirchhoff's plate with D = 2 sqrt(3) k / L^2 and no Poisson effect, D (k_1^2 + k_2^2) / 2, in every direction.
  constexpr double kStrength = 0.7;
  for (const auto& [k_1, k_2] : {std::pair{1.0, 0.0}, std::pair{1.0, 1.0}, std::pair{1.0, -1.0}, std::pair{0.4, -0.9}}) {
    for (const double angle : {0.0, 0.2, 0.5}) {
      std::array<double, 4> error{};
      for (std::size_t n = 0; n < error.size(); ++n) {
        const double spacing = 0.2 / static_cast<double>(1 << n);
        const double plate = std::sqrt(3.0) * kStrength / (spacing * spacing) * (k_1 * k_1 + k_2 * k_2);
        error[n] = std::abs(bending_energy_density(kStrength, spacing, k_1, k_2, angle) / plate - 1.0);
      }
      // The slopes differ from the arcs by a quarter of (L k)^2 or so.
      EXPECT_LT(error.back(), 1e-3) << k_1 << ' ' << k_2 << ' ' << angle;
      for (std::size_t n = 0; n + 1 < error.size(); ++n) {
        EXPECT_NEAR(std::log2(error[n] / error[n + 1]), 2.0, 0.1) << k_1 << ' ' << k_2 << ' ' << angle;
      }
    }
  }
}

TEST(FreeSpiral, KeepsItsEnergyOverAMillionSteps) {
  test::Particles p = test::make_spiral();
  Interactions interactions;
  interactions.bond_frame.push_back(test::bond_frames(p, 40.0, 0.5));
  test::Draw draw(7);
  for (std::size_t i = 0; i < p.set.size(); ++i) {
    p.state.velocity[i] = draw.vector(0.05);
    p.state.angular_momentum[i] = draw.vector(1e-4);
  }
  const Executor executor(1);
  InteractionWorkspace pairs(p.set, interactions);
  const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
    accumulate_interactions(p.set, state, interactions, executor, pairs, out.internal);
    add_external_loads(p.set, interactions, t, out.external);
  };
  KickState kick;
  Ledger ledger;
  const double dt = 1e-4;  // omega dt = .04: the energy swings by about 1e-4 of itself
  const auto mean_energy = [&](int steps) {
    double sum = 0.0;
    for (int k = 0; k < steps; ++k) {
      advance({p.set, interactions, forces}, 0.0, dt, {p.state, kick, ledger});
      if (k % 10 == 0) {
        sum += measure_motion(p.set, p.state).kinetic_energy + potential_energy(p.set, p.state, interactions);
      }
    }
    return sum / std::max(steps / 10, 1);
  };
#ifdef NDEBUG
  constexpr int kMiddle = 800000;
#else
  constexpr int kMiddle = 0;  // a debug build takes a minute for all of them
#endif
  const double early = mean_energy(100000);
  mean_energy(kMiddle);
  const double late = mean_energy(100000);
  RecordProperty("relative_drift", std::to_string(late / early - 1.0));
  EXPECT_LT(std::abs(late / early - 1.0), 1e-6);
}

}  // namespace
}  // namespace supple::core
