/// @file march_changes.h
/// How samplers write tiles into blocks.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <vector>

#include "mesh/cubes/march_sampling.h"

namespace supple::implicit::march {

using blobs::kTile;
using blobs::kTileNodes;

/// The lowest node of a tile, and of a leaf, in its block.
[[nodiscard]] inline std::array<int, 3> corner_of(unsigned tile) {
  const auto [x, y, z] = coordinates(tile);
  return {kTile * x, kTile * y, kTile * z};
}
[[nodiscard]] inline std::array<int, 3> leaf_corner(unsigned leaf) {
  return {kLeafNodes * static_cast<int>(leaf & 1u), kLeafNodes * static_cast<int>(leaf >> 1 & 1u), kLeafNodes * static_cast<int>(leaf >> 2)};
}

/// Gives a block tiles with values and takes them from it, all at once.
class TileChanges {
 public:
  void begin(const Block& block) {
    made_ = dropped_ = 0;
    to_ = block.values.data();
    room_ = block.values.capacity();
  }
  /// Room for the values of a tile.
  [[nodiscard]] float* room(unsigned place) { return values_.data() + std::size_t{kTileNodes} * place; }
  /// The values there are those of a tile.
  void make(unsigned place, Bits inside) {
    inside_[place] = inside;
    made_ |= Bits{1} << place;
    // Prefetches the memory that apply() will write.
    constexpr std::size_t kLine = 64 / sizeof(float);
    const std::size_t first = kTileNodes * static_cast<std::size_t>(std::popcount(made_) - 1);
    for (std::size_t i = first; i < std::min(first + kTileNodes, room_); i += kLine) __builtin_prefetch(to_ + i, 1);
  }
  void drop(Bits tiles) { dropped_ |= tiles; }

  void apply(Block& block) {
    const Bits kept = block.held & ~dropped_ & ~made_, held = kept | made_;
    if (made_ == 0 && kept == block.held) return;
    old_nodes_.clear();
    old_tiles_.clear();
    old_values_.clear();
    if (kept != 0) {
      old_nodes_.swap(block.inside_nodes);
      old_tiles_.swap(block.tile);
      old_values_.swap(block.values);
    }
    const auto count = static_cast<std::size_t>(std::popcount(held));
    block.inside_nodes.resize(count);
    block.tile.assign(count, Tile{});
    block.values.clear();
    block.values.reserve(kTileNodes * count);
    std::size_t rank = 0;
    for_bits(held, [&](unsigned place) {
      const float* values = room(place);
      Tile& tile = block.tile[rank];
      if ((made_ >> place & 1u) != 0) {
        block.inside_nodes[rank] = inside_[place];
        tile.place = static_cast<std::uint8_t>(place);
      } else {
        const std::size_t old = block.rank(place);
        block.inside_nodes[rank] = old_nodes_[old];
        tile = old_tiles_[old];
        values = old_values_.data() + kTileNodes * old;
      }
      ++rank;
      block.values.insert(block.values.end(), values, values + kTileNodes);
    });
    block.flipped |= block.held ^ held;
    block.held = held;
  }

 private:
  Bits made_ = 0, dropped_ = 0;
  const float* to_ = nullptr;  ///< where the block's values are, in that much room
  std::size_t room_ = 0;
  std::array<Bits, 64> inside_{};
  alignas(64) std::array<float, 64 * kTileNodes> values_;  // by place
  std::vector<Bits> old_nodes_;
  std::vector<float> old_values_;
  std::vector<Tile> old_tiles_;
};

/// Without values: all nodes on one side.
inline void set_sign(Block& block, Bits tiles, bool inside) {
  block.outside = inside ? block.outside & ~tiles : block.outside | tiles;
}

/// The samplers of bodies of Wyvill points, in single precision, and of any field, through its view in double precision.
[[nodiscard]] std::unique_ptr<Sampler> make_blob_sampler(const Field& field, const Lattice& lattice, bool skip, blobs::BlobGrid& grid);
[[nodiscard]] std::unique_ptr<Sampler> make_view_sampler(const FieldView& field, const Lattice& lattice, ViewMemory& memory);

}  // namespace supple::implicit::march
