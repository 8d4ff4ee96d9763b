/// @file polygonise_rims.h
/// Rims inside the triangles between two labels. Where a third label wins at some vertices of a triangle and not at others, a rim
/// passes through: the triangle is cut there, at points on the rim in the faces and tetrahedra of the lattice, and beyond them
/// parts into one on either side of the third label. Where different labels win at its vertices it is cut for both, and where these two
/// meet in it a wall between them stands on the cut. All of it stays in the tetrahedron of the triangle.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "polygonise_partition.h"

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

/// The facets of the blocks of one task.
struct FacetPart {
  std::vector<Facet> facet;
  std::vector<std::size_t> end;      ///< those of block i of the task end here
  std::uint32_t first_block = 0;     ///< of the task
  std::vector<BodyCount> body;
};

/// All vertices, in block order, and how bodies number those they use.
struct AllVertices {
  std::vector<LabelledBlock> block;
  std::vector<std::uint32_t> use_end;
  std::vector<VertexUse> use;
  std::vector<VertexKind> kind;
  std::vector<Cover> cover;      ///< by vertex, ascending
  std::vector<Meeting> meeting;  ///< by vertex, ascending

  [[nodiscard]] std::span<VertexUse> uses_of(std::uint32_t vertex) {
    const std::uint32_t begin = vertex == 0 ? 0 : use_end[vertex - 1];
    return std::span(use).subspan(begin, use_end[vertex] - begin);
  }
  /// As a body sees it in triangles with `other` beyond.
  [[nodiscard]] const VertexUse& use_of(std::uint32_t vertex, std::uint32_t body, Label other) const {
    std::uint32_t u = vertex == 0 ? 0 : use_end[vertex - 1];
    while (use[u].body != body || (use[u].other != kAnyLabel && use[u].other != other)) ++u;
    return use[u];
  }
};

/// Cuts the facets that rims cross, and adds vertices on these.
void cut_at_rims(std::span<const FieldView> fields, std::span<const std::uint8_t> has_mesh, const Lattice& lattice,
                 const Executor& executor, AllVertices& all, std::span<FacetPart> parts, PolygoniseCounts& counts);

}  // namespace supple::implicit::lattice
