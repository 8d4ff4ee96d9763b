/// Where kinks of a field, and the borders of third bodies, cross a patch: which do, where on rays, and where rays begin to meet others.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

constexpr double kFarOff = 0.2;          // of the radius: crossings from where the heights that are guessed have them
constexpr int kSamples = 8;              // of the heights along a ray, to find crossings
constexpr double kBorder = 0.01;         // of the way from its middle
constexpr double kAtOrigin = 1e-9;       // radius of a crossing, over that of the rim: the kink goes through the origin

}  // namespace

/// Whether there are certainly none where the rim may be, which is kept in `smooth_`.
bool PolarRuleSolver::no_kinks_near(PairPressure& pressure) {
  constexpr double kReach = 1.5;  // of the rim, over what the curvature of the pressure says
  const double square = 2.0 * kReach * kReach * frame_.peak;
  const double height = std::abs(frame_.height_uu) + 2.0 * std::abs(frame_.height_uv) + std::abs(frame_.height_vv);
  const Vec3 across = (square * (frame_.u.cwiseAbs2() + frame_.v.cwiseAbs2())).cwiseSqrt();
  const Vec3 half = across + 0.5 * square * height * frame_.axis.cwiseAbs();
  smooth_ = {frame_.origin - half, frame_.origin + half};
  levels_.kink.clear();
  const bool known = pressure.kinks(smooth_, levels_.kink);
  const double reach = std::sqrt(square * (frame_.u.squaredNorm() + frame_.v.squaredNorm()) + 0.25 * square * square * height * height);
  const bool near = std::any_of(levels_.kink.begin(), levels_.kink.end(), [&](const implicit::Kink& kink) {
    return std::abs(kink.value(frame_.origin)) <= kink.change(frame_.origin, reach);
  });
  levels_.kink.clear();
  return known && !near;
}

void PolarRuleSolver::find_kinks(PairPressure& pressure) {
  levels_.kink.clear();
  Box box;
  for (const Vec3& x : rim_batch_.point) {
    box.include(x);
    if (rim_.size() > 1) continue;  // the ray stands for those all around
    const Vec3 reach = Vec3::Constant((x - frame_.origin).norm());
    box.include(frame_.origin - reach);
    box.include(frame_.origin + reach);
  }
  for (const Vec3& x : node_.point) box.include(x);
  levels_.all_kinks = pressure.kinks(box, levels_.kink);
  double square = 0.0;
  for (const Vec3& x : rim_batch_.point) square = std::max(square, (x - frame_.origin).squaredNorm());
  const double reach = kBeyondRim * std::sqrt(square);
  std::erase_if(levels_.kink, [&](const implicit::Kink& kink) { return std::abs(kink.value(frame_.origin)) > kink.change(frame_.origin, reach); });
}

/// Whether third bodies press harder than the pair all over the patch, as far as its nodes and the rim show.
bool PolarRuleSolver::taken_by_thirds() {
  const auto taken = [this](std::size_t n, std::size_t i, double p) {
    for (std::size_t t = 0; t < levels_.third.size(); ++t) {
      if (levels_.third_value[t * n + i] > p) return true;
    }
    return false;
  };
  levels_.evaluate_thirds(node_.point);
  for (std::size_t i = 0; i < node_.size(); ++i) {
    if (!taken(node_.size(), i, pressure_[i])) return false;
  }
  follow_rim();
  levels_.evaluate_thirds(fine_rim_);
  for (std::size_t i = 0; i < fine_rim_.size(); ++i) {
    if (!taken(fine_rim_.size(), i, -at_rim())) return false;
  }
  return true;
}

/// Whether some change their side on the patch, as far as its nodes show and the rim as they give it; keeps which.
bool PolarRuleSolver::kinks_cross(PairPressure& pressure) {
  levels_.crossing.clear();
  if (levels_.kink.empty() && levels_.third.empty()) return false;
  follow_rim();
  for (std::size_t k = 0; k < levels_.kink.size(); ++k) {
    if (!parts_at(levels_.kink[k])) continue;
    const bool side = levels_.kink[k].value(frame_.origin) > 0.0;
    const auto other = [&](const Vec3& x) { return (levels_.kink[k].value(x) > 0.0) != side; };
    if (std::any_of(fine_rim_.begin(), fine_rim_.end(), other) ||
        std::any_of(node_.point.begin(), node_.point.end(), other)) {
      levels_.crossing.push_back(k);
    }
  }
  if (levels_.third.empty()) return !levels_.crossing.empty();
  thirds_seen_.assign(levels_.third.size(), 0);
  std::vector<const Vec3*> inside(levels_.third.size(), nullptr);
  levels_.evaluate_thirds(node_.point);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) {
    for (std::size_t i = 0; i < node_.size(); ++i) {
      const bool harder = levels_.third_value[t * node_.size() + i] > pressure_[i];
      thirds_seen_[t] |= harder ? 1 : 2;
      if (harder && pressure_[i] > 0.0) inside[t] = &node_.point[i];
    }
  }
  levels_.evaluate_thirds(fine_rim_);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) {
    for (std::size_t i = 0; i < fine_rim_.size(); ++i) {
      const double p = levels_.third_value[t * fine_rim_.size() + i];
      if (std::abs(p) > at_rim()) thirds_seen_[t] |= p > 0.0 ? 1 : 2;
    }
  }
  levels_.imprint.clear();
  cover(cover_);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) {
    if (find_imprint(pressure, t, inside[t])) thirds_seen_[t] |= 1;
    if (thirds_seen_[t] == 3) levels_.crossing.push_back(levels_.kink.size() + t);
  }
  return !levels_.crossing.empty();
}

/// That of one third body on `cover_`. @param inside  a place in it, or null   @return whether there is one, whether its border is found or not
bool PolarRuleSolver::find_imprint(PairPressure& pressure, std::size_t third, const Vec3* inside) {
  cover_.thickness = frame_.thickness;
  const std::optional<Vec3> place = inside != nullptr ? std::optional<Vec3>(*inside) : finder_.find(pressure, cover_, *levels_.third[third], 0.0);
  if (!place) return false;
  Imprint imprint;
  imprint.third = third;
  if (finder_.trace(pressure, cover_, *levels_.third[third], *place, imprint)) levels_.imprint.push_back(std::move(imprint));
  return true;
}

/// Those on a patch with the rim `outline_`.
void PolarRuleSolver::find_imprints(PairPressure& pressure) {
  levels_.imprint.clear();
  if (levels_.third.empty()) return;
  polygon_ = outline_;
  cover(cover_);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) find_imprint(pressure, t, nullptr);
}

/// The rim found so far as a trigonometric sum, and points of it that leave no room for a kink between them.
void PolarRuleSolver::follow_rim() {
  const auto n = static_cast<Eigen::Index>(rim_.size()), waves = n / 2 + 1;
  const CurveAngles& angles = curve_angles(rim_.size());
  for (Wave& wave : wave_) {
    const std::vector<double>& f = &wave == &wave_[0] ? rim_.radius : rim_.height;
    wave.cosine.setZero(waves);
    wave.sine.setZero(waves);
    for (Eigen::Index k = 0; k < n; ++k) {
      const double share = f[static_cast<std::size_t>(k)] * (1.0 / static_cast<double>(n));
      wave.cosine += share * Eigen::Map<const Eigen::ArrayXd>(angles.wave_cosine.data() + k * waves, waves);
      wave.sine += share * Eigen::Map<const Eigen::ArrayXd>(angles.wave_sine.data() + k * waves, waves);
    }
    const Eigen::Index inner = (n - 1) / 2;
    wave.cosine.segment(1, inner) *= 2.0;
    wave.sine.segment(1, inner) *= 2.0;
  }
  constexpr std::size_t kTogether = 8;
  using Together = Eigen::Array<double, kTogether, 1>;
  fine_rim_.resize(4 * rim_.size());
  for (std::size_t first = 0; first < fine_rim_.size(); first += kTogether) {
    const std::size_t count = std::min(kTogether, fine_rim_.size() - first);
    Together cosine = Together::Zero(), sine = Together::Zero();
    std::copy_n(angles.cosine.data() + first, count, cosine.data());
    std::copy_n(angles.sine.data() + first, count, sine.data());
    const std::array<Together, 2> at = sum_waves(cosine, sine);
    for (std::size_t i = 0; i < count; ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      fine_rim_[first + i] = frame_.origin + at[0][j] * direction(cosine[j], sine[j]) + at[1][j] * frame_.axis;
    }
  }
}

/// Radius and height of the rim in directions, all at once.
template <class Directions>
std::array<Directions, 2> PolarRuleSolver::sum_waves(const Directions& cosine, const Directions& sine) const {
  std::array<Directions, 2> sum{Directions::Zero(), Directions::Zero()};
  Directions c = Directions::Ones(), s = Directions::Zero();
  for (Eigen::Index m = 0; m < wave_[0].cosine.size(); ++m) {
    for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) sum[which] += wave_[which].cosine[m] * c + wave_[which].sine[m] * s;
    const Directions next = c * cosine - s * sine;
    s = s * cosine + c * sine;
    c = next;
  }
  return sum;
}

std::array<double, 2> PolarRuleSolver::rim_at(double cosine, double sine) const {
  using One = Eigen::Array<double, 1, 1>;
  const std::array<One, 2> at = sum_waves(One(cosine), One(sine));
  return {at[0][0], at[1][0]};
}

double PolarRuleSolver::model_height(std::size_t ray, double share) const {
  const double square = share * share;
  return share * linear_[ray] + square * (square_[ray] + (about_star_ ? share : square) * rest_[ray]);
}

/// Where a ray crosses the border of a third body whose imprint may lie between two of its samples s. @return false where they show it
bool PolarRuleSolver::cross_imprints(PairPressure& pressure, std::size_t ray, std::size_t kink, std::span<const double> s) {
  if (std::count_if(s.begin(), s.end(), [](double x) { return x > 0.0; }) > 1) return false;
  const std::size_t third = kink - levels_.kink.size();
  const double radius = rays_.radius[ray];
  const Vec2 way(rays_.cosine[ray], rays_.sine[ray]);
  struct Sample {
    double share, s, height;
    bool within;
  };
  const auto look = [&](double share, bool within) -> Sample {
    const auto [excess, height] = finder_.excess_at(pressure, frame_, *levels_.third[third], (share * radius) * way, model_height(ray, share));
    return {share, excess, height, within};
  };
  std::vector<Sample> samples;
  for (const Imprint& imprint : levels_.imprint) {
    if (imprint.third != third) continue;
    const std::optional<double> middle = imprint.middle_on(way);
    if (middle && *middle < radius) samples.push_back(look(*middle / radius, true));
  }
  if (samples.empty()) return false;
  for (std::size_t j = 0; j < s.size(); ++j) {
    const double share = static_cast<double>(j) / static_cast<double>(s.size() - 1);
    samples.push_back({share, s[j], model_height(ray, share), false});
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
    crossings_.push_back({ray, kink, last.share, last.height, from, to, false});
  }
  return true;
}

/// Appends where a ray crosses a kink between two places with different sides of it, on the heights that are guessed.
/// @param others  of `crossings_`, those that do not belong to this ray and kink
void PolarRuleSolver::cross_between(PairPressure& pressure, const RaySheet& on, Interval where, Interval sides, std::size_t others) {
  double share = where.lower + (where.upper - where.lower) * sides.lower / (sides.lower - sides.upper);
  for (int step = 0; step < 3; ++step) {
    const double s = side_on_ray(pressure, on, share, model_height(on.ray, share));
    const bool lower = (s > 0.0) == (sides.lower > 0.0);
    (lower ? where.lower : where.upper) = share;
    (lower ? sides.lower : sides.upper) = s;
    share = where.lower + (where.upper - where.lower) * sides.lower / (sides.lower - sides.upper);
  }
  // Two of one kink must not become one; the borders of third bodies are round.
  const bool field = on.kink < levels_.kink.size(), alone = crossings_.size() == others && field;
  const double far = alone ? kFarOff : 0.5 / kSamples;
  if (!alone && crossings_.size() > others && field) {
    Crossing& last = crossings_.back();
    last.left = std::max(0.0, last.radius - far);
    last.right = last.radius + far;
  }
  crossings_.push_back({on.ray, on.kink, share, model_height(on.ray, share), std::max(0.0, share - far), share + far, false});
}

/// A kink as a ray sees it. @param c  of `levels_.crossing`   @param reach  of the ray
PolarRuleSolver::RaySheet PolarRuleSolver::sheet_along(std::size_t ray, std::size_t c, const Vec3& reach) const {
  const Sheet& sheet = sheets_[c];
  const Vec3 bend_along = sheet.bend * reach, bend_up = sheet.bend * frame_.axis;
  return {ray, levels_.crossing[c], reach, sheet.told, sheet.value, sheet.slope.dot(reach), sheet.slope.dot(frame_.axis),
          bend_along.dot(reach), 2.0 * bend_along.dot(frame_.axis), bend_up.dot(frame_.axis)};
}

/// s at a share of the ray and a height above it.
double PolarRuleSolver::side_on_ray(PairPressure& pressure, const RaySheet& on, double share, double rise) {
  if (!on.told) return levels_.value(on.kink, frame_, pressure, frame_.origin + share * on.reach + rise * frame_.axis);
  return on.value + share * (on.along + on.square * share + on.mixed * rise) + rise * (on.up + on.up_square * rise);
}

/// How much harder than the pair third bodies press at the samples of all rays, to first order, in `levels_.third_value`: one body after the other.
void PolarRuleSolver::sample_thirds(PairPressure& pressure) {
  PressureBatch& batch = crossing_batch_;
  batch.point.clear();
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    const Vec3 reach = rays_.radius[i] * direction(rays_.cosine[i], rays_.sine[i]);
    for (int j = 0; j <= kSamples; ++j) {
      const double share = static_cast<double>(j) / kSamples;
      batch.point.push_back(frame_.origin + share * reach + model_height(i, share) * frame_.axis);
    }
  }
  batch.resize(batch.point.size());
  pressure.evaluate_values(batch);
  const double of_a = frame_.depth[0] / frame_.thickness;
  const std::size_t n = batch.size();
  levels_.third_value.resize(levels_.third.size() * n);
  for (std::size_t t = 0; t < levels_.third.size(); ++t) {
    const auto value = std::span(levels_.third_value).subspan(t * n, n);
    levels_.third[t]->field.evaluate(batch.point, value);
    for (std::size_t i = 0; i < n; ++i) value[i] = levels_.third[t]->material.modulus * value[i] - (of_a * batch.a[i] + (1.0 - of_a) * batch.b[i]);
  }
}

/// Where the rays cross kinks, on the heights as the curvature at the peak and the rim give them.
void PolarRuleSolver::guess_crossings(PairPressure& pressure) {
  if (cut_) sample_thirds(pressure);
  crossings_.clear();
  sheets_.clear();
  for (const std::size_t k : levels_.crossing) sheets_.push_back(k < levels_.kink.size() ? sheet_of(levels_.kink[k], frame_.origin) : Sheet{});
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    const Vec3 reach = rays_.radius[i] * direction(rays_.cosine[i], rays_.sine[i]);
    std::array<double, kSamples + 1> height, s;
    for (int j = 0; j <= kSamples; ++j) height[static_cast<std::size_t>(j)] = model_height(i, static_cast<double>(j) / kSamples);
    for (std::size_t c = 0; c < levels_.crossing.size(); ++c) {
      const RaySheet on = sheet_along(i, c, reach);
      const bool field = on.kink < levels_.kink.size();
      const std::size_t first = field ? 0 : ((on.kink - levels_.kink.size()) * rays_.size() + i) * s.size();
      for (std::size_t j = 0; j < s.size(); ++j) s[j] = field ? side_on_ray(pressure, on, static_cast<double>(j) / kSamples, height[j]) : levels_.third_value[first + j];
      if (!field && cross_imprints(pressure, i, on.kink, s)) continue;
      const std::size_t others = crossings_.size();
      for (std::size_t j = 0; j < kSamples; ++j) {
        const double left = static_cast<double>(j) / kSamples, right = static_cast<double>(j + 1) / kSamples;
        if ((s[j] > 0.0) != (s[j + 1] > 0.0)) {
          cross_between(pressure, on, {left, right}, {s[j], s[j + 1]}, others);
          continue;
        }
        // A ray that dips through a kink and back between two samples: at the vertex of a parabola through three of them.
        if (j == 0 || (s[j - 1] > 0.0) != (s[j] > 0.0)) continue;
        const double bend = s[j - 1] - 2.0 * s[j] + s[j + 1], slope = 0.5 * (s[j + 1] - s[j - 1]);
        if (!(bend * s[j] > 0.0) || !(std::abs(slope) < std::abs(bend))) continue;
        const double vertex = left - slope / bend / kSamples, dip = side_on_ray(pressure, on, vertex, model_height(i, vertex));
        if ((dip > 0.0) == (s[j] > 0.0)) continue;
        const bool early = vertex < left;
        cross_between(pressure, on, {early ? left - 1.0 / kSamples : left, vertex}, {early ? s[j - 1] : s[j], dip}, others);
        cross_between(pressure, on, {vertex, early ? left : right}, {dip, early ? s[j] : s[j + 1]}, others);
      }
    }
  }
}

/// Where the rays cross kinks on Sigma, by Newton's method from where they are guessed.
void PolarRuleSolver::find_crossings(PairPressure& pressure, double error) {
  const double enough = std::min(1e-3, 0.1 * std::sqrt(error));  // pieces that miss a kink by x leave an error of x^2
  guess_crossings(pressure);
  PressureBatch& batch = crossing_batch_;
  batch.resize(crossings_.size());
  open_.resize(crossings_.size());
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  for (int step = 0; step < kFreeSteps && !open_.empty(); ++step) {
    for (const std::size_t c : open_) {
      const Crossing& x = crossings_[c];
      batch.point[c] = frame_.origin + (x.radius * rays_.radius[x.ray]) * direction(rays_.cosine[x.ray], rays_.sine[x.ray]) +
                       x.height * frame_.axis;
    }
    pressure.evaluate(batch, open_, some_);
    levels_.evaluate_thirds(batch.point);
    std::erase_if(open_, [&](std::size_t c) {
      Crossing& x = crossings_[c];
      const Vec3 e = rays_.radius[x.ray] * direction(rays_.cosine[x.ray], rays_.sine[x.ray]);
      Vec3 slope;
      const double s = levels_.value(x.kink, frame_, batch, c, slope), gap = batch.a[c] - batch.b[c];
      const Vec3 across = batch.slope_a[c] - batch.slope_b[c];
      const double gr = across.dot(e), gt = across.dot(frame_.axis), sr = slope.dot(e), st = slope.dot(frame_.axis);
      const double determinant = gr * st - gt * sr;
      const double radius = x.radius + (gt * s - st * gap) / determinant;
      if (!std::isfinite(radius)) return false;
      const double next = std::clamp(radius, x.left, x.right);  // two that lie close must not change places
      const double moved = next - x.radius;
      x.height -= (gap + gr * moved) / gt;
      x.radius = next;
      // Relative to the piece between kink and rim on faces, whose share of the ray may be small.
      x.good = std::abs(moved) <= enough * (about_middle_ ? std::abs(1.0 - next) : 1.0) && next == radius;
      return x.good;
    });
  }
  std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& x, const Crossing& y) {
    return x.ray != y.ray ? x.ray < y.ray : x.radius != y.radius ? x.radius < y.radius : x.kink < y.kink;
  });
}

std::array<double, 2> PolarRuleSolver::Panel::bend(double x) const {
  const double width = end - begin, y = 0.5 * (1.0 + x), z = 1.0 - y;
  if (touch_begin && touch_end) return {begin + width * y * y * (3.0 - 2.0 * y), 3.0 * width * y * z};
  return touch_begin ? std::array{begin + width * y * y, width * y} : std::array{end - width * z * z, width * z};
}

/// Where neighbouring rays of the panels from `first` on meet other kinks, or in another order; only crossings that were found are kept.
void PolarRuleSolver::find_changes(PairPressure& pressure, const KronrodRule& rule, std::size_t first) {
  const std::size_t per_panel = rule.node.size();
  const auto ray_end = [this](std::size_t i) -> RayEnd {
    const Vec2 way(rays_.cosine[i], rays_.sine[i]);
    return {way, frame_.origin + rays_.radius[i] * direction(way.x(), way.y()) + rays_.height[i] * frame_.axis};
  };
  // Round-off says which rays meet a kink that goes through the origin.
  std::erase_if(crossings_, [](const Crossing& x) { return x.radius < kAtOrigin; });
  for (const Crossing& x : crossings_) {
    if (!x.good) panels_[first + x.ray / per_panel].lost = true;
  }
  std::erase_if(crossings_, [](const Crossing& x) { return !x.good || x.radius >= 1.0; });
  const auto same = [](const Crossing& x, const Crossing& y) { return x.kink == y.kink; };
  std::size_t next = 0;
  for (std::size_t p = first; p < panels_.size(); ++p) {
    Panel& panel = panels_[p];
    const double half = 0.5 * (panel.end - panel.begin);
    const auto place_at = [&](double x) { return panel.touches() ? panel.bend(x)[0] : panel.begin + half * (1.0 + x); };
    panel.change = changes_.size();
    std::span<const Crossing> before;
    for (std::size_t k = 0; k < per_panel; ++k) {
      const std::size_t begin = next;
      while (next < crossings_.size() && crossings_[next].ray == (p - first) * per_panel + k) ++next;
      const std::span<const Crossing> here = std::span(crossings_).subspan(begin, next - begin);
      const auto differ = std::mismatch(before.begin(), before.end(), here.begin(), here.end(), same);
      const bool changes = differ.first != before.end() || differ.second != here.end();
      if (k > 0 && changes) {
        double share = 0.5;
        const auto at = static_cast<std::size_t>(differ.first - before.begin());
        if (before.size() == here.size() && at + 1 < here.size() && same(before[at], here[at + 1]) && same(before[at + 1], here[at])) {
          // Two that change places do so where they meet.
          const double left = before[at + 1].radius - before[at].radius, right = here[at + 1].radius - here[at].radius;
          if (left + right > 0.0) share = left / (left + right);
        } else if (std::max(before.size(), here.size()) == at + 1 && std::min(before.size(), here.size()) == at) {
          // One that leaves through the rim does so at a corner.
          const std::size_t kink = before.size() > at ? before[at].kink : here[at].kink, ray = (p - first) * per_panel + k;
          if (const std::optional<double> corner = CornerFinder(pressure, frame_, levels_, extent_).between(kink, ray_end(ray - 1), ray_end(ray))) {
            share = *corner;
            panel.leaves = true;
          }
        }
        changes_.push_back(place_at(rule.node[k - 1] + share * (rule.node[k] - rule.node[k - 1])));
      }
      before = here;
    }
    panel.change_end = changes_.size();
  }
}

}  // namespace supple::collision
