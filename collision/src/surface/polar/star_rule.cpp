/// Polar quadrature of a patch that its peak does not see whole, or whose rim Newton's method misses from there: the rim, where
/// both pressures vanish, is followed all around, and rays begin at a point that all of it is seen from. Such points are the
/// kernel of the polygon that the rim is in the plane across the axis; the patch is star-shaped where there are some (Preparata &
/// Shamos 1985, sec. 7.2.6). The rest is that of patches that kinks cross.
#include <algorithm>
#include <cmath>

#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {

/// The kinks that come as near to the frame's origin as the rim goes.
void PolarRuleSolver::find_star_kinks(PairPressure& pressure) {
  double square = 0.0;
  for (const Vec3& x : fine_rim_) square = std::max(square, (x - frame_.origin).squaredNorm());
  const double reach = kBeyondRim * std::sqrt(square);
  levels_.kink.clear();
  levels_.all_kinks = pressure.kinks({frame_.origin - Vec3::Constant(reach), frame_.origin + Vec3::Constant(reach)}, levels_.kink);
  std::erase_if(levels_.kink, [&](const implicit::Kink& kink) { return std::abs(kink.value(frame_.origin)) > kink.change(frame_.origin, reach); });
}

/// Those of them that have points of rays to the rim on the other side than the centre; third bodies may all cross.
void PolarRuleSolver::cross_star(PairPressure& pressure) {
  levels_.crossing.clear();
  for (std::size_t k = 0; k < levels_.kink.size(); ++k) {
    if (!parts_at(levels_.kink[k])) continue;
    const bool side = levels_.kink[k].value(frame_.origin) > 0.0;
    const auto other = [&](const RimPoint& p) {
      const Vec3 reach = frame_.across(p.at);
      const double linear = rise_.dot(reach);
      for (const double share : {0.25, 0.5, 0.75, 1.0}) {
        const double height = share * linear + share * share * (p.height - linear);
        if ((levels_.kink[k].value(frame_.origin + share * reach + height * frame_.axis) > 0.0) != side) return true;
      }
      return false;
    };
    if (std::any_of(outline_.begin(), outline_.end(), other)) levels_.crossing.push_back(k);
  }
  for (std::size_t t = 0; t < levels_.third.size(); ++t) levels_.crossing.push_back(levels_.kink.size() + t);
  find_imprints(pressure);
}

/// @param frame  of the peak   @param fine  the steps along the rim   @return false where no point sees the whole rim
bool PolarRuleSolver::solve_about_star(const PolarJob& job, const PeakFrame& frame, bool fine, PatchPoints& points) {
  PairPressure& pressure = job.pressure;
  std::optional<Star> star = find_star(pressure, frame, extent_, fine);
  if (!star) return false;
  star_ = std::move(*star);
  frame_ = star_.frame;
  jacobian_ = frame_.u.norm() * frame_.v.norm();
  rise_ = star_.rise;
  fine_rim_ = star_.rim;
  outline_ = star_.outline;
  about_middle_ = false;
  about_star_ = true;
  find_star_kinks(pressure);
  cross_star(pressure);
  const bool fits = solve_split(pressure, job.settings);
  about_star_ = false;
  if (!fits) return false;
  polygon_ = outline_;
  return finish_parted(job, points);
}

}  // namespace supple::collision
