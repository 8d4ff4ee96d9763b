/// @file boundary_islands.h
/// Facets near boundary curves whose cuts can depend on each other: those that share a tetrahedron or a vertex where three labels meet. What becomes
/// of such an island depends on nothing else.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/partition/polygonise_boundaries.h"

namespace supple::implicit::lattice {

class BoundaryFacets;

/// Islands of the last call that changed.
class BoundaryIslands {
 public:
  /// @param last  of each vertex in the last call, the number that one vertex of its island had then
  BoundaryIslands(const AllVertices& all, const Carried& carried, std::span<const std::uint32_t> last);

  [[nodiscard]] bool changed(std::uint32_t vertex) const { return changed_[vertex] != 0; }
  [[nodiscard]] bool changed(const Facet& facet) const { return changed(anchor(facet)); }
  /// Whether facets of a part may belong to a changed island.
  [[nodiscard]] bool any_changed(std::uint32_t part) const { return in_part_[part] != 0; }
  /// The islands of this call, in the form of `last`. @param facets  of changed islands
  [[nodiscard]] std::vector<std::uint32_t> now(const BoundaryFacets& facets) const;

 private:
  /// The first vertex that is not on an edge between two labels.
  [[nodiscard]] std::uint32_t anchor(const Facet& facet) const {
    for (const std::uint32_t v : facet.vertex) {
      if (all_.kind[v] != VertexKind::Edge) return v;
    }
    return facet.vertex[0];
  }

  const AllVertices& all_;
  std::vector<std::uint32_t> island_;  ///< by vertex: a vertex of the same island that is kept; itself where it changed
  std::vector<std::uint8_t> changed_;  ///< by vertex
  std::vector<std::uint8_t> in_part_;  ///< by part: 1 where a changed vertex, of no edge, may be
};

}  // namespace supple::implicit::lattice
