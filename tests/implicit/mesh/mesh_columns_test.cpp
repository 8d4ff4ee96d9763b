#include "supple/implicit/mesh_columns.h"

#include <gtest/gtest.h>

#include "implicit/bodies.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit {
namespace {

using namespace testing;

struct Coloured {
  Body body = random_body({.seed = 8, .parts = 20});
  Mesh mesh = march_cubes(body.field, {.lattice = {.origin = Vec3(0.01, 0.02, 0.03), .cell = 0.08}}, Executor(1));
  [[nodiscard]] double value(std::size_t column, std::size_t vertex) const { return mesh.columns[column].values[vertex]; }
};

TEST(MeshColumns, RestCoordinatesOfARigidBodyUndoItsMotion) {
  Coloured c;
  const Pose moved{.position = Vec3(1, -2, 0.5), .orientation = Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()))};
  std::vector<PartPlace> parts;
  for (const Pose& now : c.body.parts) {
    // `now` is `rest` carried by `moved`.
    parts.push_back({.now = now, .rest = {moved.to_body(now.position), moved.orientation.conjugate() * now.orientation}});
  }
  const Vec3 origin(0.3, 0.2, 0.1);
  add_rest_coordinates(c.body.field, parts, origin, Executor(2), c.mesh);
  ASSERT_EQ(c.mesh.columns.size(), 3u);
  EXPECT_EQ(c.mesh.columns[0].name, "rest_x");
  for (std::size_t v = 0; v < c.mesh.vertex_count(); ++v) {
    const Vec3 rest(c.value(0, v), c.value(1, v), c.value(2, v));
    EXPECT_LT((rest + origin - moved.to_body(c.mesh.position[v])).norm(), 1e-12);
  }
}

TEST(MeshColumns, ValuesOfPartsAreMixedByTheirShares) {
  Coloured c;
  std::vector<Vec3> places;
  std::vector<double> one, rising;
  for (std::size_t k = 0; k < c.body.parts.size(); ++k) {
    places.push_back(c.body.parts[k].position);
    one.push_back(1.0);
    rising.push_back(static_cast<double>(k));
  }
  add_part_values(c.body.field, places, one, "one", Executor(1), c.mesh);
  add_part_values(c.body.field, places, rising, "rising", Executor(1), c.mesh);
  FieldParts shares;
  c.body.field.evaluate_parts(c.mesh.position, shares);
  for (std::size_t v = 0; v < c.mesh.vertex_count(); ++v) {
    double sum = 0.0, mean = 0.0;
    for (std::size_t i = shares.offset[v]; i < shares.offset[v + 1]; ++i) {
      sum += shares.value[i];
      mean += shares.value[i] * shares.part[i];
    }
    EXPECT_NEAR(c.value(0, v), 1.0, 1e-12);
    EXPECT_NEAR(c.value(1, v), mean / sum, 1e-9);
  }
}

TEST(MeshColumns, TakeTheNearestPartWhereNoneReaches) {
  Coloured c;
  Mesh far;
  far.position = {Vec3(100, 0, 0), Vec3(-100, 0, 0)};
  const std::vector<Vec3> places = {Vec3(-1, 0, 0), Vec3(1, 0, 0)};
  add_part_values(c.body.field, places, std::vector<double>{5.0, 7.0}, "value", Executor(1), far);
  EXPECT_EQ(far.columns[0].values, (std::vector<double>{7.0, 5.0}));
}

TEST(MeshColumns, SpeedIsThatOfARigidBody) {
  Coloured c;
  const Vec3 v(0.3, -1.0, 0.5), w(0.2, 0.7, -1.1);
  std::vector<PartMotion> motion;
  for (const Pose& part : c.body.parts)
    motion.push_back({.centre = part.position, .velocity = v + w.cross(part.position), .angular_velocity = w});
  add_speed(c.body.field, motion, Executor(1), c.mesh);
  for (std::size_t i = 0; i < c.mesh.vertex_count(); ++i)
    EXPECT_NEAR(c.value(0, i), (v + w.cross(c.mesh.position[i])).norm(), 1e-12);
}

}  // namespace
}  // namespace supple::implicit
