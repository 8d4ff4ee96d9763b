/// @file rim_pieces.h
/// Pieces of facets that rims cross.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/partition/rim_crossings.h"

namespace supple::implicit::lattice {

class RimPieces {
 public:
  RimPieces(const RimFacets& facets, const RimCrossings& crossings) : facets_(facets), crossings_(crossings) {}

  /// Adds the pieces of a facet. @return false where that cannot be told; `out` is then of no use
  [[nodiscard]] bool cut(const Facet& facet, std::vector<Facet>& out) const;
  /// Do triangles of one body cross?
  [[nodiscard]] bool cross(std::span<const Facet> facets) const;

 private:
  using Polygon = std::vector<std::uint32_t>;
  /// The fan of a polygon whose smallest triangle is the largest, facing from one label to another.
  void add(const Polygon& polygon, Label from, Label to, std::vector<Facet>& out) const;

  const RimFacets& facets_;
  const RimCrossings& crossings_;
};

}  // namespace supple::implicit::lattice
