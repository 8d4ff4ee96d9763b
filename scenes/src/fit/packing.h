/// @file packing.h
/// Particles inside a closed mesh, each in the middle of an equal share of the volume, and bonds between neighbouring shares.
#pragma once

#include <array>
#include <vector>

#include "fit/samples.h"

namespace supple::fit {

/// Between the shares of two bonded particles.
struct Face {
  Vec3 area = Vec3::Zero();    ///< along its normal, from the first particle to the second
  Vec3 centre = Vec3::Zero();
  Mat3 first = Mat3::Zero();                   ///< sum of (x - centre) dA^T over the squares of the lattice that it consists of
  std::array<Mat3, 3> second = no_moments();   ///< sum of (x - centre)(x - centre)^T dA_m, for each axis m

  [[nodiscard]] static std::array<Mat3, 3> no_moments() { return {Mat3::Zero(), Mat3::Zero(), Mat3::Zero()}; }
};

struct Packing {
  std::vector<Vec3> particle;
  std::vector<std::uint32_t> share;                   ///< of each point of the lattice inside: the particle that it belongs to
  std::vector<std::array<std::uint32_t, 2>> bond;     ///< sorted
  std::vector<Face> face;                             ///< of each bond; faces close around shares that have no free boundary
  bool connected = false;
};

/// Whether bonds lead from the first particle to all others.
[[nodiscard]] bool is_connected(const Packing& packing);

/// Particles and their shares of points, without bonds.
[[nodiscard]] Packing pack_points(const std::vector<Vec3>& points, std::size_t count, const Executor& executor);

/// Centroidal Voronoi tessellation of the points of the lattice (Lloyd 1982), from points that lie farthest from one another. Bonds join particles whose shares
/// have a common face within the solid, so not across a gap; parts that a neck thinner than the lattice joins get a bond between their nearest particles.
/// @param count  fewer where the lattice has fewer points
[[nodiscard]] Packing pack_inside(const Surroundings& around, std::size_t count, const Executor& executor);

}  // namespace supple::fit
