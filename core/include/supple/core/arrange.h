/// @file supple/core/arrange.h
/// Generators of particle arrangements. They lie in the x-y plane with z as axis; `place` turns them elsewhere.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::core {

/// Poses of particles and the body vector that is each particle's normal.
struct Arrangement {
  std::vector<Vec3> position;      ///< [m]
  std::vector<Quat> orientation;   ///< body to world
  // Of particles from files; empty: none are given.
  std::vector<Vec3> normal{};            ///< unit, body axes
  std::vector<Vec3> velocity{};          ///< [m/s]
  std::vector<double> mass{};            ///< [kg]
  std::vector<double> inertia_radius{};  ///< a in 2/5 m a^2 [m]
  [[nodiscard]] std::size_t size() const noexcept { return position.size(); }
};

/// Direction of the normals at rest; the normal is always the body's z axis.
enum class NormalDirection : std::uint8_t {
  Radial,  ///< along the principal normal of the curve, away from its centre (spiral, ring), in the plane
  Axis,    ///< along the axis of the arrangement (+z)
};

/// Archimedean spiral of `count` particles from `inner_radius` to `outer_radius` over `turns` turns, at equal arc length;
/// body x points along the curve. @pre count >= 2, 0 <= inner < outer
[[nodiscard]] Arrangement arrange_spiral(int count, double inner_radius, double outer_radius, double turns,
                                         NormalDirection normal);
/// `count` particles on a circle, at equal angles.
[[nodiscard]] Arrangement arrange_ring(int count, double radius, NormalDirection normal);
/// `count` particles `spacing` apart along x, centred; normals +z.
[[nodiscard]] Arrangement arrange_line(int count, double spacing);
/// Grid, `columns` along x, `rows` along y and `layers` along z, centred; normals +z.
[[nodiscard]] Arrangement arrange_grid(int columns, int rows, double spacing, int layers = 1);
/// Moves every particle by a random vector in a ball of radius `distance`, which depends on its index only: the same in every run.
void disorder(Arrangement& arrangement, double distance);
/// A closed shell: the icosahedron, each edge divided into `frequency` parts and its faces into triangles, projected to the sphere about
/// the origin; 10 frequency^2 + 2 particles, normals outward, the first and the twelfth opposite. @pre frequency <= 300
[[nodiscard]] Arrangement arrange_geodesic(int frequency, double radius);
/// The points of a cubic lattice, one of them the middle, within a ball.
[[nodiscard]] Arrangement arrange_ball(double radius, double spacing);
/// Rings about the z axis at equal distances of about `spacing`, from -length / 2 to length / 2, with as many particles as fit around;
/// normals outward, body x along z.
[[nodiscard]] Arrangement arrange_tube(double radius, double length, double spacing);
/// `count` particles at equal distances along the curve through the points (Catmull & Rom 1974, ends doubled), body x along it; body y and the normal turn
/// with it and no more (parallel transport). @pre count >= 2, at least two points, neighbours apart
[[nodiscard]] Arrangement arrange_curve(std::span<const Vec3> points, int count);
/// `count` particles at random in a box about the origin, no two nearer than `apart`; the same in every run. Fewer where a hundred tries for each
/// particle are not enough. @param size  edges of the box [m]
[[nodiscard]] Arrangement arrange_scatter(const Vec3& size, int count, double apart, int seed);
/// One particle at the origin, normal +z.
[[nodiscard]] Arrangement arrange_single();

/// Moves an arrangement: x -> pose x.
void place(Arrangement& arrangement, const Pose& pose);

/// Bonds between particles whose numbers differ by at most `steps` (chains), A < B, sorted.
struct Bonds {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> second;
};
[[nodiscard]] Bonds bonds_along(std::uint32_t begin, std::uint32_t end, int steps);
/// Number of bonds that `bonds_along` makes of `particles`.
[[nodiscard]] std::uint64_t count_bonds_along(std::uint64_t particles, int steps);
/// Bonds between particles of [begin, end) nearer than `distance` [m], sorted.
[[nodiscard]] Bonds bonds_within(std::span<const Vec3> position, std::uint32_t begin, std::uint32_t end, double distance);

/// Number of bonds that `bonds_within` makes of all particles, without making them.
struct BondCount {
  std::uint64_t number = 0;
  bool estimated = false;  ///< extrapolated from a part of the particles, as there are so many
};
[[nodiscard]] BondCount count_bonds_within(std::span<const Vec3> position, double distance);

}  // namespace supple::core
