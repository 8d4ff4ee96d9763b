/// @file boundary_facets.h
/// Facets near boundary curves: which of their vertices a third label covers, and positions of these.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/partition/polygonise_boundaries.h"
#include "mesh/partition/boundary_islands.h"

namespace supple::implicit::lattice {

/// A vertex of a facet relative to the label that covers others of its vertices.
enum class Side : std::uint8_t { Here, Boundary, Covered };

/// A facet of a part.
struct FacetPlace {
  std::uint32_t part, facet;
};

class BoundaryFacets {
 public:
  /// @param islands  facets of those that are kept are neither near nor beside any
  BoundaryFacets(std::span<const FieldView> fields, std::span<const std::uint8_t> has_mesh, AllVertices& all, std::span<const FacetPart> parts,
            const BoundaryIslands& islands);

  [[nodiscard]] std::span<const FieldView> fields() const { return fields_; }
  [[nodiscard]] AllVertices& all() const { return all_; }
  [[nodiscard]] std::span<const FacetPart> parts() const { return parts_; }
  /// Those with a vertex that was covered.
  [[nodiscard]] std::span<const FacetPlace> near() const { return near_; }
  /// These, and others with an edge between boundary curves.
  [[nodiscard]] std::span<const FacetPlace> beside() const { return beside_; }
  [[nodiscard]] const Facet& facet_at(const FacetPlace& place) const { return parts_[place.part].facet[place.facet]; }
  [[nodiscard]] bool is_covered(const Facet& facet) const;
  /// Of `all().cover`. @pre the vertex has one
  [[nodiscard]] std::uint32_t cover_index(std::uint32_t vertex) const { return place_[vertex]; }
  [[nodiscard]] const Cover& cover_of(std::uint32_t vertex) const { return all_.cover[cover_index(vertex)]; }
  [[nodiscard]] const Cover* covered(const Facet& facet, std::uint32_t vertex) const {
    if (all_.kind[vertex] != VertexKind::Covered) return nullptr;
    const Cover& cover = cover_of(vertex);
    return cover.parts(facet.inner, facet.outer) ? &cover : nullptr;
  }
  /// The labels that are largest at vertices of a facet.
  struct Covering {
    std::array<Label, 3> by{};
    std::size_t count = 0;
  };
  [[nodiscard]] Covering covering_of(const Facet& facet) const;
  /// Labels that meet at a vertex; empty for a vertex on an edge.
  [[nodiscard]] LabelSet labels_at(std::uint32_t vertex) const;
  [[nodiscard]] Side side(const Facet& facet, std::uint32_t vertex, Label by) const;
  [[nodiscard]] bool has_mesh(Label label) const { return label != 0 && has_mesh_[label - 1] != 0; }
  /// Does a body with a mesh lie on one side?
  [[nodiscard]] bool is_wanted(Label a, Label b) const { return has_mesh(a) || has_mesh(b); }
  [[nodiscard]] const Vec3& position(std::uint32_t vertex, Label inner, Label outer) const;
  /// Position of a vertex between two labels, before it is split.
  [[nodiscard]] const Vec3& place(std::uint32_t vertex, Label low, Label high) const;
  [[nodiscard]] double value(Label label, const Vec3& point) const {
    return label == 0 ? 0.0 : fields_[label - 1].value(point);
  }

 private:
  std::span<const FieldView> fields_;
  std::span<const std::uint8_t> has_mesh_;
  AllVertices& all_;
  std::span<const FacetPart> parts_;
  std::vector<std::uint32_t> place_;  ///< by vertex: of its cover or of what meets there
  std::vector<FacetPlace> near_, beside_;
};

}  // namespace supple::implicit::lattice
