/// @file shapes.h
/// Closed meshes of known shapes, written where `fit` reads them.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>

#include "supple/core/io/mesh_files.h"
#include "supple/core/mesh.h"
#include "support/closed_meshes.h"
#include "support/temp_folder.h"

namespace supple::test {

/// A sphere moved by a function.
inline Mesh moved_sphere(int levels, const std::function<Vec3(const Vec3&)>& move) {
  Mesh mesh = octahedral_sphere(1.0, levels);
  for (Vec3& p : mesh.position) p = move(p);
  return mesh;
}

/// A torus about the z axis.
inline Mesh torus(double large, double small, std::uint32_t around, std::uint32_t across) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < around; ++i) {
    for (std::uint32_t j = 0; j < across; ++j) {
      const double a = 2.0 * std::numbers::pi * i / around, b = 2.0 * std::numbers::pi * j / across;
      const double r = large + small * std::cos(b);
      mesh.position.emplace_back(r * std::cos(a), r * std::sin(a), small * std::sin(b));
      const std::uint32_t ni = (i + 1) % around, nj = (j + 1) % across;
      const std::uint32_t p = i * across + j, q = ni * across + j, r0 = ni * across + nj, s = i * across + nj;
      mesh.triangle.push_back({p, q, r0});
      mesh.triangle.push_back({p, r0, s});
    }
  }
  return mesh;
}

/// A rod with round ends along x.
inline Mesh rod(double half, double radius) {
  constexpr std::uint32_t kRings = 48, kAround = 32;
  Mesh mesh;
  for (std::uint32_t i = 0; i < kRings; ++i) {
    // Ten rings on each end, the others between; the first and the last are nearly points.
    constexpr double kOfEnd = 10.0;
    const double k = i, end = std::min({k, kRings - 1.0 - k, kOfEnd}) / kOfEnd;
    const double angle = 0.5 * std::numbers::pi * (1.0 - end) * (1.0 - 1e-3), along = std::clamp((k - kOfEnd) / (kRings - 1.0 - 2.0 * kOfEnd), 0.0, 1.0);
    const double x = half * (2.0 * along - 1.0) + (2.0 * i < kRings ? -1.0 : 1.0) * radius * std::sin(angle);
    for (std::uint32_t j = 0; j < kAround; ++j) {
      const double turn = 2.0 * std::numbers::pi * j / kAround;
      mesh.position.emplace_back(x, radius * std::cos(angle) * std::cos(turn), radius * std::cos(angle) * std::sin(turn));
      const std::uint32_t next = (j + 1) % kAround, p = i * kAround;
      if (i + 1 < kRings) {
        mesh.triangle.push_back({p + j, p + next, p + kAround + next});
        mesh.triangle.push_back({p + j, p + kAround + next, p + kAround + j});
      }
    }
  }
  const auto first = static_cast<std::uint32_t>(mesh.position.size());
  mesh.position.emplace_back(-half - radius, 0.0, 0.0);
  mesh.position.emplace_back(half + radius, 0.0, 0.0);
  for (std::uint32_t j = 0; j < kAround; ++j) {
    const std::uint32_t next = (j + 1) % kAround, last = (kRings - 1) * kAround;
    mesh.triangle.push_back({first, next, j});
    mesh.triangle.push_back({first + 1, last + j, last + next});
  }
  return mesh;
}

/// The file of a mesh in the folder of the test.
inline std::filesystem::path saved(const Mesh& mesh, const std::string& name) {
  const std::filesystem::path path = temp_folder() / (name + ".obj");
  Mesh with_normals = mesh;
  with_normals.normal.assign(mesh.position.size(), Vec3::UnitZ());
  io::write_obj(path, with_normals);
  return path;
}

}  // namespace supple::test
