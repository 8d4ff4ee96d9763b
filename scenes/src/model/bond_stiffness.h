/// @file bond_stiffness.h
/// Stiffness of one bond from the modulus of the material and the section that it stands for.
#pragma once

#include <algorithm>
#include <numbers>

namespace supple::scenes {

struct BondStiffness {
  double along = 0.0;     ///< k_n [N/m]
  double across = 0.0;    ///< k_t [N/m]
  double rotation = 0.0;  ///< k_theta [N m]
};

/// A rod of round section between neighbours at this distance. The share of the bending stiffness that resists sliding makes the twist that of
/// nu = 1/4, G J = 4/5 E I; a tip bends by 3.5 (distance / length)^2 too far.
/// @param section  area [m^2]
[[nodiscard]] inline BondStiffness rod_bond(double youngs_modulus, double section, double distance) {
  constexpr double kSlidingShare = 0.2;
  constexpr double kShear = 0.36;  // of round sections: kappa G / E with kappa = 0.9, G = 0.4 E
  const double second = section * section / (4.0 * std::numbers::pi);
  BondStiffness k;
  k.along = youngs_modulus * section / distance;
  k.across = std::min(kSlidingShare * 4.0 * youngs_modulus * second / (distance * distance * distance), kShear * k.along);
  k.rotation = 0.5 * (youngs_modulus * second / distance - 0.25 * k.across * distance * distance);
  return k;
}

/// k_t / k_n of bonds in all directions of space whose sum contracts by nu (sums over the directions; Born & Huang 1954).
[[nodiscard]] constexpr double sliding_ratio(double poissons_ratio) { return (1.0 - 4.0 * poissons_ratio) / (1.0 + poissons_ratio); }

/// A bond between the middles of two shares of a solid. Sections that close around each share carry a modulus of (2 + 3 alpha)(1 + nu) / 5 of theirs where all
/// bonds deform alike; k_theta and the least k_t are those of a rod, so that thin parts bend.
/// @param section  area of the face between the shares [m^2]
[[nodiscard]] inline BondStiffness packing_bond(double youngs_modulus, double poissons_ratio, double section, double distance) {
  const double alpha = sliding_ratio(poissons_ratio);
  BondStiffness k = rod_bond(youngs_modulus, 5.0 * section / ((2.0 + 3.0 * alpha) * (1.0 + poissons_ratio)), distance);
  k.across = std::max(k.across, alpha * k.along);
  k.rotation = std::max(k.rotation, 0.0);
  return k;
}

}  // namespace supple::scenes
