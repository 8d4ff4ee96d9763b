/// @file march_leaves.h
/// The leaves with values of a field that is sampled through its view, from call to call.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "field/field_changes.h"
#include "mesh/partition/polygonise_blocks.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit::march {

using lattice::BlockCoord;

/// Leaves with surface, about 7 kB each with their part of the mesh; where more are in reach, no data are kept per leaf.
inline constexpr std::uint64_t kMostLeaves = 1'000'000;

/// The closed box of a leaf: it ends at the first nodes of the next ones.
[[nodiscard]] Box leaf_box(const BlockCoord& leaf, const Lattice& lattice);

/// Whether one of these meets a box, or they are too many to test.
[[nodiscard]] bool may_meet(std::span<const Reach> reaches, const Box& box);

/// Tiles of leaves, those of a leaf as bits x + 2 y + 4 z; beyond a range of leaves there are none.
class ChangedTiles {
 public:
  /// None, in that range.
  void reset(const lattice::BlockRange& range);
  /// Adds the tiles whose closed boxes a support meets.
  void add(const Reach& reach, const Lattice& lattice);
  [[nodiscard]] std::uint8_t operator[](const BlockCoord& leaf) const;
  /// Whether a leaf that a box meets has tiles.
  [[nodiscard]] bool meets(const Box& box, const Lattice& lattice) const;
  /// Whether all leaves that a box meets are in the range.
  [[nodiscard]] bool covers(const Box& box, const Lattice& lattice) const;
  /// Leaves with tiles, in z, y, x order.
  [[nodiscard]] std::vector<BlockCoord> leaves() const;
  [[nodiscard]] std::size_t bytes() const { return tiles_.capacity(); }

 private:
  /// The lowest and the highest leaf that a box meets along an axis, without end.
  [[nodiscard]] static std::pair<double, double> along(std::size_t axis, const Box& box, const Lattice& lattice);
  /// The leaves of the range that a box meets, and no more than one beyond on each side.
  [[nodiscard]] lattice::BlockRange around(const Box& box, const Lattice& lattice) const;
  [[nodiscard]] std::size_t index(const BlockCoord& leaf) const;

  lattice::BlockRange range_;
  std::vector<std::uint8_t> tiles_;
};

/// Known data of the field of the last call.
struct ViewMemory {
  Lattice lattice;
  FieldChanges changes;
  std::vector<BlockCoord> leaf;  ///< those with values
  ChangedTiles changed;             ///< where values may be different, if not everywhere
  bool all = true;               ///< everywhere

  void forget() { changes.forget(); }
  /// Whether values next to the surface, as far as a leaf, may be different in a box.
  [[nodiscard]] bool differs(const Box& box) const { return all || changed.meets(box, lattice); }
  /// Whether values anywhere in a box may be different.
  [[nodiscard]] bool differs_at(const Box& evaluated) const {
    if (all || !changed.covers(evaluated, lattice)) return true;
    return changed.meets(evaluated, lattice) && may_meet(changes.reaches(), evaluated);
  }
  /// Records the changes of a field that is to be sampled, and `leaf` of the last call.
  void compare(const FieldView& field, const Lattice& now);
  [[nodiscard]] std::size_t bytes() const { return changes.bytes() + leaf.capacity() * sizeof(leaf[0]) + changed.bytes(); }
};

}  // namespace supple::implicit::march
