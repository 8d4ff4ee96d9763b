/// @file supple/core/gay_berne.h
/// The Gay-Berne pair law of equal ellipsoids (Gay & Berne 1981, in the form for three unequal axes of Everaers &
/// Ejtehadi 2003, and of LAMMPS' pair_style gayberne): a Lennard-Jones potential of the distance between surfaces,
/// with a strength that depends on the directions of approach.
#pragma once

#include "supple/core/pair_laws.h"

namespace supple::core {

/// U = 4 epsilon (rho^12 - rho^6) eta chi with rho = sigma / (d - sigma_12 + gamma sigma), G = G_A + G_B and
/// B = B_A + B_B,
///   sigma_12 = (u^T G^-1 u / 2)^(-1/2), u = r/d    the distance at which the ellipsoids would touch,
///   eta = (2 l^2 / det G)^(upsilon/2), l = (a b + c^2) sqrt(a b),
///   chi = (2 u^T B^-1 u)^mu,
/// where G_X = Q_X diag(a^2, b^2, c^2) Q_X^T and B_X = Q_X diag(well^(-1/mu)) Q_X^T. A sphere of radius sigma/2 with
/// wells 1 and gamma 1 is a Lennard-Jones particle. @pre d - sigma_12 + gamma sigma > 0: deep overlap has no energy
struct GayBerne {
  double epsilon = 1.0;                   ///< [J]
  double sigma = 1.0;                     ///< [m], > 0
  double gamma = 1.0;                     ///< shift of the distance [sigma]
  Vec3 radii = Vec3::Constant(0.5);       ///< half axes a, b, c along the body axes [m], > 0
  Vec3 well = Vec3::Ones();               ///< depth of the well for approach along each body axis [epsilon], > 0
  int upsilon = 1;                        ///< >= 0
  int mu = 1;                             ///< >= 1
};

/// The same with a potential that is switched off between two distances of the centres, so that force and energy end
/// without a jump: S U with S = 1 - t^3 (10 - 15 t + 6 t^2), t = (d - switch_from) / (cut_off - switch_from) in [0, 1].
struct SwitchedGayBerne {
  GayBerne ellipsoid;
  double switch_from = 0.0;  ///< [m], >= 0
  double cut_off = 0.0;      ///< [m], > switch_from

  static constexpr int kLargestExponent = 63;  ///< of upsilon and mu
};

/// The law without a cut-off. @pre d > 0
[[nodiscard]] PairLoad evaluate(const GayBerne& law, const PairPose& pose);

/// @pre d > 0
[[nodiscard]] PairLoad evaluate(const SwitchedGayBerne& law, const PairPose& pose);
/// Bound for the deepest wells, at gaps down to a tenth below the rest gap.
[[nodiscard]] Stiffness stiffness(const SwitchedGayBerne& law);

}  // namespace supple::core
