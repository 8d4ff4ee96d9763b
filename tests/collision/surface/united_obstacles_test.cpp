// Obstacles are one solid, whose pressure is the largest of theirs: against sums over fine grids of columns, and where they are flush against one obstacle.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "collision/bodies.h"
#include "supple/implicit/field.h"
#include "supple/implicit/mesh_solid.h"
#include "supple/implicit/solids.h"

namespace supple::collision {
namespace {

using namespace testing;
using implicit::HalfSpace;
using implicit::SolidBox;

struct Obstacle {
  implicit::FieldView field;
  double modulus = 1.0;
};

/// A ball of linear pressure 1 - rho about a place 0.9 above z = 0 or elsewhere, as bodies[0].
struct Meeting {
  LinearSphere ball;
  Stage stage;

  Meeting(const Vec3& at, const std::vector<Obstacle>& obstacles) : ball{at, Linear{1.0, 1.0}} {
    stage.add(ball, {at});
    for (const Obstacle& o : obstacles) stage.add(o.field, {Vec3::Zero()}, o.modulus).fixed = true;
  }
};

struct Sum {
  Vec3 force = Vec3::Zero();
  double energy = 0.0, area = 0.0, load = 0.0, bound = 0.0;
  std::uint64_t evaluations = 0;
};

Sum sum_of(const ContactSurface& s) {
  Sum all;
  for (const auto& x : s.summary) {
    all.force += x.force;
    all.energy += x.energy;
    all.area += x.area;
    all.load += x.load;
    all.bound = std::max(all.bound, x.error_estimate);
    all.evaluations += x.evaluations;
  }
  return all;
}

/// Force up on a ball from what it meets below itself, the integral of p over the columns that meet Sigma, and the energy. What the ball meets does not press
/// less further down.
struct Columns {
  double force = 0.0, energy = 0.0;
};
Columns by_columns(const LinearSphere& ball, const std::vector<Obstacle>& obstacles, int cells) {
  const auto solid = [&](const Vec3& x) {
    double p = -1.0;
    for (const Obstacle& o : obstacles) p = std::max(p, o.modulus * o.field.value(x));
    return p;
  };
  const auto own = [&](const Vec3& x) { return ball.profile.value((x - ball.centre).norm()); };
  constexpr int kAlong = 16;  // of the middle rule, for energies
  Columns sum;
  const double cell = 2.0 / cells;
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      const double x = ball.centre.x() - 1.0 + (i + 0.5) * cell, y = ball.centre.y() - 1.0 + (j + 0.5) * cell;
      const double across = Eigen::Vector2d(x - ball.centre.x(), y - ball.centre.y()).squaredNorm();
      if (across >= 1.0) continue;
      const double bottom = ball.centre.z() - std::sqrt(1.0 - across);
      double low = bottom, high = ball.centre.z();
      if (!(solid(Vec3(x, y, low)) > 0.0)) continue;
      for (int half = 0; half < 50; ++half) {
        const double z = 0.5 * (low + high);
        (own(Vec3(x, y, z)) < solid(Vec3(x, y, z)) ? low : high) = z;
      }
      sum.force += own(Vec3(x, y, low)) * cell * cell;
      double top = low, beyond = ball.centre.z();
      for (int half = 0; half < 50; ++half) {
        const double z = 0.5 * (top + beyond);
        (solid(Vec3(x, y, z)) > 0.0 ? top : beyond) = z;
      }
      for (int k = 0; k < kAlong; ++k) {
        const double z_in = bottom + (low - bottom) * (k + 0.5) / kAlong, z_out = low + (top - low) * (k + 0.5) / kAlong;
        sum.energy += cell * cell / kAlong * ((low - bottom) * own(Vec3(x, y, z_in)) + (top - low) * std::max(0.0, solid(Vec3(x, y, z_out))));
      }
    }
  }
  return sum;
}

const HalfSpace kGround{Vec3::Zero(), Vec3::UnitZ(), 1.0};
SolidBox box(const Vec3& middle, const Vec3& half) { return {Pose{middle, Quat::Identity()}, half, 0.0, 1.0}; }

TEST(UnitedObstacles, ThatAreFlushAreAsOne) {
  const SolidBox slab = box(Vec3(0, 0, -1), Vec3(3, 3, 1)), same = box(Vec3(0, 0, -1), Vec3(3, 3, 1)), wide = box(Vec3(1, 0, -2), Vec3(5, 4, 2));
  const Vec3 at(0.05, 0.03, 0.9);
  for (const double error : {1e-2, 1e-4, 1e-8}) {
    const ContactSettings settings{.error = error};
    Meeting one(at, {{kGround}});
    const Sum alone = sum_of(one.stage.solve(settings));
    const std::vector<std::vector<Obstacle>> flush{{{kGround}, {slab}}, {{slab}, {kGround}}, {{slab}, {same}},
                                                   {{kGround}, {slab}, {wide}}, {{wide}, {same}, {kGround}, {slab}}};
    for (std::size_t k = 0; k < flush.size(); ++k) {
      Meeting several(at, flush[k]);
      const ContactSurface& s = several.stage.solve(settings);
      ASSERT_EQ(s.summary.size(), 1u) << error << ' ' << k;
      EXPECT_EQ(s.summary[0].bodies, (BodyPair{0, 1}));  // the first of them has the contact
      const Sum all = sum_of(s);
      const double within = 2.0 * error + 1e-12;  // of both bounds
      EXPECT_LE((all.force - alone.force).norm(), within * alone.force.norm()) << error << ' ' << k;
      EXPECT_NEAR(all.area, alone.area, within * alone.area);
      EXPECT_NEAR(all.energy, alone.energy, std::max(1e-4, within) * alone.energy);
    }
  }
}

TEST(UnitedObstacles, PressAsTheHardestOfThem) {
  const SolidBox left = box(Vec3(-2, 0, -1), Vec3(2, 3, 1)), right = box(Vec3(2, 0, -1), Vec3(2, 3, 1));        // side by side
  const SolidBox over_left = box(Vec3(-1.7, 0, -1), Vec3(2, 3, 1)), over_right = box(Vec3(1.7, 0, -1), Vec3(2, 3, 1));  // with 0.6 in common
  const SolidBox middle = box(Vec3(0.25, 0, -1), Vec3(0.25, 3, 1)), next = box(Vec3(2.5, 0, -1), Vec3(2, 3, 1));
  const SolidBox sunk = box(Vec3(2.1, 0, -0.95), Vec3(2, 3, 1)), narrow = box(Vec3(0.1, 0, -1), Vec3(0.2, 3, 1)), edge = box(Vec3(-2.8, 0, -1), Vec3(3, 3, 1));
  struct Case {
    const char* name;
    std::vector<Obstacle> obstacles;
    bool smooth = false;  // of the surface that the ball meets
  };
  const std::vector<Case> cases{{"side by side", {{left}, {right}}},
                                {"three side by side", {{left}, {middle}, {next}}},
                                {"with one top", {{over_left}, {over_right}}, true},
                                {"an edge on the ground", {{edge}, {kGround}}, true},
                                {"above the ground", {{kGround}, {sunk}}},
                                {"another modulus", {{kGround, 0.5}, {edge, 2.0}}},
                                {"a weaker one", {{kGround, 2.0}, {edge, 0.5}}, true},
                                {"narrow", {{narrow}, {kGround}}, true}};
  for (const Case& c : cases) {
    Meeting meeting(Vec3(0.07, 0.03, 0.9), c.obstacles);
    const Columns exact = by_columns(meeting.ball, c.obstacles, 500);
    const ContactSurface& s = meeting.stage.solve({.error = 1e-2});
    const Sum all = sum_of(s);
    // Cells of the columns that borders cross are taken or left whole: less than 1e-3 of the force.
    EXPECT_NEAR(all.force.z(), exact.force, (all.bound + 1e-3) * exact.force) << c.name;
    EXPECT_NEAR(all.energy, exact.energy, 0.01 * exact.energy) << c.name;
    EXPECT_LE(all.bound, 1.01e-2) << c.name;
    if (c.smooth) {
      EXPECT_EQ(s.summary.size(), 1u) << c.name;
      EXPECT_LT(all.evaluations, 10000u) << c.name;  // 3,000 of one half-space
    }
  }
}

TEST(UnitedObstacles, HoldBodiesOfSeveralPartsOnce) {
  const SolidBox slab = box(Vec3(0, 0, -1), Vec3(3, 3, 1)), left = box(Vec3(-1.7, 0, -1), Vec3(2, 3, 1)), right = box(Vec3(1.7, 0, -1), Vec3(2, 3, 1));
  Blobs dumbbell({Vec3(-0.25, 0.02, 0.42), Vec3(0.25, -0.03, 0.42)}, 1.0);
  const auto meet = [&](const std::vector<Obstacle>& obstacles, ContactRule only) {
    Stage stage;
    stage.add(dumbbell.field, dumbbell.centre).skeleton = &dumbbell.skeleton;
    for (const Obstacle& o : obstacles) stage.add(o.field, {Vec3::Zero()}, o.modulus).fixed = true;
    EXPECT_EQ(stage.solve({.error = 1e-3, .only = only}).summary.size(), 1u);
    return sum_of(stage.surface);
  };
  for (const ContactRule only : {ContactRule::None, ContactRule::March}) {
    const Sum alone = meet({{kGround}}, only);
    EXPECT_GT(alone.force.z(), 0.0);
    for (const std::vector<Obstacle>& flush : {std::vector<Obstacle>{{kGround}, {slab}}, {{slab}, {kGround}}, {{left}, {right}}, {{right}, {left}, {kGround}}}) {
      const Sum all = meet(flush, only);
      EXPECT_LE((all.force - alone.force).norm(), 2e-3 * alone.force.norm());
      EXPECT_NEAR(all.energy, alone.energy, 1e-2 * alone.energy);
      EXPECT_LE(all.evaluations, 4 * alone.evaluations);
    }
  }
}

TEST(UnitedObstacles, MayBeMeshesOrOfSeveralMaterials) {
  const SolidBox block = box(Vec3(0, 0, -1), Vec3(3, 3, 1)), left = box(Vec3(-1.7, 0, -1), Vec3(2, 3, 1)), right = box(Vec3(1.7, 0, -1), Vec3(2, 3, 1));
  const implicit::MeshSolid mesh(block.mesh(), {});
  const Vec3 at(0.07, 0.03, 0.9);
  Meeting alone(at, {{kGround}}), flush(at, {{kGround}, {mesh}});
  const Sum one = sum_of(alone.stage.solve({.error = 1e-3}));
  EXPECT_EQ(flush.stage.solve({.error = 1e-3}).summary.size(), 1u);
  EXPECT_LE((sum_of(flush.stage.surface).force - one.force).norm(), 2e-3 * one.force.norm());
  // What differs in friction stays apart, each area with its own.
  Meeting rough(at, {{left}, {right}});
  rough.stage.bodies()[2].material.friction = 0.5;
  const ContactSurface& s = rough.stage.solve({.error = 1e-2});
  EXPECT_EQ(s.summary.size(), 2u);
  EXPECT_NEAR(sum_of(s).force.z(), one.force.z(), 1e-2 * one.force.z());
}

TEST(UnitedObstacles, CostAboutAsMuchAsOne) {
  const SolidBox slab = box(Vec3(0, 0, -1), Vec3(3, 3, 1));
  Meeting one(Vec3(0.05, 0.03, 0.9), {{slab}}), two(Vec3(0.05, 0.03, 0.9), {{kGround}, {slab}});
  EXPECT_LE(sum_of(two.stage.solve({.error = 1e-2})).evaluations, 3 * sum_of(one.stage.solve({.error = 1e-2})).evaluations);
}

}  // namespace
}  // namespace supple::collision
