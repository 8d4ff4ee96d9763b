#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/distance.h>
#include <CGAL/Surface_mesh.h>

#include <array>
#include <limits>

#include "supple/cgal/surface_meshes.h"
#include "supple/core/error.h"

namespace supple::cgal {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;

/// Share of the error by which degenerate triangles are widened.
constexpr double kWidth = 0.125;

/// The triangles as a soup: corners are not shared, so any mesh will do. What has no area, a segment or a point, becomes a triangle that holds
/// it and goes no farther than `width` from it.
SurfaceMesh soup(const Mesh& mesh, double width) {
  SurfaceMesh result;
  const auto add = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto corner = [&](const Vec3& p) { return result.add_vertex({p.x(), p.y(), p.z()}); };
    result.add_face(corner(a), corner(b), corner(c));
  };
  for (const auto& t : mesh.triangle) {
    std::array<Vec3, 3> p{mesh.position[t[0]], mesh.position[t[1]], mesh.position[t[2]]};
    SUPPLE_EXPECTS(p[0].allFinite() && p[1].allFinite() && p[2].allFinite());
    if ((p[1] - p[0]).cross(p[2] - p[0]).squaredNorm() > 0.0) {
      add(p[0], p[1], p[2]);
      continue;
    }
    for (std::size_t k = 0; k < 2; ++k) {  // the longest edge first
      if ((p[2] - p[1]).squaredNorm() > (p[1] - p[0]).squaredNorm() || (p[0] - p[2]).squaredNorm() > (p[1] - p[0]).squaredNorm()) {
        p = {p[1], p[2], p[0]};
      }
    }
    Vec3 along = p[1] - p[0];
    if (!(along.norm() > 0.0)) {
      along = Vec3::UnitX();
      p[1] += width * along;
    }
    add(p[0], p[1], p[0] + width * along.unitOrthogonal());
  }
  return result;
}

}  // namespace

double one_sided_hausdorff_distance(const Mesh& from, const Mesh& to, double error) {
  SUPPLE_EXPECTS(error > 0.0);
  const SurfaceMesh a = soup(from, kWidth * error), b = soup(to, kWidth * error);
  if (a.number_of_faces() == 0) return 0.0;
  if (b.number_of_faces() == 0) return std::numeric_limits<double>::infinity();
  return CGAL::Polygon_mesh_processing::bounded_error_Hausdorff_distance<CGAL::Sequential_tag>(a, b, (1.0 - 2.0 * kWidth) * error);
}

}  // namespace supple::cgal
