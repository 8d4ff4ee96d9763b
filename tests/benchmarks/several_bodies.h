/// @file several_bodies.h
/// Bodies of which more than two are in one place, and the forces and the energy of their contacts by columns through the volumes that they lose.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
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

/// A cubic over 0 to 1 from its values and slopes at both ends.
struct EndsCubic {
  double from, to, slope_from, slope_to;
  [[nodiscard]] double at(double t) const {
    const double u = 1.0 - t;
    return u * u * ((1.0 + 2.0 * t) * from + t * slope_from) + t * t * ((1.0 + 2.0 * u) * to - u * slope_to);
  }
  /// Where it is zero, if its ends are of different signs.
  [[nodiscard]] std::optional<double> zero() const {
    if ((from > 0.0) == (to > 0.0)) return std::nullopt;
    double low = 0.0, high = 1.0;
    for (int step = 0; step < 40; ++step) {
      const double middle = 0.5 * (low + high);
      ((at(middle) > 0.0) == (from > 0.0) ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }
  EndsCubic operator-(const EndsCubic& other) const { return {from - other.from, to - other.to, slope_from - other.slope_from, slope_to - other.slope_to}; }
};

/// One column of places through all bodies, which are known at the ends of its parts; between them pressures are cubics.
class Column {
 public:
  Column(std::size_t bodies, int parts)
      : place(static_cast<std::size_t>(parts) + 1), value_(bodies, std::vector<double>(place.size())), slope_(bodies, std::vector<Vec3>(place.size())), cubic_(bodies) {}

  /// @param length  of a part [m]   @param area  that the column stands for [m^2]
  void add(std::span<const collision::ContactBody> bodies, double length, double area, LostVolumes& sum) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      bodies[b].field.evaluate(place, value_[b], slope_[b]);
      for (double& p : value_[b]) p *= bodies[b].material.modulus;
      for (Vec3& slope : slope_[b]) slope *= bodies[b].material.modulus;
    }
    for (std::size_t k = 0; k + 1 < place.size(); ++k) add_part(k, length, area, sum);
  }

  std::vector<Vec3> place;  ///< along z

 private:
  void add_part(std::size_t k, double length, double area, LostVolumes& sum) {
    const auto reaches = [&](const std::vector<double>& p) { return p[k] > 0.0 || p[k + 1] > 0.0; };
    if (std::count_if(value_.begin(), value_.end(), reaches) < 2) return;
    cut_.assign({0.0, 1.0});
    const auto cut_at = [this](std::optional<double> t) {
      if (t) cut_.push_back(*t);
    };
    for (std::size_t b = 0; b < cubic_.size(); ++b) {
      cubic_[b] = {value_[b][k], value_[b][k + 1], length * slope_[b][k].z(), length * slope_[b][k + 1].z()};
      cut_at(cubic_[b].zero());
      for (std::size_t c = 0; c < b; ++c) cut_at((cubic_[b] - cubic_[c]).zero());
    }
    std::sort(cut_.begin(), cut_.end());
    for (std::size_t n = 0; n + 1 < cut_.size(); ++n) add_between(k, cut_[n], cut_[n + 1], length * area, sum);
  }
  /// Between cuts, by two Gauss points.
  void add_between(std::size_t k, double begin, double end, double volume, LostVolumes& sum) {
    const double root = 0.5 / std::sqrt(3.0);
    double largest = 0.0;
    for (const EndsCubic& p : cubic_) largest = std::max(largest, p.at(0.5 * (begin + end)));
    for (std::size_t b = 0; b < cubic_.size(); ++b) {
      const double middle = cubic_[b].at(0.5 * (begin + end));
      if (!(middle > 0.0) || !(middle < largest)) continue;
      for (const double node : {0.5 - root, 0.5 + root}) {
        const double t = begin + node * (end - begin), weight = 0.5 * volume * (end - begin);
        const Vec3 push = weight * slope_at(b, k, t);
        sum.force[b] += push;
        sum.load[b] += push.norm();
        sum.energy += weight * cubic_[b].at(t);
      }
    }
  }
  /// By the cubic through four places.
  [[nodiscard]] Vec3 slope_at(std::size_t b, std::size_t k, double t) const {
    const std::vector<Vec3>& s = slope_[b];
    if (k == 0 || k + 2 >= s.size()) return (1.0 - t) * s[k] + t * s[k + 1];
    return -t * (t - 1.0) * (t - 2.0) / 6.0 * s[k - 1] + 0.5 * (t + 1.0) * (t - 1.0) * (t - 2.0) * s[k] - 0.5 * (t + 1.0) * t * (t - 2.0) * s[k + 1] +
           (t + 1.0) * t * (t - 1.0) / 6.0 * s[k + 2];
  }

  std::vector<std::vector<double>> value_;  // of pressures, by body
  std::vector<std::vector<Vec3>> slope_;
  std::vector<EndsCubic> cubic_;
  std::vector<double> cut_;
};

/// By columns through the box of all overlaps, of which each is cut where the largest pressure changes hands: off by about n^-2.
/// @param columns  n, along each side; each has as many parts
inline LostVolumes lost_volumes(std::span<const collision::ContactBody> bodies, int columns) {
  Box box;
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const Box common = bodies[a].field.surface_box().intersection(bodies[b].field.surface_box());
      if (!common.empty()) box = box.united(common);
    }
  }
  LostVolumes sum{std::vector<Vec3>(bodies.size(), Vec3::Zero()), std::vector<double>(bodies.size(), 0.0)};
  if (box.empty()) return sum;
  const Vec3 cell = box.extent() / columns;
  Column column(bodies.size(), columns);
  for (int n = 0; n < columns * columns; ++n) {
    for (std::size_t k = 0; k < column.place.size(); ++k) {
      column.place[k] = box.lower + cell.cwiseProduct(Vec3(n % columns + 0.5, n / columns + 0.5, static_cast<double>(k)));
    }
    column.add(bodies, cell.z(), cell.x() * cell.y(), sum);
  }
  return sum;
}

/// What the force on a body by columns is off by at most [N]; half as many each way are off by more than twice as much.
inline double force_left(const LostVolumes& exact, const LostVolumes& of_half_as_many, std::size_t body) {
  constexpr double kLeast = 2e-4;
  return (exact.force[body] - of_half_as_many.force[body]).norm() + kLeast * *std::max_element(exact.load.begin(), exact.load.end());
}

/// What the energy by columns is off by at most [J]; half as many each way are off by more than twice as much.
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
