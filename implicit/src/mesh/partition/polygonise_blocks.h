/// @file polygonise_blocks.h
/// Which blocks of the lattice can matter: boxes of blocks are halved until bounds exclude them or they are one block.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mesh/partition/polygonise_lattice.h"

namespace supple::implicit::lattice {

/// Inclusive range of blocks; empty when any upper < lower.
struct BlockRange {
  BlockCoord lower{0, 0, 0};
  BlockCoord upper{-1, -1, -1};
  [[nodiscard]] bool empty() const {
    return upper[0] < lower[0] || upper[1] < lower[1] || upper[2] < lower[2];
  }
  [[nodiscard]] std::uint64_t count() const;
};

/// The blocks that contain the box and `margin` cells around it.
/// @throws Error{Usage} when the box is unbounded, Error{Limit} when node numbers leave 2^30.
[[nodiscard]] BlockRange block_range(const Box& box, const Lattice& lattice, int margin);

enum class Verdict : std::uint8_t {
  Outside,  ///< no surface, all outside
  Inside,   ///< no surface, all inside one body
  Keep,     ///< halve, or keep when it is one block
};

/// Classifies a box. `candidates` are the bodies left by its parent; those that remain are appended to `left`.
using Decide =
    std::function<Verdict(const Box& box, std::span<const std::uint32_t> candidates, std::vector<std::uint32_t>& left)>;

/// A cube of blocks, clipped to the range: inclusive.
struct BlockBox {
  BlockCoord lower{};
  BlockCoord upper{};
};

struct BlockList {
  std::vector<BlockCoord> block;         ///< in z, y, x order
  std::vector<std::uint32_t> offset;     ///< candidates of block i are [offset[i], offset[i+1])
  std::vector<std::uint32_t> candidate;  ///< bodies, ascending
  std::vector<BlockBox> inside;          ///< boxes that were found inside, if requested
};

struct RefineOptions {
  std::uint64_t limit = 0;        ///< largest number of blocks
  std::uint64_t look_factor = 1;  ///< times that: limit of boxes processed in one level
  int last_node = kCells;         ///< a block spans nodes 0..last_node: 8 for cells, 7 for voxels
  bool keep_inside = false;       ///< fill BlockList::inside
  std::string_view counted = "blocks of 8^3 cells";  ///< noun of the counts in messages
  std::uint64_t per_block = 1;                       ///< how many of them a block has
};

/// @throws Error{Limit}: `blocks` are too many for options.limit; names the cell that would fit.
[[noreturn]] void refuse_blocks(double blocks, const Lattice& lattice, const RefineOptions& options);

/// @throws Error{Limit} beyond options.limit, naming the cell that would fit.
[[nodiscard]] BlockList refine_blocks(const BlockRange& range, const Lattice& lattice, std::uint32_t bodies,
                                      const Executor& executor, const RefineOptions& options, const Decide& decide);

/// Blocks where the label "largest positive field, or outside" can change, with the fields that can be it, and `inside`. Unbounded
/// fields count only where a bounded one can be positive.
/// @param surface  surface_box() of each field
[[nodiscard]] BlockList find_label_blocks(std::span<const FieldView> fields, std::span<const Box> surface,
                                          const Lattice& lattice, const Executor& executor, std::uint64_t limit,
                                          PolygoniseCounts& counts);

/// find_surface_blocks(), and the boxes of blocks between them that are inside.
[[nodiscard]] BlockList surface_blocks(const FieldView& field, const Lattice& lattice, const Executor& executor, std::uint64_t limit,
                                       PolygoniseCounts& counts);

[[nodiscard]] bool is_bounded(const Box& box);
/// x with three significant digits, for messages.
[[nodiscard]] std::string three_digits(double x);

}  // namespace supple::implicit::lattice
