// Two free bodies under one law, and the checks that every pair law must pass.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "core/support.h"
#include "supple/core/cohesion_variants.h"
#include "supple/core/directed_form.h"
#include "supple/core/lennard_jones.h"
#include "supple/core/pair_laws.h"

namespace supple::core::test {

/// Two free bodies with body normals, whose poses the tests vary.
struct TwoBodies {
  Vec3 x_a, x_b;
  Quat q_a, q_b;
  Vec3 e_a, e_b;

  static TwoBodies random(Draw& draw) {
    return {draw.vector(0.3), Vec3(1.0, 0.2, -0.1) + draw.vector(0.3), draw.rotation(), draw.rotation(),
            draw.direction(), draw.direction()};
  }
  [[nodiscard]] PairPose pose() const { return {x_b - x_a, q_a, q_b, q_a * e_a, q_b * e_b}; }
  /// Moved along q = (dx_A, dtheta_A, dx_B, dtheta_B).
  [[nodiscard]] TwoBodies moved(const Eigen::Matrix<double, 12, 1>& q) const {
    const auto turned = [](const Quat& from, const Vec3& by) -> Quat {
      if (by.norm() == 0.0) return from;
      return turn_about(by, by.norm()) * from;
    };
    return {x_a + q.segment<3>(0), x_b + q.segment<3>(6), turned(q_a, q.segment<3>(3)), turned(q_b, q.segment<3>(9)),
            e_a, e_b};
  }
};

template <class Law>
double energy(const Law& law, const TwoBodies& bodies) {
  return evaluate(law, bodies.pose()).energy;
}

/// -dU/dq of a pair: (F_A, tau_A, F_B, tau_B).
inline Eigen::Matrix<double, 12, 1> generalised_force(const PairLoad& load) {
  Eigen::Matrix<double, 12, 1> f;
  f << -load.force_b, load.torque_a, load.force_b, load.torque_b;
  return f;
}

/// Force and torque by central differences of the energy. Step 1e-5: truncation h^2/6 U''' < 1e-9 U_scale and rounding
/// eps U / h < 1e-10 U_scale, U_scale about 10 for the gains of the tests; more where a force is large.
template <class Law>
void expect_gradient(const Law& law, const TwoBodies& at, const std::string& name) {
  constexpr double kStep = 1e-5, kBound = 1e-7;
  const Eigen::Matrix<double, 12, 1> load = generalised_force(evaluate(law, at.pose()));
  for (int k = 0; k < 12; ++k) {
    const Eigen::Matrix<double, 12, 1> h = kStep * Eigen::Matrix<double, 12, 1>::Unit(k);
    EXPECT_NEAR(-(energy(law, at.moved(h)) - energy(law, at.moved(-h))) / (2.0 * kStep), load[k],
                kBound * (1.0 + std::abs(load[k])))
        << name << ' ' << k;
  }
}

/// sum (x x F + tau) = r x F_B + tau_A + tau_B; the forces cancel by their definition.
template <class Law>
void expect_no_moment(const Law& law, const TwoBodies& at, const std::string& name) {
  const PairPose pose = at.pose();
  const PairLoad load = evaluate(law, pose);
  const double scale = 1.0 + load.force_b.norm() + load.torque_a.norm() + load.torque_b.norm();
  EXPECT_LE((pose.r.cross(load.force_b) + load.torque_a + load.torque_b).norm(), 1e-13 * scale) << name;
}

/// Calls check(law, name) for each kind of law, with and without a range.
template <class Check>
void for_each_law(Draw& draw, const Check& check) {
  for (const double range : {0.0, 2.5}) {
    const Weight weight{.range = range};
    check(Form{.strength = 0.8, .curvature = 0.7, .weight = weight}, "form");
    check(Form{.strength = 0.8, .curvature = 0.0, .weight = weight}, "flat form");
    check(FormRadius{.strength = 0.6, .radius = 1.3, .weight = weight}, "form radius");
    check(Coplanarity{.strength = 1.2, .weight = weight}, "coplanarity");
    check(NormalisedCoplanarity{.strength = 1.1, .weight = weight}, "normalised coplanarity");
    check(CoNormality{.strength = 0.9, .weight = weight}, "co-normality");
    check(CoCircularity{.strength = 0.5, .weight = weight}, "co-circularity");
    check(NormalisedCoCircularity{.strength = 0.6, .weight = weight}, "normalised co-circularity");
  }
  for (const double range : {0.0, 2.5}) {
    DirectedForm law{.strength = 0.4, .shape_a = Mat3::Zero(), .shape_b = Mat3::Zero(), .weight = {.range = range}};
    law.shape_a << 0.7, 0.1, 0.0, 0.1, -0.4, 0.2, 0.0, 0.2, 0.1;
    law.shape_b << 0.2, -0.3, 0.1, -0.3, 0.9, 0.0, 0.1, 0.0, 0.0;
    check(law, "directed form");
  }
  check(Cohesion{.r0 = 0.8, .f0 = 1.5, .a = 4.0}, "cohesion");
  check(Repulsion{.force = 0.5, .distance = 0.9, .length = 0.3, .tolerance = 1e-3}, "repulsion");
  LennardJones lennard_jones{.r0 = 0.9, .depth = 0.4, .repulsive = 7, .attractive = 3};
  check(lennard_jones, "Lennard-Jones");
  lennard_jones.cut_off = 1.6;
  check(lennard_jones, "Lennard-Jones with shifted force");
  lennard_jones.switch_from = 0.7;
  check(lennard_jones, "Lennard-Jones with switched potential");
  check(LinearCohesion{.r0 = 0.8, .f0 = 1.5, .a = 3.0, .eta = 0.2}, "linear cohesion");
  const DirectedCohesion directed_cohesion{
      .scale = 1.2, .a = 4.0, .semi_axes_a = Vec3(0.3, 0.5, 0.4), .semi_axes_b = Vec3(0.6, 0.2, 0.4)};
  check(directed_cohesion, "directed cohesion");
  const TwoBodies rest = TwoBodies::random(draw);
  check(BondFrame::from_rest(2.0, 0.7, rest.pose()), "bond frame");
}

}  // namespace supple::core::test
