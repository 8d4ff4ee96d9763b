/// @file shapes.h
/// Closed meshes of known shapes, written where `fit` reads them.
#pragma once

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

/// The file of a mesh in the folder of the test.
inline std::filesystem::path saved(const Mesh& mesh, const std::string& name) {
  const std::filesystem::path path = temp_folder() / (name + ".obj");
  Mesh with_normals = mesh;
  with_normals.normal.assign(mesh.position.size(), Vec3::UnitZ());
  io::write_obj(path, with_normals);
  return path;
}

}  // namespace supple::test
