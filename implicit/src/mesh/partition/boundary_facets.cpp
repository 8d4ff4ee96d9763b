#include "mesh/partition/boundary_facets.h"

#include <algorithm>
#include <utility>

namespace supple::implicit::lattice {
namespace {

/// Can boundary curves ever run along an edge of it?
bool has_edge_of_boundaries(const AllVertices& all, const Facet& facet) {
  return std::count_if(facet.vertex.begin(), facet.vertex.end(), [&](std::uint32_t v) { return all.kind[v] != VertexKind::Edge; }) > 1;
}

}  // namespace

BoundaryFacets::BoundaryFacets(std::span<const FieldView> fields, std::span<const std::uint8_t> has_mesh, AllVertices& all,
                     std::span<const FacetPart> parts, const BoundaryIslands& islands)
    : fields_(fields), has_mesh_(has_mesh), all_(all), parts_(parts), place_(all.kind.size()) {
  for (std::uint32_t c = 0; c < all.cover.size(); ++c) place_[all.cover[c].vertex] = c;
  for (std::uint32_t m = 0; m < all.meeting.size(); ++m) place_[all.meeting[m].vertex] = m;
  for (std::uint32_t p = 0; p < parts.size(); ++p) {
    if (!islands.any_changed(p)) continue;
    for (std::size_t f = 0; f < parts[p].facet.size(); ++f) {
      const FacetPlace at{p, static_cast<std::uint32_t>(f)};
      if (!islands.changed(parts[p].facet[f])) continue;
      const bool near = is_covered(parts[p].facet[f]);
      if (near) near_.push_back(at);
      if (near || has_edge_of_boundaries(all, parts[p].facet[f])) beside_.push_back(at);
    }
  }
}

bool BoundaryFacets::is_covered(const Facet& facet) const {
  return std::any_of(facet.vertex.begin(), facet.vertex.end(),
                     [&](std::uint32_t v) { return all_.kind[v] == VertexKind::Covered; });
}

BoundaryFacets::Covering BoundaryFacets::covering_of(const Facet& facet) const {
  Covering covering;
  for (const std::uint32_t v : facet.vertex) {
    const Cover* cover = covered(facet, v);
    if (cover == nullptr || std::find(covering.by.begin(), covering.by.begin() + covering.count, cover->by) != covering.by.begin() + covering.count) continue;
    covering.by[covering.count++] = cover->by;
  }
  return covering;
}

LabelSet BoundaryFacets::labels_at(std::uint32_t vertex) const {
  switch (all_.kind[vertex]) {
    case VertexKind::Junction: return all_.meeting[place_[vertex]].labels;
    case VertexKind::Uncovered:
    case VertexKind::Covered: return cover_of(vertex).between.with(cover_of(vertex).by);
    case VertexKind::Edge: break;
  }
  return {};
}

Side BoundaryFacets::side(const Facet& facet, std::uint32_t vertex, Label by) const {
  if (covered(facet, vertex) != nullptr) return Side::Covered;
  const VertexKind kind = all_.kind[vertex];
  return (kind == VertexKind::Junction || kind == VertexKind::Uncovered) && labels_at(vertex).has(by) ? Side::Boundary : Side::Here;
}

const Vec3& BoundaryFacets::position(std::uint32_t vertex, Label inner, Label outer) const {
  const std::uint32_t body = (has_mesh(inner) ? inner : outer) - 1;
  return all_.use_of(vertex, body, body + 1 == inner ? outer : inner).position;
}

const Vec3& BoundaryFacets::place(std::uint32_t vertex, Label low, Label high) const {
  if (all_.kind[vertex] == VertexKind::Covered) {
    const Cover& cover = cover_of(vertex);
    if (cover.parts(low, high)) return cover.point;
  }
  return position(vertex, high, low);
}

}  // namespace supple::implicit::lattice
