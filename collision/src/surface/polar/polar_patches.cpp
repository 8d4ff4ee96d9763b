#include "surface/polar/polar_patches.h"

#include <algorithm>
#include <cmath>

#include "surface/accuracy.h"

namespace supple::collision {
namespace {

/// A patch reaches so much farther than its rim, over its radius, where places are told from those of others.
constexpr double kBesideRim = 0.05;

constexpr std::size_t kMostPatches = 16;
constexpr int kFootSteps = 6;  // of Newton's method from places of many patches at once

}  // namespace

void PolarPatches::start_from(const Vec3& seed, PairPressure& pressure) {
  starts_.hill.assign(1, {.at = seed});
  starts_.inside.clear();
  starts_.beside.clear();
  batch_.resize(1);
  batch_.point[0] = seed;
  pressure.evaluate_values(batch_);
  if (std::min(batch_.a[0], batch_.b[0]) > 0.0) starts_.inside.push_back({.at = seed});
}

bool PolarPatches::solve(const PolarJob& job, PairResult& out) {
  bool unseen = false;
  if (solve(job, false, unseen, out)) return true;
  if (!unseen) return false;
  // A rim that is followed all around leaves nothing out.
  out.clear();
  return solve(job, true, unseen, out);
}

/// @param follow  all rims   @param unseen  whether there is a place of a patch that its rim leaves out
bool PolarPatches::solve(const PolarJob& job, bool follow, bool& unseen, PairResult& out) {
  forget();
  share_.clear();
  for (const StartPoint& hill : starts_.hill) {
    if (add_patch(job, hill, follow, out) == Patch::Unfit) return false;
  }
  // Two patches may lie so near to each other that their seeds have one hill.
  for (std::size_t more = 0; const std::optional<StartPoint> x = outside(job.pressure, job.extent); ++more) {
    const Patch found = more < kMostPatches ? add_patch(job, *x, follow, out) : Patch::Unfit;
    if (found == Patch::Lost) break;
    unseen = found == Patch::Known && !empty();
    if (found != Patch::Added) return false;
  }
  crossing_.clear();
  if (!job.pressure.convex()) find_crossings(job.pressure, job.spacing);
  for (const StartPoint& x : crossing_) {
    if (!covered(x, kBesideRim) && add_patch(job, x, follow, out) == Patch::Unfit) return false;
  }
  out.summary.patches = static_cast<std::uint32_t>(cover_count_);
  if (share_.size() > 1) out.summary.error_estimate = estimate_of_all(share_, out);
  return !overlap(job.pressure);
}

bool PolarPatches::any_touches(PairPressure& pressure, double extent, bool convex) {
  return std::any_of(starts_.hill.begin(), starts_.hill.end(),
                     [&](const StartPoint& hill) { return finder_.climb(pressure, hill.at, extent, convex, false).has_value(); });
}

bool PolarPatches::knows_overlap(PairPressure& pressure) {
  constexpr double kInside = 1e-6;  // pressure over the modulus
  batch_.point.clear();
  for (const StartPoint& place : starts_.inside) batch_.point.push_back(place.at);
  batch_.resize(batch_.point.size());
  pressure.evaluate_values(batch_);
  for (std::size_t i = 0; i < batch_.size(); ++i) {
    const double a = batch_.a[i] / pressure.modulus(0), b = batch_.b[i] / pressure.modulus(1);
    if (std::min(a, b) > -kOnSurface && std::max(a, b) > kInside) return true;
  }
  return false;
}

bool PolarPatches::covered(const StartPoint& place, double slack) const {
  const std::span<const PolarCover> all = covers();
  return std::any_of(all.begin(), all.end(), [&](const PolarCover& cover) { return cover.contains(place, slack); });
}

PolarPatches::Patch PolarPatches::add_patch(const PolarJob& job, const StartPoint& hill, bool follow, PairResult& out) {
  if (covered(hill, 0.0)) return Patch::Known;
  std::optional<PeakFrame> frame;
  if (job.axis && job.third.empty()) frame = finder_.find_on_axis(job.pressure, *job.axis, hill.at, job.extent);
  const bool on_axis = frame.has_value();
  if (!on_axis) frame = finder_.climb(job.pressure, hill.at, job.extent, job.faces, job.faces);
  if (!frame || covered({frame->origin, frame->axis}, 0.0)) return Patch::Known;
  const auto fits = [&] {
    return polar_.solve(job, *frame, {.round = on_axis, .follow = follow}, out.points);
  };
  if (!fits()) {
    if (polar_.rounding() > kLostInRounding) return Patch::Lost;
    if (!frame->flat) return Patch::Unfit;
    frame = finder_.climb(job.pressure, hill.at, job.extent, job.faces, false);
    if (!frame || covered({frame->origin, frame->axis}, 0.0)) return Patch::Known;
    if (!fits()) return Patch::Unfit;
  }
  out.add(polar_.sums(), polar_.origin());
  const PatchSums& sums = polar_.sums();
  share_.push_back({sums.force, sums.first + sums.load * polar_.origin(), sums.load, sums.area, polar_.estimate()});
  out.summary.error_estimate = std::max(out.summary.error_estimate, polar_.estimate());
  out.rounding = std::max(out.rounding, polar_.rounding());
  out.summary.kinks += polar_.kinks();
  if (polar_.largest() > out.summary.largest_pressure) {
    out.summary.largest_pressure = polar_.largest();
    out.summary.largest_overlap = polar_.thickness();
  }
  if (covers_.size() == cover_count_) covers_.emplace_back();
  polar_.cover(covers_[cover_count_++]);
  return Patch::Added;
}

double estimate_of_all(std::span<const PatchShare> patches, const PairResult& all) {
  if (!(all.load > 0.0)) return 1.0;
  const Vec3 centre = all.first / all.load;
  double force = 0.0, area = 0.0, first = 0.0;
  for (const PatchShare& patch : patches) {
    if (!(patch.load > 0.0)) continue;  // a third body has all of it
    force += patch.estimate * patch.force.norm();
    area += patch.estimate * patch.area;
    first += patch.estimate * patch.load * (std::sqrt(patch.area) + (patch.first / patch.load - centre).norm());
  }
  return std::min(1.0, std::max({force / force_scale(all.summary.force, all.load), area / all.summary.area, first / (all.load * std::sqrt(all.summary.area))}));
}

bool PolarPatches::overlap(PairPressure& pressure) {
  for (const PolarCover& one : covers()) {
    for (const PolarCover& other : covers()) {
      if (&one == &other) continue;
      for (const Vec3& x : one.rim) {
        if (!other.contains({.at = x}, 0.0)) continue;
        batch_.resize(1);
        batch_.point[0] = x;
        pressure.evaluate(batch_);
        if (other.contains({x, batch_.slope_b[0] - batch_.slope_a[0]}, 0.0)) return true;
      }
    }
  }
  return false;
}

/// A place of Sigma where both bodies press that belongs to no patch, from the points inside both.
std::optional<StartPoint> PolarPatches::outside(PairPressure& pressure, double extent) {
  batch_.point.clear();
  for (const StartPoint& place : starts_.inside) {
    if (!covered(place, kBesideRim)) batch_.point.push_back(place.at);
  }
  if (batch_.point.empty()) return std::nullopt;
  // The rest may only seem to lie outside, by a slanted axis: what counts is their foot on Sigma.
  batch_.resize(batch_.point.size());
  double peak = 0.0;
  for (const PolarCover& cover : covers()) peak = std::max(peak, cover.frame.peak);
  for (int step = 0; step < kFootSteps; ++step) {
    pressure.evaluate(batch_);
    if (step + 1 == kFootSteps) break;
    step_to_sigma(batch_, extent);
  }
  for (std::size_t i = 0; i < batch_.size(); ++i) {
    const double noise = pressure.noise_on_sigma(batch_.point[i], batch_.slope_a[i].norm(), batch_.slope_b[i].norm());
    if (std::min(batch_.a[i], batch_.b[i]) <= std::max(1e-3 * peak, noise)) continue;
    const StartPoint place{batch_.point[i], batch_.slope_b[i] - batch_.slope_a[i]};
    if (std::abs(batch_.a[i] - batch_.b[i]) > 1e-6 * pressure.largest_modulus()) return place;  // it found no place on Sigma
    if (!covered(place, kBesideRim)) return place;
  }
  return std::nullopt;
}

/// Fills `crossing_`: places near seeds where the surfaces cross, or all but touch, and that belong to no patch. A patch may lie between samples, and
/// beside a larger one, whose hill then is the only one.
void PolarPatches::find_crossings(PairPressure& pressure, double spacing) {
  constexpr double kFarthest = 2.0, kLongest = 0.5, kNear = 0.05;  // of the spacing
  crossing_.clear();
  batch_.point.clear();
  from_.clear();
  const auto keep = [&](const StartPoint& place, const Vec3& from) {
    if (covered(place, kBesideRim)) return;
    batch_.point.push_back(place.at);
    from_.push_back(from);
  };
  for (const StartPoint& place : starts_.beside) keep(place, place.at);
  for (int step = 0; step < kFootSteps && !batch_.point.empty(); ++step) {
    batch_.resize(batch_.point.size());
    pressure.evaluate(batch_);
    point_.swap(batch_.point);
    before_.swap(from_);
    batch_.point.clear();
    from_.clear();
    for (std::size_t i = 0; i < point_.size(); ++i) {
      const double steep_a = batch_.slope_a[i].norm(), steep_b = batch_.slope_b[i].norm();
      if (!(steep_a > 0.0) || !(steep_b > 0.0)) continue;
      const Vec3 across = batch_.slope_b[i] - batch_.slope_a[i];
      // Newton's method to p_A = p_B = 0, the shortest step: normals and distances of both surfaces, to first order.
      const Vec3 normal_a = batch_.slope_a[i] / steep_a, normal_b = batch_.slope_b[i] / steep_b;
      const double off_a = batch_.a[i] / steep_a, off_b = batch_.b[i] / steep_b, c = normal_a.dot(normal_b), square = 1.0 - c * c;
      if (step + 1 == kFootSteps) {
        if (std::max(std::abs(off_a), std::abs(off_b)) <= kNear * spacing) crossing_.push_back({point_[i], across});
        continue;
      }
      if (!(square > 0.0)) continue;
      Vec3 move = ((c * off_b - off_a) / square) * normal_a + ((c * off_a - off_b) / square) * normal_b;
      const double length = move.norm(), longest = kLongest * spacing;
      if (length > longest) move *= longest / length;
      const Vec3 next = point_[i] + move;
      if ((next - before_[i]).norm() <= kFarthest * spacing) keep({next, across}, before_[i]);
    }
  }
}

}  // namespace supple::collision
