/// @file closed_meshes.h
/// Closed triangle meshes of known shapes.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "supple/core/math.h"
#include "supple/core/mesh.h"

namespace supple::test {

/// An octahedron whose triangles are cut in four `levels` times, with vertices on the unit sphere times `radius`.
inline Mesh octahedral_sphere(double radius, int levels) {
  Mesh mesh;
  mesh.position = {Vec3::UnitX(), -Vec3::UnitX(), Vec3::UnitY(), -Vec3::UnitY(), Vec3::UnitZ(), -Vec3::UnitZ()};
  mesh.triangle = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle;
    const auto between = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, fresh] = middle.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.position.size()));
      if (fresh) mesh.position.push_back((mesh.position[a] + mesh.position[b]).normalized());
      return at->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& [a, b, c] : mesh.triangle) {
      const std::uint32_t ab = between(a, b), bc = between(b, c), ca = between(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    mesh.triangle = std::move(finer);
  }
  for (Vec3& x : mesh.position) x *= radius;
  return mesh;
}

/// A box about `centre`. @param turned  reverses the orientation of its triangles
inline Mesh block(const Vec3& half, const Vec3& centre = Vec3::Zero(), bool turned = false) {
  Mesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    const auto side = [&](int axis) { return (corner >> axis & 1) == 1 ? 1.0 : -1.0; };
    mesh.position.push_back(centre + half.cwiseProduct(Vec3(side(0), side(1), side(2))));
  }
  mesh.triangle = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4}, {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  if (turned) {
    for (auto& t : mesh.triangle) std::swap(t[1], t[2]);
  }
  return mesh;
}

inline Mesh both(Mesh one, const Mesh& other) {
  append(one, other);
  return one;
}

/// A gear: `teeth` of them between two radii, `height` thick, with its faces divided into strips from its axis.
inline Mesh gear(int teeth, double inner, double outer, double height) {
  Mesh mesh;
  const auto rim = static_cast<std::uint32_t>(4 * teeth);
  for (const double z : {-0.5 * height, 0.5 * height}) {
    for (std::uint32_t i = 0; i < rim; ++i) {
      const auto [s, c] = math::sin_cos(2.0 * std::numbers::pi * i / rim);
      mesh.position.push_back((i % 4 < 2 ? outer : inner) * Vec3(c, s, 0) + Vec3(0, 0, z));
    }
    mesh.position.emplace_back(0, 0, z);
  }
  const std::uint32_t top = rim + 1;
  for (std::uint32_t i = 0; i < rim; ++i) {
    const std::uint32_t j = (i + 1) % rim;
    mesh.triangle.insert(mesh.triangle.end(), {{rim, j, i}, {top + rim, top + i, top + j}, {i, j, top + j}, {i, top + j, top + i}});
  }
  return mesh;
}

/// Places spread evenly over a box, by the R3 sequence.
inline std::vector<Vec3> places(const Box& box, int count) {
  std::vector<Vec3> out;
  for (int i = 1; i <= count; ++i) {
    const Vec3 at(std::fmod(0.8191725133961645 * i, 1.0), std::fmod(0.6710436067037893 * i, 1.0), std::fmod(0.5497004779019703 * i, 1.0));
    out.push_back(box.lower + box.extent().cwiseProduct(at));
  }
  return out;
}

}  // namespace supple::test
