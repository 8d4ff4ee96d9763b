#include "mesh/delaunay/patch_refine.h"

#include <algorithm>
#include <array>
#include <cmath>
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

/// Edges shorter than this share of the size are not split: towards a corner sharper than the angle they would become ever shorter.
constexpr double kShortest = 2e-2;

/// Does a point lie in the ball that an edge is a diameter of?
bool encroaches(const Vec3& p, const Vec3& a, const Vec3& b) { return (a - p).dot(b - p) < 0.0; }

class Refiner {
 public:
  Refiner(const PatchSurface& surface, const DelaunayOptions& options, const DelaunayEstimate& estimate,
          std::span<const NearerPlace> nearer, PatchComplex& complex)
      : surface_(surface), options_(options), estimate_(estimate), nearer_(nearer), complex_(complex) {}

  [[nodiscard]] bool run(DelaunayReport& report) {
    for (std::uint32_t t = 0; t < complex_.triangles().size(); ++t) {
      if (complex_.triangle(t).alive) look_at(t);
    }
    const std::size_t before = complex_.vertex_count();
    const std::uint64_t most_tiny = 100 + report.seeds;
    for (;;) {
      if (complex_.vertex_count() > options_.most_vertices) refuse_more_vertices(estimate_, options_);
      if (tiny_ > most_tiny) return false;
      if (!encroached_.empty()) {
        const auto [a, b] = encroached_.back();
        encroached_.pop_back();
        const Around edge = complex_.around(a, b);
        if (edge.count > 0 && complex_.is_boundary(edge) && is_encroached(a, b, edge)) split_boundary(a, b, edge);
        continue;
      }
      if (bad_.empty()) break;
      const BadTriangle next = bad_.top();
      bad_.pop();
      const PatchComplex::Triangle& triangle = complex_.triangle(next.triangle);
      if (!triangle.alive || triangle.version != next.version) continue;
      improve(next);
    }
    report.inserted += complex_.vertex_count() - before;
    return true;
  }

 private:
  struct BadTriangle {
    double badness;
    std::uint32_t triangle, version;
    bool operator<(const BadTriangle& b) const { return std::tie(badness, b.triangle) < std::tie(b.badness, triangle); }
  };

  [[nodiscard]] static LabelSet labels_of(const PatchComplex::Triangle& t) {
    LabelSet set;
    set.insert(t.inner);
    set.insert(t.outer);
    return set;
  }

  /// Priority of a triangle for a new vertex; 0: none needed.
  [[nodiscard]] double badness_of(std::uint32_t t) const {
    const PatchComplex::Triangle& triangle = complex_.triangle(t);
    const Corners corner = complex_.corners(t);
    const Shape shape = shape_of(corner);
    if (shape.shortest < kShortest * options_.size) return 0.0;
    if (shape.radius > options_.size) return 2.0 + shape.radius / options_.size;
    if (shape.angle < options_.angle) {
      // Between two boundary curves the angle is fixed.
      const std::size_t k = shape.sharpest;
      const Vertex at = triangle.vertex[k];
      const bool corner_of_boundaries = complex_.is_boundary(complex_.around(at, triangle.vertex[(k + 1) % 3])) &&
                                  complex_.is_boundary(complex_.around(at, triangle.vertex[(k + 2) % 3]));
      if (!corner_of_boundaries) return 2.0 - shape.angle;
    }
    const Vec3 normal = normal_of(corner).normalized();
    const double away = surface_.distance_along(triangle, shape.centre, normal, 2.0 * options_.size);
    const double ball = std::hypot(away, shape.radius);
    return away > distance_at(corner) || ball > options_.size ? 2.0 + ball / options_.size : 0.0;
  }

  [[nodiscard]] double distance_at(const Corners& corner) const {
    double least = options_.distance;
    Box box;
    for (const Vec3& p : corner) box.include(p);
    for (const NearerPlace& place : nearer_) {
      if (place.distance < least && place.box.overlaps(box)) least = place.distance;
    }
    return least;
  }

  void look_at(std::uint32_t t) {
    const PatchComplex::Triangle& triangle = complex_.triangle(t);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vertex a = triangle.vertex[k], b = triangle.vertex[(k + 1) % 3], c = triangle.vertex[(k + 2) % 3];
      if (encroaches(complex_.position(c), complex_.position(a), complex_.position(b)) && complex_.is_boundary(complex_.around(a, b))) {
        encroached_.push_back({a, b});
      }
    }
    const double badness = badness_of(t);
    if (badness > 0.0) bad_.push({badness, t, triangle.version});
  }

  void look_at_changed() {
    std::sort(changed_.begin(), changed_.end());
    changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
    for (const std::uint32_t t : changed_) {
      if (complex_.triangle(t).alive) look_at(t);
    }
    changed_.clear();
  }

  [[nodiscard]] bool is_encroached(Vertex a, Vertex b, const Around& edge) const {
    return std::any_of(edge.view().begin(), edge.view().end(), [&](std::uint32_t t) {
      return encroaches(complex_.position(complex_.triangle(t).apex(a, b)), complex_.position(a), complex_.position(b));
    });
  }

  /// @return whether it was split
  bool split_boundary(Vertex a, Vertex b, const Around& edge) {
    if ((complex_.place(a) == PatchPlace::Corner) < (complex_.place(b) == PatchPlace::Corner)) std::swap(a, b);
    const Vec3 &p = complex_.position(a), &q = complex_.position(b);
    const double length = (q - p).norm();
    if (length < kShortest * options_.size) return false;
    double share = 0.5;
    if (complex_.place(a) == PatchPlace::Corner && complex_.place(b) != PatchPlace::Corner) {
      // At a power of two from the corner, so that boundary curves that meet at a sharp angle do not split each other for ever.
      share = std::exp2(std::round(std::log2(0.5 * length / options_.size))) * options_.size / length;
    }
    const Vec3 chord = p + share * (q - p);
    const Vec3 at = surface_.settle(complex_.labels(edge), chord, 0.5 * length).value_or(chord);
    const Vertex v = complex_.split(a, b, at);
    after_insertion(v);
    return true;
  }

  void after_insertion(Vertex v) {
    std::vector<PatchEdge> edges;
    double shortest = options_.size;
    for (const std::uint32_t t : complex_.star(v)) {
      changed_.push_back(t);
      const auto& w = complex_.triangle(t).vertex;
      const std::size_t k = complex_.triangle(t).place_of(v);
      edges.push_back({w[(k + 1) % 3], w[(k + 2) % 3]});
      shortest = std::min(shortest, (complex_.position(v) - complex_.position(w[(k + 1) % 3])).norm());
    }
    tiny_ += shortest < 2.0 * kShortest * options_.size ? 1 : 0;
    flip_edges(complex_, std::move(edges), changed_);
    look_at_changed();
  }

  /// Where the way over a patch from a triangle's centroid to a point in its plane ends.
  struct Way {
    std::uint32_t triangle;
    Vec3 point;
    std::optional<PatchEdge> boundary;  ///< the edge where it leaves the patch
  };
  [[nodiscard]] Way walk(std::uint32_t t, Vec3 to) const {
    constexpr int kMost = 200;
    const Corners start = complex_.corners(t);
    Vec3 from = (start[0] + start[1] + start[2]) / 3.0;
    std::optional<PatchEdge> entered;
    for (int step = 0; step < kMost; ++step) {
      const auto& v = complex_.triangle(t).vertex;
      const Corners c = complex_.corners(t);
      const Vec3 normal = normal_of(c).normalized();
      std::size_t exit = 3;
      double least = 1.0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vertex a = v[k], b = v[(k + 1) % 3];
        if (entered && ((*entered)[0] == a || (*entered)[0] == b) && ((*entered)[1] == a || (*entered)[1] == b)) continue;
        const Vec3 inward = normal.cross(c[(k + 1) % 3] - c[k]);
        const double here = inward.dot(from - c[k]), there = inward.dot(to - c[k]);
        if (there >= 0.0) continue;
        const double share = here > 0.0 ? here / (here - there) : 0.0;
        if (share <= least) {
          least = share;
          exit = k;
        }
      }
      if (exit == 3) return {t, to, std::nullopt};
      const Vertex a = v[exit], b = v[(exit + 1) % 3];
      const Around edge = complex_.around(a, b);
      if (complex_.is_boundary(edge)) return {t, to, std::array{a, b}};
      const Vec3 origin = c[exit], along = (c[(exit + 1) % 3] - origin).normalized();
      const Vec3 crossing = from + least * (to - from);
      const Vec3 outward = along.cross(normal);
      const double on = (to - origin).dot(along), beyond = (to - origin).dot(outward);
      t = edge.triangle[0] == t ? edge.triangle[1] : edge.triangle[0];
      const Vec3 next_normal = normal_of(complex_.corners(t)).normalized();
      to = origin + on * along + beyond * along.cross(next_normal);
      from = crossing;
      entered = {a, b};
    }
    return {t, from, std::nullopt};
  }

  /// Edges of boundary curves that a new vertex would come too near to, of the triangles of a patch whose balls hold it.
  [[nodiscard]] std::vector<PatchEdge> boundaries_near(std::uint32_t first, const Vec3& p) const {
    constexpr std::size_t kMost = 100;
    std::vector<std::uint32_t> seen{first};
    std::vector<PatchEdge> boundaries;
    for (std::size_t i = 0; i < seen.size() && seen.size() < kMost; ++i) {
      const auto v = complex_.triangle(seen[i]).vertex;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vertex a = v[k], b = v[(k + 1) % 3];
        const Around edge = complex_.around(a, b);
        if (complex_.is_boundary(edge)) {
          if (encroaches(p, complex_.position(a), complex_.position(b))) boundaries.push_back({a, b});
          continue;
        }
        const std::uint32_t next = edge.triangle[0] == seen[i] ? edge.triangle[1] : edge.triangle[0];
        if (std::find(seen.begin(), seen.end(), next) != seen.end()) continue;
        const Shape shape = shape_of(complex_.corners(next));
        if ((p - shape.centre).squaredNorm() < shape.radius * shape.radius * (1.0 - 1e-9)) seen.push_back(next);
      }
    }
    return boundaries;
  }

  void improve(const BadTriangle& bad) {
    const std::uint32_t t = bad.triangle;
    const Shape shape = shape_of(complex_.corners(t));
    if (!std::isfinite(shape.radius)) return;
    const Way way = walk(t, shape.centre);
    std::vector<PatchEdge> boundaries;
    std::optional<Vec3> at;
    if (way.boundary) {
      boundaries.push_back(*way.boundary);
    } else {
      at = surface_.settle(labels_of(complex_.triangle(t)), way.point, shape.radius);
      boundaries = boundaries_near(way.triangle, at.value_or(way.point));
    }
    if (!boundaries.empty()) {
      bool any = false;
      for (const auto& [a, b] : boundaries) {
        const Around edge = complex_.around(a, b);
        if (edge.count > 0 && complex_.is_boundary(edge)) any = split_boundary(a, b, edge) || any;
      }
      if (any && complex_.triangle(t).alive && complex_.triangle(t).version == bad.version) bad_.push(bad);
      return;
    }
    if (!at) {
      split_longest(t);
      return;
    }
    for (const Vec3& p : complex_.corners(way.triangle)) {
      if ((*at - p).norm() < 0.3 * shape.shortest) return;
    }
    after_insertion(complex_.split(way.triangle, *at));
  }

  /// Where the circumcentre has no place on the surface.
  void split_longest(std::uint32_t t) {
    const auto v = complex_.triangle(t).vertex;
    const Corners c = complex_.corners(t);
    std::size_t k = 0;
    for (const std::size_t j : {std::size_t{1}, std::size_t{2}}) {
      if ((c[(j + 1) % 3] - c[j]).norm() > (c[(k + 1) % 3] - c[k]).norm()) k = j;
    }
    const Around edge = complex_.around(v[k], v[(k + 1) % 3]);
    if (complex_.is_boundary(edge)) {
      (void)split_boundary(v[k], v[(k + 1) % 3], edge);
      return;
    }
    const double length = (c[(k + 1) % 3] - c[k]).norm();
    const auto at = surface_.settle(complex_.labels(edge), 0.5 * (c[k] + c[(k + 1) % 3]), 0.5 * length);
    if (at && length > 2.0 * kShortest * options_.size) after_insertion(complex_.split(v[k], v[(k + 1) % 3], *at));
  }

  const PatchSurface& surface_;
  const DelaunayOptions& options_;
  const DelaunayEstimate& estimate_;
  std::span<const NearerPlace> nearer_;
  PatchComplex& complex_;
  std::vector<PatchEdge> encroached_;
  std::priority_queue<BadTriangle> bad_;
  std::vector<std::uint32_t> changed_;
  std::uint64_t tiny_ = 0;  ///< vertices that came very near to others
};

}  // namespace

bool refine_patches(const PatchSurface& surface, const DelaunayOptions& options, const DelaunayEstimate& estimate,
                    std::span<const NearerPlace> nearer, PatchComplex& complex, DelaunayReport& report) {
  return Refiner(surface, options, estimate, nearer, complex).run(report);
}

}  // namespace supple::implicit
