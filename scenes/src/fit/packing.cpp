#include "fit/packing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "fit/point_tree.h"
#include "supple/core/interrupt.h"

namespace supple::fit {
namespace {

constexpr std::size_t kBlock = 512;

/// Points far from one another: first the one next to the mean, then always the one farthest from all chosen.
std::vector<Vec3> far_points(const std::vector<Vec3>& points, std::size_t count) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  std::vector<double> distance(points.size());
  std::transform(points.begin(), points.end(), distance.begin(), [&](const Vec3& p) { return -(p - mean).norm(); });
  std::vector<Vec3> out;
  for (std::size_t chosen = 0; chosen < count; ++chosen) {
    const auto farthest = std::max_element(distance.begin(), distance.end()) - distance.begin();
    const Vec3 next = points[static_cast<std::size_t>(farthest)];
    if (chosen == 0) std::fill(distance.begin(), distance.end(), std::numeric_limits<double>::infinity());
    out.push_back(next);
    for (std::size_t k = 0; k < points.size(); ++k) distance[k] = std::min(distance[k], (points[k] - next).squaredNorm());
  }
  return out;
}

void assign_shares(const std::vector<Vec3>& points, Packing& packing, const Executor& executor) {
  const PointTree tree(packing.particle);
  executor.for_blocks(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) packing.share[k] = tree.nearest(points[k]);
  });
}

/// Particles move to the middle of their shares.
void centre(const std::vector<Vec3>& points, Packing& packing) {
  std::vector<Vec3> sum(packing.particle.size(), Vec3::Zero());
  std::vector<double> count(packing.particle.size(), 0.0);
  for (std::size_t k = 0; k < points.size(); ++k) {
    sum[packing.share[k]] += points[k];
    count[packing.share[k]] += 1.0;
  }
  for (std::size_t i = 0; i < sum.size(); ++i) {
    if (count[i] > 0.0) packing.particle[i] = sum[i] / count[i];
  }
}

std::uint32_t root_of(std::vector<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

/// The squares of the lattice between the shares of a pair.
struct Shared {
  std::vector<Vec3> centre, area;

  [[nodiscard]] Face face() const {
    Face out;
    for (std::size_t k = 0; k < area.size(); ++k) {
      out.area += area[k];
      out.centre += centre[k] / static_cast<double>(area.size());
    }
    for (std::size_t k = 0; k < area.size(); ++k) {
      const Vec3 arm = centre[k] - out.centre, n = area[k].normalized();
      const Mat3 own = area[k].norm() / 12.0 * (Mat3::Identity() - n * n.transpose());  // of a square
      out.first += arm * area[k].transpose();
      for (Eigen::Index m = 0; m < 3; ++m) out.second[static_cast<std::size_t>(m)] += area[k][m] * (arm * arm.transpose() + own);
    }
    return out;
  }
};

std::map<std::array<std::uint32_t, 2>, Shared> shared_faces(const Surroundings& around, const Packing& packing) {
  const PointTree tree(around.inside);
  std::map<std::array<std::uint32_t, 2>, Shared> out;
  std::vector<std::uint32_t> near;
  for (std::uint32_t k = 0; k < around.inside.size(); ++k) {
    constexpr double kNext = 1.1;  // of the step: the six points beside
    tree.within(around.inside[k], kNext * around.step, near);
    for (const std::uint32_t other : near) {
      const std::uint32_t a = packing.share[k], b = packing.share[other];
      if (a >= b) continue;  // each face once, from its first particle
      Shared& shared = out[{a, b}];
      shared.area.push_back(around.step * (around.inside[other] - around.inside[k]));
      shared.centre.push_back(0.5 * (around.inside[other] + around.inside[k]));
    }
  }
  return out;
}

/// What the lattice leaves apart, by the shortest bond between two parts, of the section of one point.
void join_parts(const Surroundings& around, std::vector<std::uint32_t>& parent, std::map<std::array<std::uint32_t, 2>, Shared>& faces, const Packing& packing) {
  for (;;) {
    std::array<std::uint32_t, 2> best{};
    double least = std::numeric_limits<double>::infinity();
    for (std::uint32_t i = 0; i < parent.size(); ++i) {
      for (std::uint32_t j = i + 1; j < parent.size(); ++j) {
        if (root_of(parent, i) == root_of(parent, j)) continue;
        const double d = (packing.particle[i] - packing.particle[j]).squaredNorm();
        if (d < least) {
          least = d;
          best = {i, j};
        }
      }
    }
    if (!std::isfinite(least)) break;
    const Vec3 &a = packing.particle[best[0]], &b = packing.particle[best[1]];
    faces[best] = {{0.5 * (a + b)}, {around.step * around.step * (b - a).normalized()}};
    parent[root_of(parent, best[0])] = root_of(parent, best[1]);
  }
}

void add_bonds(const Surroundings& around, Packing& packing) {
  std::map<std::array<std::uint32_t, 2>, Shared> faces = shared_faces(around, packing);
  std::vector<std::uint32_t> parent(packing.particle.size());
  std::iota(parent.begin(), parent.end(), 0U);
  for (const auto& [pair, shared] : faces) parent[root_of(parent, pair[0])] = root_of(parent, pair[1]);
  join_parts(around, parent, faces, packing);
  for (const auto& [pair, shared] : faces) {
    packing.bond.push_back(pair);
    packing.face.push_back(shared.face());
  }
}

}  // namespace

bool is_connected(const Packing& packing) {
  std::vector<std::uint32_t> parent(packing.particle.size());
  std::iota(parent.begin(), parent.end(), 0U);
  std::size_t parts = parent.size();
  for (const auto& [a, b] : packing.bond) {
    const std::uint32_t x = root_of(parent, a), y = root_of(parent, b);
    if (x == y) continue;
    parent[x] = y;
    --parts;
  }
  return parts == 1;
}

Packing pack_points(const std::vector<Vec3>& points, std::size_t count, const Executor& executor) {
  Packing out;
  count = std::min(count, points.size());
  out.particle = far_points(points, count);
  out.share.resize(points.size());
  constexpr int kSweeps = 40;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    heed_scope();
    assign_shares(points, out, executor);
    centre(points, out);
  }
  assign_shares(points, out, executor);
  return out;
}

Packing pack_inside(const Surroundings& around, std::size_t count, const Executor& executor) {
  Packing out = pack_points(around.inside, count, executor);
  add_bonds(around, out);
  out.connected = is_connected(out);
  return out;
}

}  // namespace supple::fit
