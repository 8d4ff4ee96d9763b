#include "mesh/partition/boundary_pieces.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>

namespace supple::implicit::lattice {
namespace {

/// A corner of a facet or a point between two: its numbers in triangles on the side of either label, and the parts that have it.
struct RingPoint {
  std::uint32_t inner, outer;
  bool here;
  std::array<bool, 2> in;             ///< in the part of the first covering label, of the second
  std::optional<std::uint32_t> tip{}; ///< end of the edge at which one of the covering labels lies between three
};

using Corners = std::array<const VertexUse*, 3>;
/// Does an edge of s that has no vertex in common with t pass through it, by more than rounding?
bool pierces(const Corners& s, const Corners& t) {
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

}  // namespace

bool BoundaryPieces::cut(const Facet& facet, std::vector<Facet>& out) const {
  const BoundaryFacets::Covering covering = facets_.covering_of(facet);
  const auto& by = covering.by;
  const auto [low, high] = std::minmax(facet.inner, facet.outer);
  std::vector<RingPoint> ring;
  std::size_t apart = 0, walls = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t v = facet.vertex[k], w = facet.vertex[(k + 1) % 3];
    RingPoint point{v, v, true, {}};
    std::array<Side, 2> from{Side::Here, Side::Here}, to = from;
    for (std::size_t c = 0; c < covering.count; ++c) {
      from[c] = facets_.side(facet, v, by[c]);
      to[c] = facets_.side(facet, w, by[c]);
      point.in[c] = from[c] != Side::Here;
    }
    const bool covered_v = facets_.covered(facet, v) != nullptr, covered_w = facets_.covered(facet, w) != nullptr;
    point.here = !covered_v;
    if (covered_v) {
      for (std::size_t c = 0; c < covering.count; ++c) point.in[c] = facets_.covered(facet, v)->by == by[c];
    }
    ring.push_back(point);
    if (!covered_v && !covered_w) {
      if (const std::optional<std::uint32_t> x = crossings_.crossing_for_others(v, w, low, high)) ring.push_back({*x, *x, true, {}});
      continue;
    }
    const auto first = static_cast<std::size_t>(covered_v && facets_.covered(facet, v)->by != by[0] ? 1 : 0);
    if (covered_v && covered_w) {
      if (facets_.covered(facet, v)->by == facets_.covered(facet, w)->by) continue;
      const TwiceCovered::Kind kind = crossings_.kind_of(v, w, low, high);
      if (kind == TwiceCovered::Kind::Unknown) return false;
      if (kind == TwiceCovered::Kind::Touching) {
        ring.push_back({crossings_.crossing_of(v, w, {facet.inner, by[0], by[1]}), crossings_.crossing_of(v, w, {facet.outer, by[0], by[1]}), false, {true, true}});
        // The other pairs of the three are cut at these points, too, and leave a triangle between them and their end of the edge.
        const auto parts_from = [&](std::uint32_t end, std::uint32_t other) {
          return facets_.cover_of(end).between.has(facets_.cover_of(other).by) && (facets_.cover_of(other).between.count == 2 || end != facet.vertex[0]);
        };
        if (parts_from(v, w)) ring.back().tip = v;
        if (parts_from(w, v)) ring.back().tip = w;
        ++walls;
        continue;
      }
      for (const std::size_t c : {first, 1 - first}) {
        const std::uint32_t x = crossings_.crossing_of(v, w, {low, high, by[c]});
        ring.push_back({x, x, true, {c == 0, c == 1}});
      }
      ++apart;
      continue;
    }
    const std::size_t c = covered_v ? first : static_cast<std::size_t>(facets_.covered(facet, w)->by != by[0] ? 1 : 0);
    if ((covered_v ? to[c] : from[c]) != Side::Here) continue;
    const std::uint32_t x = crossings_.crossing_of(v, w, {low, high, by[c]});
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

bool BoundaryPieces::cross(std::span<const Facet> facets) const {
  struct Sheet {
    Label label;
    Corners corners;
    Box box;
  };
  std::vector<Sheet> sheets;
  sheets.reserve(2 * facets.size());
  for (const Facet& facet : facets) {
    for (const auto& [label, other] : {std::pair(facet.inner, facet.outer), std::pair(facet.outer, facet.inner)}) {
      if (!facets_.has_mesh(label)) continue;
      Sheet sheet{.label = label, .corners = {}, .box = {}};
      for (std::size_t k = 0; k < 3; ++k) {
        sheet.corners[k] = &facets_.all().use_of(facet.vertex[k], label - 1, other);
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

void BoundaryPieces::add(const Polygon& polygon, Label from, Label to, std::vector<Facet>& out) const {
  if (!facets_.is_wanted(from, to)) return;
  const std::size_t n = polygon.size();
  std::size_t best = 0;
  double most = -1.0;
  for (std::size_t apex = 0; n > 3 && apex < n; ++apex) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t d = 1; d + 1 < n; ++d) {
      const Vec3 &p = facets_.position(polygon[apex], from, to), &q = facets_.position(polygon[(apex + d) % n], from, to),
                 &r = facets_.position(polygon[(apex + d + 1) % n], from, to);
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

}  // namespace supple::implicit::lattice
