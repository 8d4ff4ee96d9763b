#include <CGAL/Complex_2_in_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_cell_base_with_circumcenter_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Robust_circumcenter_traits_3.h>
#include <CGAL/Surface_mesh_cell_base_3.h>
#include <CGAL/Surface_mesh_default_criteria_3.h>
#include <CGAL/Surface_mesh_vertex_base_3.h>
#include <CGAL/make_surface_mesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "supple/cgal/surface_meshes.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/project.h"

namespace supple::cgal {
namespace {

/// A vertex or cell with the number of its creation. CGAL then sorts by that and not by address, so results repeat.
template <class Base>
class Stamped : public Base {
 public:
  template <class Structure>
  struct Rebind_TDS {
    using Other = Stamped<typename Base::template Rebind_TDS<Structure>::Other>;
  };
  using Has_timestamp = CGAL::Tag_true;
  using Base::Base;
  [[nodiscard]] std::size_t time_stamp() const { return stamp_; }
  void set_time_stamp(const std::size_t& stamp) { stamp_ = stamp; }

 private:
  std::size_t stamp_ = std::numeric_limits<std::size_t>::max();
};

using Traits = CGAL::Robust_circumcenter_traits_3<CGAL::Exact_predicates_inexact_constructions_kernel>;
using VertexBase = Stamped<CGAL::Surface_mesh_vertex_base_3<Traits>>;
using CellBase =
    Stamped<CGAL::Delaunay_triangulation_cell_base_with_circumcenter_3<Traits, CGAL::Surface_mesh_cell_base_3<Traits>>>;
using Triangulation =
    CGAL::Delaunay_triangulation_3<Traits, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;
using Complex = CGAL::Complex_2_in_triangulation_3<Triangulation>;
using Point = Traits::Point_3;
using Facet = Triangulation::Facet;

Vec3 vec(const Point& p) { return {p.x(), p.y(), p.z()}; }
Point point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

/// The surface as the mesher meets it: where dual edges of the triangulation cross it.
struct Surface {
  implicit::FieldView field;
  Vec3 centre;  ///< of a ball that holds the surface
  double radius;
  std::vector<Point> seeds;
};

class Oracle {
 public:
  using Surface_3 = Surface;
  using Point_3 = Point;
  using Intersection_point = Point;
  using Segment_3 = Traits::Segment_3;
  using Ray_3 = Traits::Ray_3;
  using Line_3 = Traits::Line_3;

  class Intersect_3 {
   public:
    CGAL::Object operator()(const Surface& surface, const Segment_3& s) const {
      return between(surface, vec(s.source()), vec(s.target()));
    }
    CGAL::Object operator()(const Surface& surface, const Ray_3& r) const {
      const Vec3 from = vec(r.source());
      return between(surface, from, from + beyond(surface, from) * (vec(r.point(1)) - from).normalized());
    }
    CGAL::Object operator()(const Surface& surface, const Line_3& l) const {
      const Vec3 at = vec(l.point(0)), along = beyond(surface, at) * (vec(l.point(1)) - at).normalized();
      return between(surface, at - along, at + along);
    }

   private:
    /// How far it is from a place to beyond the surface, whichever way [m].
    static double beyond(const Surface& surface, const Vec3& from) { return (from - surface.centre).norm() + 1.01 * surface.radius; }

    // A dual edge counts when its ends lie on different sides; the triangles then bound the cells whose circumcentre lies
    // inside, and that is a closed surface.
    static CGAL::Object between(const Surface& surface, const Vec3& a, const Vec3& b) {
      const bool a_inside = surface.field.value(a) > 0.0;
      if (a_inside == (surface.field.value(b) > 0.0)) return {};
      // From the end inside, so that it does not matter which end an edge comes from, and no farther than there may be a surface: centres
      // around four points near a plane are so far away that places on the way there round to none of the surface.
      const Vec3 inside = a_inside ? a : b;
      Vec3 outside = a_inside ? b : a;
      const double length = (outside - inside).norm(), enough = beyond(surface, inside);
      if (length > enough) outside = inside + enough / length * (outside - inside);
      return CGAL::make_object(point(implicit::root_on_segment(surface.field, inside, outside)));
    }
  };

  class Construct_initial_points {
   public:
    template <class Out>
    Out operator()(const Surface& surface, Out out, int /*count*/ = 0) const {
      return std::copy(surface.seeds.begin(), surface.seeds.end(), out);
    }
  };

  [[nodiscard]] Intersect_3 intersect_3_object() const { return {}; }
  [[nodiscard]] Construct_initial_points construct_initial_points_object() const { return {}; }
};

/// The bounds, a limit, and an exit: the mesher tests every new triangle here.
class Criteria : public CGAL::Surface_mesh_default_criteria_3<Triangulation> {
 public:
  Criteria(const implicit::DelaunayOptions& options, const implicit::DelaunayEstimate& estimate, const Triangulation& triangulation)
      : Surface_mesh_default_criteria_3(options.angle * 180.0 / std::numbers::pi, options.size, options.distance),
        options_(options),
        estimate_(estimate),
        triangulation_(triangulation) {}
  bool is_bad(const Facet& facet, Quality& quality) const {
    heed(options_.interrupt);
    if (triangulation_.number_of_vertices() > options_.most_vertices) implicit::refuse_more_vertices(estimate_, options_);
    return Surface_mesh_default_criteria_3::is_bad(facet, quality);
  }

 private:
  const implicit::DelaunayOptions& options_;
  const implicit::DelaunayEstimate& estimate_;
  const Triangulation& triangulation_;
};

/// Connected part of each vertex, numbered by its first vertex.
std::vector<std::uint32_t> parts_of(const Mesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.vertex_count());
  for (std::uint32_t v = 0; v < parent.size(); ++v) parent[v] = v;
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const auto& t : mesh.triangle) {
    for (const std::uint32_t v : t) {
      const std::uint32_t a = root(t[0]), b = root(v);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::uint32_t v = 0; v < parent.size(); ++v) parent[v] = root(v);
  return parent;
}

struct Seed {
  Vec3 place;
  std::uint32_t part;
};

/// Vertices of the mesh, in their order, that keep the spacing of their part from those taken before.
std::vector<Seed> spread(const implicit::FieldView& field, const Mesh& mesh, std::span<const std::uint32_t> part, std::span<const double> spacing) {
  struct Place {
    std::int64_t x, y, z;
    std::uint32_t part;
    bool operator==(const Place&) const = default;
  };
  const auto hash = [](const Place& p) {
    return static_cast<std::size_t>((static_cast<std::uint64_t>(p.x) * 73856093u) ^ (static_cast<std::uint64_t>(p.y) * 19349663u) ^
                                    (static_cast<std::uint64_t>(p.z) * 83492791u) ^ (std::uint64_t{p.part} * 2654435761u));
  };
  std::unordered_map<Place, std::vector<std::uint32_t>, decltype(hash)> taken(64, hash);
  std::vector<Seed> seeds;
  for (std::uint32_t v = 0; v < part.size(); ++v) {
    const double apart = spacing[part[v]];
    const Vec3& p = mesh.position[v];
    const Eigen::Matrix<std::int64_t, 3, 1> at = (p / apart).array().floor().cast<std::int64_t>();
    bool free = true;
    for (int n = 0; n < 27 && free; ++n) {
      const auto found = taken.find({at.x() + n % 3 - 1, at.y() + n / 3 % 3 - 1, at.z() + n / 9 - 1, part[v]});
      if (found == taken.end()) continue;
      free = std::none_of(found->second.begin(), found->second.end(),
                          [&](std::uint32_t u) { return (mesh.position[u] - p).squaredNorm() < apart * apart; });
    }
    if (!free) continue;
    taken[{at.x(), at.y(), at.z(), part[v]}].push_back(v);
    seeds.push_back({implicit::project_to_surface(field, p).point, part[v]});
  }
  return seeds;
}

/// Of seeds, by part: a size, and a sixth of the part's extent where that is less.
std::vector<double> first_spacing(const Mesh& mesh, std::span<const std::uint32_t> part, double size) {
  std::vector<Box> extent(mesh.vertex_count());
  for (std::size_t v = 0; v < part.size(); ++v) extent[part[v]].include(mesh.position[v]);
  std::vector<double> spacing(mesh.vertex_count());
  for (std::size_t v = 0; v < spacing.size(); ++v) spacing[v] = std::min(size, extent[v].extent().norm() / 6.0);
  return spacing;
}

void measure(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& surface_centre, implicit::DelaunayReport& report) {
  const double ab = (b - a).norm(), bc = (c - b).norm(), ca = (a - c).norm();
  const Vec3 normal = (b - a).cross(c - a);
  const double twice_area = normal.norm();
  const double radius = ab * bc * ca / (2.0 * twice_area);
  report.least_angle = std::min(report.least_angle, std::asin(std::min(1.0, std::min({ab, bc, ca}) / (2.0 * radius))));
  report.largest_radius = std::max(report.largest_radius, radius);
  const Vec3 u = b - a, w = c - a;
  const Vec3 circumcentre =
      a + (u.squaredNorm() * w.cross(normal) + w.squaredNorm() * normal.cross(u)) / (2.0 * normal.squaredNorm());
  report.largest_distance = std::max(report.largest_distance, (surface_centre - circumcentre).norm());
}

/// Triangles of the complex, counter-clockwise from outside: the cell whose circumcentre lies inside is behind each.
Mesh extract(const implicit::FieldView& field, const implicit::DelaunayOptions& options, Complex& complex,
             implicit::DelaunayReport& report) {
  const Triangulation& triangulation = complex.triangulation();
  Mesh mesh;
  std::unordered_map<Triangulation::Vertex_handle, std::uint32_t> number;
  for (auto v = triangulation.finite_vertices_begin(); v != triangulation.finite_vertices_end(); ++v) {
    if (!complex.is_in_complex(v)) continue;
    number.emplace(v, static_cast<std::uint32_t>(mesh.position.size()));
    mesh.position.push_back(vec(v->point()));
  }
  std::vector<double> values(mesh.vertex_count());
  mesh.normal.resize(mesh.vertex_count());
  field.evaluate(mesh.position, values, mesh.normal);
  for (Vec3& n : mesh.normal) n = n.squaredNorm() > 0.0 ? Vec3(-n.normalized()) : Vec3::UnitZ();

  report.least_angle = std::numbers::pi;
  for (auto facet = complex.facets_begin(); facet != complex.facets_end(); ++facet) {
    heed(options.interrupt);
    auto [cell, side] = *facet;
    const Vec3 centre = vec(cell->get_facet_surface_center(side));
    if (!triangulation.is_infinite(cell) && (field.value(vec(triangulation.dual(cell))) > 0.0)) {
      std::tie(cell, side) = triangulation.mirror_facet(*facet);
    }
    std::array<std::uint32_t, 3> t{};
    for (int k = 0; k < 3; ++k) {
      t[static_cast<std::size_t>(k)] = number.at(cell->vertex(Triangulation::vertex_triple_index(side, k)));
    }
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    mesh.triangle.push_back(t);
    measure(mesh.position[t[0]], mesh.position[t[1]], mesh.position[t[2]], centre, report);
  }
  std::sort(mesh.triangle.begin(), mesh.triangle.end());
  if (mesh.triangle.empty()) report.least_angle = 0.0;
  return mesh;
}

/// Parts of the surface with a seed that no triangle reached.
struct Missing {
  std::set<std::uint32_t> part;
};

/// Seeds farther apart than the body is thick may leave some of it without triangles: dual edges that cross it twice count as none.
Mesh refine(const implicit::FieldView& field, const implicit::DelaunayOptions& options, const implicit::DelaunayEstimate& estimate,
            std::span<const Seed> seeds, implicit::DelaunayReport& report, Missing& missing) {
  const Box box = field.surface_box();
  Surface surface{field, box.centre(), 0.5 * box.extent().norm(), {}};
  for (const Seed& seed : seeds) surface.seeds.push_back(point(seed.place));
  Triangulation triangulation;
  Complex complex(triangulation);
  CGAL::make_surface_mesh(complex, surface, Oracle(), Criteria(options, estimate, triangulation), CGAL::Manifold_tag());
  report.seeds = seeds.size();
  report.inserted = triangulation.number_of_vertices() - seeds.size();
  const auto key = [](const Vec3& p) { return std::tuple(p.x(), p.y(), p.z()); };
  std::set<std::tuple<double, double, double>> bare;
  for (auto v = triangulation.finite_vertices_begin(); v != triangulation.finite_vertices_end(); ++v) {
    if (!complex.is_in_complex(v)) bare.insert(key(vec(v->point())));
  }
  for (const Seed& seed : seeds) {
    if (bare.contains(key(seed.place))) missing.part.insert(seed.part);
  }
  return extract(field, options, complex, report);
}

bool alike(const MeshReport& a, const MeshReport& b) {
  return a.components == b.components && a.euler_characteristic == b.euler_characteristic;
}

/// Halves the spacing of seeds in the parts concerned, in all where none is: then parts are broken or joined. @return false where seeds
/// lie as densely as the lattice has vertices
bool seed_denser(const Missing& missing, std::span<const std::uint32_t> part, double cell, std::span<double> spacing) {
  constexpr double kDensest = 0.25;
  bool any = false;
  for (std::uint32_t v = 0; v < part.size(); ++v) {
    if (part[v] != v || !(missing.part.empty() || missing.part.contains(v))) continue;
    if (spacing[v] < kDensest * cell) continue;
    spacing[v] *= 0.5;
    any = true;
  }
  return any;
}

/// @throws Error{Limit}
[[noreturn]] void refuse_missing(const implicit::DelaunayOptions& options) {
  std::array<char, 32> cell{};
  std::snprintf(cell.data(), cell.size(), "%.3g", options.cell);
  throw Error(ErrorKind::Limit,
              Fault{.place = "",
                    .key = "mesh.cell",
                    .expected = "expected lattice cells that resolve the surface, whose vertices seed its triangles",
                    .found = std::string("a part without a seed at cells of ") + cell.data() + " m",
                    .hint = "use smaller cells"});
}

}  // namespace

Mesh delaunay_mesh(const implicit::FieldView& field, const implicit::DelaunayOptions& options,
                   implicit::DelaunayReport* report) {
  SUPPLE_EXPECTS(options.angle > 0.0 && options.angle <= 0.5236 && options.size > 0.0 && options.distance > 0.0 &&
                 options.cell > 0.0);
  implicit::DelaunayReport found;
  implicit::MarchOptions march;
  march.lattice.cell = options.cell;
  const Mesh coarse = implicit::march_cubes(field, march, Executor(1));
  heed(options.interrupt);
  const implicit::DelaunayEstimate estimate = estimate_delaunay({&coarse, 1}, options);
  check_estimate(estimate, options);
  Mesh mesh;
  if (coarse.triangle.empty()) {
    if (report != nullptr) *report = found;
    return mesh;
  }
  const std::vector<std::uint32_t> part = parts_of(coarse);
  const MeshReport seen = inspect(coarse);
  std::vector<double> spacing = first_spacing(coarse, part, options.size);
  for (;;) {
    const std::vector<Seed> seeds = spread(field, coarse, part, spacing);
    Missing missing;
    found = {};
    mesh = refine(field, options, estimate, seeds, found, missing);
    if (missing.part.empty() && alike(inspect(mesh), seen)) break;
    if (!seed_denser(missing, part, options.cell, spacing)) {
      if (!missing.part.empty()) refuse_missing(options);
      break;  // complete, but of another topology than on the lattice
    }
  }
  if (report != nullptr) *report = found;
  return mesh;
}

}  // namespace supple::cgal
