/// @file polygonise_block_edges.h
/// Common code of both mesh paths for one block: roots on crossed edges, and vertices of a neighbour.
#pragma once

#include <limits>
#include <span>

#include "mesh/partition/polygonise_lattice.h"
#include "mesh/partition/polygonise_roots.h"

namespace supple::implicit::lattice {

/// From the node (x, y, z) of a block to the next one along the axes in `mask`.
struct BlockEdge {
  int x, y, z;
  unsigned mask;
};

/// Adds an edge of a block to `roots`; `value` gives f at a node index of the block.
template <class Value>
void add_edge(const BlockEdge& edge, std::span<const Vec3> nodes, const Value& value, EdgeRoots& roots) {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  const auto moves = [&](int axis) { return (edge.mask >> axis & 1u) != 0; };
  const auto inside = [&](int steps) {  // is the node that many directions away in the block?
    const auto within = [&](int axis, int at) { return !moves(axis) || (at + steps >= 0 && at + steps < kNodes); };
    return within(0, edge.x) && within(1, edge.y) && within(2, edge.z);
  };
  const int start = node_index(edge.x, edge.y, edge.z), stride = node_stride(edge.mask);
  const double f0 = value(start), f1 = value(start + stride);
  const double before = inside(-1) ? value(start - stride) : kMissing;
  const double after = inside(2) ? value(start + 2 * stride) : kMissing;
  roots.add(nodes[static_cast<std::size_t>(start)], nodes[static_cast<std::size_t>(start + stride)], f0, f1,
            guess_root(before, f0, f1, after));
}

/// Calls use(x, y, z, mask) for the crossed edges of a block in vertex order.
template <class Use>
void for_edges(const EdgeSet& edges, const Use& use) {
  for (int z = 0; z < kCells; ++z) {
    for (int y = 0; y < kCells; ++y) {
      for (unsigned mask = 1; mask <= kDirections; ++mask) {
        for (unsigned bits = edges.row(EdgeSet::row_of(y, z, mask)); bits != 0; bits &= bits - 1) {
          use(std::countr_zero(bits), y, z, mask);
        }
      }
    }
  }
}

/// Outward unit normal of f > 0 at a root; where f has no gradient, the direction `towards_outside` of the edge.
[[nodiscard]] inline Vec3 outward(const Vec3& gradient, const Vec3& towards_outside) {
  const double norm = gradient.norm();
  if (norm > 0.0 && std::isfinite(norm)) return -gradient / norm;
  return towards_outside.normalized();
}

/// Indices of the eight blocks at block + (0..1)^3 in a list in z, y, x order; -1 where there is none.
template <class Block, class Coord>
[[nodiscard]] std::array<std::int64_t, 8> upper_neighbours(std::span<const Block> blocks, std::size_t self,
                                                           const Coord& coord) {
  std::array<std::int64_t, 8> found{};
  found[0] = static_cast<std::int64_t>(self);
  for (unsigned step = 1; step < 8; ++step) {
    BlockCoord wanted = coord(blocks[self]);
    for (std::size_t k = 0; k < 3; ++k) wanted[k] += static_cast<std::int32_t>(step >> k & 1u);
    const auto rest = blocks.subspan(self + 1);  // all of them come later in the order
    const std::int64_t at = find_block(rest, wanted, coord);
    found[step] = at < 0 ? -1 : at + static_cast<std::int64_t>(self) + 1;
  }
  return found;
}

/// A node of a closed block in the block that owns it: which of the eight neighbours, and its position there.
struct OwnedNode {
  unsigned neighbour;
  int x, y, z;
  OwnedNode(int x0, int y0, int z0)
      : neighbour(static_cast<unsigned>(x0 >> 3) | static_cast<unsigned>(y0 >> 3) << 1 |
                  static_cast<unsigned>(z0 >> 3) << 2),
        x(x0 & 7), y(y0 & 7), z(z0 & 7) {}
};

/// @throws Error{Internal}: a bound excluded a block with surface, so the mesh would have a hole.
[[noreturn]] void throw_missing_block(const BlockCoord& block);
/// @throws Error{Limit} when vertices cannot be numbered in 32 bits.
void expect_indexable(std::uint64_t vertices, const Lattice& lattice);

}  // namespace supple::implicit::lattice
