/// Where rays of a patch cross its levels: first on the heights that curvature and rim give them, then on Sigma by Newton's method.
#include "surface/polar/ray_crossings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "surface/accuracy.h"

namespace supple::collision {
namespace {

constexpr double kFarOff = 0.2;          // of the radius: crossings from where the heights that are guessed have them
constexpr int kSamples = 8;              // of the heights along a ray, to find crossings
constexpr double kBorder = 0.01;         // of the way from its middle

}  // namespace

/// Where a ray crosses the border of a third body whose imprint may lie between two of its samples s. @return false where they show it
bool RayCrossings::cross_imprints(const CrossedPatch& on, std::size_t ray, std::size_t level, std::span<const double> s) {
  if (std::count_if(s.begin(), s.end(), [](double x) { return x > 0.0; }) > 1) return false;
  const std::size_t third = level - on.levels.kink.size();
  const double radius = on.rays.radius[ray];
  const Vec2 way(on.rays.cosine[ray], on.rays.sine[ray]);
  struct Sample {
    double share, s, height;
    bool within;
  };
  const auto look = [&](double share, bool within) -> Sample {
    const auto [excess, height] = on.finder.excess_at(on.pressure, on.frame, *on.levels.third[third], (share * radius) * way, on.height(ray, share));
    return {share, excess, height, within};
  };
  std::vector<Sample> samples;
  for (const Imprint& imprint : on.levels.imprint) {
    if (imprint.third != third) continue;
    const std::optional<double> middle = imprint.middle_on(way);
    if (middle && *middle < radius) samples.push_back(look(*middle / radius, true));
  }
  if (samples.empty()) return false;
  for (std::size_t j = 0; j < s.size(); ++j) {
    const double share = static_cast<double>(j) / static_cast<double>(s.size() - 1);
    samples.push_back({share, s[j], on.height(ray, share), false});
  }
  std::sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.share < b.share; });
  for (std::size_t j = 0; j + 1 < samples.size(); ++j) {
    Sample left = samples[j], right = samples[j + 1], last = left;
    if ((left.s > 0.0) == (right.s > 0.0)) continue;
    const double from = left.share, to = right.share, within = left.within ? from : to;
    for (int step = 0; step < kBracketSteps; ++step) {
      const double before = last.share;
      last = look(left.share + (right.share - left.share) * left.s / (left.s - right.s), false);
      if (step > 0 && std::abs(last.share - before) <= kBorder * std::abs(last.share - within)) break;
      // Illinois: an end that stays counts half.
      if ((last.s > 0.0) == (left.s > 0.0)) {
        left = last;
        right.s *= 0.5;
      } else {
        right = last;
        left.s *= 0.5;
      }
    }
    crossings_.push_back({ray, level, last.share, last.height, from, to, false});
  }
  return true;
}

/// Appends where a ray crosses a kink between two places with different sides of it, on the heights that are guessed.
/// @param others  of `crossings_`, those that do not belong to this ray and kink
void RayCrossings::cross_between(const CrossedPatch& on, const RaySheet& along, Interval where, Interval sides, std::size_t others) {
  double share = where.lower + (where.upper - where.lower) * sides.lower / (sides.lower - sides.upper);
  for (int step = 0; step < 3; ++step) {
    const double s = side_on_ray(on, along, share, on.height(along.ray, share));
    const bool lower = (s > 0.0) == (sides.lower > 0.0);
    (lower ? where.lower : where.upper) = share;
    (lower ? sides.lower : sides.upper) = s;
    share = where.lower + (where.upper - where.lower) * sides.lower / (sides.lower - sides.upper);
  }
  // Two of one kink must not become one; the borders of third bodies are round.
  const bool field = along.level < on.levels.kink.size(), alone = crossings_.size() == others && field;
  const double far = alone ? kFarOff : 0.5 / kSamples;
  if (!alone && crossings_.size() > others && field) {
    Crossing& last = crossings_.back();
    last.left = std::max(0.0, last.radius - far);
    last.right = last.radius + far;
  }
  crossings_.push_back({along.ray, along.level, share, on.height(along.ray, share), std::max(0.0, share - far), share + far, false});
}

/// A kink as a ray sees it. @param c  of `on.levels.crossing`   @param reach  of the ray
RayCrossings::RaySheet RayCrossings::sheet_along(const CrossedPatch& on, std::size_t ray, std::size_t c, const Vec3& reach) const {
  const Sheet& sheet = sheets_[c];
  const Vec3 bend_along = sheet.bend * reach, bend_up = sheet.bend * on.frame.axis;
  return {ray, on.levels.crossing[c], reach, sheet.told, sheet.value, sheet.slope.dot(reach), sheet.slope.dot(on.frame.axis),
          bend_along.dot(reach), 2.0 * bend_along.dot(on.frame.axis), bend_up.dot(on.frame.axis)};
}

/// s at a share of the ray and a height above it.
double RayCrossings::side_on_ray(const CrossedPatch& on, const RaySheet& along, double share, double rise) {
  if (!along.told) return on.levels.value(along.level, on.frame, on.pressure, on.frame.origin + share * along.reach + rise * on.frame.axis);
  return along.value + share * (along.along + along.square * share + along.mixed * rise) + rise * (along.up + along.up_square * rise);
}

/// How much harder than the pair third bodies press at the samples of all rays, to first order, in `on.levels.third_value`: one body after the other.
void RayCrossings::sample_thirds(const CrossedPatch& on) {
  PressureBatch& batch = batch_;
  batch.point.clear();
  for (std::size_t i = 0; i < on.rays.size(); ++i) {
    const Vec3 reach = on.rays.radius[i] * on.direction(on.rays.cosine[i], on.rays.sine[i]);
    for (int j = 0; j <= kSamples; ++j) {
      const double share = static_cast<double>(j) / kSamples;
      batch.point.push_back(on.frame.origin + share * reach + on.height(i, share) * on.frame.axis);
    }
  }
  batch.resize(batch.point.size());
  on.pressure.evaluate_values(batch);
  const double of_a = on.frame.depth[0] / on.frame.thickness;
  const std::size_t n = batch.size();
  on.levels.third_value.resize(on.levels.third.size() * n);
  for (std::size_t t = 0; t < on.levels.third.size(); ++t) {
    const auto value = std::span(on.levels.third_value).subspan(t * n, n);
    on.levels.third[t]->field.evaluate(batch.point, value);
    for (std::size_t i = 0; i < n; ++i) value[i] = on.levels.third[t]->material.modulus * value[i] - (of_a * batch.a[i] + (1.0 - of_a) * batch.b[i]);
  }
}

/// Where the rays cross kinks, on the heights as the curvature at the peak and the rim give them.
void RayCrossings::guess(const CrossedPatch& on) {
  if (!on.levels.crossing.empty() && !on.levels.is_kink(on.levels.crossing.back())) sample_thirds(on);
  crossings_.clear();
  sheets_.clear();
  for (const std::size_t k : on.levels.crossing) sheets_.push_back(k < on.levels.kink.size() ? sheet_of(on.levels.kink[k], on.frame.origin) : Sheet{});
  for (std::size_t i = 0; i < on.rays.size(); ++i) {
    const Vec3 reach = on.rays.radius[i] * on.direction(on.rays.cosine[i], on.rays.sine[i]);
    std::array<double, kSamples + 1> height, s;
    for (int j = 0; j <= kSamples; ++j) height[static_cast<std::size_t>(j)] = on.height(i, static_cast<double>(j) / kSamples);
    for (std::size_t c = 0; c < on.levels.crossing.size(); ++c) {
      const RaySheet along = sheet_along(on, i, c, reach);
      const bool field = along.level < on.levels.kink.size();
      const std::size_t first = field ? 0 : ((along.level - on.levels.kink.size()) * on.rays.size() + i) * s.size();
      for (std::size_t j = 0; j < s.size(); ++j) s[j] = field ? side_on_ray(on, along, static_cast<double>(j) / kSamples, height[j]) : on.levels.third_value[first + j];
      if (!field && cross_imprints(on, i, along.level, s)) continue;
      const std::size_t others = crossings_.size();
      for (std::size_t j = 0; j < kSamples; ++j) {
        const double left = static_cast<double>(j) / kSamples, right = static_cast<double>(j + 1) / kSamples;
        if ((s[j] > 0.0) != (s[j + 1] > 0.0)) {
          cross_between(on, along, {left, right}, {s[j], s[j + 1]}, others);
          continue;
        }
        // A ray that dips through a kink and back between two samples: at the vertex of a parabola through three of them.
        if (j == 0 || (s[j - 1] > 0.0) != (s[j] > 0.0)) continue;
        const double bend = s[j - 1] - 2.0 * s[j] + s[j + 1], slope = 0.5 * (s[j + 1] - s[j - 1]);
        if (!(bend * s[j] > 0.0) || !(std::abs(slope) < std::abs(bend))) continue;
        const double vertex = left - slope / bend / kSamples, dip = side_on_ray(on, along, vertex, on.height(i, vertex));
        if ((dip > 0.0) == (s[j] > 0.0)) continue;
        const bool early = vertex < left;
        cross_between(on, along, {early ? left - 1.0 / kSamples : left, vertex}, {early ? s[j - 1] : s[j], dip}, others);
        cross_between(on, along, {vertex, early ? left : right}, {dip, early ? s[j] : s[j + 1]}, others);
      }
    }
  }
}

/// Where the rays cross kinks on Sigma, by Newton's method from where they are guessed.
std::vector<Crossing>& RayCrossings::find(const CrossedPatch& on, double error) {
  const double enough = std::min(1e-3, 0.1 * std::sqrt(error));  // pieces that miss a kink by x leave an error of x^2
  guess(on);
  PressureBatch& batch = batch_;
  batch.resize(crossings_.size());
  open_.resize(crossings_.size());
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  for (int step = 0; step < kFreeSteps && !open_.empty(); ++step) {
    for (const std::size_t c : open_) {
      const Crossing& x = crossings_[c];
      batch.point[c] = on.frame.origin + (x.radius * on.rays.radius[x.ray]) * on.direction(on.rays.cosine[x.ray], on.rays.sine[x.ray]) +
                       x.height * on.frame.axis;
    }
    on.pressure.evaluate(batch, open_, some_);
    on.levels.evaluate_thirds(batch.point);
    std::erase_if(open_, [&](std::size_t c) {
      Crossing& x = crossings_[c];
      const Vec3 e = on.rays.radius[x.ray] * on.direction(on.rays.cosine[x.ray], on.rays.sine[x.ray]);
      Vec3 slope;
      const double s = on.levels.value(x.level, on.frame, batch, c, slope), gap = batch.a[c] - batch.b[c];
      const Vec3 across = batch.slope_a[c] - batch.slope_b[c];
      const double gr = across.dot(e), gt = across.dot(on.frame.axis), sr = slope.dot(e), st = slope.dot(on.frame.axis);
      const double determinant = gr * st - gt * sr;
      const double radius = x.radius + (gt * s - st * gap) / determinant;
      if (!std::isfinite(radius)) return false;
      const double next = std::clamp(radius, x.left, x.right);  // two that lie close must not change places
      const double moved = next - x.radius;
      x.height -= (gap + gr * moved) / gt;
      x.radius = next;
      // Relative to the piece between kink and rim on faces, whose share of the ray may be small.
      x.good = std::abs(moved) <= enough * (on.faces ? std::abs(1.0 - next) : 1.0) && next == radius;
      return x.good;
    });
  }
  std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& x, const Crossing& y) {
    return x.ray != y.ray ? x.ray < y.ray : x.radius != y.radius ? x.radius < y.radius : x.level < y.level;
  });
  return crossings_;
}

}  // namespace supple::collision
