#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Surface_mesh.h>

#include <cmath>

#include "fit/surface.h"

namespace supple::fit {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_face_graph_triangle_primitive<SurfaceMesh>>>;

SurfaceMesh graph_of(const Mesh& mesh) {
  SurfaceMesh out;
  for (const Vec3& p : mesh.position) out.add_vertex({p.x(), p.y(), p.z()});
  for (const auto& t : mesh.triangle) out.add_face(SurfaceMesh::Vertex_index(t[0]), SurfaceMesh::Vertex_index(t[1]), SurfaceMesh::Vertex_index(t[2]));
  return out;
}

}  // namespace

struct SurfaceTree::Impl {
  explicit Impl(const Mesh& data) : mesh(graph_of(data)), tree(faces(mesh).begin(), faces(mesh).end(), mesh), side((tree.build(), tree.accelerate_distance_queries(), tree)) {
    // What is otherwise built by the first query, which several threads may make at the same time.
    (void)tree.squared_distance({0.0, 0.0, 0.0});
    (void)side({0.0, 0.0, 0.0});
  }
  SurfaceMesh mesh;
  Tree tree;
  CGAL::Side_of_triangle_mesh<SurfaceMesh, Kernel, CGAL::Default, Tree> side;
};

SurfaceTree::SurfaceTree(const Mesh& mesh) : impl_(std::make_unique<Impl>(mesh)) {}
SurfaceTree::~SurfaceTree() = default;

double SurfaceTree::distance(const Vec3& p) const { return std::sqrt(impl_->tree.squared_distance({p.x(), p.y(), p.z()})); }

double SurfaceTree::signed_distance(const Vec3& p) const {
  const bool inside = impl_->side({p.x(), p.y(), p.z()}) == CGAL::ON_BOUNDED_SIDE;
  return inside ? -distance(p) : distance(p);
}

}  // namespace supple::fit
