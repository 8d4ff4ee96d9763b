// Every pair law is the full gradient of an invariant energy. Szeliski & Tonnesen 1992; Lombardo & Puech 1995, sec. 4.
#include "supple/core/pair_laws.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/support.h"
#include "core/two_bodies.h"

namespace supple::core {
namespace {

using test::Draw;
using test::energy;
using test::expect_gradient;
using test::expect_no_moment;
using test::for_each_law;
using test::turn_about;
using test::TwoBodies;

TEST(PairLaws, AreTheGradientOfTheirEnergy) {
  Draw draw(11);
  for (int k = 0; k < 20; ++k) {
    const TwoBodies at = TwoBodies::random(draw);
    for_each_law(draw, [&](const auto& law, const char* name) { expect_gradient(law, at, name); });
  }
}

TEST(PairLaws, GiveNoForceAndNoMomentToThePair) {
  Draw draw(12);
  for (int k = 0; k < 200; ++k) {
    const TwoBodies at = TwoBodies::random(draw);
    for_each_law(draw, [&](const auto& law, const char* name) { expect_no_moment(law, at, name); });
  }
}

TEST(PairLaws, TurnWithThePair) {
  Draw draw(13);
  for (int k = 0; k < 20; ++k) {
    const TwoBodies at = TwoBodies::random(draw);
    const Quat turn = draw.rotation();
    TwoBodies turned = at;
    turned.x_a = turn * at.x_a;
    turned.x_b = turn * at.x_b;
    turned.q_a = turn * at.q_a;
    turned.q_b = turn * at.q_b;
    for_each_law(draw, [&](const auto& law, const char* name) {
      const PairLoad here = evaluate(law, at.pose());
      const PairLoad there = evaluate(law, turned.pose());
      EXPECT_NEAR(here.energy, there.energy, 1e-13 * (1.0 + here.energy)) << name;
      EXPECT_LE((turn * here.force_b - there.force_b).norm(), 1e-13 * (1.0 + here.force_b.norm())) << name;
      EXPECT_LE((turn * here.torque_a - there.torque_a).norm(), 1e-13 * (1.0 + here.torque_a.norm())) << name;
    });
  }
}

TEST(WeightFunction, HasItsPrintedValues) {
  const Weight weight{.range = 2.0};
  EXPECT_DOUBLE_EQ(weight.at(1.0).psi, 0.421875);
  EXPECT_DOUBLE_EQ(weight.at(1.0).slope, -0.84375);
  EXPECT_DOUBLE_EQ(weight.at(1.0).second, 0.28125);
  EXPECT_EQ(weight.at(2.0).psi, 0.0);
  EXPECT_EQ(weight.at(2.0).slope, 0.0);
  EXPECT_EQ(weight.at(3.0).psi, 0.0);
  EXPECT_EQ(Weight{}.at(1e9).psi, 1.0);
}

TEST(CoplanarityLaw, HasItsPrintedValues) {
  // Both directions are counted: with n_B across r only the one emitted by A remains.
  const PairPose pose{.r = Vec3(1, 0, 1), .normal_a = Vec3::UnitZ(), .normal_b = Vec3::UnitY()};
  const PairLoad load = evaluate(Coplanarity{.strength = 1.0, .weight = {}}, pose);
  EXPECT_LE((load.force_b - Vec3(0, 0, -2)).norm(), 1e-15);
  EXPECT_LE((load.torque_a - Vec3(0, -2, 0)).norm(), 1e-15);
  EXPECT_LE(load.torque_b.norm(), 1e-15);
  EXPECT_DOUBLE_EQ(load.energy, 1.0);
}

TEST(CoNormalityLaw, HasItsPrintedValues) {
  const PairPose pose{
      .r = Vec3(1, 0, 1), .normal_a = Vec3::UnitZ(), .normal_b = Vec3(std::sin(0.5), 0, std::cos(0.5))};
  const PairLoad load = evaluate(CoNormality{.strength = 1.0, .weight = {}}, pose);
  EXPECT_LE((load.torque_a - Vec3(0, 0.9588510772, 0)).norm(), 1e-10);
  EXPECT_EQ(load.torque_b, -load.torque_a);
  EXPECT_EQ(load.force_b.norm(), 0.0);
  EXPECT_NEAR(load.energy, 0.2448348762, 1e-10);
}

TEST(CoCircularityLaw, HasItsPrintedValues) {
  const PairPose pose{.r = Vec3(1, 0, 1), .normal_a = Vec3::UnitZ(), .normal_b = Vec3::UnitZ()};
  const PairLoad load = evaluate(CoCircularity{.strength = 1.0, .weight = {}}, pose);
  EXPECT_LE((load.force_b - Vec3(0, 0, -8)).norm(), 1e-15);
  EXPECT_LE((load.torque_a - Vec3(0, -4, 0)).norm(), 1e-15);
  EXPECT_LE((load.torque_b - Vec3(0, -4, 0)).norm(), 1e-15);
  EXPECT_DOUBLE_EQ(load.energy, 4.0);
}

TEST(CoCircularityLaw, IsAtRestOnEverySphere) {
  Draw draw(17);
  for (int k = 0; k < 50; ++k) {
    const Vec3 n_a = draw.direction(), n_b = draw.direction();
    const PairPose pose{.r = draw.uniform(0.5, 2.0) * (n_b - n_a), .normal_a = n_a, .normal_b = n_b};
    const PairLoad load = evaluate(CoCircularity{.strength = 1.0, .weight = {}}, pose);
    EXPECT_LE(load.force_b.norm() + load.torque_a.norm() + load.torque_b.norm(), 1e-14);  // roundings of c, times 2 |r|
  }
}

TEST(NormalisedLaws, DoNotDependOnScale) {
  Draw draw(18);
  for (int k = 0; k < 20; ++k) {
    const TwoBodies at = TwoBodies::random(draw);
    PairPose large = at.pose();
    large.r *= 4.0;
    const auto check = [&](const auto& law) {
      const PairLoad here = evaluate(law, at.pose()), there = evaluate(law, large);
      EXPECT_NEAR(here.energy, there.energy, 1e-15 * (1.0 + here.energy));
      EXPECT_LE((here.torque_a - there.torque_a).norm(), 1e-15 * (1.0 + here.energy));
      EXPECT_LE((here.force_b - 4.0 * there.force_b).norm(), 2e-15 * (1.0 + here.force_b.norm()));
    };
    check(NormalisedCoplanarity{.strength = 1.0, .weight = {}});
    check(NormalisedCoCircularity{.strength = 1.0, .weight = {}});
  }
}

TEST(FormLaw, HasItsPrintedValues) {
  const PairPose pose{.r = Vec3::UnitX(), .normal_a = Vec3::UnitZ(), .normal_b = Vec3::UnitZ()};
  const PairLoad load = evaluate(FormRadius{.strength = 1.0, .radius = 2.0, .weight = {}}, pose);
  EXPECT_DOUBLE_EQ(load.energy, 1.0);
  EXPECT_LE((load.force_b - Vec3(-2, 0, 0)).norm(), 1e-15);
  EXPECT_LE((load.torque_a - Vec3(0, -4, 0)).norm(), 1e-15);
  EXPECT_LE((load.torque_b - Vec3(0, 4, 0)).norm(), 1e-15);
}

TEST(FormLaw, CountsTheSlopeOfItsWeight) {
  // psi = (1 - d^2/4)^3: the spring pulls with 0.84375 and the slope of psi pushes with as much.
  const PairPose pose{.r = Vec3::UnitX(), .normal_a = Vec3::UnitZ(), .normal_b = Vec3::UnitZ()};
  const PairLoad load = evaluate(FormRadius{.strength = 1.0, .radius = 2.0, .weight = {.range = 2.0}}, pose);
  EXPECT_LE(load.force_b.norm(), 1e-15);
  EXPECT_LE((load.torque_a - Vec3(0, -1.6875, 0)).norm(), 1e-15);
  EXPECT_DOUBLE_EQ(load.energy, 0.421875);
}

TEST(FormLaw, IsAtRestOnASphere) {
  Draw draw(14);
  for (int k = 0; k < 50; ++k) {
    const double radius = draw.uniform(0.3, 3.0);
    const Vec3 n_a = draw.direction(), n_b = draw.direction();
    const PairPose pose{.r = radius * (n_b - n_a), .normal_a = n_a, .normal_b = n_b};
    if (pose.r.norm() < 0.1) continue;
    const double curvature = Form::fit_curvature(pose.r, n_a, n_b);
    EXPECT_NEAR(curvature * radius, 1.0, 1e-13);
    for (const double range : {0.0, 9.0}) {
      const Weight weight{.range = range};
      const FormRadius by_radius{.strength = 1.0, .radius = radius, .weight = weight};
      const Form by_curvature{.strength = 1.0, .curvature = 1.0 / radius, .weight = weight};
      for (const PairLoad& load : {evaluate(by_radius, pose), evaluate(by_curvature, pose)}) {
        // The rest deviation is a rounding error of r; its loads are the stiffness (up to 2 R^2, 2 / d^2) times that.
        const double bound = 1e-15 * (8.0 * (1.0 + radius * radius) + 8.0 / pose.r.squaredNorm());
        EXPECT_LE(load.energy, 1e-28);
        EXPECT_LE(load.force_b.norm(), bound);
        EXPECT_LE(load.torque_a.norm() + load.torque_b.norm(), bound);
      }
    }
  }
}

TEST(FormLaw, StoresTheSquareOfTheCurvatureChangeOfAnArc) {
  // U = k psi (kappa_1 - kappa_0)^2 exactly, for any chord of the arc.
  for (const double angle : {0.1, 0.7, 2.0}) {
    const double kappa_1 = 1.2, kappa_0 = 1.0;
    const Vec3 n_a(0, 0, 1), n_b(std::sin(angle), 0, std::cos(angle));
    const PairPose pose{.r = (n_b - n_a) / kappa_1, .normal_a = n_a, .normal_b = n_b};
    EXPECT_NEAR(evaluate(Form{.strength = 1.0, .curvature = kappa_0, .weight = {}}, pose).energy, 0.04, 1e-15);
  }
}

TEST(FormLaw, FitsTheCurvatureOfASpiralPairByPair) {
  // Residuals |r + R (n_A - n_B)| / |r| of the first and the last bond; literal: R is that of particle A alone.
  const test::Particles spiral = test::make_spiral();
  const auto residual = [&](std::uint32_t a, bool literal) {
    const PairPose pose = test::pair_pose(spiral, a, a + 1);
    const Vec3 turn = pose.normal_b - pose.normal_a;
    const double fitted =
        Form::fit_curvature(pose.r, pose.normal_a, pose.normal_b) * pose.r.squaredNorm() / turn.squaredNorm();
    const double theta = spiral.state.position[a].norm() / 0.15;
    const double own = 0.15 * std::pow(1.0 + theta * theta, 1.5) / (2.0 + theta * theta);
    return (pose.r - (literal ? own : fitted) * turn).norm() / pose.r.norm();
  };
  EXPECT_NEAR(residual(0, true), 0.295, 5e-4);
  EXPECT_NEAR(residual(0, false), 0.085, 5e-4);
  EXPECT_NEAR(residual(8, true), 0.029, 5e-4);
  EXPECT_NEAR(residual(8, false), 0.0024, 5e-5);
}

TEST(BondFrameLaw, IsAtRestWhereverItsRestPoseIsCarried) {
  Draw draw(15);
  for (int k = 0; k < 50; ++k) {
    TwoBodies bodies = TwoBodies::random(draw);
    const BondFrame law = BondFrame::from_rest(3.0, 2.0, bodies.pose());
    const Quat turn = draw.rotation();
    bodies.x_a = turn * bodies.x_a;
    bodies.x_b = turn * bodies.x_b;
    bodies.q_a = turn * bodies.q_a;
    bodies.q_b = turn * bodies.q_b;
    const PairLoad load = evaluate(law, bodies.pose());
    EXPECT_LE(load.energy, 1e-28);
    EXPECT_LE(load.force_b.norm() + load.torque_a.norm() + load.torque_b.norm(), 3e-14);
  }
}

TEST(BondFrameLaw, StoresFourSineSquaredOfTheHalfAngle) {
  const PairPose rest{.r = Vec3::UnitX()};
  const BondFrame law = BondFrame::from_rest(0.0, 0.5, rest);
  for (const double angle : {0.3, 1.5707963267948966, 3.0}) {
    PairPose pose = rest;
    pose.orientation_b = turn_about(Vec3(0.2, -0.5, 1.0), angle);
    const PairLoad load = evaluate(law, pose);
    EXPECT_NEAR(load.energy, 0.5 * 4.0 * std::pow(std::sin(0.5 * angle), 2), 1e-14);
    EXPECT_NEAR(load.torque_b.norm(), 2.0 * 0.5 * std::sin(angle), 1e-14);  // largest 2 k_theta, at 90 degrees
    EXPECT_LT(load.torque_b.dot(Vec3(0.2, -0.5, 1.0)), 0.0);
  }
}

TEST(RepulsionLaw, EndsContinuouslyAtItsCutOff) {
  const Repulsion law{.force = 2.0, .distance = 0.5, .length = 0.05, .tolerance = 1e-3};
  EXPECT_NEAR(law.cut_off(), 0.5 + 0.05 * std::log(1e3), 1e-14);
  const auto at = [&](double d) { return evaluate(law, PairPose{.r = Vec3(0, d, 0)}); };
  EXPECT_NEAR(at(0.5).force_b.y(), 2.0 * (1.0 - 1e-3), 1e-14);
  // Just inside, the force is slope times distance and the energy its integral.
  const double gap = 1e-6, slope = 2.0 * 1e-3 / 0.05;
  EXPECT_NEAR(at(law.cut_off() - gap).force_b.y(), slope * gap, 1e-4 * slope * gap);
  EXPECT_NEAR(at(law.cut_off() - gap).energy, 0.5 * slope * gap * gap, 1e-16);
  EXPECT_EQ(at(law.cut_off() + 1e-12).force_b.norm(), 0.0);
  EXPECT_EQ(at(law.cut_off() + 1.0).energy, 0.0);
}

// Second variation of the energy about rest, by second differences along random directions.
TEST(PairStiffness, BoundsTheSecondVariation) {
  Draw draw(16);
  constexpr double kStep = 1e-4;
  for (int k = 0; k < 40; ++k) {
    const Vec3 n_a = draw.direction(), n_b = draw.direction();
    const double radius = draw.uniform(0.5, 2.0);
    TwoBodies rest{Vec3::Zero(), radius * (n_b - n_a), draw.rotation(), draw.rotation(), {}, {}};
    if (rest.x_b.norm() < 0.2) continue;
    rest.e_a = rest.q_a.conjugate() * n_a;
    rest.e_b = rest.q_b.conjugate() * n_b;
    const double d = rest.x_b.norm();
    const Vec3 dx_a = draw.vector(1.0), dx_b = draw.vector(1.0), t_a = draw.vector(1.0), t_b = draw.vector(1.0);
    const auto check = [&](const auto& law, const Stiffness& bound, const char* name) {
      const double here = energy(law, rest);
      const auto variation = [&](bool moves) {
        double sum = -2.0 * here;
        for (const double h : {kStep, -kStep}) {
          TwoBodies varied = rest;
          if (moves) {
            varied.x_a += h * dx_a;
            varied.x_b += h * dx_b;
          } else {
            varied.q_a = turn_about(h * t_a, (h * t_a).norm()) * varied.q_a;
            varied.q_b = turn_about(h * t_b, (h * t_b).norm()) * varied.q_b;
          }
          sum += energy(law, varied);
        }
        return sum / (kStep * kStep);
      };
      const double slack = 1e-5 * (1.0 + bound.translation + bound.rotation);  // h^2 and rounding / h^2
      EXPECT_LE(variation(true), bound.translation * (dx_b - dx_a).squaredNorm() + slack) << name;
      EXPECT_LE(variation(false), 2.0 * bound.rotation * (t_a.squaredNorm() + t_b.squaredNorm()) + slack) << name;
    };
    const Form form{.strength = 0.8, .curvature = 1.0 / radius, .weight = {}};
    check(form, stiffness(form, d), "form");
    const FormRadius form_radius{.strength = 0.6, .radius = radius, .weight = {}};
    check(form_radius, stiffness(form_radius), "form radius");
    const CoCircularity co_circularity{.strength = 0.7, .weight = {}};
    check(co_circularity, stiffness(co_circularity, d), "co-circularity");
    const NormalisedCoCircularity normalised{.strength = 0.7, .weight = {}};
    check(normalised, stiffness(normalised, d), "normalised co-circularity");
    const BondFrame frame = BondFrame::from_rest(2.0, 0.7, rest.pose());
    check(frame, stiffness(frame), "bond frame");
    // Flat laws rest where both normals are parallel and across r.
    rest.x_b = d * n_a.cross(n_b).normalized();
    rest.e_b = rest.q_b.conjugate() * n_a;
    const CoNormality co_normality{.strength = 0.7, .weight = {}};
    check(co_normality, stiffness(co_normality, d), "co-normality");
    const Coplanarity coplanarity{.strength = 0.7, .weight = {}};
    check(coplanarity, stiffness(coplanarity, d), "coplanarity");
    const NormalisedCoplanarity flat{.strength = 0.7, .weight = {}};
    check(flat, stiffness(flat, d), "normalised coplanarity");
    const LennardJones pair = LennardJones::from_gain(d, 0.3, 4);
    check(pair, stiffness(pair), "Lennard-Jones");
  }
}

}  // namespace
}  // namespace supple::core
