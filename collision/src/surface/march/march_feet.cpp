#include "surface/accuracy.h"
#include "surface/march/march_rule.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "supple/core/interrupt.h"

namespace supple::collision {
void MarchRuleSolver::Feet::clear() {
  triangle.clear();
  at.clear();
  height.clear();
}

void MarchRuleSolver::Feet::add(std::uint32_t in, const Vec2& where, double guess) {
  triangle.push_back(in);
  at.push_back(where);
  height.push_back(guess);
}

Vec3 MarchRuleSolver::plane(std::uint32_t triangle, const Vec2& at) const {
  const auto& c = mesh_.triangle[triangle].corner;
  return (1.0 - at.x() - at.y()) * mesh_.vertex[c[0]] + at.x() * mesh_.vertex[c[1]] + at.y() * mesh_.vertex[c[2]];
}

/// The interpolated normal, which is no unit vector.
Vec3 MarchRuleSolver::along(std::uint32_t triangle, const Vec2& at) const {
  const auto& c = mesh_.triangle[triangle].corner;
  return (1.0 - at.x() - at.y()) * mesh_.normal[c[0]] + at.x() * mesh_.normal[c[1]] + at.y() * mesh_.normal[c[2]];
}

double MarchRuleSolver::area_of(const Piece& piece) const {
  const Vec3 p = plane(piece.triangle, piece.corner[0].at), q = plane(piece.triangle, piece.corner[1].at);
  return 0.5 * (q - p).cross(plane(piece.triangle, piece.corner[2].at) - p).norm();
}

/// Tangents of the image at a foot, as if it were on Sigma.
void MarchRuleSolver::find_tangents(Feet& feet, std::size_t i) const {
  const auto& c = mesh_.triangle[feet.triangle[i]].corner;
  const Vec3 &n = feet.way[i], slope = feet.batch.slope_a[i] - feet.batch.slope_b[i];
  const double rate = slope.dot(n);
  const auto flat = [&](std::uint32_t to) {
    return Vec3(mesh_.vertex[to] - mesh_.vertex[c[0]] + feet.height[i] * (mesh_.normal[to] - mesh_.normal[c[0]]));
  };
  const Vec3 s = flat(c[1]), t = flat(c[2]);
  feet.climb[i] = Vec2(-slope.dot(s), -slope.dot(t)) / rate;
  feet.along_s[i] = s + feet.climb[i].x() * n;
  feet.along_t[i] = t + feet.climb[i].y() * n;
}

/// Whether the image lies the same way round there as its triangle, and does not stand on end.
bool MarchRuleSolver::upright(const Feet& feet, std::size_t i) {
  const Vec3 normal = feet.batch.slope_b[i] - feet.batch.slope_a[i], &way = feet.way[i];
  return normal.dot(way) > kGraphCosine * normal.norm() * way.norm() && feet.along_s[i].cross(feet.along_t[i]).dot(normal) > 0.0;
}

/// Pressures at some feet, at their heights so far.
void MarchRuleSolver::measure(PairPressure& pressure, Thirds third, Feet& feet, std::span<const std::size_t> which) {
  heed_scope();  // a pair may take seconds
  for (const std::size_t i : which) {
    feet.way[i] = along(feet.triangle[i], feet.at[i]);
    feet.batch.point[i] = plane(feet.triangle[i], feet.at[i]) + feet.height[i] * feet.way[i];
  }
  pressure.evaluate(feet.batch, which, some_);
  if (third.empty()) return;
  place_.resize(which.size());
  value_.resize(which.size());
  slope_.resize(which.size());
  for (std::size_t k = 0; k < which.size(); ++k) {
    place_[k] = feet.batch.point[which[k]];
    feet.third[which[k]] = -std::numeric_limits<double>::max();
  }
  for (const ContactBody* body : third) {
    body->field.evaluate(place_, value_, slope_);
    for (std::size_t k = 0; k < which.size(); ++k) {
      const double p = body->material.modulus * value_[k];
      if (p <= feet.third[which[k]]) continue;
      feet.third[which[k]] = p;
      feet.third_slope[which[k]] = body->material.modulus * slope_[k];
    }
  }
}

void MarchRuleSolver::Feet::make_room() {
  const std::size_t n = size();
  batch.resize(n);
  along_s.resize(n);
  along_t.resize(n);
  way.resize(n);
  climb.resize(n);
  third.assign(n, 0.0);
  third_slope.assign(n, Vec3::Zero());
  met.assign(n, 0);
  good.assign(n, 0);
}

/// How far a foot is from Sigma along the interpolated normal, to first order.
double MarchRuleSolver::to_sigma(const Feet& feet, std::size_t i) {
  return (feet.batch.b[i] - feet.batch.a[i]) / (feet.batch.slope_a[i] - feet.batch.slope_b[i]).dot(feet.way[i]);
}

/// The pressures after such a move, to first order.
void MarchRuleSolver::lift(Feet& feet, std::size_t i, double move) {
  const Vec3 way = move * feet.way[i];
  feet.batch.point[i] += way;
  feet.batch.a[i] += feet.batch.slope_a[i].dot(way);
  feet.batch.b[i] += feet.batch.slope_b[i].dot(way);
  feet.third[i] += feet.third_slope[i].dot(way);
}

/// Feet on Sigma by Newton's method in their heights, with the tangents of the image before the last step.
void MarchRuleSolver::place(PairPressure& pressure, Thirds third, Feet& feet) {
  feet.make_room();
  open_.resize(feet.size());
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  for (int step = 0; step < kBracketSteps && !open_.empty(); ++step) {
    measure(pressure, third, feet, open_);
    std::size_t left = 0;
    for (const std::size_t i : open_) {
      const double move = to_sigma(feet, i), there = feet.height[i] + std::clamp(move, -0.5 * cell_, 0.5 * cell_);
      const bool lost = !(std::abs(there) <= cell_), last = step + 1 == kBracketSteps, near = std::abs(move) <= on_sigma_ * cell_;
      if (lost || last || near) find_tangents(feet, i);
      if (!std::isfinite(move)) continue;
      feet.height[i] = there;
      if (lost) continue;
      if (!near) {
        open_[left++] = i;
        continue;
      }
      lift(feet, i, move);
      feet.met[i] = 1;
      feet.good[i] = upright(feet, i) ? 1 : 0;
    }
    open_.resize(left);
  }
}

MarchRuleSolver::Foot MarchRuleSolver::foot(const Feet& feet, std::size_t i) const {
  Foot out;
  out.at = feet.at[i];
  out.height = feet.height[i];
  out.climb = feet.climb[i];
  out.good = feet.good[i] != 0;
  // The softer body says its pressure best, as it changes least off Sigma.
  const Vec3 &ga = feet.batch.slope_a[i], &gb = feet.batch.slope_b[i];
  const double sa = ga.norm(), sb = gb.norm(), share = sa + sb > 0.0 ? sb / (sa + sb) : 0.5;
  out.pressure = share * feet.batch.a[i] + (1.0 - share) * feet.batch.b[i];
  Vec3 slope = share * ga + (1.0 - share) * gb;
  if (feet.third[i] > 0.0) {
    out.pressure -= feet.third[i];
    slope -= feet.third_slope[i];
  }
  out.slope = Vec2(slope.dot(feet.along_s[i]), slope.dot(feet.along_t[i]));
  if (!out.slope.allFinite()) out.good = false;
  return out;
}

}  // namespace supple::collision
