/// @file column_kinks.h
/// Where columns cross the kinks of a body: Gauss's rule along one converges slowly across them.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "surface/pair_pressure.h"

namespace supple::collision {

class ColumnKinks {
 public:
  /// The kinks of one body, as far as its field tells; none of bodies without end. @param error  at which mild ones are left out
  ColumnKinks(const PairPressure& pressure, int side, double error);

  /// The ends of the parts of a column in which the pressure is smooth: 0, where it crosses kinks, and its length [m], rising.
  /// @param way  unit   @return valid until the next call
  [[nodiscard]] std::span<const double> parts(const Vec3& from, const Vec3& way, double length);

 private:
  void cross(const implicit::Kink& kink, const Vec3& from, const Vec3& way, double length);
  void add(double at, double length) {
    if (at > 0.0 && at < length) part_.push_back(at);
  }

  std::vector<implicit::Kink> kink_;
  std::vector<double> part_;
};

/// Gauss points on each part of a column. @param whole  on one without kinks
[[nodiscard]] inline int order_of_parts(int whole, std::span<const double> parts) {
  constexpr int kFewer = 2, kEnough = 5;  // parts are shorter
  return parts.size() > 2 ? std::max(whole - kFewer, std::min(whole, kEnough)) : whole;
}

}  // namespace supple::collision
