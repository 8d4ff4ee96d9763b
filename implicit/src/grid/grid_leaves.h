/// @file grid_leaves.h
/// Construction of OpenVDB grids of a surface, leaf by leaf.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "mesh/partition/polygonise_blocks.h"
#include "supple/core/hash.h"
#include "supple/implicit/surface_grid.h"

namespace supple::implicit {

struct SurfaceGrid::Impl {
  explicit Impl(openvdb::FloatGrid::Ptr made) : grid(std::move(made)) {}
  openvdb::FloatGrid::Ptr grid;
};

namespace gridding {

using lattice::BlockBox;
using lattice::BlockCoord;
using lattice::BlockList;
using lattice::BlockRange;
using lattice::Verdict;
using Leaf = openvdb::FloatTree::LeafNodeType;

inline constexpr std::size_t kLeafVoxels = Leaf::SIZE;
inline constexpr std::size_t kLeavesPerTask = 16;
static_assert(Leaf::DIM == lattice::kCells, "a leaf holds the nodes that a block owns");

/// Width of the band on each side [m].
[[nodiscard]] inline double band_of(const GridOptions& options) { return options.half_width * options.lattice.cell; }

/// The blocks of a grid: those of the surface's box and of the band around it.
[[nodiscard]] BlockRange range_of(const FieldView& field, const GridOptions& options);

/// Whether parts may be so thin that a node inside has neighbours beyond all supports, where no gradient gives a distance. Its leaves are then
/// found from the nodes next to them, too.
[[nodiscard]] bool is_thin(const FieldView& field, const GridOptions& options);

/// Whether the nodes of a box may be in the band, or, of thin parts, a cell from the surface.
[[nodiscard]] Verdict look(const FieldView& field, const GridOptions& options, bool thin, const Box& box);

/// The box of a leaf's nodes.
[[nodiscard]] Box box_of(const BlockCoord& block, const Lattice& lattice);

[[nodiscard]] std::uint64_t most_leaves(const GridOptions& options);

/// The leaves of a range that may contain some of the narrow band, decided by `decide` on boxes. @param bodies  to decide among
/// @throws Error{Limit}
[[nodiscard]] BlockList band_leaves(const BlockRange& range, const GridOptions& options, std::uint32_t bodies, const Executor& executor,
                                    const lattice::Decide& decide);
[[nodiscard]] BlockList band_leaves(const FieldView& field, const GridOptions& options, const Executor& executor);

/// A leaf during construction.
struct SampledLeaf {
  std::unique_ptr<Leaf> leaf;   ///< none when no voxel is in the band
  bool inside = false;          ///< of a leaf without band: all voxels inside
  float largest = 0.0F;         ///< largest |value| of an active voxel
};
[[nodiscard]] SampledLeaf sample_leaf(const FieldView& field, const GridOptions& options, bool thin, const BlockCoord& block);

/// The value of voxels beyond the band: its width, or the largest |F| in it, with the sign of the side.
[[nodiscard]] float inside_value(const GridOptions& options, float largest);

void set_beyond(Leaf& leaf, float inside);
void fill(openvdb::FloatTree& tree, const BlockBox& box, float value);
/// Sets another value for all voxels beyond the band.
void change_beyond(openvdb::FloatTree& tree, float inside);
/// Puts a sampled leaf, or the tile that replaces it, into the tree.
void place(openvdb::FloatTree& tree, const BlockCoord& block, SampledLeaf& sampled, float inside);

/// A complete grid and the counts of its construction.
struct MadeGrid {
  openvdb::FloatGrid::Ptr grid;
  float inside = 0.0F;
  std::vector<std::pair<BlockCoord, float>> largest;  ///< |value| by leaf
  std::uint64_t looked_at = 0;
};

/// The largest |value| by leaf, of GridContent::Field: the maximum of all is the value beyond the band.
class LargestValues {
 public:
  void reset(std::span<const std::pair<BlockCoord, float>> by_leaf);
  void set(const BlockCoord& block, const SampledLeaf& sampled);
  void erase(const BlockCoord& block) { by_leaf_.erase(block); }
  [[nodiscard]] float of_all() const;

 private:
  struct Hash {
    std::size_t operator()(const BlockCoord& block) const { return static_cast<std::size_t>(hash_bytes(std::as_bytes(std::span<const std::int32_t>(block)))); }
  };
  std::unordered_map<BlockCoord, float, Hash> by_leaf_;
};

/// @param sample  leaf i of the list
[[nodiscard]] MadeGrid make_whole(const BlockList& list, const GridOptions& options, const Executor& executor,
                                  const std::function<SampledLeaf(std::size_t)>& sample);
[[nodiscard]] MadeGrid make_whole(const FieldView& field, const GridOptions& options, const Executor& executor);

[[nodiscard]] bool same(const GridOptions& a, const GridOptions& b);

}  // namespace gridding
}  // namespace supple::implicit
