/// @file quadrature.h
/// Tables of the quadrature rules: Gauss-Legendre on (0, 1), equally spaced angles, trigonometric interpolation.
#pragma once

#include <array>
#include <span>
#include <vector>

namespace supple::collision {

struct GaussRule {
  std::vector<double> node;    ///< in (0, 1), rising
  std::vector<double> weight;  ///< sum to 1
};
/// @pre 1 <= n <= 16
[[nodiscard]] const GaussRule& gauss_rule(int n);

/// On (0, 1) from values and slopes at both ends: sum = end (f(0) + f(1)) + slope (f'(0) - f'(1)) + weight . f(node), exact for
/// polynomials of degree 2 n + 3, as Gauss's rule with n + 2 nodes is (Gautschi 2004, BIT 44, 711).
struct TwoEndRule {
  double end, slope;
  std::vector<double> node, weight;
};
/// @param n  nodes between the ends, in [0, 4]
[[nodiscard]] const TwoEndRule& two_end_rule(int n);

/// Gauss-Legendre on (-1, 1) and its extension by Kronrod: every second node is the smaller rule's.
struct KronrodRule {
  std::vector<double> node;          ///< rising
  std::vector<double> weight;        ///< sum to 2
  std::vector<double> gauss_weight;  ///< of the smaller rule, 0 where it has no node
};
/// @param gauss  nodes of the smaller rule, in {2, 3, 7}; 2 gauss + 1 of the larger (Kronrod 1965; QUADPACK)
[[nodiscard]] const KronrodRule& kronrod_rule(int gauss);

/// The rules of the polar quadrature from coarse to fine (theory of spectral quadrature on a smooth patch).
struct PolarRule {
  int radial;
  int angular;
  int column;  ///< Gauss points through each squeezed region
  std::vector<double> cosine, sine;  ///< of the angles 2 pi k / angular
  /// Row k: trigonometric interpolation from the angles of the rule before to angle k; empty for the first.
  std::vector<double> from_coarser;
};
[[nodiscard]] std::span<const PolarRule> polar_rules();
/// The same with a single ray.
[[nodiscard]] std::span<const PolarRule> polar_rays();

/// For a closed curve known at the angles 2 pi k / n of a rule.
struct CurveAngles {
  std::vector<double> cosine, sine;            ///< of these and of three between each two, 2 pi i / (4 n)
  std::vector<double> wave_cosine, wave_sine;  ///< row k: of 2 pi m k / n, m from 0 to n / 2
};
/// @pre n is the number of angles of a rule
[[nodiscard]] const CurveAngles& curve_angles(std::size_t n);

}  // namespace supple::collision
