/// @file polygonise_boundaries.h
/// Boundary curves inside the triangles between two labels. Where a third label is largest at some vertices of a triangle and not at others, a boundary
/// curve passes through: the triangle is cut there, at points on the curve in the faces and tetrahedra of the lattice, and beyond them
/// splits into one on either side of the third label. Where different labels are largest at its vertices it is cut for both, and where these two
/// meet in it, an interface between them starts at the cut. All of it stays in the tetrahedron of the triangle.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/partition/polygonise_partition.h"

namespace supple::implicit::lattice {

/// A triangle facing from body `inner` into label `outer`; vertices are numbered over all blocks.
struct Facet {
  static constexpr unsigned kInside = 4;
  Label inner = 0, outer = 0;
  std::array<std::uint32_t, 3> vertex{};
  std::uint16_t tetrahedron = 0;  ///< of the block: six for a cell
  std::uint16_t faces = 0;        ///< three bits for the edge from each vertex: corner opposite the face that holds it, or kInside

  /// The face of the edge from vertex k.
  [[nodiscard]] unsigned face(std::size_t k) const { return faces >> (3 * k) & 7u; }
};

struct BodyCount {
  std::uint32_t body = 0;
  std::uint64_t count = 0;
  std::uint64_t first = 0;  ///< index of the first one in the body's mesh
};

/// The facets of one block.
struct FacetPart {
  std::vector<Facet> facet;  ///< before boundary curves cut them
  std::vector<Facet> cut;    ///< after that, where is_cut
  bool is_cut = false;
  std::vector<BodyCount> body;  ///< of `whole()`, where it is counted

  [[nodiscard]] std::span<const Facet> whole() const { return is_cut ? cut : facet; }
};

/// All vertices, in block order, and how bodies number those they use.
struct AllVertices {
  std::vector<const LabelledBlock*> block;
  std::vector<std::uint32_t> use_end;
  std::vector<VertexUse> use;
  std::vector<VertexKind> kind;
  std::vector<Cover> cover;      ///< by vertex, ascending
  std::vector<Meeting> meeting;  ///< by vertex, ascending

  /// Capacity stays.
  void clear() {
    block.clear();
    use_end.clear();
    use.clear();
    kind.clear();
    cover.clear();
    meeting.clear();
  }
  /// Where the uses of a vertex begin.
  [[nodiscard]] std::uint32_t first_use(std::uint32_t vertex) const { return vertex == 0 ? 0 : use_end[vertex - 1]; }
  [[nodiscard]] std::span<VertexUse> uses_of(std::uint32_t vertex) {
    const std::uint32_t begin = first_use(vertex);
    return std::span(use).subspan(begin, use_end[vertex] - begin);
  }
  /// The vertex of a body in triangles with `other` beyond.
  [[nodiscard]] const VertexUse& use_of(std::uint32_t vertex, std::uint32_t body, Label other) const {
    std::uint32_t u = first_use(vertex);
    while (use[u].body != body || (use[u].other != kAnyLabel && use[u].other != other)) ++u;
    return use[u];
  }
};

inline constexpr std::uint32_t kGone = ~std::uint32_t{0};
inline constexpr std::uint8_t kTouched = 1, kNew = 2;

/// Results of the last call that are valid in this one.
struct Carried {
  std::vector<std::uint32_t> number;     ///< by vertex of the last call, those on boundary curves behind the others: its number now, or kGone
  std::vector<std::uint8_t> disturbed;   ///< by vertex: kNew, or kTouched where one of its facets is not as it was; 0: it and they are
  std::vector<std::uint8_t> same;        ///< by part, 1: its facets are those of the last call, but for `cut`
};

inline void renumber(std::span<const std::uint32_t> number, std::span<Facet> facets) {
  for (Facet& facet : facets) {
    for (std::uint32_t& v : facet.vertex) v = number[v];
  }
}

/// Results at boundary curves, see boundary_crossings.h.
struct KeptBoundaries;

/// The bodies that are meshed together.
struct CutBodies {
  std::span<const FieldView> fields;
  std::span<const std::uint8_t> has_mesh;
  const Lattice& lattice;
  const Executor& executor;
};

/// Cuts the facets that boundary curves cross, and adds vertices on these.
/// @param carried  gets the numbers of vertices on boundary curves
/// @param kept  in: results of the last call, in its numbers; out: those of this one
void cut_at_boundaries(const CutBodies& bodies, AllVertices& all, std::span<FacetPart> parts, Carried& carried, KeptBoundaries& kept,
                 PolygoniseCounts& counts);

}  // namespace supple::implicit::lattice
