#include "fit/shell.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "fit/point_tree.h"

namespace supple::fit {
namespace {

constexpr double kNear = 2.5;     // of the samples' spacing: pairs that count for a common edge
constexpr double kAlike = 0.5;    // least cosine between normals of neighbours: not through a fold

/// The width of the edge between two shares: of samples at spacing s, w 2 rho^3 / (3 s^4) pairs nearer than rho lie on both sides of a straight one.
void add_edges(ShellElements& shell) {
  const SurfaceSamples& samples = shell.samples;
  Packing& packing = shell.packing;
  const double s = samples.spacing, rho = kNear * s, width_of_pair = 1.5 * s * s * s * s / (rho * rho * rho);
  const PointTree tree(samples.position);
  std::map<std::array<std::uint32_t, 2>, Face> edges;
  std::map<std::array<std::uint32_t, 2>, double> pairs;
  std::vector<std::uint32_t> near;
  for (std::uint32_t k = 0; k < samples.position.size(); ++k) {
    tree.within(samples.position[k], rho, near);
    for (const std::uint32_t other : near) {
      const std::uint32_t a = packing.share[k], b = packing.share[other];
      if (a >= b || samples.normal[k].dot(samples.normal[other]) < kAlike) continue;
      edges[{a, b}].centre += 0.5 * (samples.position[k] + samples.position[other]);
      pairs[{a, b}] += 1.0;
    }
  }
  constexpr double kLeast = 0.1;  // of the distance: corners where four shares meet
  for (const auto& [pair, edge] : edges) {
    const double count = pairs[pair], width = count * width_of_pair;
    const Vec3 r = packing.particle[pair[1]] - packing.particle[pair[0]];
    if (width < kLeast * r.norm()) continue;
    packing.bond.push_back(pair);
    packing.face.push_back({width * r.normalized(), edge.centre / count});
  }
}

}  // namespace

Mesh thickened(const Mesh& middle, double thickness) {
  std::vector<Vec3> normal(middle.position.size(), Vec3::Zero());
  std::map<std::array<std::uint32_t, 2>, int> edges;  // directed
  for (const auto& t : middle.triangle) {
    const Vec3 across = (middle.position[t[1]] - middle.position[t[0]]).cross(middle.position[t[2]] - middle.position[t[0]]);
    for (std::size_t k = 0; k < 3; ++k) {
      normal[t[k]] += across;
      ++edges[{t[k], t[(k + 1) % 3]}];
    }
  }
  const auto n = static_cast<std::uint32_t>(middle.position.size());
  Mesh out;
  for (const double side : {0.5, -0.5}) {
    for (std::uint32_t i = 0; i < n; ++i) out.position.push_back(middle.position[i] + side * thickness * normal[i].normalized());
  }
  for (const auto& t : middle.triangle) {
    out.triangle.push_back(t);
    out.triangle.push_back({n + t[0], n + t[2], n + t[1]});
  }
  for (const auto& [edge, count] : edges) {
    const auto [a, b] = edge;
    if (edges.contains({b, a})) continue;
    out.triangle.push_back({b, a, n + a});
    out.triangle.push_back({b, n + a, n + b});
  }
  return out;
}

ShellElements pack_shell(const Mesh& middle, std::size_t count, const Executor& executor) {
  constexpr std::size_t kSamplesOfShare = 100;
  ShellElements out;
  out.samples = sample_surface(middle, kSamplesOfShare * count);
  out.packing = pack_points(out.samples.position, count, executor);
  const PointTree tree(out.samples.position);
  const double spacing = out.samples.spacing * std::sqrt(static_cast<double>(kSamplesOfShare));
  std::vector<std::uint32_t> near;
  for (Vec3& place : out.packing.particle) {
    const std::uint32_t sample = tree.nearest(place);
    place = out.samples.position[sample];
    const Vec3 normal = out.samples.normal[sample];
    tree.within(place, spacing, near);
    std::vector<Vec3> points{place};
    for (const std::uint32_t k : near) {
      if (k != sample && out.samples.normal[k].dot(normal) > kAlike) points.push_back(out.samples.position[k]);
    }
    out.frame.push_back(measure_frame(points, normal));
  }
  add_edges(out);
  out.packing.connected = is_connected(out.packing);
  return out;
}

}  // namespace supple::fit
