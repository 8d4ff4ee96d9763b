// The particles near each particle, kept while nothing moves far, and laid out for laws that work on vectors of particles.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <hwy/contrib/sort/vqsort.h>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "neighbours/cell_search.h"
#include "supple/core/executor.h"

namespace supple::core {

/// Particles whose neighbours are visited together, one in each lane.
inline constexpr std::size_t kGroup = 8;

struct PairGroup {
  std::array<std::uint32_t, kGroup> owner{};
  std::uint32_t owners = 0;  ///< the others are fillers
  std::uint32_t steps = 0;   ///< entries of the longest list
  std::size_t begin = 0;     ///< of its entries, shape [steps][kGroup]
};

/// Every pair stands in the lists of both of its particles, so that each particle adds up what acts on it alone. A list
/// ascends: sums over it that take pairs out of range as 0 have the same bits whenever it was made.
class PairLists {
 public:
  struct Block {
    std::vector<PairGroup> group;
    std::vector<std::uint32_t> entry;  ///< particles, or the filler after the end of a list
    std::uint64_t pairs = 0;           ///< entries that are no fillers
  };
  /// Whether a pair counts, by its places in `particles`; empty: all do.
  using Takes = std::function<bool(std::uint32_t, std::uint32_t)>;

  /// @param particles  ascending  @param filler  an index that is no particle's: of entries; the next one: of owners
  PairLists(double range, std::vector<std::uint32_t> particles, std::uint32_t filler, Takes takes);

  /// Finds the lists for the positions of all particles, or keeps those that still hold every pair nearer than the range.
  /// @return distances computed
  std::uint64_t update(std::span<const Vec3> positions, const Executor& executor);
  [[nodiscard]] std::span<const Block> blocks() const { return std::span(block_).first(cells_.blocks()); }

 private:
  struct Scratch {
    NearLists near;
    hwy::Sorter sorter;
    std::vector<std::uint32_t> order, start;
  };
  [[nodiscard]] bool holds(std::span<const Vec3> positions, const Executor& executor);
  void fill(Scratch& scratch, Block& out) const;
  void take_lists(Scratch& scratch) const;
  void lay_group(const Scratch& scratch, std::size_t first, std::size_t count, Block& out) const;

  double range_;
  std::vector<std::uint32_t> particle_;
  std::uint32_t filler_;
  Takes takes_;
  std::vector<Vec3> reference_;     ///< positions at which the lists were found
  std::vector<double> block_move2_;
  CellSearch cells_;
  std::vector<Block> block_;
  std::vector<std::unique_ptr<Scratch>> scratch_;  ///< those that no thread uses
};

}  // namespace supple::core
