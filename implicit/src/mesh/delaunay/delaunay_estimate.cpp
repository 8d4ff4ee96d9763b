#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "mesh/partition/polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/delaunay.h"

namespace supple::implicit {
namespace {

/// Refinement takes 1.8 (balls) to 3.5 (boundary curves of contacts) times the estimate where there are no edges: it ends within so many.
constexpr double kEnough = 4.0;

/// Integral of the mean curvature over a triangle, of the normals as they vary between its corners: half that of their divergence. [m]
double bend(const Mesh& mesh, const std::array<std::uint32_t, 3>& t, const Vec3& normal) {
  double divergence = 0.0;  // times twice the area
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 opposite = mesh.position[t[(k + 2) % 3]] - mesh.position[t[(k + 1) % 3]];
    divergence += mesh.normal[t[k]].dot(normal.cross(opposite));
  }
  return 0.25 * divergence;
}

Fault fault_of(const DelaunayOptions& options) {
  return {.place = "", .key = "", .expected = "expected bounds of triangles that need at most " + std::to_string(options.most_vertices) + " vertices",
          .found = "", .hint = ""};
}

/// Names the stricter bound, and values of those that take too many vertices. @return whether any does
bool blame(const DelaunayEstimate& estimate, const DelaunayOptions& options, Fault& fault) {
  const double most = static_cast<double>(options.most_vertices) / kEnough;
  fault.key = estimate.by_distance > estimate.by_size ? "mesh.distance" : "mesh.size";
  std::string wanted;
  if (estimate.by_size > most) {
    wanted = "a size of at least " + lattice::three_digits(1.05 * options.size * std::sqrt(estimate.by_size / most)) + " m";
  }
  if (estimate.by_distance > most) {
    wanted += (wanted.empty() ? "" : " and ");
    wanted += "a distance of at least " + lattice::three_digits(1.05 * options.distance * estimate.by_distance / most) + " m";
  }
  fault.hint = "use " + wanted;
  return !wanted.empty();
}

}  // namespace

DelaunayEstimate estimate_delaunay(std::span<const Mesh> coarse, const DelaunayOptions& options) {
  constexpr double kEquilateral = 0.75 * std::numbers::sqrt3;  // its area over the square of the circumradius
  constexpr double kVertices = 0.5 / kEquilateral;             // there are two triangles to one
  DelaunayEstimate sum;
  for (const Mesh& mesh : coarse) {
    const auto contact = std::find_if(mesh.columns.begin(), mesh.columns.end(), [](const auto& c) { return c.name == "contact"; });
    for (const auto& t : mesh.triangle) {
      const Vec3 twice = (mesh.position[t[1]] - mesh.position[t[0]]).cross(mesh.position[t[2]] - mesh.position[t[0]]);
      const double area = 0.5 * twice.norm();
      if (!(area > 0.0)) continue;
      // At a boundary curve normals turn from patch to patch, which bends none of them.
      const bool free = contact == mesh.columns.end() ||
                        std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return contact->values[v] == 0.0; });
      const double by_size = (free ? kVertices : 0.5 * kVertices) * area / (options.size * options.size);
      const double by_distance = free ? kVertices * std::abs(bend(mesh, t, twice.normalized())) / (2.0 * options.distance) : 0.0;
      sum.by_size += by_size;
      sum.by_distance += by_distance;
      sum.vertices += std::max(by_size, by_distance);
    }
  }
  return sum;
}

void check_estimate(const DelaunayEstimate& estimate, const DelaunayOptions& options) {
  if (estimate.vertices <= static_cast<double>(options.most_vertices)) return;
  Fault fault = fault_of(options);
  (void)blame(estimate, options, fault);
  fault.found = "at least " + lattice::three_digits(estimate.vertices) + " by the area and curvature of the surface";
  throw Error(ErrorKind::Limit, fault);
}

void refuse_more_vertices(const DelaunayEstimate& estimate, const DelaunayOptions& options) {
  Fault fault = fault_of(options);
  fault.found = "more";
  if (!blame(estimate, options, fault)) {
    fault.key = "mesh.angle";
    fault.found += ", where size and distance alone need less than " + lattice::three_digits(kEnough * estimate.vertices);
    fault.hint = "use a smaller angle, or a larger size or distance: at edges of the surface no angle is guaranteed";
  }
  throw Error(ErrorKind::Limit, fault);
}

}  // namespace supple::implicit
