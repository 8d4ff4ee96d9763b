/// @file supple/core/lennard_jones.h
/// The Lennard-Jones pair law with two whole exponents, and two ways to end it at a cut-off that keep it an energy.
#pragma once

#include "supple/core/pair_laws.h"

namespace supple::core {

/// Phi(d) = depth / (n - m) (m (r0/d)^n - n (r0/d)^m), n > m: least, -depth, at r0, and 0 at infinity.
/// With a cut-off r1 either the force is shifted, f(d) - f(r1), or, with switch_from = r_s > 0, the potential is
/// multiplied by S = 1 - t^3 (10 - 15 t + 6 t^2), t = (d - r_s) / (r1 - r_s) in [0, 1], and then differentiated:
/// f S - Phi S'. A switch on the force alone would have no energy. Both energies are 0 from r1 on.
struct LennardJones {
  double r0 = 0.0;            ///< rest distance [m], > 0
  double depth = 0.0;         ///< binding energy without cut-off [J], > 0
  int repulsive = 12;         ///< n, at most kLargestExponent
  int attractive = 6;         ///< m, 0 < m < n
  double cut_off = 0.0;       ///< r1 [m]; 0: none
  double switch_from = 0.0;   ///< r_s [m], < r1; 0: the force is shifted

  static constexpr int kLargestExponent = 63;

  /// Lombardo & Puech 1995, footnote 2, with corrected exponents: f = E ((r0/d)^(2n+1) - (r0/d)^(n+1)), so that
  /// f(r0) = 0 and the short-ranged term repels. Stiffness n E / r0, binding energy E r0 / (2 n).
  /// @param gain E [N]
  [[nodiscard]] static LennardJones from_gain(double r0, double gain, int n);

  [[nodiscard]] double energy(double distance) const;   ///< [J]
  [[nodiscard]] double force(double distance) const;    ///< f [N], > 0 repulsive
  [[nodiscard]] double slope(double distance) const;    ///< df/dd [N/m]
  /// Where the attraction is largest without cut-off [m]: r0 ((n + 1) / (m + 1))^(1 / (n - m)).
  [[nodiscard]] double maximum_distance() const;
};

/// @pre d > 0, 0 < m < n <= kLargestExponent
[[nodiscard]] PairLoad evaluate(const LennardJones& law, const PairPose& pose);
/// Bound by the steepest slope within r0/10 of rest.
[[nodiscard]] Stiffness stiffness(const LennardJones& law);

}  // namespace supple::core
