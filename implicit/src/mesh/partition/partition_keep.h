/// @file partition_keep.h
/// Data of a division of space that are kept for the next one: results of blocks whose candidates are the same bodies with the same fields.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/partition/polygonise_blocks.h"
#include "mesh/partition/polygonise_boundaries.h"
#include "mesh/partition/boundary_crossings.h"

namespace supple::implicit::lattice {

struct KeptBlock {
  BlockCoord coord{};
  std::vector<std::uint32_t> candidate;  ///< bodies, ascending
  PartitionVertices vertices;            ///< of this block, without a LabelledBlock where no labels meet
  FacetPart facets;
  bool made = true;                      ///< rebuilt in this call
};

struct KeptPartition {
  Lattice lattice;
  std::vector<std::uint64_t> version;  ///< of the bodies' fields
  std::vector<KeptBlock> block;        ///< in z, y, x order
  KeptBoundaries boundaries;
  std::uint32_t vertices = 0;          ///< that have numbers
  AllVertices all;                     ///< of the call, kept for its capacity

  [[nodiscard]] std::uint64_t bytes() const;
};

/// Where a block is new, changed, or gone.
struct ChangedBlock {
  BlockCoord coord{};
  std::vector<Facet> facet;  ///< that it had
};

/// Makes the last partition that of these blocks: those that can stay, with labels of this call, and the others empty.
[[nodiscard]] std::vector<ChangedBlock> take_blocks(KeptPartition& partition, const BlockList& list, const Lattice& lattice,
                                                    std::span<const std::uint64_t> version);

/// Calls use(part) for the parts whose facets may have vertices of these blocks, some of them more than once.
template <class Use>
void for_parts_with(std::span<const BlockCoord> coords, std::span<const LabelledBlock* const> blocks, const Use& use) {
  const auto lies_before = [](const LabelledBlock* block, const BlockCoord& c) { return before(block->coord, c); };
  for (const BlockCoord& at : coords) {
    for (int z = -1; z <= 0; ++z) {
      for (int y = -1; y <= 0; ++y) {
        const BlockCoord last{at[0], at[1] + y, at[2] + z};
        auto block = std::lower_bound(blocks.begin(), blocks.end(), BlockCoord{at[0] - 1, last[1], last[2]}, lies_before);
        for (; block != blocks.end() && !before(last, (*block)->coord); ++block) use(static_cast<std::size_t>(block - blocks.begin()));
      }
    }
  }
}

/// Finds parts whose facets stay: those of blocks that, like those above them, did not change.
[[nodiscard]] std::vector<std::uint8_t> find_same_parts(std::span<const ChangedBlock> changed, std::span<const LabelledBlock* const> blocks);

/// Marks the vertices of this call at which facets differ from those of the last one: those of tetrahedra that have facets with a vertex
/// that is gone or new, or of all that are given. @param facets  of the last call, in its numbers
void mark_last(std::span<const Facet> facets, bool all_of_them, Carried& carried);
/// @param facets  of this call
void mark_now(std::span<const Facet> facets, bool all_of_them, Carried& carried);

}  // namespace supple::implicit::lattice
