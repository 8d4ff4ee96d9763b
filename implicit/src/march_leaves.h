/// @file march_leaves.h
/// What marching cubes keeps of a field: blocks of 2^3 leaves of 8^3 nodes, each leaf cut into 2^3 tiles of 4^3 nodes.
/// A node belongs to one leaf, a cell and an edge to the leaf of its lowest node. A tile holds values unless bounds show
/// that F keeps one sign on all cells that it owns, or partial sums that it is inside and no node next to it is outside;
/// then only the sign is known.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "blob_grid.h"
#include "polygonise_lattice.h"

namespace supple::implicit::march {

using lattice::BlockCoord;

inline constexpr int kLeafNodes = 8;   ///< along the edge of a leaf
inline constexpr int kBlockNodes = 16; ///< along the edge of a block
inline constexpr int kPlanes = 3 * kLeafNodes;

/// Nodes of a plane z of a leaf as bits x + 8 y.
using Plane = std::uint64_t;

struct Leaf {
  std::uint8_t slot = 0;         ///< which leaf of its block: x + 2 y + 4 z
  std::uint8_t active = 0;       ///< bit tx + 2 ty + 4 tz: the tile holds values
  std::uint32_t first_tile = 0;  ///< of those with values, in Block::values
  std::uint32_t vertices = 0, triangles = 0;
  std::size_t first_vertex = 0, first_triangle = 0;  ///< in the mesh
  std::size_t old_vertex = 0, old_triangle = 0;      ///< in the mesh of the last call, if the leaf was kept
  std::uint32_t first_cell = 0;                      ///< in Block::corners
  bool solve = true;   ///< its vertices are not those of the last call
  bool emit = true;    ///< its triangles are not those of the last call, but for their numbers
  std::array<std::uint16_t, 9> tile_vertex{}, tile_triangle{};  ///< those before each tile's
  std::array<Plane, kLeafNodes> inside{};      ///< F > 0
  std::array<Plane, kLeafNodes> cells{};       ///< crossed
  std::array<Plane, kPlanes> edges{};          ///< crossed: [3 z + axis]
};

/// Nodes x, y of a tile in the planes of its leaf.
[[nodiscard]] constexpr Plane tile_plane(unsigned tile) {
  return Plane{0x0f0f0f0f} << (blobs::kTile * static_cast<int>(tile & 1u)) << (8 * blobs::kTile * static_cast<int>(tile >> 1 & 1u));
}

/// Calls use(bit, z, axis) for the crossed edges of a tile in vertex order.
template <class Use>
void for_tile_edges(const Leaf& leaf, unsigned tile, const Use& use) {
  const Plane own = tile_plane(tile);
  const int first = blobs::kTile * static_cast<int>(tile >> 2);
  for (int z = first; z < first + blobs::kTile; ++z) {
    for (int axis = 0; axis < 3; ++axis) {
      for (Plane left = leaf.edges[static_cast<std::size_t>(3 * z + axis)] & own; left != 0; left &= left - 1) {
        use(std::countr_zero(left), z, axis);
      }
    }
  }
}

/// Calls use(bit, z) for the crossed cells of a tile.
template <class Use>
void for_tile_cells(const Leaf& leaf, unsigned tile, const Use& use) {
  const Plane own = tile_plane(tile);
  const int first = blobs::kTile * static_cast<int>(tile >> 2);
  for (int z = first; z < first + blobs::kTile; ++z) {
    for (Plane left = leaf.cells[static_cast<std::size_t>(z)] & own; left != 0; left &= left - 1) {
      use(std::countr_zero(left), z);
    }
  }
}

/// The tiles of a leaf among those of its block, and one of them.
[[nodiscard]] constexpr std::uint64_t block_tiles(unsigned slot) {
  return std::uint64_t{0x330033} << (2 * (slot & 1u) + 8 * (slot >> 1 & 1u) + 32 * (slot >> 2));
}
[[nodiscard]] constexpr std::uint64_t block_tile(unsigned slot, unsigned tile) {
  return std::uint64_t{1} << (2 * (slot & 1u) + 8 * (slot >> 1 & 1u) + 32 * (slot >> 2) + (tile & 1u) +
                              4 * (tile >> 1 & 1u) + 16 * (tile >> 2));
}

/// Where a leaf without values lies.
inline constexpr std::int8_t kOutside = -1, kInside = -2;

struct Block {
  BlockCoord coord{};  ///< lowest node / 16
  std::array<std::int8_t, 8> leaf_of{kOutside, kOutside, kOutside, kOutside, kOutside, kOutside, kOutside, kOutside};
  std::vector<Leaf> leaf;     ///< by slot
  std::vector<float> values;  ///< F, tile by tile, x fastest
  std::vector<std::uint8_t> corners;  ///< inside corners of the crossed cells, leaf by leaf tile by tile
  std::uint8_t changed = 0;  ///< bit by slot: sampled anew in this call
  bool touched = false;      ///< it or an upper neighbour has changed leaves
  // Of its 4^3 tiles, bit x + 4 y + 16 z.
  std::uint64_t outside = ~std::uint64_t{0};  ///< those with nodes outside
  std::uint64_t early = 0;    ///< those inside by partial sums, whose values nobody needs yet
  std::uint64_t needed = 0;   ///< of these, those next to a node outside
  std::uint64_t kernel_values = 0;  ///< taken in this call

  /// All outside, memory kept.
  void clear() {
    leaf_of.fill(kOutside);
    leaf.clear();
    values.clear();
    corners.clear();
    changed = 0;
    outside = ~std::uint64_t{0};
    early = needed = kernel_values = 0;
  }
  [[nodiscard]] bool uniform() const { return leaf.empty(); }
  [[nodiscard]] blobs::Cells base() const {
    return {std::int64_t{kBlockNodes} * coord[0], std::int64_t{kBlockNodes} * coord[1],
            std::int64_t{kBlockNodes} * coord[2]};
  }
};

/// Values of a tile that holds some.
[[nodiscard]] inline const float* tile_values(const Block& block, const Leaf& leaf, unsigned tile) {
  const auto before = static_cast<std::size_t>(std::popcount(leaf.active & ((1u << tile) - 1)));
  return block.values.data() + (leaf.first_tile + before) * blobs::kTileNodes;
}

/// The blocks around a body in z, y, x order; beyond them all is outside.
struct BlockTable {
  BlockCoord lower{}, count{};
  std::vector<Block> block;

  [[nodiscard]] std::size_t index(const BlockCoord& c) const {
    return (static_cast<std::size_t>(c[2] - lower[2]) * static_cast<std::size_t>(count[1]) +
            static_cast<std::size_t>(c[1] - lower[1])) * static_cast<std::size_t>(count[0]) +
           static_cast<std::size_t>(c[0] - lower[0]);
  }
  [[nodiscard]] const Block* find(const BlockCoord& c) const {
    for (std::size_t k = 0; k < 3; ++k) {
      if (c[k] < lower[k] || c[k] - lower[k] >= count[k]) return nullptr;
    }
    return &block[index(c)];
  }
};

}  // namespace supple::implicit::march
