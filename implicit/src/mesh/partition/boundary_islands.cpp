#include "mesh/partition/boundary_islands.h"

#include <algorithm>
#include <numeric>

#include "mesh/partition/partition_keep.h"
#include "mesh/partition/boundary_facets.h"

namespace supple::implicit::lattice {

BoundaryIslands::BoundaryIslands(const AllVertices& all, const Carried& carried, std::span<const std::uint32_t> last)
    : all_(all), island_(all.kind.size()), changed_(all.kind.size(), 1), in_part_(all.block.size()) {
  std::iota(island_.begin(), island_.end(), 0u);
  std::vector<std::uint8_t> lost(last.size());  // by vertex of the last call that gives an island its number
  for (std::uint32_t v = 0; v < last.size(); ++v) {
    const std::uint32_t now = carried.number[v];
    if (now == kGone || carried.disturbed[now] != 0) lost[last[v]] = 1;
  }
  for (std::uint32_t v = 0; v < last.size(); ++v) {
    const std::uint32_t now = carried.number[v];
    if (now == kGone || lost[last[v]] != 0) continue;
    changed_[now] = 0;
    island_[now] = carried.number[last[v]];
  }
  std::vector<BlockCoord> coords;
  for (std::size_t b = 0; b < all.block.size(); ++b) {
    const std::size_t end = b + 1 < all.block.size() ? all.block[b + 1]->first_vertex : all.kind.size();
    for (std::size_t v = all.block[b]->first_vertex; v < end; ++v) {
      if (changed_[v] == 0 || all.kind[v] == VertexKind::Edge) continue;
      coords.push_back(all.block[b]->coord);
      break;
    }
  }
  for_parts_with(coords, all.block, [&](std::size_t part) { in_part_[part] = 1; });
}

std::vector<std::uint32_t> BoundaryIslands::now(const BoundaryFacets& facets) const {
  std::vector<std::uint32_t> island = island_;
  const auto root = [&](std::uint32_t v) {
    while (island[v] != v) v = island[v] = island[island[v]];
    return v;
  };
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    island[std::max(a, b)] = std::min(a, b);
  };
  const FacetPlace* last = nullptr;
  for (const FacetPlace& place : facets.beside()) {
    const Facet& facet = facets.facet_at(place);
    const std::uint32_t first = anchor(facet);
    for (const std::uint32_t v : facet.vertex) {
      if (all_.kind[v] != VertexKind::Edge) join(first, v);
    }
    if (last != nullptr && last->part == place.part && facets.facet_at(*last).tetrahedron == facet.tetrahedron) join(first, anchor(facets.facet_at(*last)));
    last = &place;
  }
  for (std::uint32_t v = 0; v < island.size(); ++v) island[v] = root(v);
  return island;
}

}  // namespace supple::implicit::lattice
