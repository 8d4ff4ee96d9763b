#include "surface/polar/apex.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "numbers.h"
#include "pairs/boxes.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/quadrature.h"

namespace supple::collision {
namespace {

/// Distances along rays out of the apex to where the body ends; its pressure is positive at the apex and falls through 0 once on each.
void find_ends(PairPressure& pressure, int side, const Vec3& apex, std::span<const Vec3> way, int steps, std::vector<double>& end) {
  const double longest = pressure.field(side).surface_box().extent().norm();
  std::vector<double> low(way.size(), 0.0), high(way.size(), longest), value(way.size());
  std::vector<Vec3> point(way.size());
  for (int step = 0; step < steps; ++step) {
    for (std::size_t i = 0; i < way.size(); ++i) point[i] = apex + 0.5 * (low[i] + high[i]) * way[i];
    pressure.evaluate(side, point, value);
    for (std::size_t i = 0; i < way.size(); ++i) (value[i] > 0.0 ? low[i] : high[i]) = 0.5 * (low[i] + high[i]);
  }
  end.assign(low.begin(), low.end());
}

/// The middle of what the body keeps or of what it loses, along the normal of Sigma, whichever is wider: the flux grows with the square of how near
/// Sigma is to the apex.
Apex apex_across(PairPressure& pressure, int side, const Vec3& from, const Vec3& outward, double longest) {
  constexpr int kPlaces = 64;
  const auto reach = [&](const Vec3& way, bool kept) {
    double far = 0.0;
    for (int k = 1; k <= kPlaces; ++k) {
      const double t = longest * k / kPlaces;
      const Vec3 x = from + t * way;
      const double own = pressure.value(side, x);
      if (!(own > 0.0) || (kept && pressure.value(1 - side, x) >= own)) break;
      far = t;
    }
    return far;
  };
  const double kept = reach(-outward, true), lost = reach(outward, false);
  return kept >= lost ? Apex{.at = from - 0.5 * kept * outward} : Apex{.at = from + 0.5 * lost * outward, .lost = true};
}

/// Of a convex body without end: only a half-space has one.
std::optional<Apex> apex_at_infinity(PairPressure& pressure, int side, const Vec3& near) {
  const std::optional<implicit::CorePoint> core = pressure.field(side).core_point(near);
  if (!core || !core->round) return std::nullopt;
  Vec3 slope;
  static_cast<void>(pressure.value(side, near, slope));
  return Apex{.at = -slope.normalized(), .parallel = true};
}

}  // namespace

std::optional<Apex> find_apex(PairPressure& pressure, int side, const Vec3& from, const Vec3& outward) {
  const implicit::FieldView& field = pressure.field(side);
  if (!field.convex()) return std::nullopt;
  const Box box = field.surface_box();
  if (!is_finite(box)) return apex_at_infinity(pressure, side, from);
  return apex_across(pressure, side, from, outward, box.extent().norm());
}

std::optional<Apex> find_shared_apex(PairPressure& pressure, int side, Thirds others, std::size_t& taker) {
  constexpr int kEnds = 8, kPlaces = 4;  // halvings; parts of the way to where the body ends
  const implicit::FieldView& field = pressure.field(side);
  if (!field.convex()) return std::nullopt;
  const Box box = field.surface_box();
  if (!is_finite(box)) return apex_at_infinity(pressure, side, Vec3::Zero());
  const std::optional<implicit::CorePoint> core = field.core_point(box.centre());
  const Vec3 middle = core ? core->point : box.centre();
  if (!(pressure.value(side, middle) > 0.0)) return std::nullopt;
  // Away from each of the others, and along all axes.
  std::vector<Vec3> way, place{middle};
  for (Eigen::Index k = 0; k < 3; ++k) way.insert(way.end(), {Vec3(Vec3::Unit(k)), Vec3(-Vec3::Unit(k))});
  for (const ContactBody* other : others) {
    const Vec3 away = middle - other->field.surface_box().centre();
    if (away.allFinite() && away.norm() > 0.0) way.push_back(away.normalized());
  }
  std::vector<double> end;
  find_ends(pressure, side, middle, way, kEnds, end);
  for (std::size_t i = 0; i < way.size(); ++i) {
    for (int k = 1; k < kPlaces; ++k) place.push_back(middle + (end[i] * k / kPlaces) * way[i]);
  }
  const std::size_t n = place.size();
  std::vector<double> own(n), most(n, 0.0), value(n);
  std::vector<Vec3> apart(n), slope_of_most(n, Vec3::Zero()), slope(n);
  std::vector<std::size_t> by(n, 0);
  pressure.evaluate(side, place, own, apart);
  for (std::size_t b = 0; b < others.size(); ++b) {
    const double modulus = others[b]->material.modulus;
    others[b]->field.evaluate(place, value, slope);
    for (std::size_t i = 0; i < n; ++i) {
      if (!(modulus * value[i] > most[i])) continue;
      most[i] = modulus * value[i];
      slope_of_most[i] = modulus * slope[i];
      by[i] = b;
    }
  }
  // To first order, how far Sigma is.
  const auto clear = [&](std::size_t i) { return std::abs(own[i] - most[i]) / (apart[i] - slope_of_most[i]).norm(); };
  std::size_t best = 0;
  for (std::size_t i = 1; i < n; ++i) {
    if (clear(i) > clear(best)) best = i;
  }
  taker = by[best];
  return Apex{.at = place[best], .lost = most[best] > own[best]};
}

void fill_body(PairPressure& pressure, int side, const Vec3& apex, double error, std::vector<Vec3>& point, std::vector<double>& volume) {
  constexpr int kFewest = 8, kInPanel = 16, kMost = 64, kAlong = 8;
  const std::size_t begin = point.size();
  std::vector<Vec3> way;
  std::vector<double> share, end, value;
  double before = 0.0;
  for (int n = kFewest; n <= kMost; n *= 2) {
    // Gauss in the height, in panels, equal angles around it: exact of spherical harmonics of a low degree.
    const int panels = std::max(1, n / kInPanel);
    const GaussRule &height = gauss_rule(n / panels), &along = gauss_rule(kAlong);
    way.clear();
    share.clear();
    for (int panel = 0; panel < panels; ++panel) {
      for (std::size_t h = 0; h < height.node.size(); ++h) {
        const double z = 2.0 * (panel + height.node[h]) / panels - 1.0, across = std::sqrt(1.0 - z * z);
        for (int k = 0; k < 2 * n; ++k) {
          const math::SinCos turn = math::sin_cos(std::numbers::pi * (k + 0.5) / n);
          way.push_back(Vec3(across * turn.cos, across * turn.sin, z));
          share.push_back(kTurn / n * height.weight[h] / panels);
        }
      }
    }
    find_ends(pressure, side, apex, way, kBracketSteps, end);
    point.resize(begin);
    volume.resize(begin);
    for (std::size_t i = 0; i < way.size(); ++i) {
      for (std::size_t j = 0; j < along.node.size(); ++j) {
        const double s = end[i] * along.node[j];
        point.push_back(apex + s * way[i]);
        volume.push_back(share[i] * end[i] * along.weight[j] * s * s);
      }
    }
    const auto added = std::span(point).subspan(begin);
    value.resize(added.size());
    pressure.evaluate(side, added, value);
    double sum = 0.0;
    for (std::size_t i = 0; i < value.size(); ++i) sum += volume[begin + i] * value[i];
    if (std::abs(sum - before) <= error * sum) break;
    before = sum;
  }
}

}  // namespace supple::collision
