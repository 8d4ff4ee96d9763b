#include "mesh/partition/polygonise_boundaries.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "mesh/partition/polygonise_block_edges.h"
#include "mesh/partition/boundary_crossings.h"
#include "mesh/partition/boundary_facets.h"
#include "mesh/partition/boundary_islands.h"
#include "mesh/partition/boundary_pieces.h"

namespace supple::implicit::lattice {
namespace {

class BoundaryCutter {
 public:
  BoundaryCutter(const BoundaryFacets& facets, const BoundaryCrossings& crossings) : facets_(facets), crossings_(crossings), pieces_(facets, crossings) {}

  /// Where vertices of one triangle do not decide how it is cut, covered vertices get one place: what the third label has between its sheets
  /// is closed at that vertex.
  void uncover_mixed() {
    std::vector<std::uint32_t> mixed;
    do {  // one with one place is a junction to its neighbours
      mixed.clear();
      for (const FacetPlace& place : facets_.near()) {
        const Facet& facet = facets_.facet_at(place);
        if (is_mixed(facet)) mixed.insert(mixed.end(), facet.vertex.begin(), facet.vertex.end());
      }
      find_loose(mixed);
      uncover(mixed);
    } while (!mixed.empty());
  }

  /// As above where points on the edges of a facet do not decide how it is cut, where sheets on either side of a third label would cross
  /// within a tetrahedron, and, when there are none, where more than two of a body would meet in an edge. @return whether there were any
  bool uncover_tangles() {
    std::vector<std::uint32_t> tangled;
    std::vector<Facet> pieces;
    FacetPlace last{kNoBody, 0};  // where the tetrahedron ends that was looked at last
    for (const FacetPlace& place : facets_.near()) {
      if (place.part == last.part && place.facet < last.facet) continue;
      const std::vector<Facet>& facets = facets_.parts()[place.part].facet;
      std::size_t begin = place.facet, end = begin + 1;
      while (begin > 0 && facets[begin - 1].tetrahedron == facets[place.facet].tetrahedron) --begin;
      while (end < facets.size() && facets[end].tetrahedron == facets[place.facet].tetrahedron) ++end;
      last = {place.part, static_cast<std::uint32_t>(end)};
      pieces.clear();
      bool clear = true;
      for (std::size_t f = begin; f < end && clear; ++f) clear = pieces_.cut(facets[f], pieces);
      if (clear && !pieces_.cross(pieces)) continue;
      for (std::size_t f = begin; f < end; ++f) tangled.insert(tangled.end(), facets[f].vertex.begin(), facets[f].vertex.end());
    }
    if (uncover(tangled)) return true;
    tangled.clear();
    find_crowded(tangled);
    return uncover(tangled);
  }

  /// @return whether any was covered
  bool uncover(std::span<const std::uint32_t> vertices) {
    bool any = false;
    for (const std::uint32_t v : vertices) any = uncover(v) || any;
    return any;
  }

  void cut(FacetPart& part) const {
    part.body.clear();
    part.cut.clear();
    part.is_cut = std::any_of(part.facet.begin(), part.facet.end(), [&](const Facet& facet) { return facets_.is_covered(facet); });
    if (!part.is_cut) return;
    part.cut.reserve(part.facet.size());
    for (const Facet& facet : part.facet) {
      if (facets_.is_covered(facet)) {
        (void)pieces_.cut(facet, part.cut);
      } else {
        part.cut.push_back(facet);
      }
    }
  }

 private:
  /// Adds what a label covers without being next to it in any tetrahedron, where it would hang on single vertices.
  void find_loose(std::vector<std::uint32_t>& mixed) const {
    std::vector<std::uint32_t> parent(facets_.all().cover.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](std::uint32_t c) {
      while (parent[c] != c) c = parent[c] = parent[parent[c]];
      return c;
    };
    const auto for_covered = [&](const auto& use) {  // vertices of facets that are covered, whether or not for the facet's labels
      for (const FacetPlace& place : facets_.near()) {
        const Facet& facet = facets_.facet_at(place);
        for (const std::uint32_t v : facet.vertex) {
          if (facets_.all().kind[v] == VertexKind::Covered) use(facet, v, facets_.cover_index(v));
        }
      }
    };
    for_covered([&](const Facet& facet, std::uint32_t v, std::uint32_t c) {
      if (facets_.covered(facet, v) == nullptr) return;
      for (const std::uint32_t w : facet.vertex) {
        const Cover* other = facets_.covered(facet, w);
        if (other != nullptr && other->by == facets_.all().cover[c].by) parent[std::max(root(c), root(facets_.cover_index(w)))] = std::min(root(c), root(facets_.cover_index(w)));
      }
    });
    std::vector<std::uint8_t> held(facets_.all().cover.size()), hangs(facets_.all().cover.size());
    for_covered([&](const Facet& facet, std::uint32_t v, std::uint32_t c) {
      const Label by = facets_.all().cover[c].by;
      if (facet.inner == by || facet.outer == by) held[root(c)] = 1;
      if (facets_.covered(facet, v) == nullptr) return;
      for (const std::uint32_t w : facet.vertex) {
        if (facets_.side(facet, w, by) == Side::Boundary) hangs[root(c)] = 1;
      }
    });
    for (std::uint32_t c = 0; c < facets_.all().cover.size(); ++c) {
      if (facets_.all().kind[facets_.all().cover[c].vertex] != VertexKind::Covered || facets_.all().cover[c].by == 0) continue;
      if (hangs[root(c)] != 0 && held[root(c)] == 0) mixed.push_back(facets_.all().cover[c].vertex);
    }
  }

  [[nodiscard]] bool is_mixed(const Facet& facet) const {
    const BoundaryFacets::Covering covering = facets_.covering_of(facet);
    if (covering.count > 2) return true;
    std::size_t whole = 0, all_parted = 0;
    for (const std::uint32_t v : facet.vertex) {
      const Cover* cover = facets_.covered(facet, v);
      const VertexKind kind = facets_.all().kind[v];
      all_parted += cover != nullptr && cover->between.count > 2 ? 1 : 0;
      if (kind != VertexKind::Junction && kind != VertexKind::Uncovered) continue;
      for (std::size_t c = 0; c < covering.count; ++c) whole += facets_.side(facet, v, covering.by[c]) == Side::Here ? 1 : 0;
    }
    // Where three labels are parted at one end of the edge in which they meet, and not at the other, all four meet on it.
    if (whole > 0 && all_parted > 0) return true;
    return false;
  }

  /// Adds the vertices of facets of which more than two pieces of one body would meet in an edge between boundary curves.
  void find_crowded(std::vector<std::uint32_t>& crowded) const {
    struct Edge {
      const VertexUse *a, *b;
      std::uint32_t facet;  ///< of `facets_.beside()`
      [[nodiscard]] auto key() const { return std::pair(a, b); }
    };
    const auto on_boundary = [&](std::uint32_t v) { return v >= crossings_.first_vertex() || facets_.all().kind[v] != VertexKind::Edge; };
    std::vector<Edge> edges;
    std::vector<Facet> pieces;
    for (std::uint32_t f = 0; f < facets_.beside().size(); ++f) {
      pieces.clear();
      (void)pieces_.cut(facets_.facet_at(facets_.beside()[f]), pieces);
      for (const Facet& piece : pieces) {
        for (std::size_t k = 0; k < 3; ++k) {
          const std::uint32_t a = piece.vertex[k], b = piece.vertex[(k + 1) % 3];
          if (!on_boundary(a) || !on_boundary(b)) continue;
          for (const auto& [own, other] : {std::pair(piece.inner, piece.outer), std::pair(piece.outer, piece.inner)}) {
            if (!facets_.has_mesh(own)) continue;
            const VertexUse *u = &facets_.all().use_of(a, own - 1, other), *v = &facets_.all().use_of(b, own - 1, other);
            edges.push_back({std::min(u, v), std::max(u, v), f});
          }
        }
      }
    }
    std::stable_sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) { return x.key() < y.key(); });
    for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
      while (end < edges.size() && edges[end].key() == edges[begin].key()) ++end;
      for (std::size_t i = begin; i < end && end - begin > 2; ++i) {
        const auto& v = facets_.facet_at(facets_.beside()[edges[i].facet]).vertex;
        crowded.insert(crowded.end(), v.begin(), v.end());
      }
    }
  }

  /// @return whether it was covered
  bool uncover(std::uint32_t vertex) {
    if (facets_.all().kind[vertex] != VertexKind::Covered) return false;
    facets_.all().kind[vertex] = VertexKind::Uncovered;
    const Cover& cover = facets_.cover_of(vertex);
    const LabelSet between = cover.between, labels = between.with(cover.by);
    std::uint32_t last = kNoBody;
    for (VertexUse& use : facets_.all().uses_of(vertex)) {
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

  const BoundaryFacets& facets_;
  const BoundaryCrossings& crossings_;
  BoundaryPieces pieces_;
};

/// Bodies that no triangle shows at a vertex do not have it: at uncovered ones, and where a fourth body meets three in their tetrahedron.
void drop_unused(AllVertices& all, std::span<const FacetPart> parts) {
  std::vector<std::uint32_t> doubtful;
  for (const Cover& cover : all.cover) {
    if (all.kind[cover.vertex] == VertexKind::Uncovered) doubtful.push_back(cover.vertex);
  }
  for (const Meeting& meeting : all.meeting) {
    if (meeting.labels.count == 4) doubtful.push_back(meeting.vertex);
  }
  if (doubtful.empty()) return;
  std::sort(doubtful.begin(), doubtful.end());
  std::vector<std::uint8_t> used(all.use.size());
  for (const FacetPart& part : parts) {
    for (const Facet& facet : part.whole()) {
      for (const std::uint32_t v : facet.vertex) {
        if (all.kind[v] == VertexKind::Edge || !std::binary_search(doubtful.begin(), doubtful.end(), v)) continue;
        for (const VertexUse& use : all.uses_of(v)) {
          if (use.body + 1 == facet.inner || use.body + 1 == facet.outer) used[static_cast<std::size_t>(&use - all.use.data())] = 1;
        }
      }
    }
  }
  for (const std::uint32_t v : doubtful) {
    for (VertexUse& use : all.uses_of(v)) {
      if (used[static_cast<std::size_t>(&use - all.use.data())] == 0) use.body = kNoBody;
    }
  }
}

/// Takes what was found at boundary curves to the numbers of this call, without what is gone.
void renumber(std::span<const std::uint32_t> number, KeptBoundaries& kept) {
  const auto first = static_cast<std::uint32_t>(number.size() - kept.crossing.size());
  for (std::uint32_t i = 0; i < kept.crossing.size(); ++i) kept.crossing[i].before = first + i;
  const auto move = [&](auto& edge) {
    edge.a = number[edge.a];
    edge.b = number[edge.b];
    return edge.a == kGone || edge.b == kGone;
  };
  std::erase_if(kept.crossing, move);
  std::erase_if(kept.twice, move);
  for (std::uint32_t& v : kept.uncovered) v = number[v];
  std::erase(kept.uncovered, kGone);
}

/// Leaves in `kept` what holds in this call.
void leave_kept(const AllVertices& all, const Carried& carried, const BoundaryIslands& islands, KeptBoundaries& kept) {
  renumber(carried.number, kept);
  const auto changed = [&](const auto& edge) { return islands.changed(all.kind[edge.a] == VertexKind::Covered ? edge.a : edge.b); };
  std::erase_if(kept.crossing, changed);
  std::erase_if(kept.twice, changed);
  std::erase_if(kept.uncovered, [&](std::uint32_t v) { return islands.changed(v); });
}

/// By part: 1 where facets are to be cut, 0 where they are those of the last call and so are their cuts.
std::vector<std::uint8_t> find_recut(const BoundaryFacets& facets, const Carried& carried) {
  std::vector<std::uint8_t> recut(facets.parts().size());
  for (std::size_t p = 0; p < recut.size(); ++p) recut[p] = carried.same[p] == 0 ? 1 : 0;
  for (const FacetPlace& place : facets.near()) recut[place.part] = 1;
  return recut;
}

/// What this call found at boundary curves.
void keep(const AllVertices& all, const BoundaryCrossings& crossings, std::vector<std::uint32_t> island, KeptBoundaries& kept) {
  kept = {.crossing = crossings.crossings(), .twice = crossings.twice(), .uncovered = {}, .island = std::move(island)};
  for (const Cover& cover : all.cover) {
    if (all.kind[cover.vertex] == VertexKind::Uncovered) kept.uncovered.push_back(cover.vertex);
  }
}

}  // namespace

void cut_at_boundaries(const CutBodies& bodies, AllVertices& all, std::span<FacetPart> parts, Carried& carried, KeptBoundaries& kept,
                 PolygoniseCounts& counts) {
  const auto& [fields, has_mesh, lattice, executor] = bodies;
  if (all.cover.empty()) {
    kept = {};
    for (FacetPart& part : parts) {
      part.cut.clear();
      part.is_cut = false;
    }
    return;
  }
  const BoundaryIslands islands(all, carried, kept.island);
  const BoundaryFacets facets(fields, has_mesh, all, parts, islands);
  leave_kept(all, carried, islands, kept);
  const std::vector<std::uint8_t> recut = find_recut(facets, carried);
  std::vector<std::uint32_t> island = islands.now(facets);
  BoundaryCrossings crossings(facets, lattice);
  BoundaryCutter cutter(facets, crossings);
  expect_indexable(all.use.size() + 8 * all.cover.size(), lattice);
  cutter.uncover(kept.uncovered);
  cutter.uncover_mixed();
  for (;;) {  // ends when nothing is covered at the latest
    crossings.find(executor);
    crossings.add_vertices();
    if (!cutter.uncover_tangles()) break;
    crossings.remove_vertices();
    cutter.uncover_mixed();
  }
  if (!kept.crossing.empty() || !kept.twice.empty()) {
    crossings.remove_vertices();
    crossings.add_kept(kept);
    crossings.add_vertices();
  }
  crossings.count(counts);
  for (std::uint32_t i = 0; i < crossings.crossings().size(); ++i) {
    const std::uint32_t before = crossings.crossings()[i].before;
    if (before != kGone) carried.number[before] = crossings.first_vertex() + i;
  }
  constexpr std::size_t kPartsPerTask = 16;
  executor.for_blocks(parts.size(), kPartsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      if (recut[p] != 0) {
        cutter.cut(parts[p]);
        continue;
      }
      renumber(carried.number, parts[p].cut);
    }
  });
  drop_unused(all, parts);
  keep(all, crossings, std::move(island), kept);
}

}  // namespace supple::implicit::lattice
