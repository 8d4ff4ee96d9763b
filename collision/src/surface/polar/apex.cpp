#include "surface/polar/apex.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "numbers.h"
#include "pairs/boxes.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/quadrature.h"
#include "surface/region/column_kinks.h"

namespace supple::collision {
namespace {

constexpr std::size_t kLookedAt = 8;  // places that Sigma is far from to first order

/// Distances along rays out of the apex to where the body ends; its pressure is positive at the apex and falls through 0 once on each. Newton's method, held between
/// places on both sides. @param enough  of a last step, over the size of the body: sums are off by its square
void find_ends(PairPressure& pressure, int side, const Vec3& apex, std::span<const Vec3> way, double enough, std::vector<double>& end) {
  const double longest = pressure.field(side).surface_box().extent().norm();
  std::vector<double> low(way.size(), 0.0), high(way.size(), longest), value;
  std::vector<Vec3> point, slope;
  std::vector<std::size_t> open(way.size());
  std::iota(open.begin(), open.end(), std::size_t{0});
  end.assign(way.size(), 0.5 * longest);
  for (int step = 0; step < kBracketSteps && !open.empty(); ++step) {
    point.clear();
    for (const std::size_t i : open) point.push_back(apex + end[i] * way[i]);
    value.resize(open.size());
    slope.resize(open.size());
    pressure.evaluate(side, point, value, slope);
    std::size_t left = 0;
    for (std::size_t k = 0; k < open.size(); ++k) {
      const std::size_t i = open[k];
      (value[k] > 0.0 ? low[i] : high[i]) = end[i];
      const double newton = end[i] - value[k] / slope[k].dot(way[i]), next = newton > low[i] && newton < high[i] ? newton : 0.5 * (low[i] + high[i]);
      if (std::abs(next - end[i]) > enough * longest) open[left++] = i;
      end[i] = next;
    }
    open.resize(left);
  }
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

/// The pressure of a body at places, and the largest one of others there.
struct Presses {
  std::vector<double> own, most;
  std::vector<Vec3> slope, slope_of_most;
  std::vector<std::size_t> by;  ///< whose the largest is

  Presses(PairPressure& pressure, int side, Thirds others, std::span<const Vec3> place)
      : own(place.size()), most(place.size(), 0.0), slope(place.size()), slope_of_most(place.size(), Vec3::Zero()), by(place.size(), 0) {
    pressure.evaluate(side, place, own, slope);
    std::vector<double> value(place.size());
    std::vector<Vec3> gradient(place.size());
    for (std::size_t b = 0; b < others.size(); ++b) {
      const double modulus = others[b]->material.modulus;
      others[b]->field.evaluate(place, value, gradient);
      for (std::size_t i = 0; i < place.size(); ++i) {
        if (!(modulus * value[i] > most[i])) continue;
        most[i] = modulus * value[i];
        slope_of_most[i] = modulus * gradient[i];
        by[i] = b;
      }
    }
  }
  [[nodiscard]] bool lost(std::size_t i) const { return most[i] > own[i]; }
};

/// The middle of a body, and places on the ways from there to where it ends: away from each of the others, and along all axes. None where that is not in it.
std::vector<Vec3> places_in_body(PairPressure& pressure, int side, Thirds others) {
  constexpr double kEnds = 0.01;  // of the size of the body
  constexpr int kPlaces = 4;      // parts of a way
  const Box box = pressure.field(side).surface_box();
  const std::optional<implicit::CorePoint> core = pressure.field(side).core_point(box.centre());
  const Vec3 middle = core ? core->point : box.centre();
  if (!(pressure.value(side, middle) > 0.0)) return {};
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
  return place;
}

/// How far Sigma is from a place, as points on shells around it see it. @param lost  whether the place is   @param most  how far is looked [m]
double free_around(PairPressure& pressure, int side, Thirds others, const Vec3& place, bool lost, double most) {
  constexpr int kShells = 8;
  std::vector<Vec3> way;  // to the faces, edges and corners of a cube
  for (const double x : {-1.0, 0.0, 1.0}) {
    for (const double y : {-1.0, 0.0, 1.0}) {
      for (const double z : {-1.0, 0.0, 1.0}) {
        if (x != 0.0 || y != 0.0 || z != 0.0) way.push_back(Vec3(x, y, z).normalized());
      }
    }
  }
  std::vector<Vec3> point(way.size());
  for (int shell = 1; shell <= kShells; ++shell) {
    for (std::size_t i = 0; i < way.size(); ++i) point[i] = place + (most * shell / kShells) * way[i];
    const Presses there(pressure, side, others, point);
    for (std::size_t i = 0; i < point.size(); ++i) {
      if (there.own[i] > 0.0 && there.lost(i) != lost) return most * (shell - 1) / kShells;
    }
  }
  return most;
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

std::optional<Apex> find_shared_apex(PairPressure& pressure, int side, Thirds others, ApexRank rank, std::size_t& taker) {
  const implicit::FieldView& field = pressure.field(side);
  if (!field.convex()) return std::nullopt;
  const Box box = field.surface_box();
  if (!is_finite(box)) return apex_at_infinity(pressure, side, Vec3::Zero());
  const std::vector<Vec3> place = places_in_body(pressure, side, others);
  if (place.empty()) return std::nullopt;
  const Presses there(pressure, side, others, place);
  struct Free {
    double clear;  // how far Sigma is [m], to first order, then as seen
    std::size_t place;
  };
  const auto wider = [](const Free& one, const Free& other) { return one.clear > other.clear; };
  std::vector<Free> free;
  const double most = 0.25 * box.extent().norm();
  for (std::size_t i = 0; i < place.size(); ++i) {
    const double first_order = std::abs(there.own[i] - there.most[i]) / (there.slope[i] - there.slope_of_most[i]).norm();
    free.push_back({first_order < most ? first_order : most, i});
  }
  std::stable_sort(free.begin(), free.end(), wider);
  free.resize(kLookedAt);  // places_in_body gives more
  // None is seen farther from Sigma than it is to first order.
  const std::size_t ranked = static_cast<std::size_t>(rank) + 1;
  for (std::size_t k = 0; k < free.size(); ++k) {
    if (k >= ranked && free[k].clear <= free[ranked - 1].clear) {
      free.resize(k);
      break;
    }
    free[k].clear = free_around(pressure, side, others, place[free[k].place], there.lost(free[k].place), free[k].clear);
    std::inplace_merge(free.begin(), free.begin() + static_cast<std::ptrdiff_t>(k), free.begin() + static_cast<std::ptrdiff_t>(k) + 1, wider);
  }
  const std::size_t best = free[static_cast<std::size_t>(rank)].place;
  taker = there.by[best];
  return Apex{.at = place[best], .lost = there.lost(best)};
}

void fill_body(PairPressure& pressure, int side, const Vec3& apex, double error, std::vector<Vec3>& point, std::vector<double>& volume) {
  constexpr int kFewest = 8, kInPanel = 16, kMost = 64, kAlong = 8;
  constexpr double kEnough = 1e-6;  // of the size of the body
  const std::size_t begin = point.size();
  std::vector<Vec3> way;
  std::vector<double> share, end, value;
  ColumnKinks kinks(pressure, side, error);
  double before = 0.0;
  for (int n = kFewest; n <= kMost; n *= 2) {
    // Gauss in the height, in panels, equal angles around it: exact of spherical harmonics of a low degree.
    const int panels = std::max(1, n / kInPanel);
    const GaussRule& height = gauss_rule(n / panels);
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
    find_ends(pressure, side, apex, way, kEnough, end);
    point.resize(begin);
    volume.resize(begin);
    for (std::size_t i = 0; i < way.size(); ++i) {
      const std::span<const double> part = kinks.parts(apex, way[i], end[i]);
      const GaussRule& along = gauss_rule(order_of_parts(kAlong, part));
      for (std::size_t k = 0; k + 1 < part.size(); ++k) {
        const double length = part[k + 1] - part[k];
        for (std::size_t j = 0; j < along.node.size(); ++j) {
          const double s = part[k] + length * along.node[j];
          point.push_back(apex + s * way[i]);
          volume.push_back(share[i] * length * along.weight[j] * s * s);
        }
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
