/// @file patch_points.h
/// What a quadrature rule hands over: weighted points on Sigma and in the squeezed regions, and their sums.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "numbers.h"
#include "supple/core/types.h"

namespace supple::collision {

/// Sums over quadrature points of Sigma; moments are about `reference`.
struct PatchSums {
  Vec3 force = Vec3::Zero();    ///< integral of p N dA [N]
  Vec3 moment = Vec3::Zero();   ///< integral of (x - reference) x p N dA [N m]
  Vec3 first = Vec3::Zero();    ///< integral of (x - reference) p dA [N m]
  double load = 0.0;            ///< integral of p dA [N]
  double area = 0.0;            ///< [m^2]
  double spread = 0.0;          ///< integral of |x - reference|^2 p dA [N m^2]
  std::array<double, 2> flux{};  ///< about the energies of A and B, where columns out of an apex carry them (Apex); else 0 [J]

  void add(const Vec3& from_reference, const Vec3& normal, double weight, double pressure) {
    const Vec3 f = (weight * pressure) * normal;
    force += f;
    moment += from_reference.cross(f);
    first += (weight * pressure) * from_reference;
    load += weight * pressure;
    area += weight;
    spread += weight * pressure * from_reference.squaredNorm();
  }
  /// As A and B have it when they change places.
  void reverse() {
    force = -force;
    moment = -moment;
    std::swap(flux[0], flux[1]);
  }
  void add(const PatchSums& other, double weight = 1.0) {
    force += weight * other.force;
    moment += weight * other.moment;
    first += weight * other.first;
    load += weight * other.load;
    area += weight * other.area;
    spread += weight * other.spread;
    for (const std::size_t side : {0u, 1u}) flux[side] += weight * other.flux[side];
  }
  [[nodiscard]] Vec3 centre() const { return load > 0.0 ? Vec3(first / load) : Vec3::Zero().eval(); }
};

/// What errors of the force are measured against: where it nearly cancels over the patches, a thousandth of the load.
inline double force_scale(const Vec3& force, double load) { return std::max(force.norm(), 1e-3 * load); }

/// Largest relative difference of force, area and centre of pressure (over the root of the area).
inline double relative_difference(const PatchSums& fine, const PatchSums& coarse) {
  if (!(fine.load > 0.0) || !(fine.area > 0.0)) return 1.0;
  const double force = (fine.force - coarse.force).norm() / force_scale(fine.force, fine.load);
  const double area = std::abs(fine.area - coarse.area) / fine.area;
  const double centre = (fine.centre() - coarse.centre()).norm() / std::sqrt(fine.area);
  return std::max({force, area, centre});
}

/// Round-off of coordinates [m] in the place of a surface, over how deep bodies overlap [m].
inline double rounding_error(double coordinates, double thickness) {
  return 16.0 * kEpsilon * (1.0 + coordinates / thickness);
}

/// More of it than this, and no rule tells more than rings do, if they do.
inline constexpr double kLostInRounding = 1e-2;

/// What is wanted of a squeezed region.
enum class Region : std::uint8_t {
  None,
  Sums,    ///< its energy and volume
  Points,  ///< these, and quadrature points
};
using Regions = std::array<Region, 2>;  // of A, of B

struct PatchPoints {
  std::vector<Vec3> point, normal;
  std::vector<double> area, pressure;
  double residual = 0.0;  ///< largest |p_A - p_B| [Pa]

  std::vector<Vec3> volume_point;
  std::vector<double> volume_weight;
  std::vector<std::uint8_t> volume_side;
  double energy[2] = {0.0, 0.0};     ///< integrals of the own pressure over V_A and V_B
  double displaced[2] = {0.0, 0.0};  ///< volumes of these
  bool unsure[2] = {false, false};   ///< whether columns from Sigma may miss some of them, or hold it twice

  void clear() {
    point.clear();
    normal.clear();
    area.clear();
    pressure.clear();
    residual = 0.0;
    volume_point.clear();
    volume_weight.clear();
    volume_side.clear();
    for (const int side : {0, 1}) {
      energy[side] = displaced[side] = 0.0;
      unsure[side] = false;
    }
  }

  /// A becomes B.
  void reverse() {
    for (Vec3& n : normal) n = -n;
    for (std::uint8_t& side : volume_side) side = side == 0 ? 1 : 0;
    std::swap(energy[0], energy[1]);
    std::swap(displaced[0], displaced[1]);
    std::swap(unsure[0], unsure[1]);
  }

  /// Takes all of a squeezed region away.
  void drop_region(int side) {
    energy[side] = displaced[side] = 0.0;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < volume_side.size(); ++i) {
      if (volume_side[i] == side) continue;
      volume_point[kept] = volume_point[i];
      volume_weight[kept] = volume_weight[i];
      volume_side[kept++] = volume_side[i];
    }
    volume_point.resize(kept);
    volume_weight.resize(kept);
    volume_side.resize(kept);
  }

  /// How much there is, to come back to.
  struct Mark {
    std::size_t points, volumes;
    double residual, energy[2], displaced[2];
    bool unsure[2];
  };
  [[nodiscard]] Mark mark() const {
    return {point.size(), volume_point.size(), residual, {energy[0], energy[1]}, {displaced[0], displaced[1]}, {unsure[0], unsure[1]}};
  }
  void back_to(const Mark& mark) {
    point.resize(mark.points);
    normal.resize(mark.points);
    area.resize(mark.points);
    pressure.resize(mark.points);
    volume_point.resize(mark.volumes);
    volume_weight.resize(mark.volumes);
    volume_side.resize(mark.volumes);
    residual = mark.residual;
    for (const int side : {0, 1}) {
      energy[side] = mark.energy[side];
      displaced[side] = mark.displaced[side];
      unsure[side] = mark.unsure[side];
    }
  }
};

}  // namespace supple::collision
