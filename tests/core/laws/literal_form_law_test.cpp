// The form interaction as printed in Lombardo & Puech 1995, sec. 4, and what is wrong with it.
#include "supple/core/literal_form.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/support.h"
#include "supple/core/interactions.h"

namespace supple::core {
namespace {

using test::Draw;

PairPose on_sphere(double radius, const Vec3& n_a, const Vec3& n_b) {
  return {.r = radius * (n_b - n_a), .normal_a = n_a, .normal_b = n_b};
}

PairPose random_pose(Draw& draw) {
  return {.r = Vec3(1, 0, 0) + draw.vector(0.3), .normal_a = draw.direction(), .normal_b = draw.direction()};
}

TEST(LiteralForm, TurnsATiltedNormalAwayFromRest) {
  const double radius = 1.3, tilt = 0.05;
  PairPose pose = on_sphere(radius, Vec3::UnitZ(), Vec3(std::sin(0.7), 0, std::cos(0.7)));
  pose.normal_a = Vec3(std::sin(tilt), 0, std::cos(tilt));  // turned by `tilt` about y
  const double expected = 2.0 * radius * radius * std::sin(tilt);
  EXPECT_NEAR(expected, 0.1689, 5e-5);
  const LiteralForm literal{.strength = 1.0, .radius_a = radius, .radius_b = radius, .weight = {}};
  EXPECT_NEAR(evaluate(literal, pose).torque_a.y(), expected, 1e-14);
  const FormRadius consistent{.strength = 1.0, .radius = radius, .weight = {}};
  EXPECT_NEAR(evaluate(consistent, pose).torque_a.y(), -expected, 1e-14);
}

TEST(LiteralForm, HasTheForcesOfTheConsistentLawForOneRadiusAndNoWeight) {
  Draw draw(91);
  for (int k = 0; k < 20; ++k) {
    const PairPose pose = random_pose(draw);
    const LiteralForm law{.strength = 0.7, .radius_a = 1.3, .radius_b = 1.3, .weight = {}};
    const LiteralFormLoad literal = evaluate(law, pose);
    const PairLoad consistent = evaluate(FormRadius{.strength = 0.7, .radius = 1.3, .weight = {}}, pose);
    EXPECT_LE((literal.force_b - consistent.force_b).norm(), 1e-14);
    EXPECT_LE((literal.force_a + consistent.force_b).norm(), 1e-14);
    EXPECT_LE((literal.torque_a + consistent.torque_a).norm(), 1e-14);
    EXPECT_LE((literal.torque_b + consistent.torque_b).norm(), 1e-14);
  }
}

TEST(LiteralForm, LosesMomentumWhereTheRadiiDiffer) {
  Draw draw(92);
  for (int k = 0; k < 20; ++k) {
    const PairPose pose = random_pose(draw);
    const LiteralForm law{.strength = 1.0, .radius_a = 1.3, .radius_b = 0.9, .weight = {.range = 2.5}};
    const LiteralFormLoad load = evaluate(law, pose);
    const Vec3 expected = 2.0 * 0.4 * law.weight.at(pose.r.norm()).psi * (pose.normal_a - pose.normal_b);
    EXPECT_LE((load.force_a + load.force_b - expected).norm(), 1e-14);
  }
}

TEST(LiteralForm, LosesAngularMomentumEvenForOneRadius) {
  Draw draw(93);
  double largest = 0.0;
  for (int k = 0; k < 20; ++k) {
    const PairPose pose = random_pose(draw);
    const LiteralForm law{.strength = 1.0, .radius_a = 1.3, .radius_b = 1.3, .weight = {}};
    const LiteralFormLoad load = evaluate(law, pose);
    largest = std::max(largest, (pose.r.cross(load.force_b) + load.torque_a + load.torque_b).norm());
  }
  EXPECT_GT(largest, 1.0);
}

/// Work done on B around a closed square path in the x-z plane, normals and A held; the midpoint rule in `steps` steps a
/// side is exact to side^3 / steps^2.
template <class ForceOnB>
double work_around(const ForceOnB& force, int steps) {
  const std::array<Vec3, 5> corner{Vec3(0.8, 0, 0), Vec3(1.2, 0, 0), Vec3(1.2, 0, 0.4), Vec3(0.8, 0, 0.4),
                                   Vec3(0.8, 0, 0)};
  double work = 0.0;
  for (std::size_t side = 0; side < 4; ++side) {
    const Vec3 along = (corner[side + 1] - corner[side]) / steps;
    for (int k = 0; k < steps; ++k) work += force(Vec3(corner[side] + (k + 0.5) * along)).dot(along);
  }
  return work;
}

TEST(LiteralForm, DoesWorkAroundAClosedPath) {
  const Vec3 n_a = Vec3::UnitZ(), n_b = Vec3(std::sin(0.4), 0, std::cos(0.4));
  const Weight weight{.range = 2.0};
  const auto literal = [&](const Vec3& r) {
    return evaluate(LiteralForm{.strength = 1.0, .radius_a = 1.3, .radius_b = 1.3, .weight = weight},
                    PairPose{.r = r, .normal_a = n_a, .normal_b = n_b})
        .force_b;
  };
  const auto consistent = [&](const Vec3& r) {
    return evaluate(FormRadius{.strength = 1.0, .radius = 1.3, .weight = weight},
                    PairPose{.r = r, .normal_a = n_a, .normal_b = n_b})
        .force_b;
  };
  EXPECT_GT(std::abs(work_around(literal, 400)), 0.05);
  EXPECT_LE(std::abs(work_around(consistent, 400)), 1e-5);
}

TEST(LiteralForm, ActsInAStepAndInReports) {
  test::Particles p;
  p.add(Vec3(0, 0, 0));
  p.add(Vec3(1, 0.2, 0.1));
  p.state.orientation[1] = test::turn_about(Vec3(1, 2, 0), 0.6);
  Interactions all;
  all.literal_form.push_back(
      {.name = "literal", .first = {0}, .second = {1},
       .law = {{.strength = 2.0, .radius_a = 0.5, .radius_b = 0.8, .weight = {}}}});
  EXPECT_EQ(all.law_count(), 1U);
  EXPECT_EQ(potential_energy(p.set, p.state, all), 0.0);
  Loads internal, external;
  internal.reset(2);
  external.reset(2);
  InteractionWorkspace workspace(p.set, all);
  const InteractionCounts counts =
      accumulate_interactions(p.set, p.state, all, Executor(1), workspace, internal);
      add_external_loads(p.set, all, 0.0, external);
  EXPECT_EQ(counts.pairs_present, 1U);
  const LiteralFormLoad load = evaluate(all.literal_form[0].law[0], test::pair_pose(p, 0, 1));
  EXPECT_EQ(internal.force[0], load.force_a);
  EXPECT_EQ(internal.force[1], load.force_b);
  EXPECT_EQ(internal.torque[0], load.torque_a);
  EXPECT_EQ(internal.torque[1], load.torque_b);
  const std::vector<LawReport> reports = report_laws(p.set, p.state, all, 0.0);
  EXPECT_EQ(reports.front().name, "literal");
  EXPECT_EQ(reports.front().loads.force[1], load.force_b);
  // 2/m translation + 2/I rotation with m = I = 1.
  EXPECT_DOUBLE_EQ(largest_frequency(p.set, p.state, all), std::sqrt(2.0 * (4.0 + 4.0 * 0.64)));
}

}  // namespace
}  // namespace supple::core
