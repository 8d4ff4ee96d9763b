/// @file several_bodies.h
/// Bodies of which more than two are in one place, and the forces and the energy of their contacts by sums over the volumes that they lose.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "contact_shapes.h"

namespace supple::benchmarks {

/// Balls, rods, discs and ellipsoids of random sizes and moduli at random places of a cube about as large as they are.
class BodiesInOnePlace {
 public:
  BodiesInOnePlace(int count, std::uint64_t seed) {
    constexpr double kCube = 0.4, kSpacing = 0.05;  // side, samples [m]
    Draw draw(seed);
    rigid_.reserve(static_cast<std::size_t>(count));
    for (int b = 0; b < count; ++b) {
      rigid_.emplace_back(shape(draw), draw.uniform(1.0, 4.0), kSpacing);
      pose_.push_back({kCube * Vec3(draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5)), draw.rotation()});
      rigid_.back().put(pose_.back());
    }
  }
  [[nodiscard]] std::vector<collision::ContactBody> bodies() const {
    std::vector<collision::ContactBody> out;
    for (const Rigid& body : rigid_) out.push_back(body.body());
    return out;
  }
  /// Moves a body away from where it was drawn.
  void move(std::size_t body, const Vec3& by) { rigid_[body].put({pose_[body].position + by, pose_[body].orientation}); }

 private:
  static implicit::Skeleton shape(Draw& draw) {
    using implicit::ShapeKind;
    constexpr std::array kShapes{ShapeKind::Point, ShapeKind::Segment, ShapeKind::Disc, ShapeKind::Ellipsoid};
    const double support = draw.uniform(0.3, 0.6), half = draw.uniform(0.1, 0.3), flat = draw.uniform(0.6, 1.0);
    const ShapeKind kind = kShapes[std::min(kShapes.size() - 1, static_cast<std::size_t>(draw.uniform(0.0, 1.0) * kShapes.size()))];
    if (kind == ShapeKind::Ellipsoid) return wyvill_shape(kind, support * Vec3(1.0, 1.0, flat), flat * support);
    return wyvill_shape(kind, kind == ShapeKind::Point ? Vec3::Zero() : Vec3(half, 0.0, 0.0), support);
  }

  std::vector<Rigid> rigid_;
  std::vector<Pose> pose_;
};

/// The force on each body is the integral of the slope of its pressure where another one is larger (Gauss); the energy is that of all pressures but the
/// largest.
struct LostVolumes {
  std::vector<Vec3> force;   ///< by body [N]
  std::vector<double> load;  ///< the integral of the size of that slope [N]
  double energy = 0.0;       ///< [J]
};

/// By midpoints of cells in the box of all overlaps: off by about n^-1.5 of the loads at the borders of the volumes.
/// @param cells  n, along each side
inline LostVolumes lost_volumes(std::span<const collision::ContactBody> bodies, int cells) {
  Box box;
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const Box common = bodies[a].field.surface_box().intersection(bodies[b].field.surface_box());
      if (!common.empty()) box = box.united(common);
    }
  }
  LostVolumes sum{std::vector<Vec3>(bodies.size(), Vec3::Zero()), std::vector<double>(bodies.size(), 0.0)};
  if (box.empty()) return sum;
  const Vec3 cell = box.extent() / cells;
  std::vector<Vec3> row(static_cast<std::size_t>(cells));
  std::vector<std::vector<double>> value(bodies.size(), std::vector<double>(row.size()));
  std::vector<std::vector<Vec3>> slope(bodies.size(), std::vector<Vec3>(row.size()));
  const auto pressure = [&](std::size_t b, std::size_t i) { return bodies[b].material.modulus * value[b][i]; };
  for (int line = 0; line < cells * cells; ++line) {
    for (int i = 0; i < cells; ++i) row[static_cast<std::size_t>(i)] = box.lower + cell.cwiseProduct(Vec3(i + 0.5, line % cells + 0.5, line / cells + 0.5));
    for (std::size_t b = 0; b < bodies.size(); ++b) bodies[b].field.evaluate(row, value[b], slope[b]);
    for (std::size_t i = 0; i < row.size(); ++i) {
      double largest = 0.0;
      for (std::size_t b = 0; b < bodies.size(); ++b) largest = std::max(largest, pressure(b, i));
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        const double p = pressure(b, i);
        if (!(p > 0.0) || !(p < largest)) continue;
        const Vec3 push = (bodies[b].material.modulus * cell.prod()) * slope[b][i];
        sum.force[b] += push;
        sum.load[b] += push.norm();
        sum.energy += p * cell.prod();
      }
    }
  }
  return sum;
}

/// What the energy by sums over cells is off by at most [J]; half as many cells each way are off by more than twice as much. Where the largest pressure changes from one
/// body to another both press alike, so that cells there cost little.
inline double energy_left(const LostVolumes& exact, const LostVolumes& of_half_as_many) {
  constexpr double kOfDifference = 3.0, kLeast = 1e-5;
  return kOfDifference * std::abs(exact.energy - of_half_as_many.energy) + kLeast * exact.energy;
}

/// What a query of all bodies says of each, and of all.
struct ContactsOfBodies {
  std::vector<Vec3> force;   ///< by body [N]
  std::vector<double> off;   ///< by the estimates of its pairs [N]
  double energy = 0.0;       ///< [J]
  double largest_estimate = 0.0;
  std::size_t pairs = 0;

  ContactsOfBodies(std::size_t bodies, std::span<const collision::ContactSurface::Summary> summary)
      : force(bodies, Vec3::Zero()), off(bodies, 0.0), pairs(summary.size()) {
    for (const collision::ContactSurface::Summary& s : summary) {
      largest_estimate = std::max(largest_estimate, s.error_estimate);
      force[s.bodies.a] += s.force;
      force[s.bodies.b] -= s.force;
      for (const std::uint32_t b : {s.bodies.a, s.bodies.b}) off[b] += s.error_estimate * std::max(s.force.norm(), 1e-3 * s.load);
      energy += s.energy;
    }
  }
};

}  // namespace supple::benchmarks
