/// @file boundary_pieces.h
/// Pieces of facets that boundary curves cross.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/partition/boundary_crossings.h"

namespace supple::implicit::lattice {

class BoundaryPieces {
 public:
  BoundaryPieces(const BoundaryFacets& facets, const BoundaryCrossings& crossings) : facets_(facets), crossings_(crossings) {}

  /// Adds the pieces of a facet. @return false where they cannot be determined; `out` is then invalid
  [[nodiscard]] bool cut(const Facet& facet, std::vector<Facet>& out) const;
  /// Do triangles of one body intersect?
  [[nodiscard]] bool cross(std::span<const Facet> facets) const;

 private:
  using Polygon = std::vector<std::uint32_t>;
  /// The fan of a polygon whose smallest triangle is the largest, facing from one label to another.
  void add(const Polygon& polygon, Label from, Label to, std::vector<Facet>& out) const;

  const BoundaryFacets& facets_;
  const BoundaryCrossings& crossings_;
};

}  // namespace supple::implicit::lattice
