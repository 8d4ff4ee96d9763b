#include "polygonise_rims.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "polygonise_block_edges.h"

namespace supple::implicit::lattice {
namespace {

constexpr std::size_t kPointsPerTask = 64;

/// A point where three labels meet on an edge of facets: between a vertex where a third label wins and one where it does not, or between
/// two vertices where others win.
struct Crossing {
  std::uint32_t a = 0, b = 0;  ///< its vertices, ascending
  LabelSet labels;
  std::uint32_t block = 0;
  std::uint16_t tetrahedron = 0;
  std::uint8_t face = 0;
  Label minus = 0, plus = 0;                       ///< F_plus - F_minus changes its sign
  Vec3 here = Vec3::Zero(), there = Vec3::Zero();  ///< from where it is negative, on the interface of the two other labels, or of each
  Junction found{};

  [[nodiscard]] auto key() const { return std::tuple(a, b, labels.label); }
};

/// An edge of facets between labels low and high with ends where two different labels win.
struct TwiceCovered {
  enum class Kind : std::uint8_t { Unknown, Apart, Touching };  ///< Apart: low and high meet between them
  std::uint32_t a = 0, b = 0;                                   ///< its vertices, ascending
  Label low = 0, high = 0, at_a = 0, at_b = 0;
  std::uint32_t block = 0;
  std::uint16_t tetrahedron = 0;
  std::uint8_t face = 0;
  Kind kind = Kind::Unknown;

  [[nodiscard]] auto key() const { return std::tuple(a, b, low, high); }
};

/// A vertex as a facet sees it beside the label that covers others of its vertices.
enum class Side : std::uint8_t { Here, Rim, Covered };

class RimCutter {
 public:
  RimCutter(std::span<const FieldView> fields, std::span<const std::uint8_t> has_mesh, const Lattice& lattice, AllVertices& all,
            std::span<const FacetPart> parts)
      : fields_(fields), has_mesh_(has_mesh), lattice_(lattice), all_(all), parts_(parts), place_(all.kind.size()) {
    for (std::uint32_t c = 0; c < all.cover.size(); ++c) place_[all.cover[c].vertex] = c;
    for (std::uint32_t m = 0; m < all.meeting.size(); ++m) place_[all.meeting[m].vertex] = m;
    for (std::uint32_t p = 0; p < parts.size(); ++p) {
      for (std::size_t f = 0; f < parts[p].facet.size(); ++f) {
        const Place at{p, static_cast<std::uint32_t>(f)};
        const bool near = is_covered(parts[p].facet[f]);
        if (near) near_.push_back(at);
        if (near || has_edge_of_rims(parts[p].facet[f])) beside_.push_back(at);
      }
    }
  }

  /// Where vertices of one triangle do not tell how it is cut, covered vertices get one place: what the third label has between its sheets
  /// is closed at that vertex.
  void uncover_mixed() {
    std::vector<std::uint32_t> mixed;
    do {  // one with one place is a junction to its neighbours
      mixed.clear();
      for (const Place& place : near_) {
        const Facet& facet = facet_at(place);
        if (is_mixed(facet)) mixed.insert(mixed.end(), facet.vertex.begin(), facet.vertex.end());
      }
      find_loose(mixed);
      for (const std::uint32_t v : mixed) uncover(v);
    } while (!mixed.empty());
  }

  /// The same where points on the edges of a facet do not tell how it is cut, where sheets on either side of a third label would cross
  /// within a tetrahedron, and where more than two of a body would meet in an edge. @return whether there were any
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
      bool clear = true;
      for (std::size_t f = begin; f < end && clear; ++f) clear = cut(facets[f], pieces);
      if (clear && !cross(pieces)) continue;
      for (std::size_t f = begin; f < end; ++f) tangled.insert(tangled.end(), facets[f].vertex.begin(), facets[f].vertex.end());
    }
    if (tangled.empty()) find_crowded(tangled);
    bool any = false;
    for (const std::uint32_t v : tangled) any = uncover(v) || any;
    return any;
  }

  void find_crossings(const Executor& executor) {
    crossing_.clear();
    twice_.clear();
    for (const Place& at : near_) {
      const FacetPart& part = parts_[at.part];
      const Facet& facet = part.facet[at.facet];
      const auto block = part.first_block + static_cast<std::uint32_t>(std::upper_bound(part.end.begin(), part.end.end(), at.facet) - part.end.begin());
      const auto [low, high] = std::minmax(facet.inner, facet.outer);
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [a, b] = std::minmax(facet.vertex[k], facet.vertex[(k + 1) % 3]);
        const Cover *cover_a = covered(facet, a), *cover_b = covered(facet, b);
        if (cover_a == nullptr && cover_b == nullptr) continue;
        const auto face = static_cast<std::uint8_t>(facet.face(k));
        if (cover_a != nullptr && cover_b != nullptr) {
          if (cover_a->by != cover_b->by) {
            twice_.push_back({.a = a, .b = b, .low = low, .high = high, .at_a = cover_a->by, .at_b = cover_b->by, .block = block,
                              .tetrahedron = facet.tetrahedron, .face = face});
          }
          continue;
        }
        const Label by = cover_a != nullptr ? cover_a->by : cover_b->by;
        if (side(facet, cover_a != nullptr ? b : a, by) != Side::Here) continue;
        crossing_.push_back(lone_crossing(a, b, low, high, by, cover_b != nullptr, {block, facet.tetrahedron, face}));
      }
    }
    sort_crossings();
    const auto before = [](const TwiceCovered& x, const TwiceCovered& y) { return x.key() < y.key(); };
    std::stable_sort(twice_.begin(), twice_.end(), before);
    const auto same = [](const TwiceCovered& x, const TwiceCovered& y) { return x.key() == y.key(); };
    twice_.erase(std::unique(twice_.begin(), twice_.end(), same), twice_.end());
    executor.for_blocks(crossing_.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) solve(crossing_[i]);
    });
    std::vector<std::array<Crossing, 2>> found(twice_.size());
    executor.for_blocks(twice_.size(), kPointsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) found[i] = look_between(twice_[i]);
    });
    for (std::size_t i = 0; i < twice_.size(); ++i) {
      if (twice_[i].kind != TwiceCovered::Kind::Unknown) crossing_.insert(crossing_.end(), found[i].begin(), found[i].end());
    }
    sort_crossings();
  }

  void add_vertices(PolygoniseCounts& counts) {
    first_ = static_cast<std::uint32_t>(all_.use_end.size());
    counts.rim_points = counts.rim_points_moved = 0;
    for (const Crossing& c : crossing_) {
      ++counts.rim_points;
      if (!c.found.exact) ++counts.rim_points_moved;
      counts.residual = std::max(counts.residual, c.found.residual);
      add_uses(c.labels, c.found.point);
      all_.use_end.push_back(static_cast<std::uint32_t>(all_.use.size()));
      all_.kind.push_back(VertexKind::Junction);
    }
  }

  /// Bodies that no triangle shows at a vertex do not have it: at uncovered ones, and where a fourth body meets three in their tetrahedron.
  void drop_unused() {
    std::vector<std::uint32_t> doubtful;
    for (const Cover& cover : all_.cover) {
      if (all_.kind[cover.vertex] == VertexKind::Uncovered) doubtful.push_back(cover.vertex);
    }
    for (const Meeting& meeting : all_.meeting) {
      if (meeting.labels.count == 4) doubtful.push_back(meeting.vertex);
    }
    if (doubtful.empty()) return;
    std::sort(doubtful.begin(), doubtful.end());
    std::vector<std::uint8_t> used(all_.use.size());
    for (const FacetPart& part : parts_) {
      for (const Facet& facet : part.facet) {
        for (const std::uint32_t v : facet.vertex) {
          if (all_.kind[v] == VertexKind::Edge || !std::binary_search(doubtful.begin(), doubtful.end(), v)) continue;
          for (const VertexUse& use : all_.uses_of(v)) {
            if (use.body + 1 == facet.inner || use.body + 1 == facet.outer) used[static_cast<std::size_t>(&use - all_.use.data())] = 1;
          }
        }
      }
    }
    for (const std::uint32_t v : doubtful) {
      for (VertexUse& use : all_.uses_of(v)) {
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
        (void)cut(facet, out);
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

  /// Adds what a label covers without being next to it in any tetrahedron, where it would hang on single vertices.
  void find_loose(std::vector<std::uint32_t>& mixed) const {
    std::vector<std::uint32_t> parent(all_.cover.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](std::uint32_t c) {
      while (parent[c] != c) c = parent[c] = parent[parent[c]];
      return c;
    };
    const auto for_covered = [&](const auto& use) {  // vertices of facets that are covered, whether or not for the facet's labels
      for (const Place& place : near_) {
        const Facet& facet = facet_at(place);
        for (const std::uint32_t v : facet.vertex) {
          if (all_.kind[v] == VertexKind::Covered) use(facet, v, place_[v]);
        }
      }
    };
    for_covered([&](const Facet& facet, std::uint32_t v, std::uint32_t c) {
      if (covered(facet, v) == nullptr) return;
      for (const std::uint32_t w : facet.vertex) {
        const Cover* other = covered(facet, w);
        if (other != nullptr && other->by == all_.cover[c].by) parent[std::max(root(c), root(place_[w]))] = std::min(root(c), root(place_[w]));
      }
    });
    std::vector<std::uint8_t> held(all_.cover.size()), hangs(all_.cover.size());
    for_covered([&](const Facet& facet, std::uint32_t v, std::uint32_t c) {
      const Label by = all_.cover[c].by;
      if (facet.inner == by || facet.outer == by) held[root(c)] = 1;
      if (covered(facet, v) == nullptr) return;
      for (const std::uint32_t w : facet.vertex) {
        if (side(facet, w, by) == Side::Rim) hangs[root(c)] = 1;
      }
    });
    for (std::uint32_t c = 0; c < all_.cover.size(); ++c) {
      if (all_.kind[all_.cover[c].vertex] != VertexKind::Covered || all_.cover[c].by == 0) continue;
      if (hangs[root(c)] != 0 && held[root(c)] == 0) mixed.push_back(all_.cover[c].vertex);
    }
  }

  [[nodiscard]] const Facet& facet_at(const Place& place) const { return parts_[place.part].facet[place.facet]; }
  /// Can rims ever run along an edge of it?
  [[nodiscard]] bool has_edge_of_rims(const Facet& facet) const {
    return std::count_if(facet.vertex.begin(), facet.vertex.end(), [&](std::uint32_t v) { return all_.kind[v] != VertexKind::Edge; }) > 1;
  }
  [[nodiscard]] bool is_covered(const Facet& facet) const {
    return std::any_of(facet.vertex.begin(), facet.vertex.end(),
                       [&](std::uint32_t v) { return all_.kind[v] == VertexKind::Covered; });
  }
  [[nodiscard]] bool is_mixed(const Facet& facet) const {
    const Covering covering = covering_of(facet);
    if (covering.count > 2) return true;
    std::size_t whole = 0, all_parted = 0;
    for (const std::uint32_t v : facet.vertex) {
      const Cover* cover = covered(facet, v);
      const VertexKind kind = all_.kind[v];
      all_parted += cover != nullptr && cover->between.count > 2 ? 1 : 0;
      if (kind != VertexKind::Junction && kind != VertexKind::Uncovered) continue;
      for (std::size_t c = 0; c < covering.count; ++c) whole += side(facet, v, covering.by[c]) == Side::Here ? 1 : 0;
    }
    // Where three labels are parted at one end of the edge in which they meet, and not at the other, all four meet on it.
    if (whole > 0 && all_parted > 0) return true;
    return false;
  }

  /// Adds the vertices of facets of which more than two pieces of one body would meet in an edge between rims.
  void find_crowded(std::vector<std::uint32_t>& crowded) const {
    struct Edge {
      const VertexUse *a, *b;
      std::uint32_t facet;  ///< of `beside_`
      [[nodiscard]] auto key() const { return std::pair(a, b); }
    };
    const auto on_rim = [&](std::uint32_t v) { return v >= first_ || all_.kind[v] != VertexKind::Edge; };
    std::vector<Edge> edges;
    std::vector<Facet> pieces;
    for (std::uint32_t f = 0; f < beside_.size(); ++f) {
      pieces.clear();
      (void)cut(facet_at(beside_[f]), pieces);
      for (const Facet& piece : pieces) {
        for (std::size_t k = 0; k < 3; ++k) {
          const std::uint32_t a = piece.vertex[k], b = piece.vertex[(k + 1) % 3];
          if (!on_rim(a) || !on_rim(b)) continue;
          for (const auto& [own, other] : {std::pair(piece.inner, piece.outer), std::pair(piece.outer, piece.inner)}) {
            if (own == 0 || has_mesh_[own - 1] == 0) continue;
            const VertexUse *u = &all_.use_of(a, own - 1, other), *v = &all_.use_of(b, own - 1, other);
            edges.push_back({std::min(u, v), std::max(u, v), f});
          }
        }
      }
    }
    std::stable_sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) { return x.key() < y.key(); });
    for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
      while (end < edges.size() && edges[end].key() == edges[begin].key()) ++end;
      for (std::size_t i = begin; i < end && end - begin > 2; ++i) {
        const auto& v = facet_at(beside_[edges[i].facet]).vertex;
        crowded.insert(crowded.end(), v.begin(), v.end());
      }
    }
  }

  /// @pre the vertex has one
  [[nodiscard]] const Cover& cover_of(std::uint32_t vertex) const { return all_.cover[place_[vertex]]; }
  [[nodiscard]] const Cover* covered(const Facet& facet, std::uint32_t vertex) const {
    if (all_.kind[vertex] != VertexKind::Covered) return nullptr;
    const Cover& cover = cover_of(vertex);
    return cover.parts(facet.inner, facet.outer) ? &cover : nullptr;
  }
  /// The labels that win at vertices of a facet.
  struct Covering {
    std::array<Label, 3> by{};
    std::size_t count = 0;
  };
  [[nodiscard]] Covering covering_of(const Facet& facet) const {
    Covering covering;
    for (const std::uint32_t v : facet.vertex) {
      const Cover* cover = covered(facet, v);
      if (cover == nullptr || std::find(covering.by.begin(), covering.by.begin() + covering.count, cover->by) != covering.by.begin() + covering.count) continue;
      covering.by[covering.count++] = cover->by;
    }
    return covering;
  }
  /// What meets at a vertex; nothing at one of an edge.
  [[nodiscard]] LabelSet labels_at(std::uint32_t vertex) const {
    switch (all_.kind[vertex]) {
      case VertexKind::Junction: return all_.meeting[place_[vertex]].labels;
      case VertexKind::Uncovered:
      case VertexKind::Covered: return cover_of(vertex).between.with(cover_of(vertex).by);
      case VertexKind::Edge: break;
    }
    return {};
  }
  [[nodiscard]] Side side(const Facet& facet, std::uint32_t vertex, Label by) const {
    if (covered(facet, vertex) != nullptr) return Side::Covered;
    const VertexKind kind = all_.kind[vertex];
    return (kind == VertexKind::Junction || kind == VertexKind::Uncovered) && labels_at(vertex).has(by) ? Side::Rim : Side::Here;
  }
  /// Does a body with a mesh lie on one side?
  [[nodiscard]] bool is_wanted(Label a, Label b) const { return (a != 0 && has_mesh_[a - 1] != 0) || (b != 0 && has_mesh_[b - 1] != 0); }
  [[nodiscard]] std::uint32_t body_of(Label a, Label b) const { return (a != 0 && has_mesh_[a - 1] != 0 ? a : b) - 1; }
  [[nodiscard]] const Vec3& position(std::uint32_t vertex, Label inner, Label outer) const {
    const std::uint32_t body = body_of(inner, outer);
    return all_.use_of(vertex, body, body + 1 == inner ? outer : inner).position;
  }
  [[nodiscard]] double value(Label label, const Vec3& point) const {
    return label == 0 ? 0.0 : fields_[label - 1].value(point);
  }

  /// @return whether it was covered
  bool uncover(std::uint32_t vertex) {
    if (all_.kind[vertex] != VertexKind::Covered) return false;
    all_.kind[vertex] = VertexKind::Uncovered;
    const Cover& cover = cover_of(vertex);
    const LabelSet between = cover.between, labels = between.with(cover.by);
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
      use.contact = contact_of(between.has(use.body + 1) ? between : labels, use.body);
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

  struct EdgePlace {
    std::uint32_t block;
    std::uint16_t tetrahedron;
    std::uint8_t face;
  };
  /// Where a label begins to win on the interface of two others, between vertices a and b.
  [[nodiscard]] Crossing lone_crossing(std::uint32_t a, std::uint32_t b, Label low, Label high, Label by, bool wins_at_b, const EdgePlace& at) const {
    const std::uint32_t from = wins_at_b ? a : b, to = wins_at_b ? b : a;
    return {.a = a, .b = b, .labels = labels_of(std::array{low, high, by}), .block = at.block, .tetrahedron = at.tetrahedron, .face = at.face,
            .minus = low == 0 ? 0 : high, .plus = by, .here = place(from, low, high), .there = place(to, low, high)};
  }
  /// Where the labels that win at the ends meet on the interface with one more label, `beside`.
  [[nodiscard]] Crossing touching(const TwiceCovered& t, Label beside) const {
    const auto start = [&](std::uint32_t v, Label by) { return is_wanted(by, beside) ? position(v, by, beside) : cover_of(v).point; };
    return {.a = t.a, .b = t.b, .labels = labels_of(std::array{beside, t.at_a, t.at_b}), .block = t.block, .tetrahedron = t.tetrahedron,
            .face = t.face, .minus = t.at_a, .plus = t.at_b, .here = start(t.a, t.at_a), .there = start(t.b, t.at_b)};
  }

  /// Which of the ways to part an edge is there: both of its points are exact, and none of the four labels wins there.
  [[nodiscard]] std::array<Crossing, 2> look_between(TwiceCovered& t) const {
    const auto holds = [&](const Crossing& c, Label other) {
      return c.found.exact && !(value(other, c.found.point) > level(c.labels, c.found.point));
    };
    std::array<Crossing, 2> points{touching(t, t.low), touching(t, t.high)};
    for (Crossing& c : points) solve(c);
    if (holds(points[0], t.high) && holds(points[1], t.low)) {
      t.kind = TwiceCovered::Kind::Touching;
      return points;
    }
    const auto whole = [&](std::uint32_t v, Label by) { return cover_of(v).between.has(by); };
    if (whole(t.a, t.at_b) || whole(t.b, t.at_a)) return points;  // what one end parts the other parts from more
    const EdgePlace at{t.block, t.tetrahedron, t.face};
    points = {lone_crossing(t.a, t.b, t.low, t.high, t.at_a, false, at), lone_crossing(t.a, t.b, t.low, t.high, t.at_b, true, at)};
    for (Crossing& c : points) solve(c);
    if (holds(points[0], t.at_b) && holds(points[1], t.at_a)) t.kind = TwiceCovered::Kind::Apart;
    return points;
  }

  /// The value at a point where labels meet.
  [[nodiscard]] double level(const LabelSet& labels, const Vec3& point) const {
    double largest = -std::numeric_limits<double>::infinity();
    for (const Label l : labels.view()) largest = std::max(largest, value(l, point));
    return largest;
  }

  void solve(Crossing& c) const {
    const Simplex simplex = simplex_of(c);
    const auto lead = [&](const Vec3& p) { return value(c.plus, p) - value(c.minus, p); };
    const double before = lead(c.here), after = lead(c.there);
    const double linear = before < 0.0 && after > 0.0 ? before / (before - after) : 0.5;
    double scale = 0.0;
    for (const Label label : c.labels.view()) scale += std::abs(value(label, c.here)) + std::abs(value(label, c.there));
    for (const double t : {linear, 0.25, 0.75}) {
      c.found = meet_inside(fields_, simplex, c.labels, c.here + t * (c.there - c.here), scale);
      if (c.found.exact) return;
    }
    c.found = search_inside(fields_, simplex, c.labels, scale);
    if (c.found.exact) return;
    c.found = {.point = c.here + std::clamp(linear, 0.05, 0.95) * (c.there - c.here), .residual = 0.0, .exact = false};
  }

  /// Where a vertex lies between two labels, before it parts.
  [[nodiscard]] const Vec3& place(std::uint32_t vertex, Label low, Label high) const {
    if (all_.kind[vertex] == VertexKind::Covered) {
      const Cover& cover = cover_of(vertex);
      if (cover.parts(low, high)) return cover.point;
    }
    return position(vertex, high, low);
  }

  void sort_crossings() {
    std::stable_sort(crossing_.begin(), crossing_.end(), [](const Crossing& x, const Crossing& y) { return x.key() < y.key(); });
    const auto same = [](const Crossing& x, const Crossing& y) { return x.key() == y.key(); };
    crossing_.erase(std::unique(crossing_.begin(), crossing_.end(), same), crossing_.end());
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

  /// The vertex on the edge between two others where three labels meet. @pre there is one
  [[nodiscard]] std::uint32_t crossing_of(std::uint32_t v, std::uint32_t w, const std::array<Label, 3>& labels) const {
    const auto [a, b] = std::minmax(v, w);
    const auto at = std::lower_bound(crossing_.begin(), crossing_.end(), std::tuple(a, b, labels_of(labels).label),
                                     [](const Crossing& c, const auto& key) { return c.key() < key; });
    return first_ + static_cast<std::uint32_t>(at - crossing_.begin());
  }

  /// The vertex on an edge where a third label meets two for which the edge has no end that is covered, if there is one.
  [[nodiscard]] std::optional<std::uint32_t> crossing_for_others(std::uint32_t v, std::uint32_t w, Label low, Label high) const {
    const auto [a, b] = std::minmax(v, w);
    auto at = std::lower_bound(crossing_.begin(), crossing_.end(), std::pair(a, b), [](const Crossing& c, const auto& key) { return std::pair(c.a, c.b) < key; });
    for (; at != crossing_.end() && at->a == a && at->b == b; ++at) {
      if (at->labels.has(low) && at->labels.has(high)) return first_ + static_cast<std::uint32_t>(at - crossing_.begin());
    }
    return {};
  }

  /// A corner of a facet or a point between two: its numbers in triangles on the side of either label, and the parts that have it.
  struct RingPoint {
    std::uint32_t inner, outer;
    bool here;
    std::array<bool, 2> in;             ///< in the part of the first covering label, of the second
    std::optional<std::uint32_t> tip{}; ///< end of the edge at which one of the covering labels lies between three
  };

  /// @return false where that cannot be told; `out` is then of no use
  [[nodiscard]] bool cut(const Facet& facet, std::vector<Facet>& out) const {
    const Covering covering = covering_of(facet);
    const auto& by = covering.by;
    const auto [low, high] = std::minmax(facet.inner, facet.outer);
    std::vector<RingPoint> ring;
    std::size_t apart = 0, walls = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = facet.vertex[k], w = facet.vertex[(k + 1) % 3];
      RingPoint point{v, v, true, {}};
      std::array<Side, 2> from{Side::Here, Side::Here}, to = from;
      for (std::size_t c = 0; c < covering.count; ++c) {
        from[c] = side(facet, v, by[c]);
        to[c] = side(facet, w, by[c]);
        point.in[c] = from[c] != Side::Here;
      }
      const bool covered_v = covered(facet, v) != nullptr, covered_w = covered(facet, w) != nullptr;
      point.here = !covered_v;
      if (covered_v) {
        for (std::size_t c = 0; c < covering.count; ++c) point.in[c] = covered(facet, v)->by == by[c];
      }
      ring.push_back(point);
      if (!covered_v && !covered_w) {
        if (const std::optional<std::uint32_t> x = crossing_for_others(v, w, low, high)) ring.push_back({*x, *x, true, {}});
        continue;
      }
      const auto first = static_cast<std::size_t>(covered_v && covered(facet, v)->by != by[0] ? 1 : 0);
      if (covered_v && covered_w) {
        if (covered(facet, v)->by == covered(facet, w)->by) continue;
        const auto [a, b] = std::minmax(v, w);
        const auto at = std::lower_bound(twice_.begin(), twice_.end(), std::tuple(a, b, low, high),
                                         [](const TwiceCovered& t, const auto& key) { return t.key() < key; });
        if (at->kind == TwiceCovered::Kind::Unknown) return false;
        if (at->kind == TwiceCovered::Kind::Touching) {
          ring.push_back({crossing_of(v, w, {facet.inner, by[0], by[1]}), crossing_of(v, w, {facet.outer, by[0], by[1]}), false, {true, true}});
          // The other pairs of the three are cut at these points, too, and leave a triangle between them and their end of the edge.
          const auto parts_from = [&](std::uint32_t end, std::uint32_t other) {
            return cover_of(end).between.has(cover_of(other).by) && (cover_of(other).between.count == 2 || end != facet.vertex[0]);
          };
          if (parts_from(v, w)) ring.back().tip = v;
          if (parts_from(w, v)) ring.back().tip = w;
          ++walls;
          continue;
        }
        for (const std::size_t c : {first, 1 - first}) {
          const std::uint32_t x = crossing_of(v, w, {low, high, by[c]});
          ring.push_back({x, x, true, {c == 0, c == 1}});
        }
        ++apart;
        continue;
      }
      const std::size_t c = covered_v ? first : static_cast<std::size_t>(covered(facet, w)->by != by[0] ? 1 : 0);
      if ((covered_v ? to[c] : from[c]) != Side::Here) continue;
      const std::uint32_t x = crossing_of(v, w, {low, high, by[c]});
      ring.push_back({x, x, true, {c == 0, c == 1}});
    }
    Polygon here;
    for (const RingPoint& p : ring) {
      if (p.here) here.push_back(p.inner);
    }
    if (walls > 0) {
      // The wall between the two runs from end to end; nothing of the facet may be left.
      std::vector<std::size_t> ends;
      for (std::size_t i = 0; i < ring.size(); ++i) {
        if (ring[i].in[0] && ring[i].in[1]) ends.push_back(i);
      }
      const bool left = std::any_of(ring.begin(), ring.end(), [](const RingPoint& p) { return p.here && !(p.in[0] && p.in[1]); });
      if (apart > 0 || ends.size() != 2 || left) return false;
      // The second label has the ring from one end to the other.
      const std::size_t begin = ring[ends[0] + 1].in[1] && !ring[ends[0] + 1].in[0] ? 0 : 1;
      const RingPoint &start = ring[ends[begin]], &stop = ring[ends[1 - begin]];
      Polygon wall{start.inner, stop.inner};
      if (stop.outer != stop.inner) wall.push_back(stop.outer);
      if (start.outer != start.inner) wall.push_back(start.outer);
      add(wall, by[0], by[1], out);
      if (start.tip) add({start.inner, start.outer, *start.tip}, by[0], by[1], out);
      if (stop.tip) add({stop.outer, stop.inner, *stop.tip}, by[0], by[1], out);
    } else if (here.size() >= 3) {
      add(here, facet.inner, facet.outer, out);
    }
    for (std::size_t c = 0; c < covering.count; ++c) {
      Polygon inner, outer;
      for (const RingPoint& p : ring) {
        if (!p.in[c]) continue;
        inner.push_back(p.inner);
        outer.push_back(p.outer);
      }
      if (inner.size() < 3) continue;
      add(inner, facet.inner, by[c], out);
      add(outer, by[c], facet.outer, out);
    }
    return true;
  }

  using Corners = std::array<const VertexUse*, 3>;
  /// Do triangles of one body cross?
  [[nodiscard]] bool cross(std::span<const Facet> facets) const {
    struct Sheet {
      Label label;
      Corners corners;
      Box box;
    };
    std::vector<Sheet> sheets;
    sheets.reserve(2 * facets.size());
    for (const Facet& facet : facets) {
      for (const auto& [label, other] : {std::pair(facet.inner, facet.outer), std::pair(facet.outer, facet.inner)}) {
        if (label == 0 || has_mesh_[label - 1] == 0) continue;
        Sheet sheet{.label = label, .corners = {}, .box = {}};
        for (std::size_t k = 0; k < 3; ++k) {
          sheet.corners[k] = &all_.use_of(facet.vertex[k], label - 1, other);
          sheet.box.include(sheet.corners[k]->position);
        }
        for (const Sheet& before : sheets) {
          if (before.label != label || !before.box.overlaps(sheet.box)) continue;
          if (pierces(before.corners, sheet.corners) || pierces(sheet.corners, before.corners)) return true;
        }
        sheets.push_back(sheet);
      }
    }
    return false;
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
    if (!is_wanted(from, to)) return;
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
  std::vector<std::uint32_t> place_;  ///< by vertex: of its cover or of what meets there
  std::vector<Place> near_;           ///< facets with a vertex that was covered
  std::vector<Place> beside_;         ///< these, and others with an edge between rims
  std::vector<Crossing> crossing_;  ///< by vertices and labels, ascending
  std::vector<TwiceCovered> twice_;   ///< by vertices and labels, ascending
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
    cutter.find_crossings(executor);
    cutter.add_vertices(counts);
    if (!cutter.uncover_tangles()) break;
    cutter.remove_vertices();
    cutter.uncover_mixed();
  }
  executor.for_blocks(parts.size(), 1, [&](std::size_t p, std::size_t) { cutter.cut(parts[p]); });
  cutter.drop_unused();
}

}  // namespace supple::implicit::lattice
