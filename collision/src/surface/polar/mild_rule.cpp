/// Polar quadrature of a patch that mild kinks cross: where the support of a Wyvill kernel ends only the third derivative
/// jumps, and rings converge with the fourth power of the number of their points. To three or six digits that is cheaper than
/// to part the patch at every kink, of which a body of many blobs has a dozen. The rings are about a point that sees the
/// whole rim, in axes in which the patch is as wide as it is long, so that its outline costs few of them.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

constexpr int kMildOrder = 3;           // of the derivative that jumps
constexpr std::size_t kFinestRings = 5;  // that is worth its points: sectors reach the rest with fewer
constexpr double kEnough = 0.9;         // leaves room for Newton's method
/// What a rule is off by, over what the one before it is: about the fourth power of the ratio of their points along a ray or
/// around (fitted in the middle of patches of bodies of ten blobs).
constexpr std::array<double, kFinestRings + 1> kFall{1.0, 0.1, 0.14, 0.13, 0.28, 0.19};
/// Over what that, and the rule two before, say; over what half the rays are off by.
constexpr double kSafety = 12.0, kHalves = 0.5;
constexpr double kUnseen = 5e-3;        // of the error asked for: two rules agree by chance, seldom to much less than that
constexpr double kFine = 5e-6;           // errors for which rays have more points
constexpr double kWide = 1.6, kNarrow = 0.7;  // sectors, and the bend of the rim within one [rad]

/// The coarsest rule that is believed: two that are coarse agree by chance where much is asked for.
std::size_t least_rule(double error) { return error >= 1e-4 ? 2 : error >= 1e-5 ? 3 : 4; }

}  // namespace

bool PolarRuleSolver::only_mild_kinks() const {
  const auto mild = [this](std::size_t k) { return k < kinks_.size() && kinks_[k].order >= kMildOrder; };
  return all_kinks_ && third_.empty() && std::all_of(crossing_.begin(), crossing_.end(), mild);
}

/// The rim from `outline_`.
void PolarRuleSolver::start_outline(const PolarRule& rule) {
  const std::size_t n = rule.cosine.size();
  rim_.cosine = rule.cosine;
  rim_.sine = rule.sine;
  rim_.radius.resize(n);
  rim_.height.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    const auto [radius, height] = outline_at(rule.cosine[k], rule.sine[k]);
    rim_.radius[k] = radius;
    rim_.height[k] = height;
  }
  start_radius_ = rim_.radius;
}

/// What half the rays are off by: half of what those of even and odd numbers differ by.
double PolarRuleSolver::half_the_rays(std::size_t radial) const {
  std::array<PatchSums, 2> half;
  for (std::size_t i = 0; i < node_.size(); ++i) {
    half[i / radial % 2].add(node_.point[i] - frame_.origin, normal_[i], 2.0 * area_[i], pressure_[i]);
  }
  return 0.5 * relative_difference(half[0], half[1]);
}

/// @param error  asked for   @return whether rings reach it; then nodes and sums are in place, about the frame's new origin
bool PolarRuleSolver::solve_mild(PairPressure& pressure, double error) {
  about_star_ = move_to_star(pressure);
  return about_star_ && refine_rings(pressure, error);
}

/// Panels of angles for outlines that rings are slow on, with rays through parabolas near the rim, which has been followed. At
/// fine errors rays are parted at kinks; angles need not be, as the integral along a ray has one more smooth derivative where
/// a kink leaves the patch or touches the ray.
bool PolarRuleSolver::solve_mild_sectors(PairPressure& pressure, const ContactSettings& settings) {
  const bool parted = settings.error < kMildPartedBelow;
  const std::vector<std::size_t> crossing = crossing_;
  if (!parted) crossing_.clear();
  const double width = parted ? kNarrow : kWide;
  bool fits = make_sectors({}, width, width);
  if (fits) {
    start_sectors(!parted ? 5 : settings.error < kFine ? 8 : 7, false);
    by_sectors_ = mild_ = true;
    cut_ = false;
    fits = solve_all_panels(pressure, settings, kronrod_rule(3), nullptr, false) && estimate_ <= settings.error;
    by_sectors_ = mild_ = false;
  }
  crossing_ = crossing;
  return fits;
}

bool PolarRuleSolver::refine_rings(PairPressure& pressure, double error) {
  const std::span<const PolarRule> rules = polar_rules();
  double last = 0.0;  // what the rule before was off by, by its difference from the one before it
  spread_ = widest_ = {};
  for (std::size_t r = 1; r <= kFinestRings; ++r) {
    if (r == 1) {
      start_outline(rules[r]);
    } else {
      start_rim(rules[r], false);
    }
    if (!solve_rim(pressure, rim_, error, false)) return false;
    place_nodes(rules[r]);
    if (!solve_heights(pressure, error)) return false;
    coarse_ = fine_;
    if (!integrate()) return false;
    if (r == 1) continue;
    const double off = kFall[r] * relative_difference(fine_, coarse_);
    const double half = half_the_rays(static_cast<std::size_t>(rules[r].radial));
    const double doubt = std::max(kSafety * std::max(off, kFall[r] * last), kHalves * half);
    last = off;
    estimate_ = doubt + kUnseen * error + algebraic_error();
    kept_rim_.clear();
    for (std::size_t k = 0; k < rim_.size(); ++k) {
      kept_rim_.push_back({rim_.radius[k] * Vec2(rim_.cosine[k], rim_.sine[k]), rim_.height[k], rim_.outward[k]});
    }
    if (doubt <= kEnough * error && r >= least_rule(error) && rim_joins(0, kept_rim_.size(), true)) {
      polygon_ = kept_rim_;
      return estimate_ <= error;
    }
    double left = doubt;  // when the finest is done, as far as can be told
    for (std::size_t next = r + 1; next <= kFinestRings; ++next) left *= kFall[next];
    if (left > error) return false;
  }
  return false;
}

}  // namespace supple::collision
