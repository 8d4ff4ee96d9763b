/// @file polar_rule.h
/// Spectral quadrature on a smooth patch of Sigma: Gauss-Legendre in the radius times the trapezoid rule in the angle
/// about the point of largest pressure, both exponentially convergent because the integrand is smooth, periodic and
/// vanishes at the rim. Columns along the axis carry the integrals over the squeezed regions.
#pragma once

#include <array>
#include <vector>

#include "find_peak.h"
#include "pair_pressure.h"
#include "patch_points.h"
#include "quadrature.h"
#include "supple/collision/contact_surface.h"

namespace supple::collision {

class PolarRuleSolver {
 public:
  /// Refines until two consecutive rules agree to `settings.error`, at most `settings.max_refinement` times.
  /// @param columns  whether the squeezed region of A, of B is wanted
  /// @param extent  rims farther away are not believed [m]
  /// @return false where the rule does not fit: rim not found, not a graph over the tangent plane, or the squeezed
  ///         regions reach beyond the rim. `points` is then not to be used.
  [[nodiscard]] bool solve(PairPressure& pressure, const PeakFrame& frame, const ContactSettings& settings,
                           const std::array<bool, 2>& columns, double extent, PatchPoints& points);

  [[nodiscard]] const PatchSums& sums() const noexcept { return fine_; }  ///< about the frame's origin
  [[nodiscard]] double estimate() const noexcept { return estimate_; }
  [[nodiscard]] double thickness() const noexcept { return thickness_; }  ///< of the overlap through the peak [m]

 private:
  bool solve_rim(PairPressure& pressure, const PolarRule& rule, double error);
  bool solve_heights(PairPressure& pressure, const PolarRule& rule, double error);
  bool integrate(const PolarRule& rule);
  bool add_columns(PairPressure& pressure, const PolarRule& rule, int side, double error, PatchPoints& points);
  bool column_ends(PairPressure& pressure, int side, double tolerance);
  void start_rim(const PolarRule& rule, bool first);
  [[nodiscard]] double algebraic_error() const;

  PeakFrame frame_;
  double jacobian_ = 0.0;  // |u| |v|
  double extent_ = 0.0;
  std::vector<double> rim_radius_, rim_height_, coarse_radius_, coarse_height_;
  std::vector<double> low_, high_;
  std::vector<std::uint8_t> done_;
  PressureBatch rim_, node_;
  std::vector<double> height_, weight_, area_, pressure_, end_[2];
  std::vector<Vec3> foot_, normal_, line_point_, line_slope_;
  std::vector<double> line_value_;
  double residual_ = 0.0;
  double rim_error_ = 0.0;  // relative, of the area
  double lift_ = 0.0;       // largest distance of a node from Sigma
  double size_ = 0.0;       // of the bodies' features
  PatchSums fine_, coarse_;
  double estimate_ = 1.0;
  double thickness_ = 0.0;

 public:
  /// The rim of the last solve: its radius by angle (equally spaced), and its world points.
  [[nodiscard]] const std::vector<double>& rim_radius() const noexcept { return rim_radius_; }
  [[nodiscard]] const std::vector<double>& rim_height() const noexcept { return rim_height_; }
};

/// The ground that a polar patch covers.
struct PolarCover {
  PeakFrame frame;
  std::vector<double> radius, height;  ///< of the rim, by angle
  double thickness = 0.0;
  /// Whether x lies over the patch, near Sigma. @param slack  share of the radius that a point may lie outside
  [[nodiscard]] bool contains(const Vec3& x, double slack) const;
  [[nodiscard]] Vec3 rim_point(std::size_t k) const;
};

}  // namespace supple::collision
