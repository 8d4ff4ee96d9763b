#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/distance.h>
#include <CGAL/Surface_mesh.h>

#include <limits>

#include "supple/cgal/surface_meshes.h"
#include "supple/core/error.h"

namespace supple::cgal {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;

/// The triangles as a soup: corners are not shared, so any mesh will do. Triangles without area are left out: their points lie
/// on others in a closed mesh.
SurfaceMesh soup(const Mesh& mesh) {
  SurfaceMesh result;
  for (const auto& t : mesh.triangle) {
    const Vec3 &a = mesh.position[t[0]], &b = mesh.position[t[1]], &c = mesh.position[t[2]];
    if (!((b - a).cross(c - a).squaredNorm() > 0.0)) continue;
    const auto corner = [&](const Vec3& p) { return result.add_vertex({p.x(), p.y(), p.z()}); };
    result.add_face(corner(a), corner(b), corner(c));
  }
  return result;
}

}  // namespace

double one_sided_hausdorff_distance(const Mesh& from, const Mesh& to, double error) {
  SUPPLE_EXPECTS(error > 0.0);
  const SurfaceMesh a = soup(from), b = soup(to);
  if (a.number_of_faces() == 0) return 0.0;
  if (b.number_of_faces() == 0) return std::numeric_limits<double>::infinity();
  return CGAL::Polygon_mesh_processing::bounded_error_Hausdorff_distance<CGAL::Sequential_tag>(a, b, error);
}

}  // namespace supple::cgal
