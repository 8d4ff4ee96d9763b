/// @file tests/implicit/mesh_checks.h
/// What tests ask of meshes.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "supple/core/hash.h"
#include "supple/core/mesh.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit::testing {

inline const Vec3 kOffset(0.0137, -0.0071, 0.0229);  // puts no node on a surface

inline Lattice lattice_of(double cell) { return {.origin = kOffset, .cell = cell}; }

inline MeshReport expect_closed(const Mesh& mesh) {
  const MeshReport report = inspect(mesh);
  EXPECT_GT(mesh.triangle_count(), 0u);
  EXPECT_TRUE(report.closed);
  EXPECT_TRUE(report.oriented);
  EXPECT_EQ(mesh.normal.size(), mesh.vertex_count());
  return report;
}

inline std::uint64_t hash_of(const Mesh& mesh) {
  Hasher hasher;
  hasher.add(std::span<const Vec3>(mesh.position));
  hasher.add(std::span<const Vec3>(mesh.normal));
  for (const auto& t : mesh.triangle) {
    for (const std::uint32_t v : t) hasher.add(std::uint64_t{v});
  }
  for (const Mesh::Column& column : mesh.columns) {
    hasher.add(std::string_view(column.name));
    hasher.add(std::span<const double>(column.values));
  }
  return hasher.value();
}

inline std::uint64_t hash_of(const std::vector<Mesh>& meshes) {
  Hasher hasher;
  for (const Mesh& mesh : meshes) hasher.add(hash_of(mesh));
  return hasher.value();
}

/// Six times the signed volume of a tetrahedron.
inline double orientation(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return (b - a).cross(c - a).dot(d - a);
}

/// Does the open segment pass through the open triangle, by more than rounding?
inline bool pierces(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  const double size = std::max({(q - p).norm(), (b - a).norm(), (c - a).norm()});
  const double least = 1e-12 * size * size * size;
  const double sp = orientation(a, b, c, p), sq = orientation(a, b, c, q);
  if (!((sp > least && sq < -least) || (sp < -least && sq > least))) return false;
  const double u = orientation(p, q, a, b), v = orientation(p, q, b, c), w = orientation(p, q, c, a);
  return (u > least && v > least && w > least) || (u < -least && v < -least && w < -least);
}

/// Pairs of triangles of a mesh where an edge of one passes through the other; an edge with a vertex of the other
/// triangle is left out. Only triangles in a common bucket are compared.
/// @param bucket  edge of the buckets [m]
inline std::size_t self_intersections(const Mesh& mesh, double bucket) {
  using Triangle = std::array<std::uint32_t, 3>;
  std::map<std::array<int, 3>, std::vector<std::uint32_t>> buckets;
  std::vector<Box> box(mesh.triangle_count());
  for (std::uint32_t i = 0; i < box.size(); ++i) {
    for (const std::uint32_t v : mesh.triangle[i]) box[i].include(mesh.position[v]);
    const Eigen::Vector3i low = (box[i].lower / bucket).array().floor().cast<int>();
    const Eigen::Vector3i high = (box[i].upper / bucket).array().floor().cast<int>();
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) buckets[{x, y, z}].push_back(i);
      }
    }
  }
  const auto crosses = [&](const Triangle& s, const Triangle& t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t p = s[k], q = s[(k + 1) % 3];
      if (std::count(t.begin(), t.end(), p) + std::count(t.begin(), t.end(), q) > 0) continue;
      if (pierces(mesh.position[p], mesh.position[q], mesh.position[t[0]], mesh.position[t[1]], mesh.position[t[2]])) {
        return true;
      }
    }
    return false;
  };
  std::set<std::pair<std::uint32_t, std::uint32_t>> found;
  for (const auto& [place, members] : buckets) {
    for (std::size_t i = 0; i < members.size(); ++i) {
      for (std::size_t j = i + 1; j < members.size(); ++j) {
        if (!box[members[i]].overlaps(box[members[j]])) continue;
        const Triangle &s = mesh.triangle[members[i]], &t = mesh.triangle[members[j]];
        if (crosses(s, t) || crosses(t, s)) found.emplace(members[i], members[j]);
      }
    }
  }
  return found.size();
}

/// Positions of a triangle, starting with the smallest, so that rotations compare equal.
using Corners = std::array<std::array<double, 3>, 3>;
inline Corners corners_of(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
  Corners c{};
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3& p = mesh.position[t[k]];
    c[k] = {p.x(), p.y(), p.z()};
  }
  std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
  return c;
}

}  // namespace supple::implicit::testing
