/// @file tests/support/mesh_distance.h
/// Distances from points to a triangle mesh: the second half of two-sided errors, which shows missed parts of a surface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "supple/core/mesh.h"

namespace supple::testing {

/// Squared distance of p to the triangle a, b, c (Ericson 2005, "Real-Time Collision Detection", sec. 5.1.5).
inline double squared_distance(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d1 <= 0.0 && d2 <= 0.0) return ap.squaredNorm();
  if (d3 >= 0.0 && d4 <= d3) return bp.squaredNorm();
  if (d6 >= 0.0 && d5 <= d6) return cp.squaredNorm();
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return (ap - d1 / (d1 - d3) * ab).squaredNorm();
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return (ap - d2 / (d2 - d6) * ac).squaredNorm();
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
    return (bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)).squaredNorm();
  }
  const double sum = va + vb + vc;
  return (ap - vb / sum * ab - vc / sum * ac).squaredNorm();
}

/// Triangles in the cubes of a grid.
class MeshDistance {
 public:
  /// @param cell  edge of the cubes [m]; the size of a triangle is fastest
  MeshDistance(const Mesh& mesh, double cell) : mesh_(mesh), cell_(cell) {
    Box box;
    for (const Vec3& p : mesh.position) box.include(p);
    if (box.empty()) return;
    lower_ = box.lower;
    for (int k = 0; k < 3; ++k) count_[static_cast<std::size_t>(k)] = at(box.upper[k], k) + 1;
    start_.assign(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]) + 1, 0);
    for_cubes([&](std::size_t cube, std::uint32_t) { ++start_[cube + 1]; });
    for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
    triangle_.resize(start_.back());
    std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
    for_cubes([&](std::size_t cube, std::uint32_t t) { triangle_[next[cube]++] = t; });
  }

  /// Infinite for a mesh without triangles.
  [[nodiscard]] double operator()(const Vec3& p) const {
    double best = std::numeric_limits<double>::infinity();
    if (triangle_.empty()) return best;
    std::array<long, 3> centre{};
    for (int k = 0; k < 3; ++k) centre[static_cast<std::size_t>(k)] = at(p[k], k);
    const long farthest = 2 + std::max({reach(centre, 0), reach(centre, 1), reach(centre, 2)});
    for (long ring = 0; ring <= farthest; ++ring) {
      // Cubes of this ring are at least ring - 1 cubes away.
      const double least = static_cast<double>(std::max(ring - 1, 0L)) * cell_;
      if (best <= least * least) break;
      for_ring(centre, ring, [&](std::size_t cube) {
        for (std::uint32_t i = start_[cube]; i < start_[cube + 1]; ++i) {
          const auto& t = mesh_.triangle[triangle_[i]];
          best = std::min(best, squared_distance(p, mesh_.position[t[0]], mesh_.position[t[1]], mesh_.position[t[2]]));
        }
      });
    }
    return std::sqrt(best);
  }

 private:
  [[nodiscard]] long at(double x, int axis) const { return static_cast<long>(std::floor((x - lower_[axis]) / cell_)); }
  [[nodiscard]] long reach(const std::array<long, 3>& centre, std::size_t axis) const {
    return std::max(std::abs(centre[axis]), std::abs(centre[axis] - count_[axis]));
  }
  template <class Use>
  void for_cubes(const Use& use) const {
    for (std::uint32_t t = 0; t < mesh_.triangle_count(); ++t) {
      Box box;
      for (const std::uint32_t v : mesh_.triangle[t]) box.include(mesh_.position[v]);
      for (long z = at(box.lower.z(), 2); z <= at(box.upper.z(), 2); ++z) {
        for (long y = at(box.lower.y(), 1); y <= at(box.upper.y(), 1); ++y) {
          for (long x = at(box.lower.x(), 0); x <= at(box.upper.x(), 0); ++x) {
            use(static_cast<std::size_t>((z * count_[1] + y) * count_[0] + x), t);
          }
        }
      }
    }
  }
  template <class Use>
  void for_ring(const std::array<long, 3>& centre, long ring, const Use& use) const {
    const auto low = [&](std::size_t k) { return std::max(centre[k] - ring, 0L); };
    const auto high = [&](std::size_t k) { return std::min(centre[k] + ring, count_[k] - 1); };
    for (long z = low(2); z <= high(2); ++z) {
      for (long y = low(1); y <= high(1); ++y) {
        // Rows at the ring's sides are on it, of the others their ends.
        const bool whole = std::abs(z - centre[2]) == ring || std::abs(y - centre[1]) == ring;
        for (long x = whole ? low(0) : centre[0] - ring; x <= (whole ? high(0) : centre[0] + ring); x += whole ? 1 : 2 * ring) {
          if (x >= 0 && x < count_[0]) use(static_cast<std::size_t>((z * count_[1] + y) * count_[0] + x));
        }
      }
    }
  }

  const Mesh& mesh_;
  double cell_;
  Vec3 lower_ = Vec3::Zero();
  std::array<long, 3> count_{0, 0, 0};
  std::vector<std::uint32_t> start_, triangle_;
};

}  // namespace supple::testing
