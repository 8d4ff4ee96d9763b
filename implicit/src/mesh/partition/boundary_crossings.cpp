#include "mesh/partition/boundary_crossings.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "mesh/partition/polygonise_block_edges.h"

namespace supple::implicit::lattice {
namespace {

constexpr std::size_t kPointsPerTask = 64;

}  // namespace

std::uint32_t contact_of(const LabelSet& labels, std::uint32_t body) {
  for (const Label label : labels.view()) {
    if (label != 0 && label != body + 1) return label;
  }
  return 0;
}

void BoundaryCrossings::find(const Executor& executor) {
  crossing_.clear();
  twice_.clear();
  for (const FacetPlace& at : facets_.near()) {
    const Facet& facet = facets_.facet_at(at);
    const std::uint32_t block = at.part;
    const auto [low, high] = std::minmax(facet.inner, facet.outer);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(facet.vertex[k], facet.vertex[(k + 1) % 3]);
      const Cover *cover_a = facets_.covered(facet, a), *cover_b = facets_.covered(facet, b);
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
      if (facets_.side(facet, cover_a != nullptr ? b : a, by) != Side::Here) continue;
      crossing_.push_back(lone_crossing({a, b, low, high, by, cover_b != nullptr}, {block, facet.tetrahedron, face}));
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

void BoundaryCrossings::add_vertices() {
  first_ = static_cast<std::uint32_t>(facets_.all().use_end.size());
  for (const Crossing& c : crossing_) {
    add_uses(c.labels, c.found.point);
    facets_.all().use_end.push_back(static_cast<std::uint32_t>(facets_.all().use.size()));
    facets_.all().kind.push_back(VertexKind::Junction);
  }
}

void BoundaryCrossings::remove_vertices() {
  facets_.all().use_end.resize(first_);
  facets_.all().kind.resize(first_);
  facets_.all().use.resize(first_ == 0 ? 0 : facets_.all().use_end.back());
}

void BoundaryCrossings::add_kept(const KeptBoundaries& kept) {
  const auto merge = [](auto& into, const auto& more) {
    const auto middle = static_cast<std::ptrdiff_t>(into.size());
    into.insert(into.end(), more.begin(), more.end());
    std::inplace_merge(into.begin(), into.begin() + middle, into.end(), [](const auto& x, const auto& y) { return x.key() < y.key(); });
  };
  merge(crossing_, kept.crossing);
  merge(twice_, kept.twice);
}

void BoundaryCrossings::count(PolygoniseCounts& counts) const {
  for (const Crossing& c : crossing_) {
    ++counts.boundary_points;
    if (!c.found.exact) ++counts.boundary_points_moved;
    counts.residual = std::max(counts.residual, c.found.residual);
  }
}

std::uint32_t BoundaryCrossings::crossing_of(std::uint32_t v, std::uint32_t w, const std::array<Label, 3>& labels) const {
  const auto [a, b] = std::minmax(v, w);
  const auto at = std::lower_bound(crossing_.begin(), crossing_.end(), std::tuple(a, b, labels_of(labels).label),
                                   [](const Crossing& c, const auto& key) { return c.key() < key; });
  return first_ + static_cast<std::uint32_t>(at - crossing_.begin());
}

std::optional<std::uint32_t> BoundaryCrossings::crossing_for_others(std::uint32_t v, std::uint32_t w, Label low, Label high) const {
  const auto [a, b] = std::minmax(v, w);
  auto at = std::lower_bound(crossing_.begin(), crossing_.end(), std::pair(a, b), [](const Crossing& c, const auto& key) { return std::pair(c.a, c.b) < key; });
  for (; at != crossing_.end() && at->a == a && at->b == b; ++at) {
    if (at->labels.has(low) && at->labels.has(high)) return first_ + static_cast<std::uint32_t>(at - crossing_.begin());
  }
  return {};
}

Crossing BoundaryCrossings::lone_crossing(const LoneCover& cover, const EdgePlace& at) const {
  const auto [a, b, low, high, by, wins_at_b] = cover;
  const std::uint32_t from = wins_at_b ? a : b, to = wins_at_b ? b : a;
  return {.a = a, .b = b, .labels = labels_of(std::array{low, high, by}), .block = at.block, .tetrahedron = at.tetrahedron, .face = at.face,
          .minus = low == 0 ? 0 : high, .plus = by, .here = facets_.place(from, low, high), .there = facets_.place(to, low, high)};
}

Crossing BoundaryCrossings::touching(const TwiceCovered& t, Label beside) const {
  const auto start = [&](std::uint32_t v, Label by) { return facets_.is_wanted(by, beside) ? facets_.position(v, by, beside) : facets_.cover_of(v).point; };
  return {.a = t.a, .b = t.b, .labels = labels_of(std::array{beside, t.at_a, t.at_b}), .block = t.block, .tetrahedron = t.tetrahedron,
          .face = t.face, .minus = t.at_a, .plus = t.at_b, .here = start(t.a, t.at_a), .there = start(t.b, t.at_b)};
}

std::array<Crossing, 2> BoundaryCrossings::look_between(TwiceCovered& t) const {
  const auto holds = [&](const Crossing& c, Label other) {
    return c.found.exact && !(facets_.value(other, c.found.point) > level(c.labels, c.found.point));
  };
  std::array<Crossing, 2> points{touching(t, t.low), touching(t, t.high)};
  for (Crossing& c : points) solve(c);
  if (holds(points[0], t.high) && holds(points[1], t.low)) {
    t.kind = TwiceCovered::Kind::Touching;
    return points;
  }
  const auto whole = [&](std::uint32_t v, Label by) { return facets_.cover_of(v).between.has(by); };
  if (whole(t.a, t.at_b) || whole(t.b, t.at_a)) return points;  // what one end parts the other parts from more
  const EdgePlace at{t.block, t.tetrahedron, t.face};
  points = {lone_crossing({t.a, t.b, t.low, t.high, t.at_a, false}, at), lone_crossing({t.a, t.b, t.low, t.high, t.at_b, true}, at)};
  for (Crossing& c : points) solve(c);
  if (holds(points[0], t.at_b) && holds(points[1], t.at_a)) t.kind = TwiceCovered::Kind::Apart;
  return points;
}

double BoundaryCrossings::level(const LabelSet& labels, const Vec3& point) const {
  double largest = -std::numeric_limits<double>::infinity();
  for (const Label l : labels.view()) largest = std::max(largest, facets_.value(l, point));
  return largest;
}

void BoundaryCrossings::solve(Crossing& c) const {
  const Simplex simplex = simplex_of(c);
  const auto lead = [&](const Vec3& p) { return facets_.value(c.plus, p) - facets_.value(c.minus, p); };
  const double before = lead(c.here), after = lead(c.there);
  const double linear = before < 0.0 && after > 0.0 ? before / (before - after) : 0.5;
  double scale = 0.0;
  for (const Label label : c.labels.view()) scale += std::abs(facets_.value(label, c.here)) + std::abs(facets_.value(label, c.there));
  for (const double t : {linear, 0.25, 0.75}) {
    c.found = meet_inside(facets_.fields(), simplex, c.labels, c.here + t * (c.there - c.here), scale);
    if (c.found.exact) return;
  }
  c.found = search_inside(facets_.fields(), simplex, c.labels, scale);
  if (c.found.exact) return;
  c.found = {.point = c.here + std::clamp(linear, 0.05, 0.95) * (c.there - c.here), .residual = 0.0, .exact = false};
}

void BoundaryCrossings::sort_crossings() {
  std::stable_sort(crossing_.begin(), crossing_.end(), [](const Crossing& x, const Crossing& y) { return x.key() < y.key(); });
  const auto same = [](const Crossing& x, const Crossing& y) { return x.key() == y.key(); };
  crossing_.erase(std::unique(crossing_.begin(), crossing_.end(), same), crossing_.end());
}

Simplex BoundaryCrossings::simplex_of(const Crossing& c) const {
  const BlockCoord& block = facets_.all().block[c.block]->coord;
  const int cell = c.tetrahedron / 6;
  const std::int64_t x = std::int64_t{kCells} * block[0] + cell % kCells, y = std::int64_t{kCells} * block[1] + cell / kCells % kCells,
                     z = std::int64_t{kCells} * block[2] + cell / (kCells * kCells);
  Simplex s{.low = node_position(lattice_, x, y, z), .high = node_position(lattice_, x + 1, y + 1, z + 1), .corner = {}, .label = {}, .size = 0};
  for (unsigned v = 0; v < 4; ++v) {
    if (v != c.face) s.corner[s.size++] = kTetrahedra[c.tetrahedron % 6u][v];
  }
  return s;
}

void BoundaryCrossings::add_uses(const LabelSet& labels, const Vec3& point) {
  for (const Label label : labels.view()) {
    if (!facets_.has_mesh(label)) continue;
    facets_.all().use.push_back({.body = label - 1, .contact = contact_of(labels, label - 1),
                        .normal = normal_at(facets_.fields(), labels, label - 1, point), .position = point});
  }
}

TwiceCovered::Kind BoundaryCrossings::kind_of(std::uint32_t v, std::uint32_t w, Label low, Label high) const {
  const auto [a, b] = std::minmax(v, w);
  return std::lower_bound(twice_.begin(), twice_.end(), std::tuple(a, b, low, high), [](const TwiceCovered& t, const auto& key) {
           return t.key() < key;
         })->kind;
}

}  // namespace supple::implicit::lattice
