/// @file supple/core/neighbours.h
/// Pairs of points nearer than a range, by a cell grid.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::core {

struct IndexPair {
  std::uint32_t first;
  std::uint32_t second;
  friend bool operator==(const IndexPair&, const IndexPair&) = default;
  friend auto operator<=>(const IndexPair&, const IndexPair&) = default;
};

/// All pairs (i < j) with |x_i - x_j| < range, sorted. Cost O(n + pairs) for bounded density; points may lie anywhere
/// (the box of cells repeats). @pre range > 0, positions finite
[[nodiscard]] std::vector<IndexPair> find_neighbours(std::span<const Vec3> positions, double range);

/// The same by visiting every pair: the reference.
[[nodiscard]] std::vector<IndexPair> find_neighbours_brute_force(std::span<const Vec3> positions, double range);

}  // namespace supple::core
