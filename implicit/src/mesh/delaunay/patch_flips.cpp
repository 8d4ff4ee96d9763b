#include "mesh/delaunay/patch_flips.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "mesh/delaunay/patch_surface.h"

namespace supple::implicit {
namespace {

using Vertex = PatchComplex::Vertex;
using Around = PatchComplex::Around;

double angle_at(const Vec3& at, const Vec3& a, const Vec3& b) {
  return std::atan2((a - at).cross(b - at).norm(), (a - at).dot(b - at));
}

bool should_flip(const PatchComplex& complex, Vertex a, Vertex b, const Around& edge) {
  const Vertex c = complex.triangle(edge.triangle[0]).apex(a, b), d = complex.triangle(edge.triangle[1]).apex(a, b);
  const Vec3 &pa = complex.position(a), &pb = complex.position(b), &pc = complex.position(c), &pd = complex.position(d);
  const double now = angle_at(pc, pa, pb) + angle_at(pd, pa, pb);
  if (now <= std::numbers::pi + 1e-9) return false;
  if (c == d || complex.joined(c, d)) return false;
  const Vec3 n1 = normal_of(complex.corners(edge.triangle[0])), n2 = normal_of(complex.corners(edge.triangle[1])), n = n1 + n2;
  // As they are wound: c, x, d with x = a, b in the order of the first triangle.
  const auto& v = complex.triangle(edge.triangle[0]).vertex;
  const bool forward = v[(complex.triangle(edge.triangle[0]).place_of(a) + 1) % 3] == b;
  const Vec3 &first = forward ? pa : pb, &second = forward ? pb : pa;
  const Vec3 m1 = normal_of({pc, first, pd}), m2 = normal_of({pc, pd, second});
  constexpr double kFold = 0.5;
  return m1.dot(n) > kFold * m1.norm() * n.norm() && m2.dot(n) > kFold * m2.norm() * n.norm() &&
         angle_at(pa, pc, pd) + angle_at(pb, pc, pd) < now;
}

}  // namespace

void flip_edges(PatchComplex& complex, std::vector<PatchEdge> edges, std::vector<std::uint32_t>& changed) {
  std::size_t left = 50 * edges.size() + 200;
  while (!edges.empty() && left-- > 0) {
    const auto [a, b] = edges.back();
    edges.pop_back();
    const Around edge = complex.around(a, b);
    if (edge.count != 2 || complex.is_boundary(edge) || !should_flip(complex, a, b, edge)) continue;
    const Vertex c = complex.triangle(edge.triangle[0]).apex(a, b), d = complex.triangle(edge.triangle[1]).apex(a, b);
    complex.flip(edge);
    changed.insert(changed.end(), edge.view().begin(), edge.view().end());
    for (const auto& e : {std::array{a, c}, std::array{c, b}, std::array{b, d}, std::array{d, a}}) edges.push_back(e);
  }
}

void flip_all(PatchComplex& complex) {
  std::vector<PatchEdge> edges;
  std::vector<std::uint32_t> changed;
  for (const auto& t : complex.triangles()) {
    if (!t.alive) continue;
    for (std::size_t k = 0; k < 3; ++k) edges.push_back({t.vertex[k], t.vertex[(k + 1) % 3]});
  }
  flip_edges(complex, std::move(edges), changed);
}

void flip_around(PatchComplex& complex, Vertex v) {
  std::vector<PatchEdge> edges;
  std::vector<std::uint32_t> changed;
  for (const std::uint32_t t : complex.star(v)) {
    const auto& w = complex.triangle(t).vertex;
    for (std::size_t k = 0; k < 3; ++k) edges.push_back({w[k], w[(k + 1) % 3]});
  }
  flip_edges(complex, std::move(edges), changed);
}

}  // namespace supple::implicit
