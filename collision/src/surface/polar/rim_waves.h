/// @file rim_waves.h
/// Rays of a patch to its rim, and the rim as a trigonometric sum through their ends.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "surface/find_peak.h"

namespace supple::collision {

/// Directions from the origin of a patch's frame, and where the rim is met on them: radii in units of u and v, heights in metres.
struct Rays {
  std::vector<double> cosine, sine, radius, height;  // (cosine, sine): about the middle, of any length
  std::vector<Vec2> outward;                         // the pressure falls, in units of u and v
  [[nodiscard]] std::size_t size() const noexcept { return cosine.size(); }
};

class RimWaves {
 public:
  /// @param rim  at equal angles
  void fit(const Rays& rim);
  /// Radius and height of the rim in a direction.
  [[nodiscard]] std::array<double, 2> at(double cosine, double sine) const;
  /// Points of the rim, four for each ray: they leave no room for a kink between them.
  void place(const PeakFrame& frame, std::vector<Vec3>& points) const;

 private:
  template <class Directions>
  std::array<Directions, 2> sum(const Directions& cosine, const Directions& sine) const;

  struct Wave {
    Eigen::ArrayXd cosine, sine;
  };
  std::array<Wave, 2> wave_;  // Fourier coefficients of the rim's radius and height
  std::size_t count_ = 0;     // of rays
};

}  // namespace supple::collision
