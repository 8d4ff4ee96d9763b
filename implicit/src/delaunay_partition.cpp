// Bodies that touch, with triangles of guaranteed quality. Every patch, the free surface of a body or the contact of two, is a
// triangulation of its own (Chew 1993): bad triangles get a vertex at their circumcentre, taken to the surface, and edges are flipped until
// opposite angles add up to pi at most. Rims are shared by their patches: a circumcentre that comes too near to an edge of one splits it
// instead, at a point of the rim (Ruppert 1995). Dihedral angles do not matter, so that also the groove where two balls just touch holds
// the angle.

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <optional>
#include <queue>
#include <string>
#include <tuple>
#include <vector>

#include "patch_complex.h"
#include "polygonise_blocks.h"
#include "polygonise_roots.h"
#include "supple/core/error.h"
#include "supple/implicit/delaunay.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {
namespace {

using lattice::Label;
using lattice::LabelSet;
using Vertex = PatchComplex::Vertex;
using Around = PatchComplex::Around;
using Corners = std::array<Vec3, 3>;

/// Edges shorter than this share of the size are not split: towards a corner sharper than the angle they would become ever shorter.
constexpr double kShortest = 2e-2;
/// Edges shorter than this share of the size are taken out at first.
constexpr double kShort = 0.7;
/// Edges shorter than this share have no shape that is worth keeping.
constexpr double kTiny = 0.02;

Vec3 normal_of(const Corners& c) { return (c[1] - c[0]).cross(c[2] - c[0]); }

struct Shape {
  double shortest, angle;  ///< least edge [m], least angle [rad]
  std::size_t sharpest;    ///< where that is
  double radius;           ///< of the circumcircle [m]
  Vec3 centre;
};

Shape shape_of(const Corners& c) {
  Shape s{};
  std::array<double, 3> edge{};  // opposite to the corners
  for (std::size_t k = 0; k < 3; ++k) edge[k] = (c[(k + 2) % 3] - c[(k + 1) % 3]).norm();
  s.sharpest = static_cast<std::size_t>(std::min_element(edge.begin(), edge.end()) - edge.begin());
  s.shortest = edge[s.sharpest];
  const Vec3 u = c[1] - c[0], w = c[2] - c[0], n = u.cross(w);
  const double n2 = n.squaredNorm();
  const std::size_t k = s.sharpest;
  const Vec3 p = c[(k + 1) % 3] - c[k], q = c[(k + 2) % 3] - c[k];
  s.angle = std::atan2(std::sqrt(n2), p.dot(q));
  s.centre = c[0] + (u.squaredNorm() * w.cross(n) + w.squaredNorm() * n.cross(u)) / (2.0 * n2);
  s.radius = n2 > 0.0 ? (s.centre - c[0]).norm() : std::numeric_limits<double>::infinity();
  return s;
}

double angle_at(const Vec3& at, const Vec3& a, const Vec3& b) {
  return std::atan2((a - at).cross(b - at).norm(), (a - at).dot(b - at));
}

/// Does a point lie in the ball that an edge is a diameter of?
bool encroaches(const Vec3& p, const Vec3& a, const Vec3& b) { return (a - p).dot(b - p) < 0.0; }

class Refiner {
 public:
  Refiner(std::span<const FieldView> fields, const DelaunayOptions& options, PatchComplex& complex)
      : fields_(fields), options_(options), complex_(complex) {
    for (const FieldView& field : fields) box_.push_back(field.surface_box());
  }

  /// @return false where the bodies are divided in a way that it does not untangle; their meshes are then of no use
  [[nodiscard]] bool run(DelaunayReport& report) {
    constexpr int kMaxRounds = 8;
    for (int round = 0; round < kMaxRounds; ++round) {
      flip_all();
      const bool any = coarsen();
      settle_rims();
      if (!drop_strays() && !any) break;
    }
    flip_all();
    if (is_folded(0.0)) return false;
    for (Vertex v = 0; v < complex_.vertex_count(); ++v) report.seeds += complex_.star(v).empty() ? 0 : 1;
    for (std::uint32_t t = 0; t < complex_.triangles().size(); ++t) {
      if (complex_.triangle(t).alive) look_at(t);
    }
    if (!refine(report) || is_folded(0.2)) return false;
    measure(report);
    return report.largest_radius <= options_.size && report.largest_distance <= options_.distance;
  }

 private:
  struct BadTriangle {
    double badness;
    std::uint32_t triangle, version;
    bool operator<(const BadTriangle& b) const { return std::tie(badness, b.triangle) < std::tie(b.badness, triangle); }
  };

  /// The place nearest to `start`, by Newton's method, where the fields of the labels agree and no other is larger.
  [[nodiscard]] std::optional<Vec3> settle(const LabelSet& labels, const Vec3& start, double within) const {
    constexpr int kMaxRounds = 40;
    const std::size_t n = std::min<std::size_t>(labels.count, 4) - 1;  // equations
    Vec3 x = start, last = start;
    double last_norm = std::numeric_limits<double>::infinity(), level = 0.0;
    for (int round = 0; round < kMaxRounds; ++round) {
      Eigen::Matrix<double, 3, 3> slope = Eigen::Matrix<double, 3, 3>::Zero();
      Vec3 difference = Vec3::Zero(), first_slope = Vec3::Zero();
      level = 0.0;
      double scale = 0.0;
      if (labels.label[0] != 0) level = fields_[labels.label[0] - 1].value(x, first_slope);
      bool close = true;
      for (std::size_t k = 0; k < n; ++k) {
        Vec3 gradient;
        const auto row = static_cast<Eigen::Index>(k);
        const double f = fields_[labels.label[k + 1] - 1].value(x, gradient);
        scale = std::max({scale, std::abs(f), std::abs(level)});
        difference[row] = f - level;
        slope.row(row) = (gradient - first_slope).transpose();
        close = close && std::abs(difference[row]) <= lattice::root_tolerance(scale, x, gradient - first_slope);
      }
      if (close) return wins(labels, x, level) ? std::optional(x) : std::nullopt;
      const double norm = difference.norm();
      if (norm > 0.9 * last_norm && (x - last).norm() > 1e-14 * within) {  // half the step instead
        x = 0.5 * (x + last);
        last_norm *= 1.0 + 1e-3;
        continue;
      }
      last = x;
      last_norm = norm;
      const auto rows = static_cast<Eigen::Index>(n);
      x -= slope.topRows(rows).completeOrthogonalDecomposition().solve(difference.head(rows));
      if (!((x - start).norm() <= within)) return std::nullopt;
    }
    return std::nullopt;
  }

  /// No other label is above the level of these.
  [[nodiscard]] bool wins(const LabelSet& labels, const Vec3& x, double level) const {
    constexpr double kTie = 1e-9;
    if (level < -kTie) return false;
    for (std::size_t m = 0; m < fields_.size(); ++m) {
      const auto label = static_cast<Label>(m + 1);
      const auto own = labels.view();
      if (std::find(own.begin(), own.end(), label) != own.end() || !box_[m].contains(x)) continue;
      if (fields_[m].value(x) > level + kTie) return false;
    }
    return true;
  }

  [[nodiscard]] static LabelSet labels_of(const PatchComplex::Triangle& t) {
    LabelSet set;
    set.insert(t.inner);
    set.insert(t.outer);
    return set;
  }

  /// Distance of a point to the surface between a triangle's labels along a direction, to second order.
  [[nodiscard]] double distance_along(const PatchComplex::Triangle& t, const Vec3& from, const Vec3& direction) const {
    double along = 0.0;
    for (int round = 0; round < 8; ++round) {
      Vec3 gradient, other = Vec3::Zero();
      const Vec3 at = from + along * direction;
      double f = fields_[t.inner - 1].value(at, gradient);
      if (t.outer != 0) f -= fields_[t.outer - 1].value(at, other);
      const double slope = (gradient - other).dot(direction);
      if (slope == 0.0) break;
      const double step = -f / slope;
      if (!(std::abs(along + step) <= 2.0 * options_.size)) break;
      along += step;
    }
    return std::abs(along);
  }

  // Coarsening.

  /// Takes vertices of rims that are near them to them.
  void settle_rims() {
    for (Vertex v = 0; v < complex_.vertex_count(); ++v) {
      if (complex_.star(v).empty() || complex_.place(v) == PatchPlace::Interior) continue;
      const Vec3 before = complex_.position(v);
      const LabelSet labels = complex_.labels(v);
      if (labels.count != (complex_.place(v) == PatchPlace::Rim ? 3 : 4)) continue;
      const auto at = settle(labels, before, 0.5 * options_.size);
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
      legalise_around(kept);
      for (const std::uint32_t t : complex_.star(kept)) {
        for (const Vertex v : complex_.triangle(t).vertex) {
          if (v != kept) offer(kept, v);
        }
      }
    }
    return any;
  }

  /// Takes out vertices that lie beyond their patch or rim, where corners have moved. @return whether there were any
  bool drop_strays() {
    bool any = false;
    for (Vertex v = 0; v < complex_.vertex_count(); ++v) {
      if (complex_.star(v).empty() || complex_.place(v) == PatchPlace::Corner) continue;
      const LabelSet labels = complex_.labels(v);
      if (labels.count == (complex_.place(v) == PatchPlace::Rim ? 3 : 2) && settle(labels, complex_.position(v), kTiny * options_.size)) continue;
      std::vector<Vertex> around;
      double best = 1.0;
      for (const std::uint32_t t : complex_.star(v)) {
        best = std::min(best, uprightness(complex_.triangle(t), complex_.corners(t), options_.distance));
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
          least = std::min(least, uprightness(triangle, corner, options_.distance));
        }
        if (least < best || (least == best && to)) continue;
        best = least;
        to = w;
      }
      if (!to) continue;
      complex_.collapse(v, *to);
      legalise_around(*to);
      any = true;
    }
    return any;
  }

  /// May `from` go to `to` without a change of what the patches and their rims are?
  [[nodiscard]] bool keeps_topology(Vertex from, Vertex to, const Around& edge) const {
    // Four labels meet at a point: an edge among them is one that the lattice made.
    const bool point = complex_.place(to) == PatchPlace::Corner && complex_.labels(edge).count > 3;
    if (complex_.place(from) == PatchPlace::Corner && !point) return false;
    if (complex_.place(from) == PatchPlace::Rim) {
      if (!complex_.is_rim(edge)) return false;
      for (const Vertex other : complex_.along_rims(from)) {  // a rim of three edges stays
        if (other == to) continue;
        const Around last = complex_.around(other, to);
        if (last.count > 0 && complex_.is_rim(last)) return false;
      }
    }
    // Neighbours that both have are corners of the triangles that vanish, and no others.
    std::vector<Vertex> apex, common;
    for (const std::uint32_t t : edge.view()) apex.push_back(apex_of(t, from, to));
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
    if (complex_.place(from) == PatchPlace::Rim && complex_.labels(edge).count < 4 && !rim_stays(from, to, edge)) return false;
    const double longest = 1.6 * options_.size;
    const bool tiny = (complex_.position(from) - complex_.position(to)).norm() < kTiny * options_.size;
    // No triangle may become sharper, or lean farther from the surface, than those that are there.
    double sharpest = 0.05, upright = 0.8;
    for (const std::uint32_t t : complex_.star(from)) {
      const Corners corner = complex_.corners(t);
      sharpest = std::min(sharpest, shape_of(corner).angle);
      upright = std::min(upright, uprightness(complex_.triangle(t), corner, options_.distance));
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
      if (!(uprightness(triangle, corner, options_.distance) >= upright)) return false;
    }
    return true;
  }

  /// Cosine of the angle between a triangle and the surface at its centroid; -1 where that lies farther off than `most`.
  [[nodiscard]] double uprightness(const PatchComplex::Triangle& t, const Corners& corner, double most) const {
    const Vec3 middle = (corner[0] + corner[1] + corner[2]) / 3.0, normal = normal_of(corner);
    Vec3 slope, other = Vec3::Zero();
    double f = fields_[t.inner - 1].value(middle, slope);
    if (t.outer != 0) f -= fields_[t.outer - 1].value(middle, other);
    slope -= other;
    const double steepness = slope.norm(), size = normal.norm();
    if (std::abs(f) > most * steepness) return -1.0;
    return size > 0.0 && steepness > 0.0 ? -slope.dot(normal) / (steepness * size) : 1.0;
  }

  /// Does a rim keep its shape without a vertex?
  [[nodiscard]] bool rim_stays(Vertex from, Vertex to, const Around& edge) const {
    constexpr double kTurn = 0.64;  // cosine: eight edges at least around a circle
    const std::vector<Vertex> ends = complex_.along_rims(from);
    if (ends.size() != 2) return false;
    const Vertex other = ends[0] == to ? ends[1] : ends[0];
    if ((complex_.position(from) - complex_.position(to)).norm() < kTiny * options_.size) return true;
    const Vec3 &a = complex_.position(other), &b = complex_.position(to);
    const auto straight = [&](Vertex at, const Vec3& towards) {
      if (complex_.place(at) == PatchPlace::Corner) return true;
      for (const Vertex next : complex_.along_rims(at)) {
        if (next == from) continue;
        const Vec3 in = complex_.position(at) - complex_.position(next), out = towards - complex_.position(at);
        if (in.dot(out) < kTurn * in.norm() * out.norm()) return false;
      }
      return true;
    };
    if (!straight(to, a) || !straight(other, b)) return false;
    const double length = (b - a).norm();
    const auto middle = settle(complex_.labels(edge), 0.5 * (a + b), 0.5 * length);
    return middle && (*middle - 0.5 * (a + b)).norm() <= options_.distance;
  }

  /// Is the cosine between a triangle and the surface less than this?
  [[nodiscard]] bool is_folded(double least) const {
    for (std::uint32_t t = 0; t < complex_.triangles().size(); ++t) {
      const PatchComplex::Triangle& triangle = complex_.triangle(t);
      if (triangle.alive && uprightness(triangle, complex_.corners(t), std::numeric_limits<double>::infinity()) < least) return true;
    }
    return false;
  }

  // Delaunay.

  void flip_all() {
    std::vector<std::array<Vertex, 2>> edges;
    for (const auto& t : complex_.triangles()) {
      if (!t.alive) continue;
      for (std::size_t k = 0; k < 3; ++k) edges.push_back({t.vertex[k], t.vertex[(k + 1) % 3]});
    }
    legalise(std::move(edges));
  }

  void legalise_around(Vertex v) {
    std::vector<std::array<Vertex, 2>> edges;
    for (const std::uint32_t t : complex_.star(v)) {
      const auto& w = complex_.triangle(t).vertex;
      for (std::size_t k = 0; k < 3; ++k) edges.push_back({w[k], w[(k + 1) % 3]});
    }
    legalise(std::move(edges));
  }

  /// Flips edges, and those around what flips, until opposite angles add up to pi at most.
  void legalise(std::vector<std::array<Vertex, 2>> edges) {
    std::size_t left = 50 * edges.size() + 200;
    while (!edges.empty() && left-- > 0) {
      const auto [a, b] = edges.back();
      edges.pop_back();
      const Around edge = complex_.around(a, b);
      if (edge.count != 2 || complex_.is_rim(edge) || !should_flip(a, b, edge)) continue;
      const Vertex c = apex_of(edge.triangle[0], a, b), d = apex_of(edge.triangle[1], a, b);
      complex_.flip(edge);
      changed_.insert(changed_.end(), edge.view().begin(), edge.view().end());
      for (const auto& e : {std::array{a, c}, std::array{c, b}, std::array{b, d}, std::array{d, a}}) edges.push_back(e);
    }
  }

  [[nodiscard]] Vertex apex_of(std::uint32_t t, Vertex a, Vertex b) const {
    for (const Vertex v : complex_.triangle(t).vertex) {
      if (v != a && v != b) return v;
    }
    return a;
  }

  [[nodiscard]] bool should_flip(Vertex a, Vertex b, const Around& edge) const {
    const Vertex c = apex_of(edge.triangle[0], a, b), d = apex_of(edge.triangle[1], a, b);
    const Vec3 &pa = complex_.position(a), &pb = complex_.position(b), &pc = complex_.position(c), &pd = complex_.position(d);
    const double now = angle_at(pc, pa, pb) + angle_at(pd, pa, pb);
    if (now <= std::numbers::pi + 1e-9) return false;
    if (c == d || complex_.joined(c, d)) return false;
    const Vec3 n1 = normal_of(complex_.corners(edge.triangle[0])), n2 = normal_of(complex_.corners(edge.triangle[1])), n = n1 + n2;
    // As they are wound: c, x, d with x = a, b in the order of the first triangle.
    const auto& v = complex_.triangle(edge.triangle[0]).vertex;
    const bool forward = v[(complex_.triangle(edge.triangle[0]).place_of(a) + 1) % 3] == b;
    const Vec3 &first = forward ? pa : pb, &second = forward ? pb : pa;
    const Vec3 m1 = normal_of({pc, first, pd}), m2 = normal_of({pc, pd, second});
    constexpr double kFold = 0.5;
    return m1.dot(n) > kFold * m1.norm() * n.norm() && m2.dot(n) > kFold * m2.norm() * n.norm() &&
           angle_at(pa, pc, pd) + angle_at(pb, pc, pd) < now;
  }

  // Refinement.

  /// How much a triangle asks for a vertex; 0: not at all.
  [[nodiscard]] double badness_of(std::uint32_t t) const {
    const PatchComplex::Triangle& triangle = complex_.triangle(t);
    const Corners corner = complex_.corners(t);
    const Shape shape = shape_of(corner);
    if (shape.shortest < kShortest * options_.size) return 0.0;
    if (shape.radius > options_.size) return 2.0 + shape.radius / options_.size;
    if (shape.angle < options_.angle) {
      // Between two rims the angle is what it is.
      const std::size_t k = shape.sharpest;
      const Vertex at = triangle.vertex[k];
      const bool corner_of_rims = complex_.is_rim(complex_.around(at, triangle.vertex[(k + 1) % 3])) &&
                                  complex_.is_rim(complex_.around(at, triangle.vertex[(k + 2) % 3]));
      if (!corner_of_rims) return 2.0 - shape.angle;
    }
    const Vec3 normal = normal_of(corner).normalized();
    const double away = distance_along(triangle, shape.centre, normal);
    const double ball = std::hypot(away, shape.radius);
    return away > options_.distance || ball > options_.size ? 2.0 + ball / options_.size : 0.0;
  }

  void look_at(std::uint32_t t) {
    const PatchComplex::Triangle& triangle = complex_.triangle(t);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vertex a = triangle.vertex[k], b = triangle.vertex[(k + 1) % 3], c = triangle.vertex[(k + 2) % 3];
      if (encroaches(complex_.position(c), complex_.position(a), complex_.position(b)) && complex_.is_rim(complex_.around(a, b))) {
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

  /// @return false where edges become ever shorter
  [[nodiscard]] bool refine(DelaunayReport& report) {
    changed_.clear();
    const std::size_t before = complex_.vertex_count();
    const std::uint64_t most_tiny = 100 + report.seeds;
    for (;;) {
      if (complex_.vertex_count() > options_.most_vertices) refuse("more");
      if (tiny_ > most_tiny) return false;
      if (!encroached_.empty()) {
        const auto [a, b] = encroached_.back();
        encroached_.pop_back();
        const Around edge = complex_.around(a, b);
        if (edge.count > 0 && complex_.is_rim(edge) && is_encroached(a, b, edge)) split_rim(a, b, edge);
        continue;
      }
      if (bad_.empty()) break;
      const BadTriangle next = bad_.top();
      bad_.pop();
      const PatchComplex::Triangle& triangle = complex_.triangle(next.triangle);
      if (!triangle.alive || triangle.version != next.version) continue;
      improve(next);
    }
    report.inserted = complex_.vertex_count() - before;
    return true;
  }

  [[nodiscard]] bool is_encroached(Vertex a, Vertex b, const Around& edge) const {
    return std::any_of(edge.view().begin(), edge.view().end(), [&](std::uint32_t t) {
      return encroaches(complex_.position(apex_of(t, a, b)), complex_.position(a), complex_.position(b));
    });
  }

  /// @return whether it was split
  bool split_rim(Vertex a, Vertex b, const Around& edge) {
    if ((complex_.place(a) == PatchPlace::Corner) < (complex_.place(b) == PatchPlace::Corner)) std::swap(a, b);
    const Vec3 &p = complex_.position(a), &q = complex_.position(b);
    const double length = (q - p).norm();
    if (length < kShortest * options_.size) return false;
    double share = 0.5;
    if (complex_.place(a) == PatchPlace::Corner && complex_.place(b) != PatchPlace::Corner) {
      // At a power of two from the corner, so that rims that meet at a sharp angle do not split each other for ever.
      share = std::exp2(std::round(std::log2(0.5 * length / options_.size))) * options_.size / length;
    }
    const Vec3 chord = p + share * (q - p);
    const Vec3 at = settle(complex_.labels(edge), chord, 0.5 * length).value_or(chord);
    const Vertex v = complex_.split(a, b, at);
    after_insertion(v);
    return true;
  }

  void after_insertion(Vertex v) {
    std::vector<std::array<Vertex, 2>> edges;
    double shortest = options_.size;
    for (const std::uint32_t t : complex_.star(v)) {
      changed_.push_back(t);
      const auto& w = complex_.triangle(t).vertex;
      const std::size_t k = complex_.triangle(t).place_of(v);
      edges.push_back({w[(k + 1) % 3], w[(k + 2) % 3]});
      shortest = std::min(shortest, (complex_.position(v) - complex_.position(w[(k + 1) % 3])).norm());
    }
    tiny_ += shortest < 2.0 * kShortest * options_.size ? 1 : 0;
    legalise(std::move(edges));
    look_at_changed();
  }

  /// Where the way over a patch from a triangle's centroid to a point in its plane ends.
  struct Way {
    std::uint32_t triangle;
    Vec3 point;
    std::optional<std::array<Vertex, 2>> rim;  ///< the edge where it leaves the patch
  };
  [[nodiscard]] Way walk(std::uint32_t t, Vec3 to) const {
    constexpr int kMost = 200;
    const Corners start = complex_.corners(t);
    Vec3 from = (start[0] + start[1] + start[2]) / 3.0;
    std::optional<std::array<Vertex, 2>> entered;
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
      if (complex_.is_rim(edge)) return {t, to, std::array{a, b}};
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

  /// Edges of rims that a new vertex would come too near to, of the triangles of a patch whose balls hold it.
  [[nodiscard]] std::vector<std::array<Vertex, 2>> rims_near(std::uint32_t first, const Vec3& p) const {
    constexpr std::size_t kMost = 100;
    std::vector<std::uint32_t> seen{first};
    std::vector<std::array<Vertex, 2>> rims;
    for (std::size_t i = 0; i < seen.size() && seen.size() < kMost; ++i) {
      const auto v = complex_.triangle(seen[i]).vertex;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vertex a = v[k], b = v[(k + 1) % 3];
        const Around edge = complex_.around(a, b);
        if (complex_.is_rim(edge)) {
          if (encroaches(p, complex_.position(a), complex_.position(b))) rims.push_back({a, b});
          continue;
        }
        const std::uint32_t next = edge.triangle[0] == seen[i] ? edge.triangle[1] : edge.triangle[0];
        if (std::find(seen.begin(), seen.end(), next) != seen.end()) continue;
        const Shape shape = shape_of(complex_.corners(next));
        if ((p - shape.centre).squaredNorm() < shape.radius * shape.radius * (1.0 - 1e-9)) seen.push_back(next);
      }
    }
    return rims;
  }

  void improve(const BadTriangle& bad) {
    const std::uint32_t t = bad.triangle;
    const Shape shape = shape_of(complex_.corners(t));
    if (!std::isfinite(shape.radius)) return;
    const Way way = walk(t, shape.centre);
    std::vector<std::array<Vertex, 2>> rims;
    std::optional<Vec3> at;
    if (way.rim) {
      rims.push_back(*way.rim);
    } else {
      at = settle(labels_of(complex_.triangle(t)), way.point, shape.radius);
      rims = rims_near(way.triangle, at.value_or(way.point));
    }
    if (!rims.empty()) {
      bool any = false;
      for (const auto& [a, b] : rims) {
        const Around edge = complex_.around(a, b);
        if (edge.count > 0 && complex_.is_rim(edge)) any = split_rim(a, b, edge) || any;
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
    if (complex_.is_rim(edge)) {
      (void)split_rim(v[k], v[(k + 1) % 3], edge);
      return;
    }
    const double length = (c[(k + 1) % 3] - c[k]).norm();
    const auto at = settle(complex_.labels(edge), 0.5 * (c[k] + c[(k + 1) % 3]), 0.5 * length);
    if (at && length > 2.0 * kShortest * options_.size) after_insertion(complex_.split(v[k], v[(k + 1) % 3], *at));
  }

  [[noreturn]] void refuse(const std::string& found) const {
    throw Error(ErrorKind::Limit,
                {.place = "", .key = "mesh.size",
                 .expected = "expected bounds of triangles that " + std::to_string(options_.most_vertices) + " vertices reach",
                 .found = found, .hint = "ask for a larger size or distance, or a smaller angle"});
  }

  void measure(DelaunayReport& report) const {
    for (std::uint32_t t = 0; t < complex_.triangles().size(); ++t) {
      if (!complex_.triangle(t).alive) continue;
      const Corners corner = complex_.corners(t);
      const Shape shape = shape_of(corner);
      report.least_angle = std::min(report.least_angle, shape.angle);
      report.sharp += shape.angle < options_.angle ? 1 : 0;
      report.largest_radius = std::max(report.largest_radius, shape.radius);
      report.largest_distance = std::max(report.largest_distance, distance_along(complex_.triangle(t), shape.centre, normal_of(corner).normalized()));
    }
  }

  std::span<const FieldView> fields_;
  const DelaunayOptions& options_;
  PatchComplex& complex_;
  std::vector<Box> box_;
  std::vector<std::array<Vertex, 2>> encroached_;
  std::priority_queue<BadTriangle> bad_;
  std::vector<std::uint32_t> changed_;
  std::uint64_t tiny_ = 0;  ///< vertices that came very near to others
};

/// The mesh of a body.
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
  const double coarsest = std::min(options.cell, 0.5 * options.size);
  std::optional<std::vector<Mesh>> best;
  for (const double share : {1.0, 0.75, 0.5}) {
    const double cell = share * coarsest;
    const Lattice lattice{.origin = cell * Vec3(0.137, 0.291, 0.419), .cell = cell};
    std::vector<Mesh> meshes = polygonise_partition(fields, lattice, executor);
    PatchComplex complex(fields, meshes);
    DelaunayReport found{.least_angle = std::numbers::pi};
    if (!Refiner(fields, options, complex).run(found) || (best && found.sharp >= report.sharp)) continue;
    for (std::size_t m = 0; m < meshes.size(); ++m) {
      if (!meshes[m].triangle.empty()) meshes[m] = extract(fields, complex, static_cast<std::uint32_t>(m));
    }
    report = found;
    best = std::move(meshes);
    if (found.sharp == 0) break;
  }
  if (best) return std::move(*best);
  // Size and distance without the angle: the longest edge of a tetrahedron is no longer than the size.
  const Lattice lattice{.origin = Vec3::Zero(), .cell = options.size / std::sqrt(3.0)};
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
    std::vector<FieldView> members;
    for (const std::uint32_t m : group) members.push_back(fields[m]);
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
    all.least_angle = std::min(all.least_angle, found.least_angle);
    all.largest_radius = std::max(all.largest_radius, found.largest_radius);
    all.largest_distance = std::max(all.largest_distance, found.largest_distance);
  }
  if (all.least_angle == std::numbers::pi) all.least_angle = 0.0;
  if (report != nullptr) *report = all;
  return meshes;
}

}  // namespace supple::implicit
