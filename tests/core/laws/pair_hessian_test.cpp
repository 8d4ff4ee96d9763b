// The Hessians of the pair laws against differences of their loads, and the modes that each law leaves free.
#include "supple/core/pair_hessian.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>

#include "core/support.h"
#include "core/two_bodies.h"
#include "supple/core/arrange.h"

namespace supple::core {
namespace {

using test::Draw;
using test::for_each_law;
using test::generalised_force;
using test::TwoBodies;
using Vec12 = Eigen::Matrix<double, 12, 1>;

double least_eigenvalue(const PairHessian& h) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(h, Eigen::EigenvaluesOnly).eigenvalues()[0];
}

Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

TEST(PairHessian, IsTheDerivativeOfTheLoads) {
  // Step 1e-5: truncation h^2/6 times fourth derivatives of U, which are below 1000 times the second ones (the
  // steepest law goes like d^-7 and d > 0.3), rounding eps F / h.
  constexpr double kStep = 1e-5, kBound = 5e-8;
  Draw draw(61);
  for (int n = 0; n < 20; ++n) {
    const TwoBodies at = TwoBodies::random(draw);
    for_each_law(draw, [&](const auto& law, const char* name) {
      const PairLoad load = evaluate(law, at.pose());
      PairHessian expected;
      for (int k = 0; k < 12; ++k) {
        const Vec12 h = kStep * Vec12::Unit(k);
        expected.col(k) = -(generalised_force(evaluate(law, at.moved(h).pose())) -
                            generalised_force(evaluate(law, at.moved(-h).pose()))) /
                          (2.0 * kStep);
      }
      expected.block<3, 3>(3, 3) -= 0.5 * cross_matrix(load.torque_a);
      expected.block<3, 3>(9, 9) -= 0.5 * cross_matrix(load.torque_b);
      const PairHessian exact = hessian(law, at.pose(), HessianKind::Exact);
      EXPECT_LE((exact - expected).cwiseAbs().maxCoeff(), kBound * (1.0 + exact.cwiseAbs().maxCoeff()))
          << name << '\n' << exact - expected;
      EXPECT_EQ((exact - exact.transpose()).cwiseAbs().maxCoeff(), 0.0) << name;
    });
  }
}

TEST(PairHessian, HasAPositiveSemiDefiniteForm) {
  Draw draw(62);
  int indefinite = 0;
  for (int n = 0; n < 50; ++n) {
    const TwoBodies at = TwoBodies::random(draw);
    for_each_law(draw, [&](const auto& law, const char* name) {
      const PairHessian h = hessian(law, at.pose(), HessianKind::PositiveSemiDefinite);
      EXPECT_GE(least_eigenvalue(h), -1e-13 * h.cwiseAbs().maxCoeff()) << name;
      EXPECT_EQ((h - h.transpose()).cwiseAbs().maxCoeff(), 0.0) << name;
      if (least_eigenvalue(hessian(law, at.pose(), HessianKind::Exact)) < -1e-3) ++indefinite;
    });
  }
  EXPECT_GT(indefinite, 100);  // or the test above would say nothing
}

TEST(PairHessian, DoesNotSeeACommonTranslation) {
  Draw draw(63);
  const TwoBodies at = TwoBodies::random(draw);
  Vec12 shift = Vec12::Zero();
  shift.segment<3>(0) = shift.segment<3>(6) = Vec3(0.3, -0.2, 0.9);
  for_each_law(draw, [&](const auto& law, const char* name) {
    for (const HessianKind kind : {HessianKind::Exact, HessianKind::PositiveSemiDefinite}) {
      const PairHessian h = hessian(law, at.pose(), kind);
      EXPECT_LE((h * shift).norm(), 1e-14 * h.norm()) << name;
    }
  });
}

TEST(PairHessian, IsPositiveSemiDefiniteItselfAtRest) {
  // On a sphere every residual of form vanishes, in a plane those of co-planarity: both matrices agree there.
  Draw draw(64);
  for (int n = 0; n < 20; ++n) {
    const double radius = draw.uniform(0.5, 2.0);
    const Vec3 n_a = draw.direction(), n_b = draw.direction();
    const PairPose on_sphere{.r = radius * (n_b - n_a),
                             .orientation_a = draw.rotation(),
                             .orientation_b = draw.rotation(),
                             .normal_a = n_a,
                             .normal_b = n_b};
    const PairPose in_plane{.r = 0.7 * n_b.cross(n_a), .normal_a = n_a, .normal_b = n_a};
    if (on_sphere.r.norm() < 0.1 || in_plane.r.norm() < 0.1) continue;
    const auto expect_equal = [](const auto& law, const PairPose& pose) {
      const PairHessian exact = hessian(law, pose, HessianKind::Exact);
      const PairHessian clamped = hessian(law, pose, HessianKind::PositiveSemiDefinite);
      // Residuals are roundings of order 1e-16, their share of the difference that times the gains.
      EXPECT_LE((exact - clamped).cwiseAbs().maxCoeff(), 1e-13 * exact.cwiseAbs().maxCoeff());
      EXPECT_GT(exact.cwiseAbs().maxCoeff(), 0.01);
    };
    for (const double range : {0.0, 6.0}) {
      expect_equal(Form{.strength = 1.0, .curvature = 1.0 / radius, .weight = {.range = range}}, on_sphere);
      expect_equal(FormRadius{.strength = 1.0, .radius = radius, .weight = {.range = range}}, on_sphere);
      expect_equal(Coplanarity{.strength = 1.0, .weight = {.range = range}}, in_plane);
    }
    expect_equal(BondFrame::from_rest(2.0, 0.5, on_sphere), on_sphere);
  }
}

TEST(PairHessian, RaisesBothCoefficientsOfACentralLaw) {
  const Cohesion law{.r0 = 1.0, .f0 = 1.0, .a = 4.0};
  const auto at = [&](double d, HessianKind kind) { return hessian(law, PairPose{.r = Vec3(d, 0, 0)}, kind); };
  // Compressed: U'' > 0 along, U'/d = -f/d < 0 across. Stretched past r_m: the other way round.
  const PairHessian compressed = at(0.8, HessianKind::PositiveSemiDefinite);
  EXPECT_DOUBLE_EQ(compressed(0, 0), -law.slope(0.8));
  EXPECT_EQ(compressed(1, 1), 0.0);
  EXPECT_DOUBLE_EQ(at(0.8, HessianKind::Exact)(1, 1), -law.force(0.8) / 0.8);
  const PairHessian stretched = at(2.0, HessianKind::PositiveSemiDefinite);
  EXPECT_EQ(stretched(0, 0), 0.0);
  EXPECT_DOUBLE_EQ(stretched(1, 7), law.force(2.0) / 2.0);
}

/// Particles with normals, and bonds.
struct Structure {
  std::vector<Vec3> position, normal;
  std::vector<std::pair<int, int>> bonds;

  /// On a circle of radius 1 with outward normals, bonded to their nearest neighbours.
  static Structure ring(int count) {
    Structure out;
    for (int k = 0; k < count; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / count;
      out.position.emplace_back(std::cos(angle), std::sin(angle), 0.0);
      out.bonds.emplace_back(std::min(k, (k + 1) % count), std::max(k, (k + 1) % count));
    }
    out.normal = out.position;
    return out;
  }
  /// The same on a sphere.
  static Structure icosahedron() {
    Structure out;
    for (const double one : {1.0, -1.0}) {
      for (const double golden : {std::numbers::phi, -std::numbers::phi}) {
        for (int axis = 0; axis < 3; ++axis) {
          Vec3 x = Vec3::Zero();
          x[axis] = one;
          x[(axis + 1) % 3] = golden;
          out.position.push_back(x.normalized());
        }
      }
    }
    for (int a = 0; a < 12; ++a) {
      for (int b = a + 1; b < 12; ++b) {
        if ((out.position[static_cast<std::size_t>(b)] - out.position[static_cast<std::size_t>(a)]).norm() < 1.2) {
          out.bonds.emplace_back(a, b);
        }
      }
    }
    out.normal = out.position;
    return out;
  }
  /// The spiral of figure 5 in its plane, normals along the axis. @param neighbours  bonds join particles whose numbers differ by at most this
  static Structure spiral(int neighbours) {
    Structure out;
    out.position = arrange_spiral(10, 0.15, 0.55, 1.2, NormalDirection::Axis).position;
    out.normal.assign(out.position.size(), Vec3::UnitZ());
    for (int a = 0; a < 10; ++a) {
      for (int b = a + 1; b < std::min(10, a + neighbours + 1); ++b) out.bonds.emplace_back(a, b);
    }
    return out;
  }

  [[nodiscard]] PairPose pose(const std::pair<int, int>& bond) const {
    const Vec3& a = position[static_cast<std::size_t>(bond.first)];
    const Vec3& b = position[static_cast<std::size_t>(bond.second)];
    return {.r = b - a, .normal_a = normal[static_cast<std::size_t>(bond.first)], .normal_b = normal[static_cast<std::size_t>(bond.second)]};
  }

  /// Number of zero eigenvalues of the sum of `add(pose)` over the bonds, on the degrees of freedom `free` of each
  /// particle (indices into x, y, z, theta_x, theta_y, theta_z).
  template <class Add>
  [[nodiscard]] int zero_modes(const std::vector<int>& free, const Add& add) const {
    const auto dof = static_cast<Eigen::Index>(free.size());
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(dof * std::ssize(position), dof * std::ssize(position));
    for (const auto& bond : bonds) {
      const PairHessian h = add(pose(bond));
      const auto place = [&](Eigen::Index k) { return dof * (k < dof ? bond.first : bond.second) + k % dof; };
      const auto row = [&](Eigen::Index k) { return (k < dof ? 0 : 6) + free[static_cast<std::size_t>(k % dof)]; };
      for (Eigen::Index i = 0; i < 2 * dof; ++i) {
        for (Eigen::Index j = 0; j < 2 * dof; ++j) sum(place(i), place(j)) += h(row(i), row(j));
      }
    }
    const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(sum).eigenvalues();
    // Rounding leaves 1e-15 of the largest; the smallest true one of these structures is above 1e-3 of it.
    return static_cast<int>((values.array().abs() < 1e-9 * values.array().abs().maxCoeff()).count());
  }
};

const std::vector<int> kInPlane{0, 1, 5};
const std::vector<int> kInSpace{0, 1, 2, 3, 4, 5};

PairHessian form_and_cohesion(const PairPose& pose) {
  return hessian(FormRadius{.strength = 1.0, .radius = 1.0, .weight = {}}, pose, HessianKind::Exact) +
         hessian(Cohesion{.r0 = pose.r.norm(), .f0 = 1.0, .a = 4.0}, pose, HessianKind::Exact);
}

TEST(ZeroModes, FormLeavesSlidingAndTwistFree) {
  const auto form = [](const PairPose& pose) {
    return hessian(FormRadius{.strength = 1.0, .radius = 1.0, .weight = {}}, pose, HessianKind::Exact);
  };
  ASSERT_EQ(Structure::icosahedron().bonds.size(), 30U);
  EXPECT_EQ(Structure::ring(8).zero_modes(kInPlane, form), 10);
  EXPECT_EQ(Structure::icosahedron().zero_modes(kInSpace, form), 39);
}

TEST(ZeroModes, CohesionAddsNoStiffnessAtRest) {
  EXPECT_EQ(Structure::ring(8).zero_modes(kInPlane, form_and_cohesion), 10);
  EXPECT_EQ(Structure::icosahedron().zero_modes(kInSpace, form_and_cohesion), 39);
}

TEST(ZeroModes, HarmonicDistancesLeaveTheSpinsOfASphereFree) {
  const auto form_and_harmonic = [](const PairPose& pose) -> PairHessian {
    const LennardJones law = LennardJones::from_gain(pose.r.norm(), 1.0, 4);
    return hessian(FormRadius{.strength = 1.0, .radius = 1.0, .weight = {}}, pose, HessianKind::Exact) +
           hessian(law, pose, HessianKind::Exact);
  };
  EXPECT_EQ(Structure::ring(8).zero_modes(kInPlane, form_and_harmonic), 3);
  EXPECT_EQ(Structure::icosahedron().zero_modes(kInSpace, form_and_harmonic), 18);
}

TEST(ZeroModes, OfAPlaneSpiralAreSpinsAloneFromSecondNeighboursOn) {
  const auto laws = [](const PairPose& pose) -> PairHessian {
    const LennardJones law = LennardJones::from_gain(pose.r.norm(), 1.0, 4);
    return hessian(Form{.strength = 1.0, .curvature = 0.0, .weight = {}}, pose, HessianKind::Exact) +
           hessian(Coplanarity{.strength = 1.0, .weight = {}}, pose, HessianKind::Exact) + hessian(law, pose, HessianKind::Exact);
  };
  constexpr int kRigid = 6, kSpins = 10;  // of each particle about its normal
  // Shapes in the plane have 2 x 10 - 3 degrees of freedom, and the chain has nine distances.
  EXPECT_EQ(Structure::spiral(1).zero_modes(kInSpace, laws), kRigid + kSpins + 8);
  for (int neighbours = 2; neighbours < 10; ++neighbours) EXPECT_EQ(Structure::spiral(neighbours).zero_modes(kInSpace, laws), kRigid + kSpins) << neighbours;
}

TEST(ZeroModes, BondFramesLeaveRigidMotionAlone) {
  const auto bond_frame = [](const PairPose& pose) {
    return hessian(BondFrame::from_rest(1.0, 1.0, pose), pose, HessianKind::Exact);
  };
  EXPECT_EQ(Structure::ring(8).zero_modes(kInPlane, bond_frame), 3);
  EXPECT_EQ(Structure::icosahedron().zero_modes(kInSpace, bond_frame), 6);
}

}  // namespace
}  // namespace supple::core
