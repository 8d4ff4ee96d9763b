#include "fit/samples.h"

#include <algorithm>
#include <cmath>

namespace supple::fit {

SurfaceSamples sample_surface(const Mesh& mesh, std::size_t count) {
  const auto edges = [&mesh](const std::array<std::uint32_t, 3>& t) {
    return std::pair<Vec3, Vec3>(mesh.position[t[1]] - mesh.position[t[0]], mesh.position[t[2]] - mesh.position[t[0]]);
  };
  double total = 0.0;
  for (const auto& t : mesh.triangle) {
    const auto [u, v] = edges(t);
    total += 0.5 * u.cross(v).norm();
  }
  std::vector<Vec3> smooth(mesh.position.size(), Vec3::Zero());
  for (const auto& t : mesh.triangle) {
    const auto [u, v] = edges(t);
    for (const std::uint32_t corner : t) smooth[corner] += u.cross(v);
  }
  SurfaceSamples out;
  out.spacing = std::sqrt(total / static_cast<double>(count));
  out.position.reserve(count);
  out.normal.reserve(count);
  double passed = 0.0;
  for (const auto& t : mesh.triangle) {
    const auto [u, v] = edges(t);
    const Vec3 across = u.cross(v);
    passed += 0.5 * across.norm();
    const Vec3 flat = across.normalized();
    const auto normal_at = [&](std::size_t corner) {
      constexpr double kCrease = 0.85;  // cosine of 32 degrees
      const Vec3 n = smooth[t[corner]].normalized();
      return n.dot(flat) > kCrease ? n : flat;
    };
    while (out.position.size() < count && (static_cast<double>(out.position.size()) + 0.5) * total <= passed * static_cast<double>(count)) {
      constexpr double kFirst = 0.7548776662466927, kSecond = 0.5698402909980532;
      const double k = static_cast<double>(out.position.size());
      double a = std::fmod(0.5 + kFirst * k, 1.0), b = std::fmod(0.5 + kSecond * k, 1.0);
      if (a + b > 1.0) {
        a = 1.0 - a;
        b = 1.0 - b;
      }
      out.position.push_back(mesh.position[t[0]] + a * u + b * v);
      out.normal.push_back(((1.0 - a - b) * normal_at(0) + a * normal_at(1) + b * normal_at(2)).normalized());
    }
  }
  return out;
}

Surroundings sample_surroundings(const Mesh& mesh, const SurfaceTree& tree, double step, const Executor& executor) {
  Box box;
  for (const Vec3& p : mesh.position) box.include(p);
  box = box.inflated(2.0 * step);
  std::vector<Vec3> points;
  for (double z = box.lower.z(); z <= box.upper.z(); z += step) {
    for (double y = box.lower.y(); y <= box.upper.y(); y += step) {
      for (double x = box.lower.x(); x <= box.upper.x(); x += step) points.emplace_back(x, y, z);
    }
  }
  std::vector<double> distance(points.size());
  constexpr std::size_t kBlock = 256;
  executor.for_blocks(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) distance[k] = tree.signed_distance(points[k]);
  });
  Surroundings out;
  out.step = step;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const bool in = distance[k] < 0.0;
    (in ? out.inside : out.outside).push_back(points[k]);
    (in ? out.depth : out.gap).push_back(std::abs(distance[k]));
  }
  return out;
}

}  // namespace supple::fit
