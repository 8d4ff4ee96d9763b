#include "supple/core/mesh.h"

#include <gtest/gtest.h>

#include "supple/core/error.h"

namespace {

using namespace supple;

Mesh tetrahedron(const Vec3& shift = Vec3::Zero()) {
  Mesh mesh;
  mesh.position = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  for (Vec3& x : mesh.position) x += shift;
  mesh.triangle = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

TEST(MeshReport, OfATetrahedronIsKnownWhereverItLies) {
  for (const double far : {0.0, 1e6}) {
    const MeshReport report = inspect(tetrahedron(Vec3::Constant(far)));
    EXPECT_TRUE(report.closed);
    EXPECT_TRUE(report.oriented);
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_EQ(report.components, 1U);
    EXPECT_NEAR(report.area, 1.5 + 0.5 * std::sqrt(3.0), 1e-9);
    EXPECT_NEAR(report.volume, 1.0 / 6.0, 1e-9);
  }
}

TEST(MeshReport, CountsComponentsAndLeavesStrayVerticesOut) {
  Mesh mesh = tetrahedron();
  const Mesh other = tetrahedron(Vec3(5, 0, 0));
  mesh.position.emplace_back(9, 9, 9);
  for (const Vec3& x : other.position) mesh.position.push_back(x);
  for (auto t : other.triangle) mesh.triangle.push_back({t[0] + 5, t[1] + 5, t[2] + 5});
  const MeshReport report = inspect(mesh);
  EXPECT_TRUE(report.closed);
  EXPECT_EQ(report.components, 2U);
  EXPECT_EQ(report.euler_characteristic, 4);
  EXPECT_NEAR(report.volume, 2.0 / 6.0, 1e-14);
}

TEST(MeshReport, SeesHolesFlippedTrianglesAndTripleEdges) {
  Mesh hole = tetrahedron();
  hole.triangle.pop_back();
  EXPECT_FALSE(inspect(hole).closed);

  Mesh flipped = tetrahedron();
  std::swap(flipped.triangle[3][0], flipped.triangle[3][1]);
  EXPECT_TRUE(inspect(flipped).closed);
  EXPECT_FALSE(inspect(flipped).oriented);

  Mesh triple = tetrahedron();
  triple.position.emplace_back(2, 2, 2);
  triple.triangle.push_back({0, 1, 4});
  EXPECT_FALSE(inspect(triple).closed);

  EXPECT_FALSE(inspect(Mesh{}).closed);
}

TEST(MeshReport, RefusesIndicesOfNoVertex) {
  Mesh mesh = tetrahedron();
  mesh.triangle[0][0] = 17;
  EXPECT_THROW(static_cast<void>(inspect(mesh)), ContractViolation);
}

}  // namespace
