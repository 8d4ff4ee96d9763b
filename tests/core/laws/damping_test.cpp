// Friction between particles and the drag of a medium.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "core/support.h"
#include "laws/damping.h"
#include "laws/pair_hessians.h"
#include "supple/core/integrate.h"

namespace supple::core {
namespace {

using test::Draw;
using test::Particles;

const ForceModel kNoForces = [](const ParticleState&, double, ForceSample&) {};

struct Damped {
  Particles p;
  Interactions interactions;
  KickState kick;
  Ledger ledger;
  void step(double dt) { advance({p.set, interactions, kNoForces}, 0.0, dt, {p.state, kick, ledger}); }
  [[nodiscard]] Motion motion() const { return measure_motion(p.set, p.state); }
};

/// Six particles with every pair rubbing; `anisotropic` bodies take the general path.
Damped make_rubbing(bool anisotropic, double linear, double angular, std::uint64_t seed) {
  Draw draw(seed);
  Damped d;
  for (int i = 0; i < 6; ++i) {
    d.p.add(draw.vector(1.0), draw.uniform(0.5, 2.0), draw.uniform(0.2, 0.6));
    if (anisotropic) d.p.set.inertia.back() = Vec3::Constant(0.4) + draw.vector(0.2);
    d.p.state.orientation.back() = draw.rotation();
    d.p.state.velocity.back() = draw.vector(1.0);
    d.p.state.angular_momentum.back() = draw.vector(0.5);
  }
  Friction law{.name = "friction", .first = {}, .second = {}, .linear = linear, .angular = angular};
  test::along_chain(6, 5, [&](std::uint32_t a, std::uint32_t b) {
    law.first.push_back(a);
    law.second.push_back(b);
  });
  d.interactions.friction.push_back(law);
  return d;
}

/// Velocities of a rigid motion of all particles.
void move_rigidly(Particles& p, const Vec3& velocity, const Vec3& spin) {
  for (std::size_t i = 0; i < p.set.size(); ++i) {
    p.state.velocity[i] = velocity + spin.cross(p.state.position[i]);
    const Quat& q = p.state.orientation[i];
    p.state.angular_momentum[i] = q * p.set.inertia[i].cwiseProduct(q.conjugate() * spin);
  }
}

class FrictionBetweenParticles : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Bodies, FrictionBetweenParticles, testing::Values(false, true),
                         [](const auto& bodies) { return bodies.param ? "Anisotropic" : "Isotropic"; });

TEST_P(FrictionBetweenParticles, KeepsMomentumAndBooksExactlyTheEnergyItTakes) {
  for (const double c : {0.1, 10.0, 1e8}) {
    Damped d = make_rubbing(GetParam(), c, 0.2 * c, 61);
    for (int k = 0; k < 20; ++k) {
      // Without motion in between: the drift turns anisotropic bodies, and that conserves energy to O(dt^2) only.
      const double dt = 1e-9;
      const Motion before = d.motion();
      const double taken = d.ledger.dissipated;
      d.step(dt);
      const Motion after = d.motion();
      ASSERT_LE((after.momentum - before.momentum).norm(), 1e-14 * before.momentum_scale);
      ASSERT_LE((after.angular_momentum - before.angular_momentum).norm(), 1e-13 * before.angular_momentum_scale);
      ASSERT_GE(d.ledger.dissipated, taken);
      ASSERT_NEAR(before.kinetic_energy - after.kinetic_energy, d.ledger.dissipated - taken,
                  1e-13 * before.kinetic_energy + 1e-9 * (d.ledger.dissipated - taken));
    }
  }
}

TEST_P(FrictionBetweenParticles, DoesNothingToARigidMotion) {
  Damped d = make_rubbing(GetParam(), 1e3, 1e3, 62);
  move_rigidly(d.p, Vec3(1, -2, 0.5), Vec3(0.3, 0.7, -0.4));
  const ParticleState before = d.p.state;
  d.step(1e-12);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_LE((d.p.state.velocity[i] - before.velocity[i]).norm(), 1e-13);
    EXPECT_LE((d.p.state.angular_momentum[i] - before.angular_momentum[i]).norm(), 1e-13);
  }
  EXPECT_LE(d.ledger.dissipated, 1e-24);
}

TEST_P(FrictionBetweenParticles, TendsToARigidMotionForAnyStep) {
  // Unconditionally stable: the largest coefficient leaves the rigid motion of the same momenta.
  Damped d = make_rubbing(GetParam(), 1e9, 1e9, 63);
  const Motion before = d.motion();
  for (int k = 0; k < 3000; ++k) d.step(1e-7);
  double largest = 0.0;
  for (std::size_t i = 1; i < 6; ++i) {
    const Vec3 relative = angular_velocity(d.p.set, d.p.state, i) - angular_velocity(d.p.set, d.p.state, 0);
    largest = std::max(largest, relative.norm());
  }
  EXPECT_LE(largest, 1e-6);
  EXPECT_LE((d.motion().angular_momentum - before.angular_momentum).norm(), 1e-12 * before.angular_momentum_scale);
  EXPECT_LT(d.motion().kinetic_energy, before.kinetic_energy);
}

TEST_P(FrictionBetweenParticles, HasThePowerOfItsLaw) {
  // -dE/dt = sum c |v_rel|^2 + c_r |omega_rel|^2 as dt -> 0.
  const double c = 0.3, c_r = 0.05;
  Damped d = make_rubbing(GetParam(), c, c_r, 64);
  double power = 0.0;
  const ParticleState& s = d.p.state;
  test::along_chain(6, 5, [&](std::uint32_t a, std::uint32_t b) {
    const Vec3 w_a = angular_velocity(d.p.set, s, a), w_b = angular_velocity(d.p.set, s, b);
    const Vec3 middle = 0.5 * (s.position[a] + s.position[b]);
    const Vec3 u_a = s.velocity[a] + w_a.cross(middle - s.position[a]);
    const Vec3 u = s.velocity[b] + w_b.cross(middle - s.position[b]) - u_a;
    power += c * u.squaredNorm() + c_r * (w_b - w_a).squaredNorm();
  });
  const double dt = 1e-6;
  d.step(dt);
  EXPECT_NEAR(d.ledger.dissipated / dt, power, 1e-4 * power);
}

TEST(Friction, DecaysAsTheExponentialToSecondOrder) {
  // Along the bond u' = -c (1/m_A + 1/m_B) u = -0.75 u.
  const auto error = [](int steps) {
    test::Particles p;
    p.add(Vec3::Zero(), 1.0);
    p.add(Vec3(1, 0, 0), 2.0);
    p.state.velocity[1] = Vec3(0.1, 0, 0);
    Interactions laws;
    laws.friction.push_back({.name = "f", .first = {0}, .second = {1}, .linear = 0.5});
    KickState kick;
    Ledger ledger;
    for (int k = 0; k < steps; ++k) advance({p.set, laws, kNoForces}, 0.0, 1.0 / steps, {p.state, kick, ledger});
    return std::abs(p.state.velocity[1].x() - p.state.velocity[0].x() - 0.1 * std::exp(-0.75));
  };
  const double coarse = error(8), fine = error(16);
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.1);
}

TEST(Friction, GivesTheSameOnTheIsotropicAndTheGeneralPath) {
  Damped isotropic = make_rubbing(false, 5.0, 1.0, 65);
  Damped general = isotropic;
  for (Vec3& inertia : general.p.set.inertia) inertia.x() *= 1.0 + 1e-15;
  isotropic.step(1e-3);
  general.step(1e-3);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_LE((isotropic.p.state.velocity[i] - general.p.state.velocity[i]).norm(), 1e-13);
    EXPECT_LE((isotropic.p.state.angular_momentum[i] - general.p.state.angular_momentum[i]).norm(), 1e-13);
  }
  EXPECT_NEAR(isotropic.ledger.dissipated, general.ledger.dissipated, 1e-13);
}

TEST(MediumDamping, IsTheExactExponentialForAnyStep) {
  for (const double dt : {0.01, 1.0, 10.0}) {
    Damped d;
    d.p.add(Vec3(1, 2, 3), 2.0);
    d.p.set.inertia[0] = Vec3(1, 2, 3);
    d.p.state.velocity[0] = Vec3(1, -1, 2);
    d.p.state.angular_momentum[0] = Vec3(0, 0, 0.3);
    d.interactions.medium.push_back({.object = 0, .linear = 0.7, .angular = 0.4});
    d.step(dt);
    EXPECT_LE((d.p.state.velocity[0] - std::exp(-0.7 * dt) * Vec3(1, -1, 2)).norm(), 1e-15);
    EXPECT_LE((d.p.state.angular_momentum[0] - std::exp(-0.4 * dt) * Vec3(0, 0, 0.3)).norm(), 1e-15);
  }
}

TEST(MediumDamping, BooksItsImpulseAndEnergyAndSparesOtherObjects) {
  Damped d = make_rubbing(false, 0.0, 0.0, 66);
  d.p.set.object[2] = 1;
  d.interactions.medium.push_back({.object = 0, .linear = 3.0, .angular = 2.0});
  const Vec3 untouched = d.p.state.velocity[2];
  const Motion before = d.motion();
  for (int k = 0; k < 100; ++k) d.step(0.01);
  const Motion after = d.motion();
  EXPECT_EQ(d.p.state.velocity[2], untouched);
  EXPECT_LE((after.momentum - before.momentum - d.ledger.external_impulse).norm(), 1e-14 * before.momentum_scale);
  EXPECT_LE((after.angular_momentum - before.angular_momentum - d.ledger.external_angular_impulse).norm(),
            1e-13 * before.angular_momentum_scale);
  EXPECT_NEAR(before.kinetic_energy - after.kinetic_energy, d.ledger.dissipated, 1e-13 * before.kinetic_energy);
}

/// Six anisotropic particles, every pair bonded and away from rest, that move at random.
Damped make_prestressed(double time, std::uint64_t seed) {
  Damped d = make_rubbing(true, 0.0, 0.0, seed);
  d.interactions.friction.clear();
  d.interactions.bond_frame.push_back(test::bond_frames(d.p, 30.0, 4.0, 5));
  d.interactions.coplanarity.push_back(test::coplanarities(d.p, 2.0, 5));
  Draw draw(seed + 1);
  for (Vec3& x : d.p.state.position) x += draw.vector(0.2);
  d.interactions.stiffness_damping.push_back({.object = 0, .time = time});
  return d;
}

using Mat12 = Eigen::Matrix<double, 12, 12>;
using Vec12 = Eigen::Matrix<double, 12, 1>;

/// Two bonded particles away from rest, that move at random, without and with pins.
Damped make_pair(std::uint64_t seed, std::uint8_t pinned) {
  Draw draw(seed);
  Damped d;
  for (int i = 0; i < 2; ++i) {
    d.p.add(draw.vector(1.0), draw.uniform(0.5, 2.0), 0.4);
    d.p.set.inertia.back() = Vec3::Constant(0.4) + draw.vector(0.2);
    d.p.state.orientation.back() = draw.rotation();
  }
  d.interactions.bond_frame.push_back(test::bond_frames(d.p, 30.0, 4.0, 1));
  for (std::size_t i = 0; i < 2; ++i) {
    d.p.state.position[i] += draw.vector(0.2);
    d.p.state.velocity[i] = draw.vector(1.0);
    d.p.state.angular_momentum[i] = draw.vector(0.5);
  }
  d.p.set.pinned[1] = pinned;
  d.interactions.stiffness_damping.push_back({.object = 0, .time = 1.0});
  return d;
}

/// time P^T K P, P the projector along the rigid motions of the pair, turns weighted by its length.
Mat12 projected(const Damped& d) {
  const Vec3 r = d.p.state.position[1] - d.p.state.position[0];
  Mat12 k = Mat12::Zero();
  for_each_hessian(d.p.set, d.p.state, d.interactions, HessianKind::PositiveSemiDefinite,
                   [&](std::uint32_t, std::uint32_t, const PairHessian& h) { k += h; });
  Eigen::Matrix<double, 12, 6> rigid = Eigen::Matrix<double, 12, 6>::Zero();
  for (const int row : {0, 6}) rigid.block<3, 3>(row, 0).setIdentity();
  for (const int row : {3, 9}) rigid.block<3, 3>(row, 3).setIdentity();
  rigid.block<3, 3>(6, 3) << 0.0, r.z(), -r.y(), -r.z(), 0.0, r.x(), r.y(), -r.x(), 0.0;
  Vec12 weight = Vec12::Ones();
  weight.segment<3>(3).setConstant(r.squaredNorm());
  weight.segment<3>(9).setConstant(r.squaredNorm());
  const Eigen::Matrix<double, 6, 12> weighted = rigid.transpose() * weight.asDiagonal();
  const Mat12 keep = Mat12::Identity() - rigid * (weighted * rigid).inverse() * weighted;
  return d.interactions.stiffness_damping.front().time * keep.transpose() * k * keep;
}

TEST(StiffnessDamping, IsTheStiffnessWithoutTheRigidMotions) {
  for (std::uint64_t seed = 80; seed < 90; ++seed) {
    const Damped d = make_pair(seed, 0);
    const Mat12 expected = projected(d);
    Mat12 found = Mat12::Zero();
    for_each_damping(d.p.set, d.p.state, d.interactions, [&](std::uint32_t, std::uint32_t, const PairHessian& h) { found += h; });
    EXPECT_LT((found - expected).norm(), 1e-13 * expected.norm());
  }
}

TEST(StiffnessDamping, TakesTheVelocitiesOfAPairAsTwelveUnknownsDo) {
  for (std::uint64_t seed = 90; seed < 110; ++seed) {
    const bool pinned = seed % 2 == 1;
    Damped d = make_pair(seed, pinned ? std::uint8_t{kPinPosition | kPinOrientation} : std::uint8_t{0});
    const double h = seed % 3 == 0 ? 100.0 : 0.05;  // far longer and shorter than the pair is damped in
    // y' = -Z y / h in y = M^(1/2) v by (1 + Z + Z^2 / 2)^-1.
    Mat12 light = Mat12::Zero();
    Vec12 motion;
    for (std::size_t i = 0; i < 2; ++i) {
      const auto at = static_cast<Eigen::Index>(6 * i);
      motion.segment<3>(at) = d.p.state.velocity[i];
      motion.segment<3>(at + 3) = angular_velocity(d.p.set, d.p.state, i);
      if (d.p.set.pinned[i] != 0) continue;
      const Mat3 q = d.p.state.orientation[i].toRotationMatrix();
      light.block<3, 3>(at, at) = Mat3::Identity() / std::sqrt(d.p.set.mass[i]);
      light.block<3, 3>(at + 3, at + 3) = q * d.p.set.inertia[i].cwiseSqrt().cwiseInverse().asDiagonal() * q.transpose();
    }
    const Mat12 z = h * light * projected(d) * light;
    Vec12 free = motion;
    if (pinned) free.tail<6>().setZero();
    Mat12 heavy = Mat12::Zero();
    for (const int row : {0, 6}) {
      if (row == 6 && pinned) continue;
      heavy.block<3, 3>(row, row) = light.block<3, 3>(row, row).inverse();
      heavy.block<3, 3>(row + 3, row + 3) = light.block<3, 3>(row + 3, row + 3).inverse();
    }
    const Vec12 led = motion - free;
    const Vec12 push = -h * light * projected(d) * led, before = heavy * free;
    const Mat12 one = Mat12::Identity();
    const Vec12 after = (one + z + 0.5 * z * z).inverse() * (before + 0.5 * z * before + 0.5 * (push + z * push));
    const Vec12 impulse = -h * projected(d) * (light * after + led);
    const Vec12 expected = motion + light * light * impulse;
    const double rounding = 1e-15 * (1.0 + z.squaredNorm());  // of the sum 1 + Z + Z^2 / 2
    apply_stiffness_damping(d.p.set, d.interactions, h, PairOrder::Forward, d.p.state, d.ledger);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto at = static_cast<Eigen::Index>(6 * i);
      EXPECT_LT((d.p.state.velocity[i] - expected.segment<3>(at)).norm(), rounding) << seed;
      EXPECT_LT((angular_velocity(d.p.set, d.p.state, i) - expected.segment<3>(at + 3)).norm(), rounding) << seed;
    }
  }
}

TEST(StiffnessDamping, KeepsMomentumAndBooksExactlyTheEnergyItTakes) {
  for (const double time : {0.1, 1e8}) {
    Damped d = make_prestressed(time, 71);
    for (int k = 0; k < 10; ++k) {
      const Motion before = d.motion();
      const double taken = d.ledger.dissipated;
      d.step(1e-9);
      const Motion after = d.motion();
      ASSERT_LE((after.momentum - before.momentum).norm(), 1e-14 * before.momentum_scale);
      ASSERT_LE((after.angular_momentum - before.angular_momentum).norm(), 1e-13 * before.angular_momentum_scale);
      ASSERT_GE(d.ledger.dissipated, taken - 1e-14 * taken);
      ASSERT_NEAR(before.kinetic_energy - after.kinetic_energy, d.ledger.dissipated - taken,
                  1e-12 * before.kinetic_energy + 1e-8 * (d.ledger.dissipated - taken));
    }
  }
}

TEST(StiffnessDamping, DoesNothingToARigidMotionAwayFromRest) {
  Damped d = make_prestressed(1.0, 72);
  move_rigidly(d.p, Vec3(1, -2, 0.5), Vec3(0.3, 0.7, -0.4));
  const ParticleState before = d.p.state;
  d.step(1e-12);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_LE((d.p.state.velocity[i] - before.velocity[i]).norm(), 1e-11);
    EXPECT_LE((d.p.state.angular_momentum[i] - before.angular_momentum[i]).norm(), 1e-11);
  }
}

TEST(StiffnessDamping, SparesPinsAndOtherObjects) {
  Damped d = make_prestressed(0.5, 73);
  d.p.set.object[2] = 1;
  d.p.set.pinned[4] = kPinPosition | kPinOrientation;
  const Vec3 untouched = d.p.state.velocity[2];
  const double start = d.motion().kinetic_energy;
  for (int k = 0; k < 3; ++k) d.step(1e-6);
  EXPECT_LE((d.p.state.velocity[2] - untouched).norm(), 1e-15);
  EXPECT_EQ(d.p.state.velocity[4], Vec3::Zero());
  EXPECT_LT(d.motion().kinetic_energy, start);
  EXPECT_GT(d.ledger.pin_impulse.norm(), 0.0);
}

TEST(StiffnessDamping, GivesABondTheRatioOfItsFrequency) {
  // U = |r|^2 / 2 between masses 1: omega^2 = 2, ratio beta omega / 2, r = exp(-omega^2 beta t / 2) cos(omega_d t) + ...
  const double beta = 0.1, omega2 = 2.0, decay = 0.5 * beta * omega2, omega_d = std::sqrt(omega2 - decay * decay);
  const auto error = [&](double dt) {
    Damped d;
    d.p.add(Vec3(-0.5, 0, 0));
    d.p.add(Vec3(0.5, 0, 0));
    d.interactions.form_radius.push_back({"spring", {0}, {1}, {{.strength = 0.5, .radius = 0.0, .weight = {}}}});
    d.interactions.stiffness_damping.push_back({.object = 0, .time = beta});
    const Executor executor(1);
    InteractionWorkspace pairs(d.p.set, d.interactions);
    const ForceModel forces = [&](const ParticleState& state, double t, ForceSample& out) {
      accumulate_interactions(d.p.set, state, d.interactions, executor, pairs, out.internal);
      add_external_loads(d.p.set, d.interactions, t, out.external);
    };
    const double end = 2.0;
    const int steps = static_cast<int>(std::lround(end / dt));
    for (int k = 0; k < steps; ++k) advance({d.p.set, d.interactions, forces}, 0.0, dt, {d.p.state, d.kick, d.ledger});
    const double exact =
        std::exp(-decay * end) * (std::cos(omega_d * end) + decay / omega_d * std::sin(omega_d * end));
    return std::abs(d.p.state.position[1].x() - d.p.state.position[0].x() - exact);
  };
  EXPECT_LT(error(0.01), 1e-4);
  EXPECT_NEAR(std::log2(error(0.02) / error(0.01)), 2.0, 0.05);
}

}  // namespace
}  // namespace supple::core
