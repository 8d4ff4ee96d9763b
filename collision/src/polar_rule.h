/// @file polar_rule.h
/// Spectral quadrature on a smooth patch of Sigma: Gauss-Legendre in the radius times the trapezoid rule in the angle
/// about the point of largest pressure, both exponentially convergent because the integrand is smooth, periodic and
/// vanishes at the rim. Where kinks of a field cross the patch, radii are parted at them, and angles where kinks meet the rim
/// and as finely as the error asks. Columns along the axis carry the integrals over the squeezed regions.
#pragma once

#include <array>
#include <vector>

#include "find_peak.h"
#include "pair_pressure.h"
#include "patch_points.h"
#include "quadrature.h"
#include "supple/collision/contact_surface.h"
#include "supple/implicit/kinks.h"

namespace supple::collision {

/// The ground that a polar patch covers.
struct PolarCover {
  PeakFrame frame;
  std::vector<double> radius, height;  ///< of the rim, by equally spaced angles
  std::vector<Vec3> rim;               ///< its points
  double thickness = 0.0;
  /// Whether x lies over the patch, near Sigma. @param slack  share of the radius that a point may lie outside
  [[nodiscard]] bool contains(const Vec3& x, double slack) const;
};

class PolarRuleSolver {
 public:
  /// Refines until two consecutive rules agree to `settings.error`, at most `settings.max_refinement` times.
  /// @param columns  whether the squeezed region of A, of B is wanted
  /// @param extent  rims farther away are not believed [m]
  /// @param third  bodies that may press on the patch too: it counts where none of them presses harder, and is parted there
  /// @param round  both pressures are the same all around the line through the frame's origin along its axis
  /// @return false where the rule does not fit: rim not found, not a graph over the tangent plane, or the squeezed
  ///         regions reach beyond the rim. `points` is then not to be used.
  [[nodiscard]] bool solve(PairPressure& pressure, const PeakFrame& frame, const ContactSettings& settings,
                           const std::array<bool, 2>& columns, double extent, std::span<const ContactBody* const> third,
                           bool round, PatchPoints& points);

  [[nodiscard]] const PatchSums& sums() const noexcept { return fine_; }  ///< about the frame's origin
  [[nodiscard]] double estimate() const noexcept { return estimate_; }
  [[nodiscard]] std::uint32_t kinks() const noexcept { return parted_; }  ///< that the patch was parted at
  [[nodiscard]] double thickness() const noexcept { return thickness_; }  ///< of the overlap through the peak [m]
  void cover(PolarCover& out) const;                                      ///< of the last solve

 private:
  /// Directions from the peak, and where the rim is met on them.
  struct Rays {
    std::vector<double> cosine, sine, radius, height;
    [[nodiscard]] std::size_t size() const noexcept { return cosine.size(); }
  };
  bool solve_rim(PairPressure& pressure, Rays& rays, double error);
  void place_nodes(const PolarRule& rule);
  bool solve_heights(PairPressure& pressure, double error);
  bool integrate();
  void keep_along_axis(PatchSums& sums) const;
  void turn(const PolarRule& rule, bool slopes);
  bool finish(PairPressure& pressure, int column, const std::array<bool, 2>& columns, double error, PatchPoints& points);
  bool add_columns(PairPressure& pressure, int column, int side, double error, PatchPoints& points);
  bool column_ends(PairPressure& pressure, int side, double tolerance);
  void start_rim(const PolarRule& rule, bool first);
  [[nodiscard]] double algebraic_error() const;
  [[nodiscard]] Vec3 direction(double cosine, double sine) const { return cosine * frame_.u + sine * frame_.v; }

  // Patches that kinks cross: split_rule.cpp.
  struct Panel {
    double begin = 0.0, end = 0.0;  // angles
    std::size_t first = 0, last = 0;  // of `kept_`
    PatchSums fine, angular, radial;  // the finest sums, with fewer angles, with fewer radii besides
    double by_angle = 0.0, by_radius = 0.0;  // differences of these
    bool halved = false;              // or a half of one
    int nodes = 0;                    // on a ray that no kink crosses
  };
  struct Crossing {
    std::size_t ray, kink;
    double radius, height;  // radius over that of the rim
    double left, right;     // it lies between these
    bool good;
  };
  void find_kinks(PairPressure& pressure);
  bool kinks_cross();
  [[nodiscard]] bool taken_by_thirds();
  void evaluate_thirds(std::span<const Vec3> points);
  [[nodiscard]] double side_of(std::size_t kink, PairPressure& pressure, const Vec3& x);
  [[nodiscard]] double side_of(std::size_t kink, const PressureBatch& at, std::size_t i, Vec3& slope) const;
  bool solve_split(PairPressure& pressure, const ContactSettings& settings);
  void follow_rim();
  [[nodiscard]] std::array<double, 2> rim_at(double cosine, double sine) const;
  void find_corners(PairPressure& pressure, std::vector<double>& turns);
  void find_crossings(PairPressure& pressure, double error);
  bool solve_panels(PairPressure& pressure, const KronrodRule& rule, double error, std::size_t first);
  void keep_panel(Panel& panel, const KronrodRule& rule, std::size_t ray);
  [[nodiscard]] double model_height(std::size_t ray, double share) const;

  PeakFrame frame_;
  double jacobian_ = 0.0;  // |u| |v|
  double extent_ = 0.0;
  Rays rim_;
  std::vector<double> coarse_radius_, coarse_height_;
  std::vector<double> low_, high_;
  std::vector<std::uint8_t> done_;
  PressureBatch rim_batch_, node_;
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

  std::span<const ContactBody* const> third_;
  bool cut_ = false;                   // nodes where a third body presses harder do not count
  std::vector<double> third_value_;    // pressures of third bodies at points, one body after the other
  std::vector<Vec3> third_slope_;
  std::vector<int> thirds_seen_;        // 1: pressing harder than the pair somewhere, 2: not so somewhere
  std::uint32_t parted_ = 0;
  std::vector<implicit::Kink> kinks_;
  std::vector<std::size_t> crossing_;  // kinks that cross the patch; from kinks_.size() on, third bodies
  std::vector<Panel> panels_;
  std::vector<double> wave_[2];        // Fourier coefficients of the rim's radius and height
  std::vector<Vec3> fine_rim_;
  Rays rays_;
  std::vector<double> square_, fourth_;  // heights along a ray: s^2 (square + s^2 fourth)
  std::vector<Crossing> crossings_;
  std::vector<std::size_t> ray_nodes_, ray_fewer_;  // first node of a ray, and of those with fewer radii
  PressureBatch kept_;
  std::vector<double> kept_weight_, kept_area_, kept_pressure_;
  std::vector<Vec3> kept_normal_;
};

}  // namespace supple::collision
