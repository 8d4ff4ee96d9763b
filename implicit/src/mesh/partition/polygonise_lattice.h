/// @file polygonise_lattice.h
/// The lattice of the mesher: blocks of 8^3 cells, each cell cut into six tetrahedra around its main diagonal (Kuhn).
/// The cut is the same in every cell, so faces and edges of neighbours agree. A corner or a direction is a bit mask,
/// x = 1, y = 2, z = 4; an edge is (base node, mask) and belongs to the block that owns its base node, nodes 0..7.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "supple/implicit/polygonise.h"

namespace supple::implicit::lattice {

inline constexpr int kCells = 8;                                      ///< cells along the edge of a block
inline constexpr int kNodes = kCells + 1;                             ///< nodes along it
inline constexpr int kBlockNodes = kNodes * kNodes * kNodes;          ///< nodes of a closed block
inline constexpr int kDirections = 7;                                 ///< masks 1..7
using BlockCoord = std::array<std::int32_t, 3>;

/// z, y, x order.
[[nodiscard]] inline bool before(const BlockCoord& a, const BlockCoord& b) {
  if (a[2] != b[2]) return a[2] < b[2];
  if (a[1] != b[1]) return a[1] < b[1];
  return a[0] < b[0];
}

/// World position of a node. The one formula, so that every block and every body sees the same bits.
[[nodiscard]] inline Vec3 node_position(const Lattice& lattice, std::int64_t i, std::int64_t j, std::int64_t k) {
  return {lattice.origin[0] + lattice.cell * static_cast<double>(i),
          lattice.origin[1] + lattice.cell * static_cast<double>(j),
          lattice.origin[2] + lattice.cell * static_cast<double>(k)};
}

/// Index of node (x, y, z) of a closed block, x fastest.
[[nodiscard]] constexpr int node_index(int x, int y, int z) { return (z * kNodes + y) * kNodes + x; }
[[nodiscard]] constexpr int node_stride(unsigned mask) {
  return node_index(static_cast<int>(mask & 1u), static_cast<int>(mask >> 1 & 1u), static_cast<int>(mask >> 2 & 1u));
}

/// The kBlockNodes nodes of a closed block, x fastest.
inline void block_nodes(const Lattice& lattice, const BlockCoord& block, std::span<Vec3> points) {
  std::size_t n = 0;
  for (int z = 0; z < kNodes; ++z) {
    for (int y = 0; y < kNodes; ++y) {
      for (int x = 0; x < kNodes; ++x) {
        points[n++] = node_position(lattice, std::int64_t{kCells} * block[0] + x, std::int64_t{kCells} * block[1] + y,
                                    std::int64_t{kCells} * block[2] + z);
      }
    }
  }
}

/// The six tetrahedra of a cell as chains of corners 0, a, a|b, 7, one for each order of the axes.
inline constexpr std::array<std::array<std::uint8_t, 4>, 6> kTetrahedra{
    {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}}};

/// The corners that span the six edges of a tetrahedron, and the index of the edge between two corners.
inline constexpr std::array<std::array<std::uint8_t, 2>, 6> kTetEdges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
inline constexpr std::array<std::array<std::int8_t, 4>, 4> kTetEdgeOf{
    {{-1, 0, 1, 2}, {0, -1, 3, 4}, {1, 3, -1, 5}, {2, 4, 5, -1}}};

/// Triangles that separate the inside corners (bit set) of a tetrahedron from the others, as indices of kTetEdges.
struct TetCase {
  std::uint8_t count = 0;
  std::array<std::array<std::uint8_t, 3>, 2> triangle{};
};

namespace detail {

using Point = std::array<int, 3>;

constexpr Point corner_point(unsigned corner) {
  return {static_cast<int>(corner & 1u), static_cast<int>(corner >> 1 & 1u), static_cast<int>(corner >> 2 & 1u)};
}
constexpr Point sum(const Point& a, const Point& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
constexpr Point difference(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
constexpr Point scaled(int s, const Point& a) { return {s * a[0], s * a[1], s * a[2]}; }
/// a . (b x c)
constexpr int triple(const Point& a, const Point& b, const Point& c) {
  return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/// Orients a triangle between edges of one tetrahedron so that it faces from the inside corners to the outside ones;
/// decided on the edges' midpoints.
constexpr void orient(const std::array<std::uint8_t, 4>& chain, unsigned inside, std::array<std::uint8_t, 3>& edges) {
  std::array<Point, 3> middle{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& ends = kTetEdges[edges[k]];
    middle[k] = sum(corner_point(chain[ends[0]]), corner_point(chain[ends[1]]));
  }
  Point in{}, out{};
  const int n_in = std::popcount(inside);
  for (std::size_t v = 0; v < 4; ++v) {
    Point& side = (inside >> v & 1u) != 0 ? in : out;
    side = sum(side, corner_point(chain[v]));
  }
  const Point across = difference(scaled(n_in, out), scaled(4 - n_in, in));
  if (triple(across, difference(middle[1], middle[0]), difference(middle[2], middle[0])) < 0) {
    const std::uint8_t keep = edges[1];
    edges[1] = edges[2];
    edges[2] = keep;
  }
}

constexpr TetCase make_tet_case(const std::array<std::uint8_t, 4>& chain, unsigned inside) {
  TetCase result;
  const auto edge = [](int a, int b) {
    return static_cast<std::uint8_t>(kTetEdgeOf[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)]);
  };
  std::array<int, 4> in{}, out{};
  int n_in = 0, n_out = 0;
  for (int v = 0; v < 4; ++v) {
    if ((inside >> v & 1u) != 0) {
      in[static_cast<std::size_t>(n_in++)] = v;
    } else {
      out[static_cast<std::size_t>(n_out++)] = v;
    }
  }
  if (n_in == 1) {
    result.count = 1;
    result.triangle[0] = {edge(in[0], out[0]), edge(in[0], out[1]), edge(in[0], out[2])};
  } else if (n_in == 3) {
    result.count = 1;
    result.triangle[0] = {edge(in[0], out[0]), edge(in[1], out[0]), edge(in[2], out[0])};
  } else if (n_in == 2) {
    result.count = 2;
    result.triangle[0] = {edge(in[0], out[0]), edge(in[0], out[1]), edge(in[1], out[1])};
    result.triangle[1] = {edge(in[0], out[0]), edge(in[1], out[1]), edge(in[1], out[0])};
  }
  for (std::size_t k = 0; k < result.count; ++k) orient(chain, inside, result.triangle[k]);
  return result;
}

}  // namespace detail

/// kTetCases[tetrahedron][inside corners]
inline constexpr auto kTetCases = [] {
  std::array<std::array<TetCase, 16>, 6> cases{};
  for (std::size_t t = 0; t < 6; ++t) {
    for (unsigned inside = 0; inside < 16; ++inside) cases[t][inside] = detail::make_tet_case(kTetrahedra[t], inside);
  }
  return cases;
}();

/// An edge of a cell's tetrahedra: base corner and direction.
struct CellEdge {
  std::uint8_t corner = 0;
  std::uint8_t mask = 0;
};
inline constexpr std::size_t kCellEdges = 19;

/// All edges of a cell, and kCellEdgeOf[corner][mask] where corner and mask are disjoint.
inline constexpr auto kCellEdge = [] {
  std::array<CellEdge, kCellEdges> edges{};
  std::size_t n = 0;
  for (std::uint8_t corner = 0; corner < 8; ++corner) {
    for (std::uint8_t mask = 1; mask < 8; ++mask) {
      if ((corner & mask) == 0) edges[n++] = {corner, mask};
    }
  }
  return edges;
}();
inline constexpr auto kCellEdgeOf = [] {
  std::array<std::array<std::uint8_t, 8>, 8> index{};
  for (std::size_t e = 0; e < kCellEdges; ++e) index[kCellEdge[e].corner][kCellEdge[e].mask] = static_cast<std::uint8_t>(e);
  return index;
}();

/// Index of a tetrahedron's edge among the edges of its cell.
[[nodiscard]] constexpr std::uint8_t cell_edge(std::size_t tetrahedron, std::size_t edge) {
  const auto low = kTetrahedra[tetrahedron][kTetEdges[edge][0]], high = kTetrahedra[tetrahedron][kTetEdges[edge][1]];
  return kCellEdgeOf[low][low ^ high];
}

/// A triangular face of the tetrahedra: nodes base, base + first, base + first + second, with disjoint masks.
struct FaceMasks {
  std::uint8_t first = 0;
  std::uint8_t second = 0;
};
inline constexpr std::size_t kFaces = 12;
inline constexpr auto kFaceMasks = [] {
  std::array<FaceMasks, kFaces> faces{};
  std::size_t n = 0;
  for (std::uint8_t first = 1; first < 8; ++first) {
    for (std::uint8_t second = 1; second < 8; ++second) {
      if ((first & second) == 0) faces[n++] = {first, second};
    }
  }
  return faces;
}();
inline constexpr auto kFaceOf = [] {
  std::array<std::array<std::uint8_t, 8>, 8> index{};
  for (std::size_t f = 0; f < kFaces; ++f) index[kFaceMasks[f].first][kFaceMasks[f].second] = static_cast<std::uint8_t>(f);
  return index;
}();

/// The edges that a block owns and the surface crosses, as a bit set with ranks. Bit order is vertex order: rows of
/// eight x in the order z, y, direction.
class EdgeSet {
 public:
  static constexpr std::size_t kRows = std::size_t{kCells} * kCells * kDirections;

  [[nodiscard]] static constexpr std::size_t row_of(int y, int z, unsigned mask) {
    return static_cast<std::size_t>((z * kCells + y) * kDirections) + mask - 1;
  }
  void set_row(std::size_t row, std::uint8_t bits) { word_[row >> 3] |= std::uint64_t{bits} << (8 * (row & 7)); }
  [[nodiscard]] std::uint8_t row(std::size_t index) const {
    return static_cast<std::uint8_t>(word_[index >> 3] >> (8 * (index & 7)));
  }
  /// Call once after the last set_row. @return number of edges
  std::uint32_t close() {
    std::uint32_t sum = 0;
    for (std::size_t w = 0; w < kWords; ++w) {
      before_[w] = static_cast<std::uint16_t>(sum);
      sum += static_cast<std::uint32_t>(std::popcount(word_[w]));
    }
    return sum;
  }
  [[nodiscard]] bool contains(std::size_t row, int x) const { return (word_[row >> 3] >> bit(row, x) & 1u) != 0; }
  /// Number of edges before this one.
  [[nodiscard]] std::uint32_t rank(std::size_t row, int x) const {
    const std::uint64_t below = word_[row >> 3] & ((std::uint64_t{1} << bit(row, x)) - 1);
    return before_[row >> 3] + static_cast<std::uint32_t>(std::popcount(below));
  }

 private:
  static constexpr std::size_t kWords = kRows / 8;
  [[nodiscard]] static constexpr unsigned bit(std::size_t row, int x) {
    return static_cast<unsigned>(8 * (row & 7)) + static_cast<unsigned>(x);
  }
  std::array<std::uint64_t, kWords> word_{};
  std::array<std::uint16_t, kWords> before_{};
};

/// Index of a block in a list in z, y, x order, or -1. `coord` gives the coordinates of an element.
template <class Block, class Coord>
[[nodiscard]] std::int64_t find_block(std::span<const Block> blocks, const BlockCoord& wanted, const Coord& coord) {
  const auto at = std::lower_bound(blocks.begin(), blocks.end(), wanted,
                                   [&](const Block& b, const BlockCoord& c) { return before(coord(b), c); });
  if (at == blocks.end() || coord(*at) != wanted) return -1;
  return at - blocks.begin();
}

}  // namespace supple::implicit::lattice
