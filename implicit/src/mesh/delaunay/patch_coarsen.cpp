#include "mesh/delaunay/patch_coarsen.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <queue>
#include <tuple>
#include <vector>

#include "mesh/delaunay/patch_flips.h"

namespace supple::implicit {
namespace {

using Vertex = PatchComplex::Vertex;
using Around = PatchComplex::Around;
using lattice::LabelSet;

/// Edges shorter than this share of the size are taken out.
constexpr double kShort = 0.7;
/// Shorter edges, over the size, have no shape worth keeping.
constexpr double kTiny = 0.02;

class Coarsener {
 public:
  Coarsener(const PatchSurface& surface, const DelaunayOptions& options, PatchComplex& complex)
      : surface_(surface), options_(options), complex_(complex) {}

  /// Takes vertices of boundary curves that are near them to them.
  void settle_boundaries() {
    for (Vertex v = 0; v < complex_.vertex_count(); ++v) {
      if (complex_.star(v).empty() || complex_.place(v) == PatchPlace::Interior) continue;
      const Vec3 before = complex_.position(v);
      const LabelSet labels = complex_.labels(v);
      if (labels.count != (complex_.place(v) == PatchPlace::Boundary ? 3 : 4)) continue;
      const auto at = surface_.settle(labels, before, 0.5 * options_.size);
      if (at && (*at - before).norm() > kTiny * kTiny * options_.size) complex_.move(v, *at);
    }
  }

  /// Takes out short edges, the shortest first. @return whether there were any
  bool coarsen() {
    using Edge = std::tuple<double, Vertex, Vertex>;
    std::priority_queue<Edge, std::vector<Edge>, std::greater<>> queue;
    const double most = kShort * options_.size;
    const auto offer = [&](Vertex a, Vertex b) {
      const double length = (complex_.position(a) - complex_.position(b)).norm();
      if (length < most) queue.emplace(length, std::min(a, b), std::max(a, b));
    };
    for (const auto& t : complex_.triangles()) {
      if (!t.alive) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        if (t.vertex[k] < t.vertex[(k + 1) % 3]) offer(t.vertex[k], t.vertex[(k + 1) % 3]);
      }
    }
    bool any = false;
    while (!queue.empty()) {
      const auto [length, a, b] = queue.top();
      queue.pop();
      if (complex_.star(a).empty() || complex_.star(b).empty()) continue;
      const Around edge = complex_.around(a, b);
      if (edge.count == 0) continue;
      Vertex kept = a;
      if (can_collapse(a, b, edge)) {
        complex_.collapse(a, b);
        kept = b;
      } else if (can_collapse(b, a, edge)) {
        complex_.collapse(b, a);
      } else {
        continue;
      }
      any = true;
      flip_around(complex_, kept);
      for (const std::uint32_t t : complex_.star(kept)) {
        for (const Vertex v : complex_.triangle(t).vertex) {
          if (v != kept) offer(kept, v);
        }
      }
    }
    return any;
  }

  /// Takes out vertices that lie beyond their patch or boundary curve, where corners have moved. @return whether there were any
  bool drop_strays() {
    bool any = false;
    for (Vertex v = 0; v < complex_.vertex_count(); ++v) {
      if (complex_.star(v).empty() || complex_.place(v) == PatchPlace::Corner) continue;
      const LabelSet labels = complex_.labels(v);
      if (labels.count == (complex_.place(v) == PatchPlace::Boundary ? 3 : 2) && surface_.settle(labels, complex_.position(v), kTiny * options_.size)) continue;
      std::vector<Vertex> around;
      double best = 1.0;
      for (const std::uint32_t t : complex_.star(v)) {
        best = std::min(best, surface_.uprightness(complex_.triangle(t), complex_.corners(t), options_.distance));
        for (const Vertex w : complex_.triangle(t).vertex) {
          if (w != v && std::find(around.begin(), around.end(), w) == around.end()) around.push_back(w);
        }
      }
      std::optional<Vertex> to;
      for (const Vertex w : around) {
        if (!keeps_topology(v, w, complex_.around(v, w))) continue;
        double least = 1.0;
        for (const std::uint32_t t : complex_.star(v)) {
          const PatchComplex::Triangle& triangle = complex_.triangle(t);
          if (triangle.has(w)) continue;
          Corners corner = complex_.corners(t);
          corner[triangle.place_of(v)] = complex_.position(w);
          least = std::min(least, surface_.uprightness(triangle, corner, options_.distance));
        }
        if (least < best || (least == best && to)) continue;
        best = least;
        to = w;
      }
      if (!to) continue;
      complex_.collapse(v, *to);
      flip_around(complex_, *to);
      any = true;
    }
    return any;
  }

 private:
  /// Can `from` merge into `to` without a change of the topology of patches and boundary curves?
  [[nodiscard]] bool keeps_topology(Vertex from, Vertex to, const Around& edge) const {
    // Four labels meet at a point: an edge among them is one that the lattice made.
    const bool point = complex_.place(to) == PatchPlace::Corner && complex_.labels(edge).count > 3;
    if (complex_.place(from) == PatchPlace::Corner && !point) return false;
    if (complex_.place(from) == PatchPlace::Boundary) {
      if (!complex_.is_boundary(edge)) return false;
      for (const Vertex other : complex_.along_boundaries(from)) {  // a boundary curve of three edges stays
        if (other == to) continue;
        const Around last = complex_.around(other, to);
        if (last.count > 0 && complex_.is_boundary(last)) return false;
      }
    }
    // Neighbours that both have are corners of the triangles that vanish, and no others.
    std::vector<Vertex> apex, common;
    for (const std::uint32_t t : edge.view()) apex.push_back(complex_.triangle(t).apex(from, to));
    for (const std::uint32_t t : complex_.star(from)) {
      for (const Vertex v : complex_.triangle(t).vertex) {
        if (v != from && v != to && std::find(common.begin(), common.end(), v) == common.end() && complex_.joined(v, to)) common.push_back(v);
      }
    }
    std::sort(apex.begin(), apex.end());
    std::sort(common.begin(), common.end());
    return apex == common && complex_.star(from).size() > edge.count;
  }

  [[nodiscard]] bool can_collapse(Vertex from, Vertex to, const Around& edge) const {
    if (!keeps_topology(from, to, edge)) return false;
    if (complex_.place(from) == PatchPlace::Boundary && complex_.labels(edge).count < 4 && !boundary_stays(from, to, edge)) return false;
    const double longest = 1.6 * options_.size;
    const bool tiny = (complex_.position(from) - complex_.position(to)).norm() < kTiny * options_.size;
    // No triangle may become sharper, or lean farther from the surface, than those that are there.
    double sharpest = 0.05, upright = 0.8;
    for (const std::uint32_t t : complex_.star(from)) {
      const Corners corner = complex_.corners(t);
      sharpest = std::min(sharpest, shape_of(corner).angle);
      upright = std::min(upright, surface_.uprightness(complex_.triangle(t), corner, options_.distance));
    }
    for (const std::uint32_t t : complex_.star(from)) {
      const PatchComplex::Triangle& triangle = complex_.triangle(t);
      if (triangle.has(to)) continue;
      Corners corner = complex_.corners(t);
      corner[triangle.place_of(from)] = complex_.position(to);
      double edge_length = 0.0;
      for (std::size_t k = 0; k < 3; ++k) edge_length = std::max(edge_length, (corner[k] - corner[(k + 1) % 3]).norm());
      if (edge_length > longest) return false;
      if (tiny && edge_length < 10.0 * kTiny * options_.size) continue;
      if (!tiny && shape_of(corner).angle < sharpest) return false;
      if (!(surface_.uprightness(triangle, corner, options_.distance) >= upright)) return false;
    }
    return true;
  }

  /// Does a boundary curve keep its shape without a vertex?
  [[nodiscard]] bool boundary_stays(Vertex from, Vertex to, const Around& edge) const {
    constexpr double kTurn = 0.64;  // cosine: eight edges at least around a circle
    const std::vector<Vertex> ends = complex_.along_boundaries(from);
    if (ends.size() != 2) return false;
    const Vertex other = ends[0] == to ? ends[1] : ends[0];
    if ((complex_.position(from) - complex_.position(to)).norm() < kTiny * options_.size) return true;
    const Vec3 &a = complex_.position(other), &b = complex_.position(to);
    const auto straight = [&](Vertex at, const Vec3& towards) {
      if (complex_.place(at) == PatchPlace::Corner) return true;
      for (const Vertex next : complex_.along_boundaries(at)) {
        if (next == from) continue;
        const Vec3 in = complex_.position(at) - complex_.position(next), out = towards - complex_.position(at);
        if (in.dot(out) < kTurn * in.norm() * out.norm()) return false;
      }
      return true;
    };
    if (!straight(to, a) || !straight(other, b)) return false;
    const double length = (b - a).norm();
    const auto middle = surface_.settle(complex_.labels(edge), 0.5 * (a + b), 0.5 * length);
    return middle && (*middle - 0.5 * (a + b)).norm() <= options_.distance;
  }

  const PatchSurface& surface_;
  const DelaunayOptions& options_;
  PatchComplex& complex_;
};

}  // namespace

void coarsen_patches(const PatchSurface& surface, const DelaunayOptions& options, PatchComplex& complex) {
  constexpr int kMaxRounds = 8;
  Coarsener coarsener(surface, options, complex);
  for (int round = 0; round < kMaxRounds; ++round) {
    flip_all(complex);
    const bool any = coarsener.coarsen();
    coarsener.settle_boundaries();
    if (!coarsener.drop_strays() && !any) break;
  }
  flip_all(complex);
}

}  // namespace supple::implicit
