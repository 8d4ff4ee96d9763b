/// Normals of meshes with smooth and sharp edges.
#include "output/pictures/smooth_normals.h"

#include <gtest/gtest.h>

#include <cmath>


namespace supple::scenes {
namespace {

/// Every triangle with three vertices of its own.
Mesh parted(const Mesh& mesh) {
  Mesh out;
  for (const auto& triangle : mesh.triangle) {
    const Vec3 &a = mesh.position[triangle[0]], &b = mesh.position[triangle[1]], &c = mesh.position[triangle[2]];
    const auto first = static_cast<std::uint32_t>(out.position.size());
    out.triangle.push_back({first, first + 1, first + 2});
    for (const Vec3& x : {a, b, c}) {
      out.position.push_back(x);
      out.normal.push_back((b - a).cross(c - a).normalized());
    }
  }
  return out;
}

Mesh cube() {
  Mesh mesh;
  const double k = 1.0;
  add_quadrangle(mesh, {-k, -k, -k}, {-k, k, -k}, {k, k, -k}, {k, -k, -k});
  add_quadrangle(mesh, {-k, -k, k}, {k, -k, k}, {k, k, k}, {-k, k, k});
  add_quadrangle(mesh, {-k, -k, -k}, {k, -k, -k}, {k, -k, k}, {-k, -k, k});
  add_quadrangle(mesh, {-k, k, -k}, {-k, k, k}, {k, k, k}, {k, k, -k});
  add_quadrangle(mesh, {-k, -k, -k}, {-k, -k, k}, {-k, k, k}, {-k, k, -k});
  add_quadrangle(mesh, {k, -k, -k}, {k, k, -k}, {k, k, k}, {k, -k, k});
  return parted(mesh);
}

/// A prism of n sides about z, open at its ends.
Mesh prism(int n) {
  Mesh mesh;
  const auto at = [n](int k, double z) { return Vec3(std::cos(2.0 * M_PI * k / n), std::sin(2.0 * M_PI * k / n), z); };
  for (int k = 0; k < n; ++k) add_quadrangle(mesh, at(k, 0.0), at(k + 1 == n ? 0 : k + 1, 0.0), at(k + 1 == n ? 0 : k + 1, 1.0), at(k, 1.0));
  return parted(mesh);
}

double radians(double degrees) { return degrees * M_PI / 180.0; }

TEST(SmoothNormals, LeaveEdgesSharpThatTurnMore) {
  Mesh mesh = cube();
  const Mesh flat = mesh;
  smooth_normals(radians(89.0), mesh);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) EXPECT_LT((mesh.normal[v] - flat.normal[v]).norm(), 1e-15);
}

TEST(SmoothNormals, AreThoseOfTheCornersWhateverTheTriangles) {
  Mesh mesh = cube();  // one, two or three of whose corners' six triangles are of one face
  smooth_normals(radians(91.0), mesh);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) EXPECT_LT((mesh.normal[v] - mesh.position[v].normalized()).norm(), 1e-14);
}

TEST(SmoothNormals, OfAPrismPointAwayFromItsAxis) {
  Mesh mesh = prism(16);  // faces that turn by 22.5 degrees
  const Mesh flat = mesh;
  smooth_normals(radians(22.0), mesh);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) EXPECT_LT((mesh.normal[v] - flat.normal[v]).norm(), 1e-14);
  smooth_normals(radians(23.0), mesh);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    EXPECT_LT((mesh.normal[v] - Vec3(mesh.position[v].x(), mesh.position[v].y(), 0.0)).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace supple::scenes
