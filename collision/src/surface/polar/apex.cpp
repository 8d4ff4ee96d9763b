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
void find_ends(PairPressure& pressure, int side, const Vec3& apex, std::span<const Vec3> way, double longest, std::vector<double>& end) {
  std::vector<double> low(way.size(), 0.0), high(way.size(), longest), value(way.size());
  std::vector<Vec3> point(way.size());
  for (int step = 0; step < kBracketSteps; ++step) {
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

}  // namespace

std::optional<Apex> find_apex(PairPressure& pressure, int side, Thirds thirds, const Vec3& from, const Vec3& outward) {
  const implicit::FieldView& field = pressure.field(side);
  if (!field.convex()) return std::nullopt;
  const Box box = field.surface_box();
  if (!is_finite(box)) {
    const std::optional<implicit::CorePoint> core = field.core_point(from);
    if (!core || !core->round) return std::nullopt;  // a half-space
    Vec3 slope;
    static_cast<void>(pressure.value(side, from, slope));
    return Apex{.at = -slope.normalized(), .parallel = true};
  }
  if (thirds.empty()) return apex_across(pressure, side, from, outward, box.extent().norm());
  const std::optional<implicit::CorePoint> core = field.core_point(box.centre());
  Apex apex{.at = core ? core->point : box.centre()};
  const double own = pressure.value(side, apex.at);
  if (!(own > 0.0)) return std::nullopt;
  double third = 0.0;
  for (const ContactBody* body : thirds) third = std::max(third, body->material.modulus * body->field.value(apex.at));
  apex.lost = pressure.value(1 - side, apex.at) > std::max(own, third);
  return apex;
}

void fill_body(PairPressure& pressure, int side, const Vec3& apex, double error, std::vector<Vec3>& point, std::vector<double>& volume) {
  constexpr int kFewest = 8, kInPanel = 16, kMost = 64, kAlong = 8;
  const double longest = pressure.field(side).surface_box().extent().norm();
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
    find_ends(pressure, side, apex, way, longest, end);
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
