// Bodies that touch, with triangles of guaranteed quality. Every patch, the free surface of a body or the contact of two, is a
// triangulation of its own (Chew 1993): bad triangles get a vertex at their circumcentre, taken to the surface, and edges are flipped until
// opposite angles add up to pi at most. Boundary curves are shared by their patches: a circumcentre that comes too near to an edge of one splits it
// instead, at a point of the boundary curve (Ruppert 1995). Dihedral angles do not matter, so that also the groove where two balls just touch holds
// the angle.

#include <algorithm>
#include <array>
#include <atomic>
#include <numbers>
#include <optional>
#include <tuple>
#include <vector>

#include "mesh/delaunay/patch_coarsen.h"
#include "mesh/delaunay/patch_complex.h"
#include "mesh/delaunay/patch_refine.h"
#include "mesh/delaunay/patch_surface.h"
#include "mesh/partition/polygonise_blocks.h"
#include "mesh/triangle_crossings.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/implicit/delaunay.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {
namespace {

using lattice::Label;
using Vertex = PatchComplex::Vertex;

void measure(const PatchSurface& surface, const DelaunayOptions& options, const PatchComplex& complex, DelaunayReport& report) {
  for (std::uint32_t t = 0; t < complex.triangles().size(); ++t) {
    if (!complex.triangle(t).alive) continue;
    const Corners corner = complex.corners(t);
    const Shape shape = shape_of(corner);
    report.least_angle = std::min(report.least_angle, shape.angle);
    report.sharp += shape.angle < options.angle ? 1 : 0;
    report.largest_radius = std::max(report.largest_radius, shape.radius);
    report.largest_distance = std::max(report.largest_distance, surface.distance_along(complex.triangle(t), shape.centre, normal_of(corner).normalized(), 2.0 * options.size));
  }
}

/// A field whose evaluation is a way out of all loops over it.
class HeedingField {
 public:
  HeedingField(const FieldView& field, const std::atomic<int>* interrupt) : field_(field), interrupt_(interrupt) {}

  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    heed(interrupt_);
    field_.evaluate(points, values);
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    heed(interrupt_);
    field_.evaluate(points, values, gradients);
  }
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { field_.evaluate_parts(points, parts); }
  [[nodiscard]] Interval bound(const Box& box) const {
    heed(interrupt_);
    return field_.bound(box);
  }
  [[nodiscard]] double gradient_bound(const Box& box) const { return field_.gradient_bound(box); }
  [[nodiscard]] Box surface_box() const { return field_.surface_box(); }
  [[nodiscard]] double feature_size() const { return field_.feature_size(); }
  [[nodiscard]] std::optional<CorePoint> core_point(const Vec3& place) const { return field_.core_point(place); }

 private:
  FieldView field_;
  const std::atomic<int>* interrupt_;
};

/// Pairs of triangles of which an edge of one passes through the other, ascending.
std::vector<std::array<std::uint32_t, 2>> find_crossings(const PatchComplex& complex) {
  std::vector<std::array<std::uint32_t, 3>> corners;
  std::vector<std::uint32_t> alive;
  for (const PatchComplex::Triangle& t : complex.triangles()) {
    if (t.alive) alive.push_back(static_cast<std::uint32_t>(corners.size()));
    corners.push_back(t.vertex);
  }
  const TriangleBoxes boxes(complex.positions(), corners, alive);
  std::vector<std::array<std::uint32_t, 2>> found;
  for (const std::uint32_t s : alive) {
    boxes.each_near(box_of(complex.positions(), corners[s]), [&](std::uint32_t t) {
      if (s < t && triangles_cross(complex.positions(), corners[s], corners[t])) found.push_back({s, t});
    });
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// Refines where triangles cross, in steps that bring vertices nearer to the surface. @return false as refine_patches
/// @throws Error{Limit} when most_vertices do not suffice for the bounds, crossings left aside
bool refine_apart(const PatchSurface& surface, const DelaunayOptions& options, const DelaunayEstimate& estimate, PatchComplex& complex,
                  DelaunayReport& report) {
  constexpr int kTries = 4;
  constexpr double kNearer = 0.25;  // edges of half the length
  std::vector<NearerPlace> nearer;
  double distance = options.distance;
  for (int i = 0;; ++i) {
    if (!refine_patches(surface, options, estimate, nearer, complex, report)) return false;
    const std::vector<std::array<std::uint32_t, 2>> crossings = find_crossings(complex);
    report.crossings = crossings.size();
    if (crossings.empty() || i == kTries) return true;
    distance *= kNearer;
    for (const auto& pair : crossings) {
      Box box;
      for (const std::uint32_t t : pair) {
        for (const Vec3& p : complex.corners(t)) box.include(p);
      }
      nearer.push_back({.box = box, .distance = distance});
    }
  }
}

/// @return false where the bodies are divided in a way that it does not untangle; their meshes are then of no use
bool make_delaunay(std::span<const FieldView> fields, const DelaunayOptions& options, const DelaunayEstimate& estimate,
                   PatchComplex& complex, DelaunayReport& report) {
  const PatchSurface surface(fields);
  coarsen_patches(surface, options, complex);
  if (surface.is_folded(complex, 0.0)) return false;
  for (Vertex v = 0; v < complex.vertex_count(); ++v) report.seeds += complex.star(v).empty() ? 0 : 1;
  if (!refine_apart(surface, options, estimate, complex, report) || surface.is_folded(complex, 0.2)) return false;
  measure(surface, options, complex, report);
  return report.largest_radius <= options.size && report.largest_distance <= options.distance;
}

/// The mesh of one body.
Mesh extract(std::span<const FieldView> fields, const PatchComplex& complex, std::uint32_t body) {
  constexpr std::uint32_t kNone = ~std::uint32_t{0};
  const Label own = body + 1;
  Mesh mesh;
  mesh.columns.push_back({.name = "contact", .values = {}});
  std::vector<std::uint32_t> number(complex.vertex_count(), kNone);
  for (Vertex v = 0; v < number.size(); ++v) {
    Label contact = 0;
    bool used = false;
    for (const std::uint32_t t : complex.star(v)) {
      const PatchComplex::Triangle& triangle = complex.triangle(t);
      if (triangle.inner != own && triangle.outer != own) continue;
      used = true;
      const Label other = triangle.inner == own ? triangle.outer : triangle.inner;
      if (other != 0 && (contact == 0 || other < contact)) contact = other;
    }
    if (!used) continue;
    number[v] = static_cast<std::uint32_t>(mesh.position.size());
    mesh.position.push_back(complex.position(v));
    mesh.normal.push_back(lattice::normal_at(fields, complex.labels(v), body, complex.position(v)));
    mesh.columns[0].values.push_back(contact);
  }
  for (const PatchComplex::Triangle& t : complex.triangles()) {
    if (!t.alive || (t.inner != own && t.outer != own)) continue;
    const std::array<std::uint32_t, 3> n{number[t.vertex[0]], number[t.vertex[1]], number[t.vertex[2]]};
    mesh.triangle.push_back(t.inner == own ? n : std::array{n[0], n[2], n[1]});
  }
  return mesh;
}

/// Bodies whose boxes overlap, directly or through others; unbounded ones go with all.
std::vector<std::vector<std::uint32_t>> groups_of(std::span<const FieldView> fields) {
  std::vector<Box> box;
  std::vector<std::uint32_t> group, grounds;
  for (std::uint32_t m = 0; m < fields.size(); ++m) {
    box.push_back(fields[m].surface_box());
    group.push_back(m);
    const bool ground = !box[m].empty() && !lattice::is_bounded(box[m]);
    if (ground) grounds.push_back(m);
    for (std::uint32_t j = 0; j < m && !ground; ++j) {
      if (group[j] == group[m] || !lattice::is_bounded(box[j]) || !box[j].overlaps(box[m])) continue;
      const std::uint32_t low = std::min(group[j], group[m]), high = std::max(group[j], group[m]);
      std::replace(group.begin(), group.end(), high, low);
    }
  }
  std::vector<std::vector<std::uint32_t>> groups;
  for (std::uint32_t g = 0; g < fields.size(); ++g) {
    std::vector<std::uint32_t> members;
    for (std::uint32_t m = 0; m < fields.size(); ++m) {
      if (group[m] == g && !std::binary_search(grounds.begin(), grounds.end(), m)) members.push_back(m);
    }
    if (members.empty()) continue;
    members.insert(members.end(), grounds.begin(), grounds.end());
    std::sort(members.begin(), members.end());
    groups.push_back(std::move(members));
  }
  return groups;
}

std::vector<Mesh> divide(std::span<const FieldView> fields, const DelaunayOptions& options, const Executor& executor,
                         DelaunayReport& report) {
  // Bodies often lie symmetrically around the origin; a lattice that does not meets them in general position. What is tangled on one
  // lattice may be plain on another.
  const auto lattice_of = [](double cell) { return Lattice{.origin = cell * Vec3(0.137, 0.291, 0.419), .cell = cell}; };
  const DelaunayEstimate estimate = estimate_delaunay(polygonise_partition(fields, lattice_of(options.cell), executor), options);
  check_estimate(estimate, options);
  const double coarsest = std::min(options.cell, 0.5 * options.size);
  const auto better = [](const DelaunayReport& a, const DelaunayReport& b) { return std::tie(a.crossings, a.sharp) < std::tie(b.crossings, b.sharp); };
  std::optional<std::vector<Mesh>> best;
  for (const double share : {1.0, 0.75, 0.5}) {
    std::vector<Mesh> meshes = polygonise_partition(fields, lattice_of(share * coarsest), executor);
    PatchComplex complex(fields, meshes);
    DelaunayReport found{.least_angle = std::numbers::pi};
    if (!make_delaunay(fields, options, estimate, complex, found) || (best && !better(found, report))) continue;
    for (std::size_t m = 0; m < meshes.size(); ++m) {
      if (!meshes[m].triangle.empty()) meshes[m] = extract(fields, complex, static_cast<std::uint32_t>(m));
    }
    report = found;
    best = std::move(meshes);
    if (found.sharp == 0 && found.crossings == 0) break;
  }
  if (best) return std::move(*best);
  // Size and distance without the angle: the longest edge of a tetrahedron is at most the size. Parts that the cell resolves are not missed.
  const Lattice lattice{.origin = Vec3::Zero(), .cell = std::min(options.cell, options.size / std::sqrt(3.0))};
  std::vector<Mesh> meshes = polygonise_partition_within(fields, lattice, {options.distance, "mesh.distance"}, executor);
  report.least_angle = std::numbers::pi;
  for (const Mesh& mesh : meshes) {
    report.seeds += mesh.vertex_count();
    for (const auto& t : mesh.triangle) {
      const Shape shape = shape_of({mesh.position[t[0]], mesh.position[t[1]], mesh.position[t[2]]});
      report.least_angle = std::min(report.least_angle, shape.angle);
      report.sharp += shape.angle < options.angle ? 1 : 0;
    }
  }
  return meshes;
}

}  // namespace

std::vector<Mesh> delaunay_partition(std::span<const FieldView> fields, const DelaunayOptions& options, const Executor& executor,
                                     DelaunayReport* report) {
  SUPPLE_EXPECTS(options.angle > 0.0 && options.angle <= 0.5236 && options.size > 0.0 && options.distance > 0.0 &&
                 options.cell > 0.0);
  const std::vector<std::vector<std::uint32_t>> groups = groups_of(fields);
  std::vector<Mesh> meshes(fields.size());
  DelaunayReport all{.least_angle = std::numbers::pi};
  for (const std::vector<std::uint32_t>& group : groups) {
    std::vector<HeedingField> heeding;
    for (const std::uint32_t m : group) heeding.emplace_back(fields[m], options.interrupt);
    const std::vector<FieldView> members(heeding.begin(), heeding.end());
    DelaunayReport found;
    std::vector<Mesh> divided = divide(members, options, executor, found);
    for (std::size_t k = 0; k < group.size(); ++k) {
      if (divided[k].triangle.empty()) continue;
      for (double& contact : divided[k].columns.at(0).values) {
        if (contact != 0.0) contact = static_cast<double>(group[static_cast<std::size_t>(contact) - 1] + 1);
      }
      meshes[group[k]] = std::move(divided[k]);
    }
    all.seeds += found.seeds;
    all.inserted += found.inserted;
    all.sharp += found.sharp;
    all.crossings += found.crossings;
    all.least_angle = std::min(all.least_angle, found.least_angle);
    all.largest_radius = std::max(all.largest_radius, found.largest_radius);
    all.largest_distance = std::max(all.largest_distance, found.largest_distance);
  }
  if (all.least_angle == std::numbers::pi) all.least_angle = 0.0;
  if (report != nullptr) *report = all;
  return meshes;
}

}  // namespace supple::implicit
