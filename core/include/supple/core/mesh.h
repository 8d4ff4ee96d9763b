/// @file supple/core/mesh.h
/// A triangle mesh as plain arrays, with named per-vertex columns for further data.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "supple/core/types.h"

namespace supple {

/// Counter-clockwise triangles seen from outside; index i is the same vertex in every array.
struct Mesh {
  struct Column {
    std::string name;            ///< e.g. "pressure"; the unit is documented where the column is made
    std::vector<double> values;  ///< shape [vertices]
  };

  std::vector<Vec3> position;                             ///< [m], shape [vertices]
  std::vector<Vec3> normal;                               ///< unit, outward, shape [vertices]
  std::vector<std::array<std::uint32_t, 3>> triangle;     ///< vertex indices, shape [triangles]
  std::vector<Column> columns;                            ///< optional per-vertex data

  [[nodiscard]] std::size_t vertex_count() const noexcept { return position.size(); }
  [[nodiscard]] std::size_t triangle_count() const noexcept { return triangle.size(); }
  void clear();
};

/// Appends `other` to `mesh`. A column that only one of them has is 0 for the vertices of the other.
void append(Mesh& mesh, const Mesh& other);

/// Adds a flat face with four vertices of its own, counter-clockwise from outside.
void add_quadrangle(Mesh& mesh, const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

/// Measured properties of a surface mesh.
struct MeshReport {
  bool closed = false;              ///< every edge has exactly two triangles
  bool oriented = false;            ///< the two triangles of every edge have consistent orientation
  long euler_characteristic = 0;    ///< V - E + F
  std::size_t components = 0;       ///< connected components
  double area = 0.0;                ///< [m^2]
  double volume = 0.0;              ///< [m^3], by the divergence theorem; meaningful when closed and oriented
};

[[nodiscard]] MeshReport inspect(const Mesh& mesh);

}  // namespace supple
