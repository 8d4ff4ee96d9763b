#include "supple/implicit/mesh_motion.h"

#include <gtest/gtest.h>

#include "implicit/bodies.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/volume.h"

namespace supple::implicit {
namespace {

using namespace testing;

struct Moving {
  Body body = random_body({.seed = 8, .parts = 20});
  std::vector<PartMotion> motion;
  Mesh mesh;

  void make() {
    mesh = march_cubes(body.field, {.lattice = {.origin = Vec3(0.01, 0.02, 0.03), .cell = 0.08}}, Executor(1));
    for (std::uint32_t i = 0; i < motion.size(); ++i) {
      motion[i].centre = body.parts[i].position;
      motion[i].id = 100 + i;
    }
    add_motion(body.field, motion, Executor(2), mesh);
  }
  [[nodiscard]] Vec3 velocity(std::size_t v) const {
    return {mesh.columns[0].values[v], mesh.columns[1].values[v], mesh.columns[2].values[v]};
  }
};

TEST(MeshMotion, IsTheMotionOfARigidBody) {
  Moving moving;
  const Vec3 v(0.3, -1.0, 0.5), w(0.2, 0.7, -1.1);
  for (const Pose& part : moving.body.parts) {
    moving.motion.push_back({.velocity = v + w.cross(part.position), .angular_velocity = w});
  }
  moving.make();
  ASSERT_GT(moving.mesh.vertex_count(), 100u);
  for (std::size_t i = 0; i < moving.mesh.vertex_count(); ++i) {
    EXPECT_LT((moving.velocity(i) - v - w.cross(moving.mesh.position[i])).norm(), 1e-12);
  }
}

// A vertex carried for a time dt stays on the surface up to dt^2 times second derivatives of F and of the motion: halving
// dt divides |F| by four. Blends by gradients see the gradients of their parts turn.
TEST(MeshMotion, KeepsVerticesOnTheMovingSurfaceToSecondOrder) {
  for (const bool by_gradients : {false, true}) {
    const auto make = [&](const std::vector<PartMotion>& motion, double dt) {
      Body body = random_body({.seed = 9, .parts = 20, .only_points = !by_gradients});
      if (by_gradients) {
        body = body_of({{wyvill_point(1.0), Vec3(-0.3, 0, 0)}, {wyvill_point(1.0), Vec3(0.4, 0.1, 0)}});
        body.skeleton.primitive[0].shape = ShapeKind::Segment;
        body.skeleton.primitive[0].size = Vec3(0.4, 0, 0);
        body.parts[0].orientation = Quat(0.8, 0.1, 0.3, 0.4).normalized();
        body.skeleton.blend.rule = BlendRule::Gradient;
      }
      for (std::size_t i = 0; i < motion.size(); ++i) {
        const Vec3 turn = dt * motion[i].angular_velocity;
        body.parts[i].position += dt * motion[i].velocity;
        if (turn.norm() > 0.0) body.parts[i].orientation = Quat(Eigen::AngleAxisd(turn.norm(), turn.normalized())) * body.parts[i].orientation;
      }
      body.place();
      return body;
    };
    Moving moving;
    moving.body = make({}, 0.0);
    Random random(3);
    for (std::size_t i = 0; i < moving.body.parts.size(); ++i) {
      moving.motion.push_back({.velocity = random.in_box(1.0), .angular_velocity = by_gradients ? random.in_box(1.0) : Vec3::Zero()});
    }
    moving.make();
    std::array<double, 2> mean{};
    for (std::size_t k = 0; k < 2; ++k) {
      const double dt = k == 0 ? 2e-3 : 1e-3;
      const Body later = make(moving.motion, dt);
      for (std::size_t i = 0; i < moving.mesh.vertex_count(); ++i) {
        const Vec3& x = moving.mesh.position[i];
        const double before = FieldView(moving.body.field).value(x);  // what the vertex is off by at first
        mean[k] += std::abs(FieldView(later.field).value(x + dt * moving.velocity(i)) - before);
      }
    }
    EXPECT_NEAR(mean[0] / mean[1], 4.0, 0.2) << by_gradients;
  }
}

// Kernels that grow move the surface of a ball outward.
TEST(MeshMotion, ByMomentsIsThatOfSurfacesThatAreNotCarriedRigidly) {
  constexpr double kRate = 0.7, kTime = 1e-5;
  const auto moments = [&](const Body& before, const Body& after) { return FieldMoments{before.field, after.field, 2.0 * kTime}; };
  Moving moving;
  const Vec3 v(0.2, 0.4, -0.1);
  const auto grown = [&](double time) { return body_of({{scaled(wyvill_point(1.0), 1.0 + time * kRate), Vec3(0.1, 0, 0) + time * v}}); };
  moving.body = grown(0.0);
  moving.motion = {{.velocity = v}};
  moving.make();
  {
    const Body before = grown(-kTime), after = grown(kTime);
    const FieldMoments found = moments(before, after);
    moving.mesh.columns.clear();
    add_motion(moving.body.field, moving.motion, Executor(1), moving.mesh, &found);
  }
  for (std::size_t i = 0; i < moving.mesh.vertex_count(); ++i) {
    ASSERT_LT((moving.velocity(i) - v - kRate * (moving.mesh.position[i] - Vec3(0.1, 0, 0))).norm(), 1e-8);
  }
}

TEST(MeshMotion, OfBallsThatTurnWhereTheyAreIsTangential) {
  Moving moving;
  moving.body = body_of({{wyvill_point(1.0), Vec3(-0.35, 0, 0)}, {wyvill_point(1.0), Vec3(0.35, 0, 0)}});
  moving.body.skeleton.blend.rule = BlendRule::Gradient;
  moving.body.place();
  moving.motion = {{.angular_velocity = Vec3(0.3, 1.0, 0.5)}, {}};
  moving.make();
  double fastest = 0.0;
  for (std::size_t i = 0; i < moving.mesh.vertex_count(); ++i) {
    fastest = std::max(fastest, moving.velocity(i).norm());
    EXPECT_LT(std::abs(moving.velocity(i).dot(moving.mesh.normal[i])), 1e-12);
  }
  EXPECT_GT(fastest, 0.1);
}

TEST(MeshMotion, NamesThePartWithTheLargestShare) {
  Moving moving;
  moving.body = body_of({{wyvill_point(1.0), Vec3(-0.5, 0, 0)}, {wyvill_point(1.0), Vec3(0.5, 0, 0)}});
  moving.motion.resize(2);
  moving.make();
  ASSERT_EQ(moving.mesh.columns[3].name, "owner");
  for (std::size_t i = 0; i < moving.mesh.vertex_count(); ++i) {
    if (std::abs(moving.mesh.position[i].x()) < 1e-9) continue;
    EXPECT_EQ(moving.mesh.columns[3].values[i], moving.mesh.position[i].x() < 0.0 ? 100.0 : 101.0);
  }
}

}  // namespace
}  // namespace supple::implicit
