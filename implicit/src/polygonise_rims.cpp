#include "polygonise_rims.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "polygonise_block_edges.h"

namespace supple::implicit::lattice {
namespace {

constexpr std::size_t kPointsPerTask = 64;

/// An edge of facets between a vertex where a third label wins and one where it does not.
struct Crossing {
  std::uint32_t a = 0, b = 0;  ///< its vertices, ascending
  std::uint32_t block = 0;
  std::uint16_t tetrahedron = 0;
  std::uint8_t face = 0;
  bool covered_first = false;  ///< the third label wins at a
  Label low = 0, high = 0, by = 0;

  [[nodiscard]] std::pair<std::uint32_t, std::uint32_t> key() const { return {a, b}; }
};

template <class Three>
LabelSet labels_between(const Three& t) {
  return labels_of(std::array{t.low, t.high, t.by});
}

/// A vertex as a facet sees it.
enum class Side : std::uint8_t { Here, Rim, Covered };

class RimCutter {
 public:
  RimCutter(std::span<const FieldView> fields, std::span<const std::uint8_t> has_mesh, const Lattice& lattice, AllVertices& all,
            std::span<const FacetPart> parts)
      : fields_(fields), has_mesh_(has_mesh), lattice_(lattice), all_(all), parts_(parts) {
    for (std::uint32_t p = 0; p < parts.size(); ++p) {
      for (std::size_t f = 0; f < parts[p].facet.size(); ++f) {
        if (is_covered(parts[p].facet[f])) near_.push_back({p, static_cast<std::uint32_t>(f)});
      }
    }
  }

  /// Where two third labels win at vertices of one triangle, or one next to a junction of others, covered vertices get one place: there
  /// four labels meet within a tetrahedron, and what the third one has between its sheets is closed at that vertex.
  void uncover_mixed() {
    std::vector<std::uint32_t> mixed;
    do {  // one with one place is a junction to its neighbours
      mixed.clear();
      for (const Place& place : near_) {
        const Facet& facet = parts_[place.part].facet[place.facet];
        if (is_mixed(facet)) mixed.insert(mixed.end(), facet.vertex.begin(), facet.vertex.end());
      }
      for (const std::uint32_t v : mixed) uncover(v);
    } while (!mixed.empty());
  }

  /// Where sheets on either side of a third label would cross within a tetrahedron, its covered vertices get one place as well.
  /// @return whether there were any
  bool uncover_tangles() {
    std::vector<std::uint32_t> tangled;
    std::vector<Facet> pieces;
    Place last{kNoBody, 0};  // where the tetrahedron ends that was looked at last
    for (const Place& place : near_) {
      if (place.part == last.part && place.facet < last.facet) continue;
      const std::vector<Facet>& facets = parts_[place.part].facet;
      std::size_t begin = place.facet, end = begin + 1;
      while (begin > 0 && facets[begin - 1].tetrahedron == facets[place.facet].tetrahedron) --begin;
      while (end < facets.size() && facets[end].tetrahedron == facets[place.facet].tetrahedron) ++end;
      last = {place.part, static_cast<std::uint32_t>(end)};
      pieces.clear();
      for (std::size_t f = begin; f < end; ++f) cut(facets[f], pieces);
      if (!cross(pieces)) continue;
      for (std::size_t f = begin; f < end; ++f) tangled.insert(tangled.end(), facets[f].vertex.begin(), facets[f].vertex.end());
    }
    bool any = false;
    for (const std::uint32_t v : tangled) any = uncover(v) || any;
    return any;
  }

  void find_crossings() {
    crossing_.clear();
    for (const Place& at : near_) {
      const FacetPart& part = parts_[at.part];
      const Facet& facet = part.facet[at.facet];
      const auto block = part.first_block + static_cast<std::uint32_t>(std::upper_bound(part.end.begin(), part.end.end(), at.facet) - part.end.begin());
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = facet.vertex[k], b = facet.vertex[(k + 1) % 3];
        const Side side_a = side(facet, a), side_b = side(facet, b);
        if (side_a == side_b || side_a == Side::Rim || side_b == Side::Rim) continue;
        const Cover& cover = *covered(facet, side_a == Side::Covered ? a : b);
        crossing_.push_back({std::min(a, b), std::max(a, b), block, facet.tetrahedron, static_cast<std::uint8_t>(facet.face(k)),
                             (side_a == Side::Covered) == (a < b), cover.low, cover.high, cover.by});
      }
    }
    std::stable_sort(crossing_.begin(), crossing_.end(), [](const Crossing& x, const Crossing& y) { return x.key() < y.key(); });
    const auto same = [](const Crossing& x, const Crossing& y) { return x.key() == y.key(); };
    crossing_.erase(std::unique(crossing_.begin(), crossing_.end(), same), crossing_.end());
  }

  void add_vertices(const Executor& executor, PolygoniseCounts& counts) {
    first_ = static_cast<std::uint32_t>(all_.use_end.size());
    counts.rim_points = counts.rim_points_moved = 0;
    std::vector<Junction> found(crossing_.size());
    executor.for_blocks(crossing_.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) found[i] = solve(crossing_[i]);
    });
    for (std::size_t i = 0; i < crossing_.size(); ++i) {
      const LabelSet labels = labels_between(crossing_[i]);
      ++counts.rim_points;
      if (!found[i].exact) ++counts.rim_points_moved;
      counts.residual = std::max(counts.residual, found[i].residual);
      add_uses(labels, found[i].point);
      all_.use_end.push_back(static_cast<std::uint32_t>(all_.use.size()));
      all_.kind.push_back(VertexKind::Junction);
    }
  }

  /// Bodies that no triangle shows at an uncovered vertex do not have it.
  void drop_unused() {
    if (std::find(all_.kind.begin(), all_.kind.end(), VertexKind::Uncovered) == all_.kind.end()) return;
    std::vector<std::uint8_t> used(all_.use.size());
    for (const FacetPart& part : parts_) {
      for (const Facet& facet : part.facet) {
        for (const std::uint32_t v : facet.vertex) {
          if (all_.kind[v] != VertexKind::Uncovered) continue;
          for (const VertexUse& use : all_.uses_of(v)) {
            if (use.body + 1 == facet.inner || use.body + 1 == facet.outer) used[static_cast<std::size_t>(&use - all_.use.data())] = 1;
          }
        }
      }
    }
    for (const Cover& cover : all_.cover) {
      if (all_.kind[cover.vertex] != VertexKind::Uncovered) continue;
      for (VertexUse& use : all_.uses_of(cover.vertex)) {
        if (used[static_cast<std::size_t>(&use - all_.use.data())] == 0) use.body = kNoBody;
      }
    }
  }

  void remove_vertices() {
    all_.use_end.resize(first_);
    all_.kind.resize(first_);
    all_.use.resize(first_ == 0 ? 0 : all_.use_end.back());
  }

  void cut(FacetPart& part) const {
    if (std::none_of(part.facet.begin(), part.facet.end(), [&](const Facet& facet) { return is_covered(facet); })) return;
    std::vector<Facet> out;
    out.reserve(part.facet.size());
    for (const Facet& facet : part.facet) {
      if (is_covered(facet)) {
        cut(facet, out);
      } else {
        out.push_back(facet);
      }
    }
    part.facet = std::move(out);
  }

 private:
  using Polygon = std::vector<std::uint32_t>;
  struct Place {
    std::uint32_t part, facet;
  };

  [[nodiscard]] bool is_covered(const Facet& facet) const {
    return std::any_of(facet.vertex.begin(), facet.vertex.end(),
                       [&](std::uint32_t v) { return all_.kind[v] == VertexKind::Covered; });
  }
  [[nodiscard]] bool is_mixed(const Facet& facet) const {
    const Cover* first = nullptr;
    for (const std::uint32_t v : facet.vertex) {
      const Cover* cover = covered(facet, v);
      if (cover != nullptr && first != nullptr && cover->by != first->by) return true;
      if (cover != nullptr) first = cover;
    }
    if (first == nullptr || first->by == 0) return false;
    std::size_t rim = 0;
    for (const std::uint32_t v : facet.vertex) {
      if (side(facet, v) != Side::Rim) continue;
      if (!is_used(v, first->by)) return true;
      ++rim;
    }
    return rim > 1;  // more than two sheets of the third label would meet in their edge
  }
  /// @pre the vertex has one
  [[nodiscard]] const Cover& cover_of(std::uint32_t vertex) const {
    return *std::lower_bound(all_.cover.begin(), all_.cover.end(), vertex,
                             [](const Cover& cover, std::uint32_t v) { return cover.vertex < v; });
  }
  [[nodiscard]] const Cover* covered(const Facet& facet, std::uint32_t vertex) const {
    if (all_.kind[vertex] != VertexKind::Covered) return nullptr;
    const Cover& cover = cover_of(vertex);
    const auto [low, high] = std::minmax(facet.inner, facet.outer);
    return cover.low == low && cover.high == high ? &cover : nullptr;
  }
  [[nodiscard]] Side side(const Facet& facet, std::uint32_t vertex) const {
    if (all_.kind[vertex] == VertexKind::Junction || all_.kind[vertex] == VertexKind::Uncovered) return Side::Rim;
    return covered(facet, vertex) != nullptr ? Side::Covered : Side::Here;
  }
  [[nodiscard]] std::uint32_t body_of(Label a, Label b) const { return (a != 0 && has_mesh_[a - 1] != 0 ? a : b) - 1; }
  [[nodiscard]] const Vec3& position(std::uint32_t vertex, Label inner, Label outer) const {
    const std::uint32_t body = body_of(inner, outer);
    return all_.use_of(vertex, body, body + 1 == inner ? outer : inner).position;
  }
  [[nodiscard]] double value(Label label, const Vec3& point) const {
    return label == 0 ? 0.0 : fields_[label - 1].value(point);
  }

  /// Does a label's body, if it has a mesh, see the vertex?
  [[nodiscard]] bool is_used(std::uint32_t vertex, Label label) const {
    if (label == 0 || has_mesh_[label - 1] == 0) return true;
    const auto uses = all_.uses_of(vertex);
    return std::any_of(uses.begin(), uses.end(), [&](const VertexUse& use) { return use.body + 1 == label; });
  }

  /// @return whether it was covered
  bool uncover(std::uint32_t vertex) {
    if (all_.kind[vertex] != VertexKind::Covered) return false;
    all_.kind[vertex] = VertexKind::Uncovered;
    const Cover& cover = cover_of(vertex);
    const LabelSet labels = labels_between(cover);
    std::uint32_t last = kNoBody;
    for (VertexUse& use : all_.uses_of(vertex)) {
      use.other = kAnyLabel;
      if (use.body == last) {
        use.body = kNoBody;
        continue;
      }
      last = use.body;
      if (cover.by == 0) continue;  // bodies apart keep their own
      use.position = cover.point;
      const Label label = use.body + 1;
      use.contact = label == cover.low ? cover.high : label == cover.high || cover.low == 0 ? cover.low : contact_of(labels, use.body);
    }
    return true;
  }

  /// The lowest other body.
  static std::uint32_t contact_of(const LabelSet& labels, std::uint32_t body) {
    for (const Label label : labels.view()) {
      if (label != 0 && label != body + 1) return label;
    }
    return 0;
  }

  void add_uses(const LabelSet& labels, const Vec3& point) {
    for (const Label label : labels.view()) {
      if (label == 0 || has_mesh_[label - 1] == 0) continue;
      all_.use.push_back({.body = label - 1, .contact = contact_of(labels, label - 1),
                          .normal = normal_at(fields_, labels, label - 1, point), .position = point});
    }
  }

  [[nodiscard]] Junction solve(const Crossing& c) const {
    const LabelSet labels = labels_between(c);
    const Simplex simplex = simplex_of(c);
    const Vec3& here = place(c.covered_first ? c.b : c.a, c);
    const Vec3& there = place(c.covered_first ? c.a : c.b, c);
    const auto lead = [&](const Vec3& p) { return value(c.by, p) - (c.low == 0 ? 0.0 : value(c.high, p)); };
    const double before = lead(here), after = lead(there);
    const double linear = before < 0.0 && after > 0.0 ? before / (before - after) : 0.5;
    double scale = 0.0;
    for (const Label label : labels.view()) scale += std::abs(value(label, here)) + std::abs(value(label, there));
    for (const double t : {linear, 0.25, 0.75}) {
      const Junction found = meet_inside(fields_, simplex, labels, here + t * (there - here), scale);
      if (found.exact) return found;
    }
    if (const Junction found = search_inside(fields_, simplex, labels, scale); found.exact) return found;
    return {.point = here + std::clamp(linear, 0.05, 0.95) * (there - here), .residual = 0.0, .exact = false};
  }

  /// Where a vertex of a crossing lies before it parts.
  [[nodiscard]] const Vec3& place(std::uint32_t vertex, const Crossing& c) const {
    if (all_.kind[vertex] == VertexKind::Covered) {
      const Cover& cover = cover_of(vertex);
      if (cover.low == c.low && cover.high == c.high) return cover.point;
    }
    return position(vertex, c.high, c.low);
  }

  /// The face or the tetrahedron that holds an edge.
  [[nodiscard]] Simplex simplex_of(const Crossing& c) const {
    const BlockCoord& block = all_.block[c.block].coord;
    const int cell = c.tetrahedron / 6;
    const std::int64_t x = std::int64_t{kCells} * block[0] + cell % kCells, y = std::int64_t{kCells} * block[1] + cell / kCells % kCells,
                       z = std::int64_t{kCells} * block[2] + cell / (kCells * kCells);
    Simplex s{.low = node_position(lattice_, x, y, z), .high = node_position(lattice_, x + 1, y + 1, z + 1), .corner = {}, .label = {}, .size = 0};
    for (unsigned v = 0; v < 4; ++v) {
      if (v != c.face) s.corner[s.size++] = kTetrahedra[c.tetrahedron % 6u][v];
    }
    return s;
  }

  /// The vertex between two others, if there is one.
  void insert_between(std::uint32_t a, std::uint32_t b, Polygon& polygon) const {
    const auto key = std::minmax(a, b);
    const auto at = std::lower_bound(crossing_.begin(), crossing_.end(), std::pair(key.first, key.second),
                                     [](const Crossing& c, const std::pair<std::uint32_t, std::uint32_t>& k) { return c.key() < k; });
    if (at != crossing_.end() && at->key() == std::pair(key.first, key.second)) {
      polygon.push_back(first_ + static_cast<std::uint32_t>(at - crossing_.begin()));
    }
  }

  void cut(const Facet& facet, std::vector<Facet>& out) const {
    Polygon here, beyond;
    Label by = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = facet.vertex[k], w = facet.vertex[(k + 1) % 3];
      const Side from = side(facet, v), to = side(facet, w);
      if (from != Side::Covered) here.push_back(v);
      if (from != Side::Here) beyond.push_back(v);
      if (from == Side::Covered) by = covered(facet, v)->by;
      const std::size_t before = here.size();
      insert_between(v, w, here);
      if (here.size() > before && from != to) beyond.push_back(here.back());
    }
    if (here.size() >= 3) add(here, facet.inner, facet.outer, out);
    if (beyond.size() >= 3) {
      add(beyond, facet.inner, by, out);
      add(beyond, by, facet.outer, out);
    }
  }

  /// Do triangles of one body cross?
  [[nodiscard]] bool cross(std::span<const Facet> facets) const {
    for (std::size_t i = 0; i < facets.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        for (const Label label : {facets[i].inner, facets[i].outer}) {
          if (label == 0 || has_mesh_[label - 1] == 0 || (label != facets[j].inner && label != facets[j].outer)) continue;
          const auto a = corners(facets[i], label), b = corners(facets[j], label);
          if (pierces(a, b) || pierces(b, a)) return true;
        }
      }
    }
    return false;
  }
  using Corners = std::array<const VertexUse*, 3>;
  [[nodiscard]] Corners corners(const Facet& facet, Label label) const {
    const Label other = label == facet.inner ? facet.outer : facet.inner;
    const auto& v = facet.vertex;
    return {&all_.use_of(v[0], label - 1, other), &all_.use_of(v[1], label - 1, other), &all_.use_of(v[2], label - 1, other)};
  }
  /// Does an edge of s that has no vertex in common with t pass through it, by more than rounding?
  static bool pierces(const Corners& s, const Corners& t) {
    const auto volume = [](const VertexUse* a, const VertexUse* b, const VertexUse* c, const VertexUse* d) {
      return (b->position - a->position).cross(c->position - a->position).dot(d->position - a->position);
    };
    for (std::size_t k = 0; k < 3; ++k) {
      const VertexUse *p = s[k], *q = s[(k + 1) % 3];
      if (std::find(t.begin(), t.end(), p) != t.end() || std::find(t.begin(), t.end(), q) != t.end()) continue;
      const double size = std::max({(q->position - p->position).norm(), (t[1]->position - t[0]->position).norm(),
                                    (t[2]->position - t[0]->position).norm()});
      const double least = 1e-12 * size * size * size;
      const auto side = [&](double v) { return v > least ? 1 : v < -least ? -1 : 0; };
      const int start = side(volume(t[0], t[1], t[2], p)), around = side(volume(p, q, t[0], t[1]));
      if (start == 0 || side(volume(t[0], t[1], t[2], q)) != -start || around == 0) continue;
      if (around == side(volume(p, q, t[1], t[2])) && around == side(volume(p, q, t[2], t[0]))) return true;
    }
    return false;
  }

  /// The fan of a polygon whose smallest triangle is the largest, facing from one label to another.
  void add(const Polygon& polygon, Label from, Label to, std::vector<Facet>& out) const {
    const bool wanted = (from != 0 && has_mesh_[from - 1] != 0) || (to != 0 && has_mesh_[to - 1] != 0);
    if (!wanted) return;
    const std::size_t n = polygon.size();
    std::size_t best = 0;
    double most = -1.0;
    for (std::size_t apex = 0; n > 3 && apex < n; ++apex) {
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t d = 1; d + 1 < n; ++d) {
        const Vec3 &p = position(polygon[apex], from, to), &q = position(polygon[(apex + d) % n], from, to),
                   &r = position(polygon[(apex + d + 1) % n], from, to);
        least = std::min(least, (q - p).cross(r - p).norm());
      }
      if (least <= most) continue;
      most = least;
      best = apex;
    }
    for (std::size_t d = 1; d + 1 < n; ++d) {
      Facet facet{.inner = from, .outer = to, .vertex = {polygon[best], polygon[(best + d) % n], polygon[(best + d + 1) % n]}};
      if (from == 0) {
        std::swap(facet.inner, facet.outer);
        std::swap(facet.vertex[1], facet.vertex[2]);
      }
      out.push_back(facet);
    }
  }

  std::span<const FieldView> fields_;
  std::span<const std::uint8_t> has_mesh_;
  Lattice lattice_;
  AllVertices& all_;
  std::span<const FacetPart> parts_;
  std::vector<Place> near_;         ///< facets with a covered vertex
  std::vector<Crossing> crossing_;  ///< by vertices, ascending
  std::uint32_t first_ = 0;         ///< vertex of the first of them
};

}  // namespace

void cut_at_rims(std::span<const FieldView> fields, std::span<const std::uint8_t> has_mesh, const Lattice& lattice,
                 const Executor& executor, AllVertices& all, std::span<FacetPart> parts, PolygoniseCounts& counts) {
  if (all.cover.empty()) return;
  RimCutter cutter(fields, has_mesh, lattice, all, parts);
  expect_indexable(all.use.size() + 8 * all.cover.size(), lattice);
  cutter.uncover_mixed();
  for (;;) {  // ends when nothing is covered at the latest
    cutter.find_crossings();
    cutter.add_vertices(executor, counts);
    if (!cutter.uncover_tangles()) break;
    cutter.remove_vertices();
    cutter.uncover_mixed();
  }
  executor.for_blocks(parts.size(), 1, [&](std::size_t p, std::size_t) { cutter.cut(parts[p]); });
  cutter.drop_unused();
}

}  // namespace supple::implicit::lattice
