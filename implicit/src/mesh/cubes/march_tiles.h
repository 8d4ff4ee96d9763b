/// @file march_tiles.h
/// What marching cubes keeps of a field: blocks of 4^3 tiles of 4^3 nodes. A node belongs to one tile, a cell and an edge to
/// the tile of its lowest node. A tile holds values unless bounds show that F keeps one sign on all cells that it owns, or
/// partial sums that it is inside and no node next to it is outside; then only the sign is known. Both the tiles of a block
/// and the nodes of a tile are bits x + 4 y + 16 z of a word.
#pragma once

#include <immintrin.h>

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "mesh/blob_grid.h"
#include "mesh/partition/polygonise_lattice.h"

namespace supple::implicit::march {

using lattice::BlockCoord;

inline constexpr int kBlockNodes = 16;  ///< along the edge of a block
inline constexpr int kLeafNodes = 8;    ///< along the edge of a leaf, 2^3 tiles whose bounds are evaluated together
inline constexpr unsigned kLeaves = 8;  ///< of a block, x + 2 y + 4 z

/// 4^3 tiles of a block or nodes of a tile.
using Bits = std::uint64_t;
inline constexpr Bits kAll = ~Bits{0};
inline constexpr Bits kFirstX = 0x1111111111111111, kFirstY = 0x000f000f000f000f, kFirstZ = 0xffff;

/// Calls use(bit) for the bits of a word in rising order.
template <class Use>
void for_bits(Bits word, const Use& use) {
  for (; word != 0; word &= word - 1) use(static_cast<unsigned>(std::countr_zero(word)));
}
[[nodiscard]] constexpr std::array<int, 3> coordinates(unsigned bit) {
  return {static_cast<int>(bit & 3u), static_cast<int>(bit >> 2 & 3u), static_cast<int>(bit >> 4)};
}

/// The first along the axes in the mask `step`.
[[nodiscard]] constexpr Bits first_of(unsigned step) {
  return ((step & 1u) != 0 ? kFirstX : kAll) & ((step & 2u) != 0 ? kFirstY : kAll) & ((step & 4u) != 0 ? kFirstZ : kAll);
}

/// What lies one step up the axes in the mask `step`, of words and the seven above them, by step.
struct Steps {
  std::array<Bits, 8> step;

  explicit constexpr Steps(const std::array<Bits, 8>& above) {
    const auto along_x = [](Bits own, Bits next) { return (own >> 1 & ~(kFirstX << 3)) | (next & kFirstX) << 3; };
    const auto along_y = [](Bits own, Bits next) { return (own >> 4 & ~(kFirstY << 12)) | (next & kFirstY) << 12; };
    const auto along_z = [](Bits own, Bits next) { return own >> 16 | next << 48; };
    const Bits x = along_x(above[0], above[1]), y_x = along_x(above[2], above[3]);
    const Bits z_x = along_x(above[4], above[5]), yz_x = along_x(above[6], above[7]);
    const Bits xy = along_y(x, y_x), y = along_y(above[0], above[2]);
    step = {above[0], x, y, xy, along_z(above[0], above[4]), along_z(x, z_x), along_z(y, along_y(above[4], above[6])),
            along_z(xy, along_y(z_x, yz_x))};
  }
  [[nodiscard]] constexpr Bits any() const {
    return step[0] | step[1] | step[2] | step[3] | step[4] | step[5] | step[6] | step[7];
  }
  [[nodiscard]] constexpr Bits all() const {
    return step[0] & step[1] & step[2] & step[3] & step[4] & step[5] & step[6] & step[7];
  }
};

/// A tile with values.
struct Tile {
  Bits cells = 0;                 ///< crossed
  std::array<Bits, 3> edges{};    ///< crossed, by axis
  std::uint16_t first_vertex = 0, old_vertex = 0;      ///< in those of the block, and before they were last counted
  std::uint16_t first_triangle = 0, old_triangle = 0;  ///< the same
  std::uint16_t triangles = 0;
  std::uint16_t first_cell = 0;   ///< in Block::corners
  std::uint8_t vertices = 0;
  std::uint8_t place = 0;         ///< in the block
};

/// Calls use(node, axis) for the crossed edges of a tile in vertex order.
template <class Use>
void for_tile_edges(const Tile& tile, const Use& use) {
  for (unsigned axis = 0; axis < 3; ++axis) {
    for_bits(tile.edges[axis], [&](unsigned node) { use(node, axis); });
  }
}

/// Prefetches data that have left the nearer caches.
template <class Item>
void fetch_ahead(const Item* items, std::size_t count) {
  constexpr std::size_t kLine = 64;
  const char* bytes = reinterpret_cast<const char*>(items);
  for (std::size_t i = 0; i < count * sizeof(Item); i += kLine) _mm_prefetch(bytes + i, _MM_HINT_T0);
}

/// The tiles of a leaf.
[[nodiscard]] constexpr Bits tiles_of(unsigned leaf) {
  return Bits{0x330033} << (2 * (leaf & 1u) + 8 * (leaf >> 1 & 1u) + 32 * (leaf >> 2));
}
[[nodiscard]] constexpr unsigned leaf_of(unsigned place) {
  return (place >> 1 & 1u) | (place >> 2 & 2u) | (place >> 3 & 4u);
}

/// Content of blocks.
struct Held {
  std::uint64_t tiles = 0, bytes = 0;
};

struct alignas(64) Block {
  // Data of blocks that are used most are in one cache line.
  BlockCoord coord{};         ///< lowest node / 16
  std::uint32_t vertices = 0, first_vertex = 0, old_vertex = 0;        ///< in the mesh, and in that of the last call
  std::uint32_t triangles = 0, first_triangle = 0, old_triangle = 0;  ///< the same
  std::uint32_t first_point = 0;                                       ///< in MeshScratch::point
  Bits held = 0;              ///< tiles with values
  Bits solve = 0;             ///< those whose vertices are not those of the last call
  Bits emit = 0;              ///< those whose triangles may be others
  Bits outside = kAll;        ///< tiles with nodes outside
  Bits changed = 0;           ///< sampled anew in this call: what moved may reach their nodes or those next to them
  Bits flipped = 0;           ///< those that hold values and did not before, or the other way round
  Bits early = 0;             ///< those inside by partial sums, whose values are not needed yet
  Bits needed = 0;            ///< of these, those next to a node outside
  std::uint8_t decided = 0;   ///< leaves on which bounds show one sign
  std::vector<Bits> inside_nodes;  ///< of the tiles that hold values, by place: F > 0
  std::vector<Tile> tile;     ///< these tiles
  std::vector<float> values;  ///< of these, F at kTileNodes nodes each, x fastest
  std::vector<std::uint8_t> corners;  ///< inside corners of the crossed cells, tile by tile
  std::uint64_t kernel_values = 0;    ///< taken in this call
  std::uint32_t point_room = 0;       ///< from first_point on
  Held counted;                       ///< when it was last counted

  /// All outside, memory kept.
  void clear() {
    inside_nodes.clear();
    tile.clear();
    values.clear();
    corners.clear();
    kernel_values = 0;
    held = changed = flipped = early = needed = 0;
    outside = kAll;
    decided = 0;
  }
  [[nodiscard]] bool uniform() const { return held == 0; }
  [[nodiscard]] blobs::Cells base() const {
    return {std::int64_t{kBlockNodes} * coord[0], std::int64_t{kBlockNodes} * coord[1],
            std::int64_t{kBlockNodes} * coord[2]};
  }
  /// Index of a tile with values among these.
  [[nodiscard]] std::size_t rank(unsigned place) const {
    return static_cast<std::size_t>(std::popcount(held & ((Bits{1} << place) - 1)));
  }
  /// The nodes of a tile with F > 0.
  [[nodiscard]] Bits inside(unsigned place) const {
    if ((held >> place & 1u) != 0) return inside_nodes[rank(place)];
    return (outside >> place & 1u) != 0 ? Bits{0} : kAll;
  }
};

/// The blocks around a body in z, y, x order; beyond them all is outside.
struct BlockTable {
  BlockCoord lower{}, count{};
  std::vector<Block> block;
  std::vector<std::uint8_t> touched;  ///< by block: whether something of it was made anew in this call
  std::vector<std::uint8_t> holds;    ///< by block: whether it held values when it was last counted
  std::vector<std::uint8_t> blank;    ///< by block: whether it is as Block::clear leaves it
  bool all = false;                   ///< whether all that hold values were touched in this call
  Held held;                          ///< of all blocks

  /// Clears the marks of rebuilt tiles.
  void begin_call() {
    all = false;
    for (std::size_t b = 0; b < block.size(); ++b) {
      if (touched[b] == 0) continue;
      touched[b] = 0;
      block[b].changed = block[b].flipped = block[b].solve = block[b].emit = block[b].kernel_values = 0;
    }
  }
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

/// Calls use(index) for a block and the seven below it, those that there are.
template <class Use>
void for_blocks_below(const BlockTable& table, const Block& block, const Use& use) {
  for (int step = 0; step < 8; ++step) {
    const BlockCoord at{block.coord[0] - (step & 1), block.coord[1] - (step >> 1 & 1), block.coord[2] - (step >> 2)};
    if (table.find(at) != nullptr) use(table.index(at));
  }
}

/// A block and the seven above it, by the steps along x, y, z in bits; null where there is none.
using BlocksAbove = std::array<const Block*, 8>;
[[nodiscard]] inline BlocksAbove blocks_above(const BlockTable& table, const Block& block) {
  BlocksAbove above{&block};
  for (unsigned step = 1; step < 8; ++step) {
    above[step] = table.find({block.coord[0] + static_cast<std::int32_t>(step & 1u),
                              block.coord[1] + static_cast<std::int32_t>(step >> 1 & 1u),
                              block.coord[2] + static_cast<std::int32_t>(step >> 2)});
  }
  return above;
}

}  // namespace supple::implicit::march
