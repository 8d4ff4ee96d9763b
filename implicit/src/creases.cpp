#include "supple/implicit/creases.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "crease_crossings.h"
#include "crease_mending.h"
#include "error_search.h"
#include "field_index.h"
#include "march_tried.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "triangle_errors.h"
#include "triangle_steps.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// Boxes of the supports by node; empty for nodes without primitives.
std::vector<Box> node_supports(const Field::Index& index) {
  std::vector<Box> box;
  for (std::size_t i = 0; i < index.size(); ++i) {
    const std::uint32_t node = index.blend.node_of(index.primitive[i].part);
    if (node >= box.size()) box.resize(node + 1);
    box[node] = box[node].united(index.support[i]);
  }
  return box;
}

/// F_k of one node.
class NodeField {
 public:
  NodeField(const Field& field, std::uint32_t node, const Box& support) : field_(&field), node_(node), box_(support) {}

  void evaluate(std::span<const Vec3> points, std::span<double> values) const { evaluate(points, values, {}); }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    const Field::Index& index = field_->index();
    thread_local FieldParts parts;
    thread_local std::vector<NodeSample> nodes;
    part_rows(index, points, parts);
    for (std::size_t i = 0; i < points.size(); ++i) {
      gather(index.blend, i, parts, nodes);
      const NodeSample own = value_of(nodes);
      values[i] = own.value - index.iso;
      Vec3 gradient = own.gradient;
      for (const NodeSample& other : nodes) {
        const double w = other.node == node_ ? 0.0 : index.blend.weight(node_, other.node);
        if (w == 0.0) continue;
        const NodeSample& less = other.value < own.value ? other : own;
        values[i] += w * less.value;
        gradient += w * less.gradient;
      }
      if (!gradients.empty()) gradients[i] = gradient;
    }
  }
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { field_->evaluate_parts(points, parts); }

  [[nodiscard]] Interval bound(const Box& box) const {
    Interval own, total;
    double scale = 0.0;
    each(box, false, [&](std::span<const BlendIndex::NodeBound> nodes, double size) {
      scale = size;
      for (const auto& n : nodes) {
        if (n.node == node_) own = n.value;
      }
      total = own;
      for (const auto& n : nodes) {
        const double w = n.node == node_ ? 0.0 : field_->index().blend.weight(node_, n.node);
        total.lower += w * std::min(n.value.lower, own.lower);
        total.upper += w * std::min(n.value.upper, own.upper);
      }
    });
    const double iso = field_->index().iso, round_off = 64.0 * kEps * (scale + iso);
    return {std::max(total.lower - iso - round_off, -iso), total.upper - iso + round_off};
  }
  [[nodiscard]] double gradient_bound(const Box& box) const {
    double total = 0.0;
    each(box, true, [&](std::span<const BlendIndex::NodeBound> nodes, double size) {
      double own = 0.0;
      for (const auto& n : nodes) {
        if (n.node == node_) own = n.slope;
      }
      total = own;
      for (const auto& n : nodes) {
        if (n.node != node_) total += field_->index().blend.weight(node_, n.node) * std::max(n.slope, own);
      }
      total += 64.0 * kEps * size;
    });
    return total;
  }
  [[nodiscard]] Box surface_box() const { return box_; }
  [[nodiscard]] double feature_size() const { return field_->feature_size(); }

 private:
  static void gather(const BlendIndex& blend, std::size_t i, const FieldParts& parts, std::vector<NodeSample>& nodes) {
    nodes.clear();
    for (std::uint32_t r = parts.offset[i]; r < parts.offset[i + 1]; ++r) {
      const std::uint32_t node = blend.node_of(parts.part[r]);
      auto at = std::find_if(nodes.begin(), nodes.end(), [&](const NodeSample& n) { return n.node == node; });
      if (at == nodes.end()) at = nodes.insert(nodes.end(), NodeSample{.node = node});
      at->value += parts.value[r];
      at->gradient += parts.gradient[r];
    }
  }
  [[nodiscard]] NodeSample value_of(const std::vector<NodeSample>& nodes) const {
    const auto at = std::find_if(nodes.begin(), nodes.end(), [&](const NodeSample& n) { return n.node == node_; });
    return at == nodes.end() ? NodeSample{.node = node_} : *at;
  }
  /// Calls use(bounds of the nodes that the box touches, size of what was added).
  template <class Use>
  void each(const Box& box, bool with_slope, const Use& use) const {
    const Field::Index& index = field_->index();
    thread_local std::vector<BlendIndex::NodeBound> nodes;
    nodes.clear();
    double scale = 0.0;
    for (const std::uint32_t id : candidates_of(index, box)) {
      if (!index.support[id].overlaps(box)) continue;
      const PrimitiveBound one = bound_primitive(index, id, box, with_slope);
      const std::uint32_t node = index.blend.node_of(index.primitive[id].part);
      auto at = std::find_if(nodes.begin(), nodes.end(), [&](const auto& n) { return n.node == node; });
      if (at == nodes.end()) at = nodes.insert(nodes.end(), BlendIndex::NodeBound{.node = node});
      at->value.lower += one.value.lower;
      at->value.upper += one.value.upper;
      at->slope += one.slope;
      scale += with_slope ? index.shape[id].lipschitz : index.shape[id].peak;
    }
    use(nodes, scale);
  }

  const Field* field_;
  std::uint32_t node_;
  Box box_;
};

/// The point near `start` where the fields of up to three bodies vanish together: Newton's method, smallest steps.
std::optional<Vec3> meeting_point(std::span<const FieldView> fields, std::span<const std::uint32_t> bodies,
                                  const Vec3& start, double farthest) {
  constexpr int kMaxIterations = 20;
  Vec3 x = start;
  const std::size_t n = std::min<std::size_t>(bodies.size(), 3);
  for (int i = 0; i < kMaxIterations; ++i) {
    std::array<double, 3> f{};
    std::array<Vec3, 3> g{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
    double largest = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
      f[k] = fields[bodies[k]].value(x, g[k]);
      largest = std::max(largest, std::abs(f[k]));
    }
    if (largest <= 1e-13) return x;
    const Vec3 along = g[0].cross(g[1]);
    const Vec3 third = n == 3 ? g[2] : along;
    const Vec3 step = -(f[0] * g[1].cross(third) + f[1] * third.cross(g[0]) + f[2] * along) / along.dot(third);
    x += step;
    if (!((x - start).norm() <= farthest)) return std::nullopt;
    if (step.norm() <= kEps * x.cwiseAbs().maxCoeff()) return x;
  }
  return std::nullopt;
}

using Triangle = TriangleSteps::Triangle;

/// Where nodes meet on the surface, sought from a point between two vertices or in the middle of a cell, where both ends are one.
struct CreaseSearch {
  Vec3 from, to;
  std::array<std::uint32_t, 3> node{kNone, kNone, kNone};  ///< two or three of the fields; that of `from` first
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  CreaseSearch(const Vec3& a, const Vec3& b, std::span<const std::uint32_t> nodes) : from(a), to(b) {
    std::copy(nodes.begin(), nodes.end(), node.begin());
  }
  [[nodiscard]] std::span<const std::uint32_t> nodes() const { return std::span(node).first(node[2] == kNone ? 2 : 3); }
  [[nodiscard]] std::array<std::uint64_t, 8> words() const {
    std::array<std::uint64_t, 8> words{};
    for (std::size_t k = 0; k < 3; ++k) {
      words[k] = std::bit_cast<std::uint64_t>(from[static_cast<Eigen::Index>(k)]);
      words[3 + k] = std::bit_cast<std::uint64_t>(to[static_cast<Eigen::Index>(k)]);
    }
    words[6] = std::uint64_t{node[0]} << 32 | node[1];
    words[7] = node[2];
    return words;
  }
};

struct CreasePoint {
  Vec3 position, normal;
};

/// What searches for points of creases found, from call to call.
class CreaseMemory {
 public:
  /// @param nothing  of the last call holds
  void begin_call(bool nothing) {
    last_.clear();
    if (!nothing) last_.swap(now_);
    now_.clear();
  }
  /// What this search found in the last call if that still holds by `holds(search)`, else search_anew(search).
  template <class Holds, class Search>
  const std::optional<CreasePoint>& find(const CreaseSearch& search, const Holds& holds, const Search& search_anew) {
    const auto words = search.words();
    if (auto known = last_.extract(words); known && holds(search)) return now_.insert(std::move(known)).position->second;
    return now_.insert_or_assign(words, search_anew(search)).first->second;
  }
  void end_call() { last_.clear(); }
  [[nodiscard]] std::size_t bytes() const {
    constexpr std::size_t kNode = sizeof(Points::value_type) + 2 * sizeof(void*);
    return now_.size() * kNode + (now_.bucket_count() + last_.bucket_count()) * sizeof(void*);
  }

 private:
  using Words = std::array<std::uint64_t, 8>;
  struct WordsHash {
    std::size_t operator()(const Words& words) const { return hash_bytes(std::as_bytes(std::span(words))); }
  };
  using Points = std::unordered_map<Words, std::optional<CreasePoint>, WordsHash>;
  Points last_, now_;
};

/// The node whose field is the largest at each point: at least one is positive or zero on the surface, and none is beyond its support.
std::vector<std::uint32_t> owners(std::span<const FieldView> fields, std::span<const Vec3> points, const Executor& executor) {
  constexpr std::size_t kPointsPerTask = 512;
  std::vector<std::uint32_t> owner(points.size(), 0);
  executor.for_blocks(points.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
    const auto own = points.subspan(begin, end - begin);
    Box box;
    for (const Vec3& p : own) box.include(p);
    std::vector<double> best(own.size(), -std::numeric_limits<double>::infinity()), value(own.size());
    for (std::uint32_t k = 0; k < fields.size(); ++k) {
      if (!fields[k].surface_box().overlaps(box)) continue;
      fields[k].evaluate(own, value);
      for (std::size_t i = 0; i < own.size(); ++i) {
        if (!(value[i] > best[i])) continue;
        best[i] = value[i];
        owner[begin + i] = k;
      }
    }
  });
  return owner;
}

/// The border of a disc of triangles as a loop of vertices, counter-clockwise; empty when they are not one disc.
std::vector<std::uint32_t> border(std::span<const Triangle> triangles) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> open;
  for (const Triangle& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::pair edge{t[k], t[(k + 1) % 3]};
      const auto reverse = std::find(open.begin(), open.end(), std::pair{edge.second, edge.first});
      if (reverse != open.end()) {
        open.erase(reverse);
      } else {
        open.push_back(edge);
      }
    }
  }
  if (open.size() != triangles.size() + 2) return {};
  std::vector<std::uint32_t> loop{open.front().first};
  for (std::uint32_t v = open.front().second; v != loop.front();) {
    loop.push_back(v);
    const auto next = std::find_if(open.begin(), open.end(), [v](const auto& edge) { return edge.first == v; });
    if (next == open.end() || loop.size() > open.size()) return {};
    v = next->second;
  }
  return loop.size() == open.size() ? loop : std::vector<std::uint32_t>{};
}

/// Puts a vertex onto the crease in every cell whose vertices belong to several nodes, turns edges that cross the crease, and cuts those
/// that still do
/// (Kobbelt et al. 2001, "Feature sensitive surface extraction from volume data"; the crease itself is met here). What crosses then is
/// taken back.
class Sharpener {
 public:
  /// @param owner    of the vertices   @param changes  since the memory was last used
  Sharpener(const FieldView& whole, std::span<const FieldView> fields, const Lattice& lattice, std::span<const std::uint32_t> owner,
            const march::ViewMemory& changes, CreaseMemory& memory, Mesh& mesh)
      : whole_(whole), fields_(fields), lattice_(lattice), owner_(owner), changes_(changes), memory_(memory), mesh_(mesh),
        steps_(std::move(mesh.triangle)), safe_(steps_.triangles().size(), true) {}

  /// @return cells that keep a crease cut off
  std::uint64_t run() {
    add_points();
    turn_edges();
    cut_edges();
    mend_creases(mesh_, owner_, lattice_.cell, [this](const std::array<std::uint32_t, 2>& nodes, const Vec3& near) {
      const std::optional<CreasePoint>& point = crease_point({near, near, nodes});
      return point ? std::optional(add_vertex(*point)) : std::nullopt;
    }, steps_);
    const std::vector<std::uint32_t> back = take_back_crossings(mesh_.position, safe_, lattice_.cell, steps_);
    mesh_.triangle.clear();
    for (const std::uint32_t t : steps_.numbers()) mesh_.triangle.push_back(steps_[t]);
    const std::uint64_t blunt = cut_off(back);
    leave_out_unused();
    return blunt;
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
  /// Where the middle of a triangle lies: all triangles of marching cubes lie in their cell.
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
    const std::uint32_t fresh = add_vertex(*point);
    std::vector<Triangle> around;
    for (std::size_t k = 0; k < loop.size(); ++k) around.push_back({loop[k], loop[(k + 1) % loop.size()], fresh});
    steps_.replace(numbers, around);
    safe_.resize(steps_.triangles().size(), inside);
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
      if (x && can_cut(steps_[left], low, high, x->position) && can_cut(steps_[right], low, high, x->position)) {
        cuts.push_back({low, high, add_vertex(*x)});
        joined.push_back({left, right});
      }
    }
    // A step for triangles that share cut edges, directly or by way of others.
    std::vector<Triangle> pieces;
    for (const std::vector<std::uint32_t>& group : groups_of(joined)) {
      pieces.clear();
      for (const std::uint32_t t : group) cut(steps_[t], cuts, pieces);
      steps_.replace(group, pieces);
    }
  }

  /// What pairs join, directly or by way of others.
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

  /// Vertices that no triangle has; all others keep their order.
  void leave_out_unused() {
    constexpr std::uint32_t kUnused = ~std::uint32_t{0};
    std::vector<std::uint32_t> number(mesh_.vertex_count(), kUnused);
    for (const Triangle& t : mesh_.triangle) {
      for (const std::uint32_t v : t) number[v] = 0;
    }
    std::uint32_t count = 0;
    for (std::size_t v = 0; v < number.size(); ++v) {
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
  }

  static constexpr double kBeyond = 1.0, kFarthest = 2.0;  // [cells]
  FieldView whole_;
  std::span<const FieldView> fields_;  ///< of the nodes
  const Lattice& lattice_;
  std::span<const std::uint32_t> owner_;
  const march::ViewMemory& changes_;
  CreaseMemory& memory_;
  Mesh& mesh_;
  TriangleSteps steps_;
  std::vector<bool> safe_;  ///< see take_back_crossings; of points and turned edges only
};

}  // namespace

bool has_creases(const Field& field) {
  const Field::Index& index = field.packed();
  if (index.blend.rule() != BlendRule::Graph) return false;
  const std::vector<Box> box = node_supports(index);
  std::vector<std::uint32_t> order;
  for (std::uint32_t k = 0; k < box.size(); ++k) {
    if (!box[k].empty()) order.push_back(k);
  }
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return box[a].lower.x() != box[b].lower.x() ? box[a].lower.x() < box[b].lower.x() : a < b;
  });
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = i + 1; j < order.size() && box[order[j]].lower.x() <= box[order[i]].upper.x(); ++j) {
      if (box[order[i]].overlaps(box[order[j]]) && index.blend.weight(order[i], order[j]) < 1.0) return true;
    }
  }
  return false;
}

namespace {

/// The mesh with creases on one lattice, and what is kept of it.
class CreaseMarcher {
 public:
  /// @param field  to be kept until the next call
  const Mesh& make(const Field& field, const Lattice& lattice, bool skip, const Executor& executor);
  /// centroid_error of the mesh that was made since the last call.
  [[nodiscard]] double error(const Executor& executor);
  /// Marches anew, with nothing of earlier calls: counts are then those of a fresh mesher. The mesh stays.
  void march_anew(const Executor& executor);

  [[nodiscard]] const MarchCounts& counts() const { return counts_; }
  [[nodiscard]] bool whole() const { return marcher_.whole(); }
  [[nodiscard]] MarchCounts most_counts() const { return marcher_.most_counts(counts_); }
  /// Of all that is kept, the mesh too.
  [[nodiscard]] std::uint64_t bytes() const { return counts_.bytes + march::bytes_of(mesh_) + march::bytes_of(last_mesh_) + errors_.bytes(); }
  [[nodiscard]] Mesh take_mesh() { return std::move(mesh_); }

 private:
  void count_kept();
  /// Whether nothing is different since the last mesh was made.
  [[nodiscard]] bool stayed(bool others) const {
    const march::ViewMemory& changes = marcher_.memory.view;
    return !others && !changes.all && changes.changes.reaches().empty();
  }
  /// Of the vertices that did not stay where they were and as they were.
  void find_owners(std::span<const FieldView> fields, bool all, const Executor& executor);

  march::Marcher marcher_;
  const Field* field_ = nullptr;
  Lattice lattice_;
  bool skip_ = true;
  MarchCounts counts_;
  bool made_ = false;                 ///< a mesh, of which the following is
  std::vector<std::uint32_t> node_;   ///< that its fields are of
  std::vector<std::uint32_t> owner_;  ///< of the vertices of the marched mesh, by place in `node_`
  CreaseMemory memory_;
  Mesh mesh_, last_mesh_;
  TriangleErrors errors_;             ///< of last_mesh_, or mesh_ once they are asked for
  std::uint64_t blunt_cells_ = 0;     ///< of mesh_
  double error_ = 0.0;                ///< the largest of them [m]
  double feature_ = 0.0;              ///< of the field when they were [m]
  bool measured_ = false;             ///< errors_ are those of mesh_
  bool comparable_ = false;           ///< errors_ are those of last_mesh_
};

void CreaseMarcher::march_anew(const Executor& executor) {
  marcher_.kept = false;
  marcher_.march(*field_, lattice_, skip_, executor, counts_);
  count_kept();
}

void CreaseMarcher::count_kept() {
  counts_.blunt_cells = blunt_cells_;
  counts_.bytes += memory_.bytes() + owner_.capacity() * sizeof(owner_[0]) + march::bytes_of(marcher_.mesh);
}

const Mesh& CreaseMarcher::make(const Field& field, const Lattice& lattice, bool skip, const Executor& executor) {
  field_ = &field;
  lattice_ = lattice;
  skip_ = skip;
  const Field::Index& index = field.index();
  const std::vector<Box> box = node_supports(index);
  std::vector<NodeField> nodes;
  std::vector<std::uint32_t> present;
  for (std::uint32_t k = 0; k < box.size(); ++k) {
    if (box[k].empty()) continue;
    nodes.emplace_back(field, k, box[k]);
    present.push_back(k);
  }
  const std::vector<FieldView> views(nodes.begin(), nodes.end());
  const bool others = !std::exchange(made_, false) || present != node_;  // made_: should the next lines throw
  marcher_.march(field, lattice, skip, executor, counts_);
  if (stayed(others)) {
    made_ = true;
    comparable_ = false;  // differences are counted from this call on
    count_kept();
    return mesh_;
  }
  comparable_ = std::exchange(measured_, false);
  const march::ViewMemory& changes = marcher_.memory.view;
  find_owners(views, others || changes.all, executor);
  memory_.begin_call(others || changes.all);
  if (comparable_) std::swap(mesh_, last_mesh_);
  mesh_ = marcher_.mesh;
  blunt_cells_ = Sharpener(field, views, lattice, owner_, changes, memory_, mesh_).run();
  memory_.end_call();
  node_ = std::move(present);
  made_ = true;
  count_kept();
  return mesh_;
}

double CreaseMarcher::error(const Executor& executor) {
  const double feature = field_->feature_size();
  const bool other = std::exchange(feature_, feature) != feature;
  if (measured_ && !other) return error_;
  const auto differs = [this](const Box& asked) { return marcher_.memory.view.differs_at(asked); };
  error_ = errors_.measure(*field_, mesh_, last_mesh_, !comparable_ || other, differs, executor);
  measured_ = true;
  return error_;
}

void CreaseMarcher::find_owners(std::span<const FieldView> fields, bool all, const Executor& executor) {
  const std::vector<Vec3>& position = marcher_.mesh.position;
  std::vector<std::uint32_t> found(position.size()), fresh;
  std::size_t known = 0;  // vertices so far
  const auto add_fresh = [&](std::size_t end) {
    for (; known < end; ++known) fresh.push_back(static_cast<std::uint32_t>(known));
  };
  if (!all) {
    for (const march::Run& run : marcher_.scratch.stayed) {
      add_fresh(run.to);
      std::copy_n(owner_.begin() + static_cast<std::ptrdiff_t>(run.from), run.count, found.begin() + static_cast<std::ptrdiff_t>(run.to));
      known = run.to + run.count;
    }
  }
  add_fresh(position.size());
  std::vector<Vec3> points;
  for (const std::uint32_t v : fresh) points.push_back(position[v]);
  const std::vector<std::uint32_t> of_points = owners(fields, points, executor);
  for (std::size_t i = 0; i < fresh.size(); ++i) found[fresh[i]] = of_points[i];
  owner_ = std::move(found);
}

}  // namespace

struct CreaseMesher::Impl {
  explicit Impl(std::uint64_t most_kept) : tried(most_kept) {}

  CreaseMarcher fixed;  ///< of the last mesh without an error
  march::TriedLattices<CreaseMarcher> tried;
  Mesh alone;           ///< where nothing is kept of it

  /// As CubeMesher::Impl::make_to_error
  const Mesh* make_to_error(const Field& field, const MarchOptions& options, const Executor& executor, MarchCounts& count,
                            std::uint64_t most = ~std::uint64_t{0});
};

CreaseMesher::CreaseMesher(std::uint64_t most_kept) : most_kept_(most_kept) {}
CreaseMesher::~CreaseMesher() = default;
CreaseMesher::CreaseMesher(CreaseMesher&&) noexcept = default;
CreaseMesher& CreaseMesher::operator=(CreaseMesher&&) noexcept = default;

const Mesh* CreaseMesher::Impl::make_to_error(const Field& field, const MarchOptions& options, const Executor& executor, MarchCounts& count,
                                              std::uint64_t most) {
  const double first = first_cell(field, options.lattice.cell);
  const Mesh* mesh = nullptr;
  CreaseMarcher* last = nullptr;
  double cell = 0.0;
  std::uint64_t sampled = 0;  // of all meshes
  march::TriedSize size(field, options.lattice.origin, most);
  tried.begin_call();
  tried.search({.error = options.error, .first = first, .stated = first == options.lattice.cell}, [&](int level) {
    cell = spacing_at(first, level);
    if (size.exceeds(level, cell, executor)) return LevelTry{};  // ends the search
    CreaseMarcher& on = tried.use(cell).first;
    last = &on;
    mesh = &on.make(field, {.origin = options.lattice.origin, .cell = cell}, options.skip, executor);
    const double error = on.error(executor);
    count = on.counts();
    count.error = error;
    sampled += count.tiles_sampled;
    size.add(level, *mesh);
    tried.fit(cell);
    return march::try_kept(error, *mesh, on, executor);
  });
  if (size.is_exceeded()) {
    tried.clear();
    return nullptr;
  }
  count.tiles_sampled = sampled;
  const bool fits = tried.end_call(cell);
  count.bytes = fits ? tried.bytes() - march::bytes_of(*mesh) : 0;
  if (fits) return mesh;
  alone = last->take_mesh();
  tried.clear();
  return &alone;
}

const Mesh& CreaseMesher::make(const Field& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts) {
  SUPPLE_EXPECTS(field.packed().blend.rule() == BlendRule::Graph && options.refinements == 0 && options.error >= 0.0);
  if (impl_ == nullptr) impl_ = std::make_unique<Impl>(most_kept_);
  MarchCounts local;
  MarchCounts& count = counts != nullptr ? *counts : local;
  impl_->alone = {};
  if (options.error > 0.0) {
    impl_->fixed = {};
    return *impl_->make_to_error(field, options, executor, count);
  }
  impl_->tried.clear();
  const Mesh& mesh = impl_->fixed.make(field, options.lattice, options.skip, executor);
  count = impl_->fixed.counts();
  return mesh;
}

void CreaseMesher::expect_error(const Field& field, const MarchOptions& options, const Executor& executor, std::uint64_t most_triangles) {
  SUPPLE_EXPECTS(field.packed().blend.rule() == BlendRule::Graph && options.error > 0.0);
  if (impl_ == nullptr) impl_ = std::make_unique<Impl>(most_kept_);
  MarchCounts count;
  (void)impl_->make_to_error(field, options, executor, count, most_triangles);
}

Mesh march_creases(const Field& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts) {
  CreaseMesher mesher;
  return mesher.make(field, options, executor, counts);
}

}  // namespace supple::implicit
