/// @file march_changes.h
/// How samplers write tiles into blocks.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <vector>

#include "march_sampling.h"

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
  void begin() { made_ = dropped_ = 0; }
  /// Room for the values of a tile.
  [[nodiscard]] float* room(unsigned place) { return values_.data() + std::size_t{kTileNodes} * place; }
  /// The values there are those of a tile.
  void make(unsigned place, Bits inside) {
    inside_[place] = inside;
    made_ |= Bits{1} << place;
  }
  void drop(Bits tiles) { dropped_ |= tiles; }

  void apply(Block& block) {
    const Bits kept = block.held & ~dropped_ & ~made_, held = kept | made_;
    if (made_ == 0 && kept == block.held) return;
    old_tiles_.clear();
    old_values_.clear();
    if (kept != 0) {
      old_tiles_.swap(block.tile);
      old_values_.swap(block.values);
    }
    block.tile.clear();
    block.values.clear();
    block.tile.reserve(static_cast<std::size_t>(std::popcount(held)));
    block.values.reserve(kTileNodes * static_cast<std::size_t>(std::popcount(held)));
    for_bits(held, [&](unsigned place) {
      const float* values = room(place);
      if ((made_ >> place & 1u) != 0) {
        block.tile.push_back({.inside = inside_[place], .place = static_cast<std::uint8_t>(place)});
      } else {
        block.tile.push_back(old_tiles_[block.rank(place)]);
        values = old_values_.data() + kTileNodes * block.rank(place);
      }
      block.values.insert(block.values.end(), values, values + kTileNodes);
    });
    block.flipped |= block.held ^ held;
    block.held = held;
  }

 private:
  Bits made_ = 0, dropped_ = 0;
  std::array<Bits, 64> inside_{};
  alignas(64) std::array<float, 64 * kTileNodes> values_;  // by place
  std::vector<float> old_values_;
  std::vector<Tile> old_tiles_;
};

/// Without values: all nodes on one side.
inline void set_sign(Block& block, Bits tiles, bool inside) {
  block.outside = inside ? block.outside & ~tiles : block.outside | tiles;
}

/// The samplers of bodies of Wyvill points, in single precision, and of any field, through its view in double precision.
[[nodiscard]] std::unique_ptr<Sampler> make_blob_sampler(const Field& field, const Lattice& lattice, bool skip, blobs::BlobGrid& grid);
[[nodiscard]] std::unique_ptr<Sampler> make_view_sampler(const FieldView& field, const Lattice& lattice);

}  // namespace supple::implicit::march
