// Shape memory with a shape operator in place of one curvature.
#include "supple/core/directed_form.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/two_bodies.h"
#include "supple/core/pair_hessian.h"

namespace supple::core {
namespace {

using test::Draw;
using test::TwoBodies;

TEST(DirectedFormLaw, IsFormWhenItsCurvatureIsTheSameInAllDirections) {
  Draw draw(81);
  for (int k = 0; k < 20; ++k) {
    const PairPose pose = TwoBodies::random(draw).pose();
    for (const double range : {0.0, 2.5}) {
      const Mat3 shape = 0.7 * Mat3::Identity();
      const DirectedForm law{.strength = 0.8, .shape_a = shape, .shape_b = shape, .weight = {.range = range}};
      const Form form{.strength = 0.8, .curvature = 0.7, .weight = {.range = range}};
      const PairLoad here = evaluate(law, pose), there = evaluate(form, pose);
      EXPECT_NEAR(here.energy, there.energy, 1e-14 * (1.0 + there.energy));
      EXPECT_LE((here.force_b - there.force_b).norm(), 1e-13 * (1.0 + there.force_b.norm()));
      EXPECT_LE((here.torque_a - there.torque_a).norm(), 1e-13 * (1.0 + there.torque_a.norm()));
      EXPECT_LE((here.torque_b - there.torque_b).norm(), 1e-13 * (1.0 + there.torque_b.norm()));
      for (const HessianKind kind : {HessianKind::Exact, HessianKind::PositiveSemiDefinite}) {
        const PairHessian expected = hessian(form, pose, kind);
        EXPECT_LE((hessian(law, pose, kind) - expected).cwiseAbs().maxCoeff(),
                  1e-13 * (1.0 + expected.cwiseAbs().maxCoeff()));
      }
    }
  }
}

/// Points of a cylinder of radius rho about x near (0, 0, rho), with outward normals.
struct Cylinder {
  double radius;
  [[nodiscard]] Vec3 point(double along, double angle) const {
    return {along, radius * std::sin(angle), radius * std::cos(angle)};
  }
  [[nodiscard]] Vec3 normal(double angle) const { return {0.0, std::sin(angle), std::cos(angle)}; }
};

TEST(ShapeOperatorFit, FindsCurvatureAndTorsionOfACylinder) {
  // kappa(theta) = sin^2 theta / rho and |tau_g| = sin theta cos theta / rho, theta from the axis.
  const Cylinder cylinder{.radius = 2.0};
  std::vector<Vec3> offsets, changes;
  for (const double along : {-1e-4, 0.0, 1e-4}) {
    for (const double angle : {-1e-4, 0.0, 1e-4}) {
      if (along == 0.0 && angle == 0.0) continue;
      offsets.push_back(cylinder.point(along, angle) - cylinder.point(0, 0));
      changes.push_back(cylinder.normal(angle) - cylinder.normal(0));
    }
  }
  const Mat3 s = fit_shape_operator(Vec3::UnitZ(), offsets, changes);
  EXPECT_LE((s - s.transpose()).norm(), 1e-15);
  EXPECT_LE((s * Vec3::UnitZ()).norm(), 1e-15);
  for (const double theta : {0.0, 0.4, 1.0, 1.5707963267948966}) {
    const Vec3 t(std::cos(theta), std::sin(theta), 0.0);
    const Vec3 across = Vec3::UnitZ().cross(t);
    EXPECT_NEAR(t.dot(s * t), std::pow(std::sin(theta), 2) / 2.0, 1e-8);  // second order in the offsets
    EXPECT_NEAR(across.dot(s * t), std::sin(theta) * std::cos(theta) / 2.0, 1e-8);
  }
}

TEST(ShapeOperatorFit, IsOneOverRadiusOnASphere) {
  Draw draw(82);
  const Vec3 n = draw.direction();
  std::vector<Vec3> offsets, changes;
  for (int k = 0; k < 5; ++k) {
    const Vec3 other = (n + draw.vector(1e-5)).normalized();
    offsets.push_back(3.0 * (other - n));
    changes.push_back(other - n);
  }
  // Both are chords: P dn = P dx / R without error.
  EXPECT_LE((fit_shape_operator(n, offsets, changes) - (Mat3::Identity() - n * n.transpose()) / 3.0).norm(), 1e-9);
}

TEST(ShapeOperatorFit, TakesTheSmallestWhereNeighboursLeaveItFree) {
  const Vec3 along = Vec3(1, 2, 0).normalized(), across = Vec3::UnitZ().cross(along);
  const std::vector<Vec3> offsets{0.1 * along, -0.1 * along};
  const std::vector<Vec3> changes{0.03 * along, -0.03 * along};
  const Mat3 s = fit_shape_operator(Vec3::UnitZ(), offsets, changes);
  EXPECT_NEAR(along.dot(s * along), 0.3, 1e-14);
  EXPECT_LE((s * across).norm(), 1e-14);
  EXPECT_EQ(fit_shape_operator(Vec3::UnitZ(), {}, {}).norm(), 0.0);
}

TEST(DirectedFormLaw, RemembersACylinderThatFormCannot) {
  // Neighbours along, around and across: one curvature for all pairs leaves a residual, the shape operator none but
  // that of second order.
  const Cylinder cylinder{.radius = 1.0};
  const double step = 1e-3;
  Mat3 shape = Mat3::Zero();
  shape(1, 1) = 1.0;  // in the frame of a particle whose normal is z and whose x is the axis
  for (const auto& [along, angle] : {std::pair{step, 0.0}, std::pair{0.0, step}, std::pair{step, step}}) {
    PairPose pose;
    pose.r = cylinder.point(along, angle) - cylinder.point(0, 0);
    pose.normal_a = Vec3::UnitZ();
    pose.normal_b = cylinder.normal(angle);
    pose.orientation_b = test::turn_about(-Vec3::UnitX(), angle);
    const DirectedForm law{.strength = 1.0, .shape_a = shape, .shape_b = shape, .weight = {}};
    // |w| is at most angle^3: U below angle^6 / d^2.
    EXPECT_LE(evaluate(law, pose).energy, std::pow(step, 4));
    // One curvature, that around the cylinder, takes 1 from pairs along it.
    const Form form{.strength = 1.0, .curvature = 1.0, .weight = {}};
    const double expected = along * along / pose.r.squaredNorm();
    EXPECT_NEAR(evaluate(form, pose).energy, expected, 1e-5);
  }
}

TEST(DirectedFormLaw, HasABoundedStiffness) {
  Draw draw(83);
  for (int k = 0; k < 50; ++k) {
    const PairPose pose = TwoBodies::random(draw).pose();
    DirectedForm law{.strength = 0.6, .shape_a = Mat3::Zero(), .shape_b = Mat3::Zero(), .weight = {}};
    for (Mat3* shape : {&law.shape_a, &law.shape_b}) {
      for (int i = 0; i < 3; ++i) *shape += draw.uniform(-1, 1) * Mat3(draw.direction().asDiagonal());
    }
    // The rest share of the Hessian: 2 k psi J^T J without the slope of psi / d^2, which a rest pose does not feel.
    const double d = pose.r.norm();
    const Stiffness bound = stiffness(law, d);
    const double gain = 2.0 * law.strength / (d * d);
    const Mat3 q_a = pose.orientation_a.toRotationMatrix();
    const Mat3 mean = 0.5 * (q_a * law.shape_a * q_a.transpose() +
                             pose.orientation_b.toRotationMatrix() * law.shape_b *
                                 pose.orientation_b.toRotationMatrix().transpose());
    EXPECT_LE(gain * (mean * mean).trace(), 3.0 * bound.translation);
    EXPECT_GE(bound.rotation, gain);
  }
}

}  // namespace
}  // namespace supple::core
