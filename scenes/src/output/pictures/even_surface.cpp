#include "output/pictures/even_surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <set>

namespace supple::scenes {
namespace {

constexpr double kLeft = 0.05;    // of a wave of that width, and of shorter ones
constexpr int kMostSteps = 2000;  // enough for waves of three thousand edges

using Key = std::array<std::uint64_t, 3>;
Key key_of(const Vec3& p) { return {std::bit_cast<std::uint64_t>(p.x()), std::bit_cast<std::uint64_t>(p.y()), std::bit_cast<std::uint64_t>(p.z())}; }

/// Neighbours along edges, one vertex after the other.
struct Neighbours {
  std::vector<std::uint32_t> first;  ///< [vertices + 1]
  std::vector<std::uint32_t> vertex;

  explicit Neighbours(const Mesh& mesh) : first(mesh.vertex_count() + 1, 0) {
    // In a closed mesh every edge runs once each way.
    for (const auto& t : mesh.triangle)
      for (const std::uint32_t v : t) ++first[v + 1];
    for (std::size_t v = 1; v < first.size(); ++v) first[v] += first[v - 1];
    vertex.resize(first.back());
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    for (const auto& t : mesh.triangle)
      for (std::size_t k = 0; k < 3; ++k) vertex[next[t[k]]++] = t[(k + 1) % 3];
  }
};

double mean_edge(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& t : mesh.triangle)
    for (std::size_t k = 0; k < 3; ++k) sum += (mesh.position[t[(k + 1) % 3]] - mesh.position[t[k]]).norm();
  return sum / (3.0 * static_cast<double>(mesh.triangle.size()));
}

/// Volume, and sets the normals to the sums of the areas around each vertex, a third of which is its own.
double volume_and_areas(Mesh& mesh, double& free_area, const std::vector<bool>& fixed) {
  std::fill(mesh.normal.begin(), mesh.normal.end(), Vec3::Zero());
  double volume = 0.0;
  for (const auto& t : mesh.triangle) {
    const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]];
    const Vec3 area = 0.5 * (b - a).cross(c - a);
    volume += (a - mesh.position.front()).dot(area) / 3.0;
    for (const std::uint32_t v : t) mesh.normal[v] += area;
  }
  free_area = 0.0;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v)
    if (!fixed[v]) free_area += mesh.normal[v].norm() / 3.0;
  return volume;
}

}  // namespace

std::vector<bool> shared_vertices(std::span<const Mesh> meshes, std::size_t own) {
  std::set<Key> others;
  std::vector<bool> shared(meshes[own].vertex_count(), false);
  Box box;
  for (const Vec3& p : meshes[own].position) box.include(p);
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (i == own) continue;
    for (const Vec3& p : meshes[i].position)
      if (box.contains(p)) others.insert(key_of(p));
  }
  for (std::size_t v = 0; v < shared.size(); ++v) shared[v] = others.contains(key_of(meshes[own].position[v]));
  return shared;
}

void even_surface(double width, const std::vector<bool>& fixed, Mesh& mesh) {
  if (mesh.triangle.empty()) return;
  const Neighbours neighbours(mesh);
  double free_area = 0.0;
  const double before = volume_and_areas(mesh, free_area, fixed);
  // A wave goes to its middle between neighbours by this share, on regular triangles; no wave by more than kFastest.
  const double wave = 2.0 * std::numbers::pi * mean_edge(mesh) / width;
  constexpr double kFastest = 2.0;
  const double slowest = std::min(0.25 * wave * wave, 0.5 * kFastest);
  // The Chebyshev iteration (Saad 2003, algorithm 12.1): of waves between the two no more than kLeft stays after this number of steps.
  const double middle = 0.5 * (kFastest + slowest), half = 0.5 * (kFastest - slowest), ratio = middle / half;
  const int steps = std::clamp(static_cast<int>(std::ceil(std::acosh(1.0 / kLeft) / std::acosh(ratio))), 1, kMostSteps);
  std::vector<Vec3> move(mesh.position.size(), Vec3::Zero());
  double rho = 0.0;
  for (int step = 0; step < steps; ++step) {
    const double next = step == 0 ? 1.0 / ratio : 1.0 / (2.0 * ratio - rho);
    const double along = step == 0 ? 1.0 / middle : 2.0 * next / half;
    for (std::size_t v = 0; v < move.size(); ++v) {
      const std::uint32_t first = neighbours.first[v], last = neighbours.first[v + 1];
      if (fixed[v] || first == last) continue;
      Vec3 sum = Vec3::Zero();
      for (std::uint32_t k = first; k < last; ++k) sum += mesh.position[neighbours.vertex[k]];
      move[v] = next * rho * move[v] + along * (sum / (last - first) - mesh.position[v]);
    }
    for (std::size_t v = 0; v < move.size(); ++v) mesh.position[v] += move[v];
    rho = next;
  }
  constexpr int kRounds = 3;  // a surface that moves out has more area
  for (int round = 0; round <= kRounds; ++round) {
    const double after = volume_and_areas(mesh, free_area, fixed);
    const double out = round < kRounds && free_area > 0.0 ? (before - after) / free_area : 0.0;
    for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
      mesh.normal[v].normalize();
      if (!fixed[v]) mesh.position[v] += out * mesh.normal[v];
    }
  }
}

}  // namespace supple::scenes
