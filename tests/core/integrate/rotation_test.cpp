// Rotations of free rigid bodies. Dullweber, Leimkuhler & McLachlan 1997; Reich & McLachlan: axis splitting.
#include <gtest/gtest.h>

#include <cmath>

#include "core/support.h"
#include "supple/core/integrate.h"

namespace supple::core {
namespace {

using test::Draw;

Vec3 body_spin(const Quat& q, const Vec3& momentum, const Vec3& inertia) {
  return (q.conjugate() * momentum).cwiseQuotient(inertia);
}

struct Top {
  Vec3 inertia;
  Vec3 spin;
  /// Orientation after `time` in steps of h, starting at the identity.
  [[nodiscard]] Quat at(double time, double h) const {
    Quat q = Quat::Identity();
    const Vec3 momentum = inertia.cwiseProduct(spin);
    const auto steps = static_cast<int>(std::lround(time / h));
    for (int k = 0; k < steps; ++k) rotate_free(q, momentum, inertia, h);
    return q;
  }
};
const Top kAsymmetric{{1, 2, 3}, {0.1, 1.0, 0.1}};

TEST(RotationExponential, HasItsPrintedValue) {
  const Quat q = rotation_exp(Vec3(0.1, 0.2, 0.3));
  EXPECT_NEAR(q.w(), 0.9825509821552590, 2e-16);
  EXPECT_NEAR(q.x(), 0.0497088433248595, 2e-16);
  EXPECT_NEAR(q.y(), 0.0994176866497190, 2e-16);
  EXPECT_NEAR(q.z(), 0.1491265299745784, 2e-16);
}

TEST(RotationExponential, IsUnitAndMatchesItsFormulaOnBothSidesOfTheSeries) {
  Draw draw(41);
  for (const double angle : {1e-9, 1e-3, 0.3, 0.4999999, 0.5000001, 1.0, 3.0, 6.0}) {
    const Vec3 axis = draw.direction();
    const Quat q = rotation_exp(angle * axis);
    EXPECT_NEAR(q.norm(), 1.0, 3e-16);
    EXPECT_NEAR(q.w(), std::cos(0.5 * angle), 5e-16);  // the rounding of |angle axis|^2, times 3
    EXPECT_LE((q.vec() - std::sin(0.5 * angle) * axis).norm(), 5e-16);
  }
}

TEST(RotationLogarithm, UndoesTheExponential) {
  Draw draw(42);
  for (const double angle : {0.0, 1e-12, 1e-8, 1e-5, 0.1, 1.0, 3.0, 3.1415926}) {
    const Vec3 rotation = angle * draw.direction();
    EXPECT_LE((rotation_log(rotation_exp(rotation)) - rotation).norm(), 1e-15 * (1.0 + angle)) << angle;
    Quat negative = rotation_exp(rotation);
    negative.coeffs() *= -1.0;
    EXPECT_LE((rotation_log(negative) - rotation).norm(), 1e-15 * (1.0 + angle)) << angle;
  }
}

TEST(FreeRotation, OfAnIsotropicBodyIsOneExactExponential) {
  Draw draw(43);
  const Vec3 inertia = Vec3::Constant(0.4);
  const Vec3 momentum = draw.vector(1.0);
  const Quat start = draw.rotation();
  Quat once = start, often = start;
  rotate_free(once, momentum, inertia, 0.7);
  for (int k = 0; k < 100; ++k) rotate_free(often, momentum, inertia, 0.007);
  EXPECT_LE((once.coeffs() - often.coeffs()).norm(), 1e-14);
}

TEST(FreeRotation, FollowsTheSymmetricTopToSecondOrder) {
  // I = (2, 2, 1), omega_0 = (.5, 0, 1): omega_body = (.5 cos t/2, -.5 sin t/2, 1).
  const Top top{{2, 2, 1}, {0.5, 0.0, 1.0}};
  const Vec3 momentum = top.inertia.cwiseProduct(top.spin);
  const double time = 10.0;
  const Vec3 exact(0.5 * std::cos(0.5 * time), -0.5 * std::sin(0.5 * time), 1.0);
  const auto error = [&](double h) { return (body_spin(top.at(time, h), momentum, top.inertia) - exact).norm(); };
  EXPECT_LT(error(0.1), 5e-3);
  EXPECT_NEAR(error(0.1) / error(0.05), 4.0, 0.1);
  EXPECT_NEAR(error(0.05) / error(0.025), 4.0, 0.05);
}

TEST(FreeRotation, FollowsTheAsymmetricTop) {
  // The error falls as h^2 from 5.4e-4 at h = .05 (next test): 2.2e-7 at h = .001.
  const double h = 1e-3;
  Quat q = kAsymmetric.at(10.0, h);
  if (q.w() * 0.01071311 < 0.0) q.coeffs() *= -1.0;
  EXPECT_NEAR(q.w(), 0.01071311, 3e-7);
  EXPECT_NEAR(q.x(), 0.17970945, 3e-7);
  EXPECT_NEAR(q.y(), -0.08901799, 3e-7);
  EXPECT_NEAR(q.z(), -0.97962520, 3e-7);
  const Vec3 spin = body_spin(q, kAsymmetric.inertia.cwiseProduct(kAsymmetric.spin), kAsymmetric.inertia);
  EXPECT_LE((spin - Vec3(-0.30454332, -0.95773345, 0.19386132)).norm(), 1e-6);
}

TEST(FreeRotation, FlipsTheAsymmetricTopInItsPeriod) {
  const Vec3 momentum = kAsymmetric.inertia.cwiseProduct(kAsymmetric.spin);
  const double h = 1e-3;
  Quat q = Quat::Identity();
  double before = kAsymmetric.spin.y();
  std::vector<double> zeros;
  for (int k = 1; k <= 25000; ++k) {
    rotate_free(q, momentum, kAsymmetric.inertia, h);
    const double now = body_spin(q, momentum, kAsymmetric.inertia).y();
    if (before * now < 0.0) zeros.push_back(h * (k - 1 + before / (before - now)));
    before = now;
  }
  // omega_2 vanishes twice a period. Its phase error grows like h^2 t: 2e-7 t.
  ASSERT_GE(zeros.size(), 2U);
  EXPECT_NEAR(zeros[0], 6.885703083, 1e-5);
  EXPECT_NEAR(2.0 * (zeros[1] - zeros[0]), 22.996262944, 2e-5);
}

TEST(FreeRotation, HasTheStatedErrorAndKeepsItsNormAndEnergy) {
  const Vec3 momentum = kAsymmetric.inertia.cwiseProduct(kAsymmetric.spin);
  const Mat3 exact = kAsymmetric.at(10.0, 1e-4).toRotationMatrix();
  const auto error = [&](double h) { return (kAsymmetric.at(10.0, h).toRotationMatrix() - exact).norm(); };
  EXPECT_NEAR(error(0.1), 2.2e-3, 5e-5);
  EXPECT_NEAR(error(0.05), 5.4e-4, 5e-6);
  EXPECT_NEAR(error(0.025), 1.4e-4, 5e-6);

  Quat q = Quat::Identity();
  double worst_norm = 0.0, worst_energy = 0.0, energy_early = 0.0;
  for (int k = 0; k < 20000; ++k) {
    rotate_free(q, momentum, kAsymmetric.inertia, 0.05);
    worst_norm = std::max(worst_norm, std::abs(q.norm() - 1.0));
    const double energy = 0.5 * momentum.dot(q * body_spin(q, momentum, kAsymmetric.inertia));
    worst_energy = std::max(worst_energy, std::abs(energy - 1.02));
    if (k == 1000) energy_early = worst_energy;
  }
  EXPECT_LE(worst_norm, 1e-15);
  // Symplectic: the energy error oscillates and does not grow.
  EXPECT_LE(worst_energy, 1.05 * energy_early);
  EXPECT_LE(worst_energy, 1e-3);
}

TEST(FreeRotation, IsReversible) {
  Draw draw(44);
  for (int k = 0; k < 20; ++k) {
    const Vec3 inertia(draw.uniform(1, 3), draw.uniform(1, 3), draw.uniform(1, 3));
    const Vec3 momentum = draw.vector(2.0);
    const Quat start = draw.rotation();
    Quat q = start;
    rotate_free(q, momentum, inertia, 0.3);
    rotate_free(q, momentum, inertia, -0.3);
    EXPECT_LE((q.coeffs() - start.coeffs()).norm(), 1e-15);
  }
}

}  // namespace
}  // namespace supple::core
