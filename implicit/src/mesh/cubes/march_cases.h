/// @file march_cases.h
/// Triangles of a cell by the signs of its corners. Inside corners are joined along edges only, never across a face, so
/// that neighbours agree on every face whatever the values. The crossed edges of a cell then form closed loops, at most
/// four, that can be kept apart by planes, and each loop is a fan around one of its vertices. A fan is taken only where
/// none of its diagonals lies in a face of the cell: seen from its apex the rest of the loop then lies on other faces,
/// where central projection is one to one, so the fan does not cross itself, and no other cell has the same diagonal.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace supple::implicit::march {

/// An edge of a cell: base corner (bit mask x = 1, y = 2, z = 4) and axis.
struct CellEdge {
  std::uint8_t corner = 0;
  std::uint8_t axis = 0;
};
inline constexpr std::size_t kCellEdges = 12;

inline constexpr auto kCellEdge = [] {
  std::array<CellEdge, kCellEdges> edges{};
  std::size_t n = 0;
  for (std::uint8_t axis = 0; axis < 3; ++axis) {
    for (std::uint8_t corner = 0; corner < 8; ++corner) {
      if ((corner >> axis & 1u) == 0) edges[n++] = {corner, axis};
    }
  }
  return edges;
}();

/// A loop of crossed edges, counter-clockwise seen from outside.
struct Loop {
  std::uint8_t size = 0;
  std::uint8_t apices = 0;  ///< bit k: the fan around edge[k] is allowed
  std::array<std::uint8_t, 7> edge{};
};
struct CellLoops {
  std::uint8_t loops = 0;
  std::array<Loop, 4> loop{};
};
inline constexpr std::size_t kMostTriangles = 5;

namespace detail {

constexpr std::uint8_t edge_between(unsigned a, unsigned b) {
  const auto axis = static_cast<std::uint8_t>(std::countr_zero(a ^ b));
  for (std::uint8_t e = 0; e < kCellEdges; ++e) {
    if (kCellEdge[e].corner == (a & b) && kCellEdge[e].axis == axis) return e;
  }
  return 0;
}

/// Bit 2 b + s: the edge lies in the face where coordinate b is s.
constexpr unsigned faces_of(std::uint8_t edge) {
  unsigned faces = 0;
  for (unsigned b = 0; b < 3; ++b) {
    if (b != kCellEdge[edge].axis) faces |= 1u << (2 * b + (kCellEdge[edge].corner >> b & 1u));
  }
  return faces;
}

constexpr CellLoops find_loops(unsigned inside) {
  constexpr std::uint8_t kNone = 255;
  std::array<std::uint8_t, kCellEdges> next{};
  next.fill(kNone);
  for (unsigned b = 0; b < 3; ++b) {
    for (unsigned side = 0; side < 2; ++side) {
      const unsigned u = 1u << (b + 1) % 3, v = 1u << (b + 2) % 3, base = side << b;
      std::array<unsigned, 4> ring{base, base | u, base | u | v, base | v};  // counter-clockwise around axis b
      if (side == 0) ring = {ring[0], ring[3], ring[2], ring[1]};            // and seen from outside the cell
      const auto is_inside = [&](std::size_t k) { return (inside >> ring[k % 4] & 1u) != 0; };
      for (std::size_t k = 0; k < 4; ++k) {
        if (is_inside(k) || !is_inside(k + 1)) continue;
        std::size_t last = k + 1;
        while (is_inside(last + 1)) ++last;
        next[edge_between(ring[k], ring[(k + 1) % 4])] = edge_between(ring[last % 4], ring[(last + 1) % 4]);
      }
    }
  }
  CellLoops result;
  for (std::uint8_t first = 0; first < kCellEdges; ++first) {
    if (next[first] == kNone) continue;
    Loop& loop = result.loop[result.loops++];
    for (std::uint8_t e = first; next[e] != kNone;) {
      loop.edge[loop.size++] = e;
      const std::uint8_t follows = next[e];
      next[e] = kNone;
      e = follows;
    }
    for (std::size_t k = 0; k < loop.size; ++k) {
      bool allowed = true;
      for (std::size_t d = 2; d + 2 <= loop.size; ++d) {
        allowed = allowed && (faces_of(loop.edge[k]) & faces_of(loop.edge[(k + d) % loop.size])) == 0;
      }
      if (allowed) loop.apices = static_cast<std::uint8_t>(loop.apices | 1u << k);
    }
  }
  return result;
}

}  // namespace detail

inline constexpr auto kCellLoops = [] {
  std::array<CellLoops, 256> cases{};
  for (unsigned inside = 0; inside < 256; ++inside) cases[inside] = detail::find_loops(inside);
  return cases;
}();

static_assert([] {
  for (const CellLoops& c : kCellLoops) {
    std::size_t triangles = 0;
    for (std::size_t l = 0; l < c.loops; ++l) {
      if (c.loop[l].apices == 0) return false;
      triangles += c.loop[l].size - 2u;
    }
    if (triangles > kMostTriangles) return false;
  }
  return true;
}(), "every loop has a fan, and no cell more triangles than there is room for");

}  // namespace supple::implicit::march
