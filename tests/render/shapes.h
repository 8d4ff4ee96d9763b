/// @file shapes.h
/// Closed meshes with exact normals for the tests of the pictures.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "supple/core/mesh.h"

namespace supple::render::test {

/// A cube's faces, each cells x cells quads, mapped to a sphere of radius `radius` swept over a box of half edges
/// `core`: a rounded box, or a sphere when `core` is zero. 12 cells^2 triangles.
inline Mesh rounded_box(const Vec3& core, double radius, int cells, const Pose& pose = {}) {
  Mesh mesh;
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const double side = face % 2 == 0 ? 1.0 : -1.0;
    const auto base = static_cast<std::uint32_t>(mesh.position.size());
    for (int j = 0; j <= cells; ++j)
      for (int i = 0; i <= cells; ++i) {
        // Equal angles: the cells of a sphere differ little in size.
        const double u = std::tan(0.25 * M_PI * (2.0 * i / cells - 1.0));
        const double v = std::tan(0.25 * M_PI * (2.0 * j / cells - 1.0));
        Vec3 on_cube;
        on_cube[axis] = side;
        on_cube[(axis + 1) % 3] = u * side;
        on_cube[(axis + 2) % 3] = v;
        const Vec3 n = on_cube.normalized();
        // The flat parts take the middle half of the cells.
        Vec3 corner = Vec3::Zero();
        for (int k = 0; k < 3; ++k) corner[k] = core[k] * std::clamp(2.0 * on_cube[k], -1.0, 1.0);
        Vec3 soft;
        for (int k = 0; k < 3; ++k) soft[k] = std::max(std::abs(on_cube[k]) - 0.5, 0.0) * (on_cube[k] < 0 ? -1 : 1);
        const Vec3 direction = core.isZero() ? n : soft.normalized();
        mesh.position.push_back(pose.to_world(corner + radius * direction));
        mesh.normal.push_back(pose.orientation * direction);
      }
    const auto row = static_cast<std::uint32_t>(cells + 1);
    for (std::uint32_t j = 0; j + 1 < row; ++j)
      for (std::uint32_t i = 0; i + 1 < row; ++i) {
        const std::uint32_t a = base + j * row + i;
        mesh.triangle.push_back({a, a + 1, a + row + 1});
        mesh.triangle.push_back({a, a + row + 1, a + row});
      }
  }
  return mesh;
}

inline Mesh sphere(const Vec3& centre, double radius, int cells) {
  return rounded_box(Vec3::Zero(), radius, cells, {.position = centre, .orientation = Quat::Identity()});
}

/// A block between two corners, with sharp edges.
inline Mesh block_of(const Vec3& low, const Vec3& high) {
  const auto corner = [&](int k) { return Vec3((k & 1) != 0 ? high.x() : low.x(), (k & 2) != 0 ? high.y() : low.y(), (k & 4) != 0 ? high.z() : low.z()); };
  Mesh mesh;
  for (const auto& f : {std::array{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
    add_quadrangle(mesh, corner(f[0]), corner(f[1]), corner(f[2]), corner(f[3]));
  }
  return mesh;
}

}  // namespace supple::render::test
