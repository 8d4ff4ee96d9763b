/// Which rule a pair gets, and that all agree.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "benchmarks/contact_shapes.h"
#include "collision/bodies.h"

namespace supple::collision {
namespace {

using testing::Blobs;
using testing::Stage;

constexpr double kPi = std::numbers::pi;

/// A body with a skeleton, in a pose.
struct Shaped {
  implicit::Skeleton skeleton;
  std::vector<Pose> parts;
  implicit::PlacedSkeleton placed;
  implicit::Field field;

  Shaped(std::vector<implicit::Primitive> primitives, std::vector<Pose> poses) : parts(std::move(poses)) {
    skeleton.primitive = std::move(primitives);
    skeleton.part_count = static_cast<std::uint32_t>(parts.size());
    implicit::place_skeleton(skeleton, parts, placed);
    implicit::index_field(skeleton, placed, field);
  }
  void add_to(Stage& stage, double modulus) const {
    std::vector<Vec3> centres;
    for (const Pose& p : parts) centres.push_back(p.position);
    stage.add(field, centres, modulus).skeleton = &skeleton;
    stage.pose(stage.bodies().size() - 1) = parts;
  }
};

/// p = E (1 - d / r) inside: Gascuel's kernel is linear as far as the surface.
Shaped linear_sphere(double r, const Pose& pose) {
  implicit::Primitive p;
  p.kernel = implicit::Kernel::gascuel(r, 1.5 * r, 0.5 / r);
  return Shaped({p}, {pose});
}
const Quat kTurn = Quat(0.3, -0.5, 0.7, 0.2).normalized();
const Quat kOther = Quat(-0.1, 0.8, 0.2, 0.5).normalized();

/// Two bodies of several blobs, one with two blobs on one part.
struct Lumps {
  Shaped left, right;
  Stage stage;
  static implicit::Primitive blob(std::uint32_t part, const Vec3& at) {
    implicit::Primitive p;
    p.part = part;
    p.offset.position = at;
    p.kernel = implicit::Kernel::wyvill(1.0);
    return p;
  }
  Lumps()
      : left({blob(0, Vec3::Zero()), blob(1, Vec3::Zero()), blob(2, Vec3::Zero())},
             {{Vec3(-0.4, 0, 0), kTurn}, {Vec3(0, 0.1, 0), kOther}, {Vec3(-0.2, 0.3, 0.1), Quat::Identity()}}),
        right({blob(0, Vec3(0.1, 0, 0)), blob(0, Vec3(-0.13, 0.2, 0.15))}, {{Vec3(0.7, 0.02, 0.2), Quat::Identity()}}) {
    left.add_to(stage, 1.0);
    right.add_to(stage, 2.0);
  }
};

TEST(ContactRules, AgreeOnForcesOfPartsAndKeepMomenta) {
  std::vector<std::vector<PartLoads>> loads;
  for (const ContactRule rule : {ContactRule::Polar, ContactRule::Panels, ContactRule::March}) {
    Lumps scene;
    scene.stage.solve({.error = 3e-3, .only = rule});
    ASSERT_EQ(scene.stage.surface.summary.size(), 1u);
    ASSERT_EQ(scene.stage.surface.summary[0].rule, rule);
    loads.push_back(scene.stage.react());
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    double size = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t k = 0; k < loads.back()[i].force.size(); ++k) {
        const Vec3& f = loads.back()[i].force[k];
        force += f;
        moment += scene.stage.pose(i)[k].position.cross(f) + loads.back()[i].torque[k];
        size += f.norm();
      }
    }
    EXPECT_LT(force.norm(), 1e-14 * size);
    EXPECT_LT(moment.norm(), 1e-14 * size);
  }
  const double size = loads[0][1].force[0].norm();
  for (const std::size_t rule : {1u, 2u}) {
    for (std::size_t k = 0; k < 3; ++k) {
      // The bounds of force and centre, and the volumes' own error of the same order.
      EXPECT_LT((loads[rule][0].force[k] - loads[0][0].force[k]).norm(), 2e-2 * size) << rule << ' ' << k;
      EXPECT_LT((loads[rule][0].torque[k] - loads[0][0].torque[k]).norm(), 2e-2 * size) << rule << ' ' << k;
    }
  }
  // They are not the same points.
  EXPECT_GT((loads[1][1].force[0] - loads[0][1].force[0]).norm(), 1e-8 * size);
  EXPECT_GT((loads[2][1].force[0] - loads[0][1].force[0]).norm(), 1e-8 * size);
}

TEST(ContactRules, MarchWhereNoPolarPatchFits) {
  // A ring of blobs on a plane, fewer than panels are chosen for, and one around a ball: the patch is an annulus, narrow there and wide here.
  constexpr std::uint32_t kBlobs = 15;
  std::vector<implicit::Primitive> blobs;
  std::vector<Pose> parts;
  for (std::uint32_t k = 0; k < kBlobs; ++k) {
    const auto [s, c] = math::sin_cos(2.0 * kPi * k / kBlobs);
    blobs.push_back(Lumps::blob(k, Vec3::Zero()));
    blobs.back().kernel = implicit::Kernel::wyvill(0.7);
    parts.push_back({Vec3(c, s, 0.3), kTurn});
  }
  const Shaped beads(blobs, parts);
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1e9};
  benchmarks::Rigid ring(benchmarks::wyvill_shape(implicit::ShapeKind::Ring, Vec3(0.2, 0.0, 0.0), 0.15), 2.0, 0.03);
  benchmarks::Rigid ball(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.33), 1.0, 0.03);
  ring.put({});
  ball.put({Vec3(0.01, 0.0, 0.005), kTurn});
  Stage narrow, wide;
  beads.add_to(narrow, 1.0);
  narrow.add(plane).fixed = true;
  wide.bodies() = {ball.body(), ring.body()};
  for (Stage* stage : {&narrow, &wide}) {
    const ContactSurface::Summary finest = stage->solve({.error = 1e-4, .only = ContactRule::March}).summary.at(0);
    for (const double error : {1e-1, 5e-2, 2e-2, 1e-2}) {
      const auto solve = [&](ContactRule only) { return stage->solve({.error = error, .only = only}).summary.at(0); };
      const ContactSurface::Summary s = solve(ContactRule::None);
      EXPECT_EQ(s.rule, ContactRule::March);
      EXPECT_EQ(s.reason, RuleReason::NoGraph);
      EXPECT_LE(s.error_estimate, error);
      EXPECT_LE((s.force - finest.force).norm(), (s.error_estimate + finest.error_estimate) * std::max(finest.force.norm(), 1e-3 * finest.load));
    }
  }
  // A rule that does not fit, alone, gives no force.
  const ContactSurface::Summary polar = narrow.solve({.error = 1e-2, .only = ContactRule::Polar}).summary.at(0);
  EXPECT_EQ(polar.rule, ContactRule::None);
  EXPECT_EQ(polar.error_estimate, 1.0);
  EXPECT_EQ(polar.force, Vec3::Zero());
  // By the midpoint rule over the plane.
  const ContactSurface::Summary s = narrow.solve({.error = 1e-2}).summary.at(0);
  constexpr int kCells = 800;
  const double half = 2.0, h = 2.0 * half / kCells;
  std::vector<Vec3> row(kCells);
  std::vector<double> p(kCells);
  double force = 0.0;
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) row[static_cast<std::size_t>(i)] = Vec3(-half + (i + 0.5) * h, -half + (j + 0.5) * h, 0.0);
    beads.field.evaluate(row, p);
    for (const double value : p) force += std::max(value, 0.0) * h * h;
  }
  EXPECT_NEAR(s.force.z(), force, 1e-2 * force);
}

TEST(ContactRules, FindNothingBetweenBodiesApart) {
  // Boxes overlap, surfaces are 1e-3 apart.
  const Vec3 axis(0.6, 0.64, 0.48);
  const Shaped left = linear_sphere(1.0, {Vec3::Zero(), kTurn}), right = linear_sphere(1.0, {2.001 * axis, kOther});
  for (const ContactRule rule : {ContactRule::None, ContactRule::Panels, ContactRule::Polar, ContactRule::March}) {
    Stage stage;
    left.add_to(stage, 1.0);
    right.add_to(stage, 1.0);
    stage.candidates.pair = {{0, 1}};
    stage.candidates.overlap = {left.field.surface_box().intersection(right.field.surface_box())};
    stage.candidates.offset = {0, 0};
    stage.candidates.spacing = {0.0};
    stage.candidates.convex = {0};
    solve_contact_surface(stage.bodies(), stage.candidates, {.error = 1e-2, .only = rule}, Executor(1), stage.surface);
    EXPECT_TRUE(stage.surface.summary.empty()) << static_cast<int>(rule);
  }
}

}  // namespace
}  // namespace supple::collision
