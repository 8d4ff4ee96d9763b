/// @file polar_rule.h
/// Spectral quadrature on a smooth patch of Sigma: Gauss-Legendre in the radius times the trapezoid rule in the angle
/// about the point of largest pressure, both exponentially convergent because the integrand is smooth, periodic and
/// vanishes at the rim. Where kinks of a field cross the patch, radii are parted at them, and angles where kinks meet the rim and as finely as the
/// error asks; kinks in a third derivative part nothing at errors of 1e-4 and more, where the same rules converge with the fourth power of their
/// points. Where faces lie on faces the pressure has no peak that says anything: there the patch is parted
/// about its middle. Columns along the axis carry the integrals over the squeezed regions.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "supple/implicit/kinks.h"
#include "surface/accuracy.h"
#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/patch_points.h"
#include "surface/polar/apex.h"
#include "surface/polar/imprint.h"
#include "surface/polar/outline.h"
#include "surface/polar/patch_levels.h"
#include "surface/polar/polar_cover.h"
#include "surface/polar/polar_job.h"
#include "surface/polar/ray_crossings.h"
#include "surface/polar/rim_curve.h"
#include "surface/polar/rim_corners.h"
#include "surface/polar/rim_waves.h"
#include "surface/quadrature.h"
#include "surface/region/polar_columns.h"

namespace supple::collision {

/// Over the error asked for times the pressure at the peak: pressures of third bodies at the rim that say nothing, as rims are off by more.
inline constexpr double kAtRim = 0.1;

class PolarRuleSolver {
 public:
  /// Refines until two consecutive rules agree to `settings.error`, at most `settings.max_refinement` times.
  /// What the caller knows of the patch.
  struct Known {
    bool round;   ///< both pressures are the same all around the line through the frame's origin along its axis
    bool follow;  ///< follow the rim all around, whether the peak sees it or not
  };
  /// @return false where the rule does not fit: rim not found, not a graph over the tangent plane, or the squeezed
  ///         regions reach beyond the rim. `points` is then not to be used.
  [[nodiscard]] bool solve(const PolarJob& job, const PeakFrame& frame, const Known& known, PatchPoints& points);

  [[nodiscard]] const PatchSums& sums() const noexcept { return fine_; }  ///< about `origin()`
  [[nodiscard]] const Vec3& origin() const noexcept { return frame_.origin; }
  [[nodiscard]] double largest() const noexcept { return largest_; }  ///< pressure: at the peak, or of the nodes about the middle [Pa]
  [[nodiscard]] double estimate() const noexcept { return estimate_; }
  [[nodiscard]] std::uint32_t kinks() const noexcept { return parted_; }  ///< that the patch was parted at
  [[nodiscard]] double thickness() const noexcept { return thickness_; }  ///< of the overlap there [m]
  [[nodiscard]] double rounding() const;                                  ///< what round-off of the coordinates adds to the estimate
  void cover(PolarCover& out) const;                                      ///< of the last solve

 private:
  struct AboutPeak {
    bool round = false;
    bool any = false;  ///< whatever the error, and without regard to kinks of the fields; else other rules are tried after this one
  };
  bool solve_about_peak(const PolarJob& job, const PeakFrame& frame, const AboutPeak& how, PatchPoints& points);
  void start_about_peak(const PeakFrame& frame);
  void start_rim_search(Rays& rays);
  bool solve_rim(PairPressure& pressure, Rays& rays, double error);
  [[nodiscard]] bool same_side(const Vec3& from, const Vec3& to) const;
  [[nodiscard]] bool rim_joins(std::size_t first, std::size_t last, bool closed) const;
  void place_nodes(const PolarRule& rule);
  bool solve_heights(PairPressure& pressure, double error);
  bool integrate();
  void keep_along_axis(PatchSums& sums) const;
  void turn(const PolarRule& rule, bool slopes);
  bool leave_all();
  bool finish_parted(const PolarJob& job, PatchPoints& points);
  bool finish(PairPressure& pressure, int column, const Regions& regions, double error, const PolarRule* turns, PatchPoints& points);
  /// Where finer rules may find the rim, over its distance as it is known.
  static constexpr double kBeyondRim = 1.2;
  void start_rim(const PolarRule& rule, bool first);
  [[nodiscard]] double placing_error() const;
  [[nodiscard]] double algebraic_error() const;
  [[nodiscard]] Vec3 direction(double cosine, double sine) const { return cosine * frame_.u + sine * frame_.v; }

  // Patches that levels cross: split_rule.cpp; which do: cross_kinks.cpp.
  /// Gauss points through a squeezed region.
  static int column_of(double error) { return error >= 1e-4 ? 3 : error >= 1e-6 ? 4 : error >= 1e-8 ? 5 : 6; }
  struct Panel {
    double begin = 0.0, end = 0.0;  // angles, or places along `sectors_`: i to i + 1 is sector i
    std::size_t first = 0, last = 0;  // of `kept_`
    std::size_t rim = 0, rim_end = 0;  // of `kept_rim_`
    PatchSums fine, angular, radial;  // the finest sums, with fewer angles, with other radii besides
    double by_angle = 0.0, by_radius = 0.0;  // what the finest sums may be off by, for either reason
    int nodes = 0;                    // on a ray that no kink crosses
    std::size_t rays = 0;             // of `fine`
    std::size_t change = 0, change_end = 0;  // of `changes_`
    bool halved = false;              // or a part of one
    bool touch_begin = false, touch_end = false;  // a ray touches an imprint there
    bool lost = false;                // a crossing that seemed to be there was not found
    bool leaves = false;              // a kink meets the rim between two rays
    [[nodiscard]] bool even() const { return change == change_end && !lost; }
    [[nodiscard]] bool touches() const { return touch_begin || touch_end; }
    /// Where node x in (-1, 1) is put between begin and end, and its rate. What a ray has of an imprint grows as the root of the
    /// angle from where it touches it: as a polynomial, when the angle grows as a square.
    [[nodiscard]] std::array<double, 2> bend(double x) const;
  };
  bool no_kinks_near(PairPressure& pressure);
  void find_kinks(PairPressure& pressure);
  bool kinks_cross(PairPressure& pressure);
  /// Whether a patch is parted at a kink.
  [[nodiscard]] bool parts_at(const implicit::Kink& kink) const { return !is_mild(kink, error_); }
  [[nodiscard]] double at_rim() const { return kAtRim * error_ * frame_.peak; }
  [[nodiscard]] bool taken_by_thirds();
  bool find_imprint(PairPressure& pressure, std::size_t third, const Vec3* inside);
  void find_imprints(PairPressure& pressure);
  /// An angle at which panels end.
  struct Turn {
    double angle;
    bool touch;  // a ray touches something there
  };
  std::vector<Turn> find_turns(PairPressure& pressure);
  bool solve_split(PairPressure& pressure, const ContactSettings& settings);
  void follow_rim() {
    waves_.fit(rim_);
    waves_.place(frame_, fine_rim_);
  }
  void find_changes(PairPressure& pressure, const KronrodRule& rule, std::size_t first);
  bool add_missed_kinks();
  bool find_rays(PairPressure& pressure, const KronrodRule& rule, double error, std::size_t first);
  [[nodiscard]] double piece_share(const KronrodRule& rule, std::size_t ray, std::size_t piece, double width) const;
  void lay_nodes(const KronrodRule& rule, std::size_t ray, int nodes, bool check, double shortest);
  bool solve_panels(PairPressure& pressure, const KronrodRule& rule, double error, std::size_t first);
  void keep_panel(Panel& panel, const KronrodRule& rule, std::size_t ray);
  void doubt(Panel& panel, const PatchSums& all) const;
  void start_panels();
  bool doubt_all();
  [[nodiscard]] bool leaves_unseen(const Panel& panel) const;
  /// How a panel becomes finer: by more points on its rays, by being parted.
  struct Finer {
    bool more, part;
  };
  [[nodiscard]] bool parts_at_changes(const Panel& panel, const Finer& how) const { return how.part && panel.change < panel.change_end && !(about_middle_ && cut_); }
  void refine_panel(const Panel& panel, const Finer& how, bool halve, std::vector<Panel>& finer);
  void gather_panels();

  // About the middle: middle_rule.cpp.
  bool solve_about_middle(const PolarJob& job, const PeakFrame& frame, PatchPoints& points);
  bool part_about_middle(PairPressure& pressure, const PeakFrame& frame, const ContactSettings& settings);
  bool follow_rays(PairPressure& pressure);
  void follow_tangents();
  void start_sectors(int nodes);
  void cross_outline();
  void place_rays(const KronrodRule& rule, std::size_t first);
  bool solve_all_panels(PairPressure& pressure, const ContactSettings& settings, const KronrodRule& first, const KronrodRule* larger);

  // About a point that sees the whole rim: star_rule.cpp.
  bool solve_about_star(const PolarJob& job, const PeakFrame& frame, bool fine, PatchPoints& points);
  void find_star_kinks(PairPressure& pressure);
  void cross_star(PairPressure& pressure);

  PeakFrame frame_;
  PatchColumns columns_;
  Vec3 peak_ = Vec3::Zero();
  double largest_ = 0.0;
  std::size_t summit_ = 0;  // node where it is; their number: at the peak
  double jacobian_ = 0.0;  // |u| |v|
  double extent_ = 0.0;
  Rays rim_;
  std::vector<double> coarse_radius_, coarse_height_;
  std::vector<double> low_, high_;
  PressureBatch rim_batch_, node_;
  PressureBatch some_;              // points of one of these at which Newton's method has not ended
  std::vector<std::size_t> open_;   // which they are
  std::vector<double> height_, weight_, area_, pressure_;
  std::vector<Vec3> foot_, normal_;
  double residual_ = 0.0;
  double rim_error_ = 0.0;  // relative, of the area
  double lift_ = 0.0;       // largest distance of a node from Sigma
  double below_ = 0.0;      // load of nodes that lie just beyond the rim, which is left out
  double size_ = 0.0;       // of the bodies' features
  PatchSums fine_, coarse_;
  double estimate_ = 1.0;
  double thickness_ = 0.0;
  bool may_go_through_ = false;  // one body through the other: not balls and half-spaces, whose surfaces meet in one circle, and not where third bodies press

  double error_ = 0.0;                 // asked for
  PatchLevels levels_;
  bool cut_ = false;                   // nodes where a third body presses harder do not count
  std::vector<int> thirds_seen_;        // 1: pressing harder than the pair somewhere, 2: not so somewhere
  ImprintFinder finder_;
  PolarCover cover_;
  std::uint32_t parted_ = 0;
  Box smooth_;                         // no kink is in it
  std::vector<Panel> panels_;
  RimWaves waves_;
  std::vector<Vec3> fine_rim_;
  Rays rays_;
  RayHeights heights_;
  RayCrossings ray_crossings_;
  std::vector<Crossing> crossings_;
  std::vector<std::size_t> first_crossing_;  // of a ray, and their number
  std::vector<double> changes_;  // places where within a panel rays begin to meet other kinks, or in another order
  std::vector<double> turn_;             // what the weight of the angle is multiplied by
  bool about_middle_ = false, about_star_ = false;  // about the middle rays go through `sectors_`
  Star star_;
  Vec3 rise_ = Vec3::Zero();             // of Sigma at the star's centre, over a step across the axis; 0 elsewhere
  std::vector<RimPoint> outline_, polygon_, kept_rim_, sorted_rim_;  // by angle; of a patch that is parted; by panel
  std::vector<Sector> sectors_;
  std::vector<std::size_t> ray_nodes_, ray_check_;  // first node of a ray, and of those to compare with
  /// Columns of kept nodes, each with that of the nodes at hand.
  template <class Body>
  void for_columns(const Body& body) {
    body(kept_.point, node_.point);
    body(kept_.slope_a, node_.slope_a);
    body(kept_.slope_b, node_.slope_b);
    body(kept_weight_, weight_);
    body(kept_area_, area_);
    body(kept_pressure_, pressure_);
    body(kept_normal_, normal_);
  }
  PressureBatch kept_;
  std::vector<double> kept_weight_, kept_area_, kept_pressure_;
  std::vector<Vec3> kept_normal_;
};

}  // namespace supple::collision
