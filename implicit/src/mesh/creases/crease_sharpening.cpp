#include "mesh/creases/crease_sharpening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "mesh/creases/crease_mending.h"
#include "mesh/triangle_borders.h"
#include "mesh/triangle_steps.h"

namespace supple::implicit {
namespace {

using Triangle = TriangleSteps::Triangle;

/// The border of a disc of triangles as a loop of vertices, counter-clockwise; empty when they are not one disc.
std::vector<std::uint32_t> border(std::span<const Triangle> triangles) {
  std::vector<BorderEdge> open;
  for (const Triangle& t : triangles) join_border(t, open);
  return open.size() == triangles.size() + 2 ? loop_of(open) : std::vector<std::uint32_t>{};
}

class Sharpener {
 public:
  Sharpener(const CreasedField& field, const march::ViewMemory& changes, CreaseMemory& memory, CrossingMemory& crossings, Mesh& mesh)
      : whole_(field.whole), fields_(field.fields), lattice_(field.lattice), owner_(field.owner), skip_(field.skip), changes_(changes),
        memory_(memory), crossings_(crossings), mesh_(mesh),
        steps_(std::move(mesh.triangle)), safe_(steps_.triangles().size(), true) {}

  Sharpened run() {
    add_points();
    turn_edges();
    cut_edges();
    mend_creases(mesh_, owner_, lattice_.cell, skip_, [this](const std::array<std::uint32_t, 2>& nodes, const Vec3& near) {
      const std::optional<CreasePoint>& point = crease_point({near, near, nodes});
      return point ? std::optional(add_vertex(*point)) : std::nullopt;
    }, steps_);
    const std::vector<std::uint32_t> back = take_back_crossings(mesh_, safe_, lattice_.cell, crossings_, steps_);
    mesh_.triangle.clear();
    for (const std::uint32_t t : steps_.numbers()) mesh_.triangle.push_back(steps_[t]);
    const std::uint64_t blunt = cut_off(back);
    return {blunt, leave_out_unused()};
  }

 private:
  /// An edge of a triangle.
  struct Side {
    std::uint32_t low, high, triangle;
    auto operator<=>(const Side&) const = default;
  };
  /// An edge with a vertex on the crease.
  struct Cut {
    std::uint32_t low, high, vertex;
  };

  using CellPlace = std::array<std::int64_t, 3>;
  /// The centre of a triangle: all triangles of marching cubes lie in their cell.
  [[nodiscard]] CellPlace cell_of(const Triangle& t) const {
    const Vec3 centre = (mesh_.position[t[0]] + mesh_.position[t[1]] + mesh_.position[t[2]]) / 3.0;
    const Vec3 at = (centre - lattice_.origin) / lattice_.cell;
    return {static_cast<std::int64_t>(std::floor(at.x())), static_cast<std::int64_t>(std::floor(at.y())), static_cast<std::int64_t>(std::floor(at.z()))};
  }

  void add_points() {
    struct Piece {
      CellPlace cell;
      std::uint32_t triangle;
    };
    std::vector<Piece> pieces;
    for (std::uint32_t i = 0; i < steps_.triangles().size(); ++i) pieces.push_back({cell_of(steps_[i]), i});
    std::sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
      return a.cell != b.cell ? a.cell < b.cell : a.triangle < b.triangle;
    });
    std::vector<std::uint32_t> cell;
    for (std::size_t begin = 0, end = 0; begin < pieces.size(); begin = end) {
      cell.clear();
      for (end = begin; end < pieces.size() && pieces[end].cell == pieces[begin].cell; ++end) cell.push_back(pieces[end].triangle);
      star(cell, pieces[begin].cell);
    }
  }

  /// Replaces the triangles of a cell by those around a point of the crease, if there is one.
  void star(std::span<const std::uint32_t> numbers, const CellPlace& cell) {
    std::vector<Triangle> triangles;
    for (const std::uint32_t t : numbers) triangles.push_back(steps_[t]);
    std::vector<std::uint32_t> nodes;
    for (const Triangle& t : triangles) {
      for (const std::uint32_t v : t) nodes.push_back(owner_[v]);
    }
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    if (nodes.size() < 2 || nodes.size() > 3) return;
    const std::vector<std::uint32_t> loop = border(triangles);
    if (loop.empty()) return;
    Vec3 middle = Vec3::Zero();
    for (const std::uint32_t v : loop) middle += mesh_.position[v] / static_cast<double>(loop.size());
    const std::optional<CreasePoint>& point = crease_point({middle, middle, nodes});
    if (!point) return;
    // In its own cell a cone over the loop, whose edges lie in the cell's faces, crosses nothing; a little beyond, its triangles must face outward.
    constexpr double kInside = 1e-9, kRounding = 1e-15;
    bool inside = true;
    const Vec3 at = (point->position - lattice_.origin) / lattice_.cell;
    for (int k = 0; k < 3; ++k) {
      const auto place = static_cast<double>(cell[static_cast<std::size_t>(k)]);
      const double offset = at[k] - place, margin = kInside + kRounding * std::abs(place);
      if (offset < -kBeyond || offset > 1.0 + kBeyond) return;
      inside = inside && offset > margin && offset < 1.0 - margin;
    }
    for (std::size_t k = 0; k < loop.size(); ++k) {
      if (!faces_out(loop[k], loop[(k + 1) % loop.size()], point->position)) return;
    }
    const auto near_point = [&](std::uint32_t v) { return meet(mesh_.position[v], point->position); };
    if (std::any_of(loop.begin(), loop.end(), near_point) || !is_first_at(point->position)) return;
    const std::uint32_t fresh = add_vertex(*point);
    std::vector<Triangle> around;
    for (std::size_t k = 0; k < loop.size(); ++k) around.push_back({loop[k], loop[(k + 1) % loop.size()], fresh});
    steps_.replace(numbers, around);
    safe_.resize(steps_.triangles().size(), inside);
  }

  /// Whether two vertices would lie in one place, as where a crease runs along a plane of the lattice.
  [[nodiscard]] bool meet(const Vec3& x, const Vec3& y) const { return (x - y).lpNorm<Eigen::Infinity>() < kLeast * lattice_.cell; }

  /// Whether no other cell has a point here yet: one in a face belongs to both of its cells.
  bool is_first_at(const Vec3& x) {
    // Lattice planes lie within the places, not between them.
    const Vec3 at = ((x - lattice_.origin) / (kLeast * lattice_.cell)).array() + 0.5;
    return taken_.insert({static_cast<std::int64_t>(std::floor(at.x())), static_cast<std::int64_t>(std::floor(at.y())), static_cast<std::int64_t>(std::floor(at.z()))}).second;
  }

  /// As the last call found it, where that cannot be different: all that a search looks at lies this near.
  [[nodiscard]] const std::optional<CreasePoint>& crease_point(const CreaseSearch& search) {
    const auto holds = [&](const CreaseSearch& s) {
      return !changes_.differs(Box{s.from.cwiseMin(s.to), s.from.cwiseMax(s.to)}.inflated(1.01 * kFarthest * lattice_.cell));
    };
    return memory_.find(search, holds, [&](const CreaseSearch& s) { return seek(s); });
  }

  [[nodiscard]] std::optional<CreasePoint> seek(const CreaseSearch& search) const {
    const std::span<const std::uint32_t> nodes = search.nodes();
    const Vec3 start = search.from == search.to ? search.from : between(search);
    const std::optional<Vec3> point = meeting_point(fields_, nodes, start, kFarthest * lattice_.cell);
    if (!point || !(whole_.value(*point) <= 1e-12)) return std::nullopt;  // else another node covers it
    Vec3 normal = Vec3::Zero();
    for (const std::uint32_t node : nodes) {
      Vec3 gradient;
      (void)fields_[node].value(*point, gradient);
      if (gradient.squaredNorm() > 0.0) normal -= gradient.normalized();
    }
    return CreasePoint{*point, normal.squaredNorm() > 0.0 ? Vec3(normal.normalized()) : Vec3::UnitZ()};
  }

  /// @return its number
  std::uint32_t add_vertex(const CreasePoint& point) {
    mesh_.position.push_back(point.position);
    mesh_.normal.push_back(point.normal);
    return static_cast<std::uint32_t>(mesh_.position.size() - 1);
  }

  [[nodiscard]] bool faces_out(std::uint32_t a, std::uint32_t b, const Vec3& c) const {
    const Vec3 &p = mesh_.position[a], &q = mesh_.position[b];
    return (q - p).cross(c - p).dot(mesh_.normal[a] + mesh_.normal[b]) > 0.0;
  }

  /// An edge between two nodes' vertices and two points of the crease becomes the edge between the points.
  void turn_edges() {
    std::vector<Side> sides;
    for (std::uint32_t i = 0; i < steps_.triangles().size(); ++i) {
      const auto [a, b, top] = steps_[i];
      if (on_crease(top)) sides.push_back({std::min(a, b), std::max(a, b), i});
    }
    std::sort(sides.begin(), sides.end());
    struct Turn {
      std::uint32_t low, high;  ///< points of the crease
      std::array<std::uint32_t, 2> triangle;
    };
    std::vector<Turn> turns;
    for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
      if (sides[i].low != sides[i + 1].low || sides[i].high != sides[i + 1].high) continue;
      const std::uint32_t x = steps_[sides[i].triangle][2], y = steps_[sides[i + 1].triangle][2];
      turns.push_back({std::min(x, y), std::max(x, y), {sides[i].triangle, sides[i + 1].triangle}});
      ++i;
    }
    std::stable_sort(turns.begin(), turns.end(), [](const Turn& a, const Turn& b) { return std::tie(a.low, a.high) < std::tie(b.low, b.high); });
    const auto same_points = [](const Turn& a, const Turn& b) { return a.low == b.low && a.high == b.high; };
    for (std::size_t i = 0; i < turns.size(); ++i) {
      // Two edges in the face between two cells would both become the same one, or one of them would pass through the other.
      if ((i > 0 && same_points(turns[i - 1], turns[i])) || (i + 1 < turns.size() && same_points(turns[i], turns[i + 1]))) continue;
      const auto [s, t] = turns[i].triangle;
      const auto [p, q, x] = steps_[s];
      if (owner_[p] == owner_[q]) continue;
      const std::uint32_t y = steps_[t][2];
      const auto out = [&](std::uint32_t a, std::uint32_t b, std::uint32_t own, std::uint32_t c) {
        const Vec3& origin = mesh_.position[a];
        return (mesh_.position[b] - origin).cross(mesh_.position[c] - origin).dot(mesh_.normal[own]) > 0.0;
      };
      if (!out(x, p, p, y) || !out(y, q, q, x)) continue;
      // Of two points each in its own cell: both triangles lie in the two cells, and in each of these on the cone over its loop with the edge in
      // the face between the cells laid through another point of that face, which no other edge crosses.
      const bool safe = safe_[s] && safe_[t];
      steps_.replace(turns[i].triangle, std::array{Triangle{x, p, y}, Triangle{y, q, x}});
      safe_.resize(steps_.triangles().size(), safe);
    }
  }

  [[nodiscard]] bool on_crease(std::uint32_t v) const { return v >= owner_.size(); }
  /// Whether the edge crosses a crease where it has no vertex.
  [[nodiscard]] bool crosses(std::uint32_t a, std::uint32_t b) const {
    return !on_crease(a) && !on_crease(b) && owner_[a] != owner_[b];
  }

  /// Whether a triangle's part at its corner a faces outward when its edge from a to b is cut at x.
  [[nodiscard]] bool part_faces_out(std::uint32_t a, const Vec3& x, std::uint32_t c, double turn) const {
    const Vec3& p = mesh_.position[a];
    const Vec3 normal = crosses(a, c) ? Vec3(mesh_.normal[a] + mesh_.normal[c]) : mesh_.normal[a];
    return turn * (x - p).cross(mesh_.position[c] - p).dot(normal) > 0.0;
  }

  /// An edge that crosses a crease still is cut at a point of it, unless a triangle would turn over.
  void cut_edges() {
    std::vector<Side> sides;
    for (std::uint32_t i = 0; i < steps_.triangles().size(); ++i) {
      if (!steps_.is_there(i)) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = steps_[i][k], b = steps_[i][(k + 1) % 3];
        if (crosses(a, b)) sides.push_back({std::min(a, b), std::max(a, b), i});
      }
    }
    std::sort(sides.begin(), sides.end());
    std::vector<Cut> cuts;
    std::vector<std::array<std::uint32_t, 2>> joined;
    for (std::size_t i = 0; i + 1 < sides.size(); i += 2) {
      const auto [low, high, left] = sides[i];
      const std::uint32_t right = sides[i + 1].triangle;
      const std::array nodes{owner_[low], owner_[high]};
      const std::optional<CreasePoint>& x = crease_point({mesh_.position[low], mesh_.position[high], nodes});
      if (x && !meet(x->position, mesh_.position[low]) && !meet(x->position, mesh_.position[high]) && can_cut(steps_[left], low, high, x->position) && can_cut(steps_[right], low, high, x->position)) {
        cuts.push_back({low, high, add_vertex(*x)});
        joined.push_back({left, right});
      }
    }
    // A step for triangles that share cut edges, directly or through others.
    std::vector<Triangle> pieces;
    for (const std::vector<std::uint32_t>& group : groups_of(joined)) {
      pieces.clear();
      for (const std::uint32_t t : group) cut(steps_[t], cuts, pieces);
      steps_.replace(group, pieces);
    }
  }

  /// Components of a set of pairs.
  static std::vector<std::vector<std::uint32_t>> groups_of(std::span<const std::array<std::uint32_t, 2>> pairs) {
    std::vector<std::uint32_t> member;
    for (const auto& pair : pairs) member.insert(member.end(), pair.begin(), pair.end());
    std::sort(member.begin(), member.end());
    member.erase(std::unique(member.begin(), member.end()), member.end());
    std::vector<std::size_t> root(member.size());
    std::iota(root.begin(), root.end(), std::size_t{0});
    const auto root_of = [&](std::uint32_t m) {
      auto k = static_cast<std::size_t>(std::lower_bound(member.begin(), member.end(), m) - member.begin());
      while (root[k] != k) k = root[k] = root[root[k]];
      return k;
    };
    for (const auto& [a, b] : pairs) {
      const std::size_t i = root_of(a), k = root_of(b);
      root[std::max(i, k)] = std::min(i, k);
    }
    std::vector<std::vector<std::uint32_t>> groups, by_root(member.size());
    for (const std::uint32_t m : member) by_root[root_of(m)].push_back(m);
    for (std::vector<std::uint32_t>& group : by_root) {
      if (!group.empty()) groups.push_back(std::move(group));
    }
    return groups;
  }

  /// Where the fields of the nodes of two vertices, taken to be linear, are equal on the edge between them.
  [[nodiscard]] Vec3 between(const CreaseSearch& search) const {
    const Vec3 &p = search.from, &q = search.to;
    const FieldView &f = fields_[search.node[0]], &g = fields_[search.node[1]];
    const double at_p = std::max(f.value(p) - g.value(p), 0.0), at_q = std::max(g.value(q) - f.value(q), 0.0);
    return at_p + at_q > 0.0 ? Vec3(p + at_p / (at_p + at_q) * (q - p)) : Vec3(0.5 * (p + q));
  }

  [[nodiscard]] bool can_cut(const Triangle& t, std::uint32_t low, std::uint32_t high, const Vec3& x) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
      if (std::min(a, b) == low && std::max(a, b) == high) return part_faces_out(a, x, c, 1.0) && part_faces_out(b, x, c, -1.0);
    }
    return false;
  }

  /// The parts of a triangle whose edges are cut. The part between two cuts and an edge is halved along its shorter diagonal.
  void cut(const Triangle& t, std::span<const Cut> cuts, std::vector<Triangle>& out) const {
    std::array<std::optional<std::uint32_t>, 3> middle;  // of the edges from corner k on
    for (std::size_t k = 0; k < 3; ++k) middle[k] = middle_of(t[k], t[(k + 1) % 3], cuts);
    const auto count = std::count_if(middle.begin(), middle.end(), [](const auto& m) { return m.has_value(); });
    if (count == 0) {
      out.push_back(t);
      return;
    }
    // Turned so that the only cut edge comes first, or the only whole one last.
    std::size_t k = 0;
    while (count == 1 ? !middle[k] : count == 2 && middle[(k + 2) % 3]) ++k;
    const std::uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3], x = *middle[k];
    if (count == 1) {
      out.insert(out.end(), {Triangle{a, x, c}, Triangle{x, b, c}});
      return;
    }
    const std::uint32_t y = *middle[(k + 1) % 3];
    out.push_back({x, b, y});
    if (count == 3) {
      const std::uint32_t z = *middle[(k + 2) % 3];
      out.insert(out.end(), {Triangle{y, c, z}, Triangle{z, a, x}, Triangle{x, y, z}});
    } else if ((mesh_.position[a] - mesh_.position[y]).squaredNorm() < (mesh_.position[x] - mesh_.position[c]).squaredNorm()) {
      out.insert(out.end(), {Triangle{a, x, y}, Triangle{a, y, c}});
    } else {
      out.insert(out.end(), {Triangle{x, y, c}, Triangle{a, x, c}});
    }
  }

  [[nodiscard]] std::optional<std::uint32_t> middle_of(std::uint32_t a, std::uint32_t b, std::span<const Cut> cuts) const {
    if (!crosses(a, b)) return std::nullopt;
    const std::pair edge = std::minmax(a, b);
    const auto at = std::lower_bound(cuts.begin(), cuts.end(), edge, [](const Cut& c, const auto& e) {
      return std::tie(c.low, c.high) < std::tie(e.first, e.second);
    });
    if (at == cuts.end() || at->low != edge.first || at->high != edge.second) return std::nullopt;
    return at->vertex;
  }

  /// Cells with an edge across a crease among triangles that are there again.
  [[nodiscard]] std::uint64_t cut_off(std::span<const std::uint32_t> back) const {
    std::vector<CellPlace> cells;
    for (const std::uint32_t n : back) {
      const auto [a, b, c] = steps_[n];
      if (crosses(a, b) || crosses(b, c) || crosses(c, a)) cells.push_back(cell_of(steps_[n]));
    }
    std::sort(cells.begin(), cells.end());
    return static_cast<std::uint64_t>(std::unique(cells.begin(), cells.end()) - cells.begin());
  }

  /// Vertices that no triangle has; all others keep their order. @return how many are left on creases
  std::size_t leave_out_unused() {
    constexpr std::uint32_t kUnused = ~std::uint32_t{0};
    std::vector<std::uint32_t> number(mesh_.vertex_count(), kUnused);
    for (const Triangle& t : mesh_.triangle) {
      for (const std::uint32_t v : t) number[v] = 0;
    }
    std::uint32_t count = 0, on_sides = 0;
    for (std::size_t v = 0; v < number.size(); ++v) {
      if (v == owner_.size()) on_sides = count;
      if (number[v] == kUnused) continue;
      mesh_.position[count] = mesh_.position[v];
      mesh_.normal[count] = mesh_.normal[v];
      number[v] = count++;
    }
    mesh_.position.resize(count);
    mesh_.normal.resize(count);
    for (Triangle& t : mesh_.triangle) {
      for (std::uint32_t& v : t) v = number[v];
    }
    return owner_.size() < number.size() ? count - on_sides : 0;
  }

  static constexpr double kBeyond = 1.0, kFarthest = 2.0;  // [cells]
  static constexpr double kLeast = 0x1p-17;                // between two vertices, as on edges of the lattice [cells]
  FieldView whole_;
  std::span<const FieldView> fields_;  ///< of the nodes
  const Lattice& lattice_;
  std::span<const std::uint32_t> owner_;
  bool skip_;
  const march::ViewMemory& changes_;
  CreaseMemory& memory_;
  CrossingMemory& crossings_;
  Mesh& mesh_;
  TriangleSteps steps_;
  std::set<CellPlace> taken_;  ///< where points are
  std::vector<bool> safe_;  ///< see take_back_crossings; of points and turned edges only
};

}  // namespace

Sharpened sharpen(const CreasedField& field, const march::ViewMemory& changes, CreaseMemory& memory, CrossingMemory& crossings, Mesh& mesh) {
  return Sharpener(field, changes, memory, crossings, mesh).run();
}

}  // namespace supple::implicit
