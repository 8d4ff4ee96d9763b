// Points sorted into cells, and the blocks in which their neighbours are searched.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "neighbours/search_cells.h"
#include "supple/core/executor.h"
#include "supple/core/types.h"

namespace supple::core {

/// The one squared distance that decides whether a pair is in range; the same bits from both of its points.
inline double squared_distance(const Vec3& r) { return std::fma(r.x(), r.x(), std::fma(r.y(), r.y(), r.z() * r.z())); }

/// How often a point has another one nearer than a range, for the points whose index is a multiple of `stride`.
std::uint64_t count_near_points(std::span<const Vec3> positions, double range, std::uint32_t stride);

class CellSearch {
 public:
  /// Points may lie anywhere. @pre reach > 0, positions finite
  void sort(std::span<const Vec3> positions, double reach, const Executor& executor);
  [[nodiscard]] std::size_t blocks() const { return first_tile_.size() - 1; }
  /// The points near those of a block whose index is a multiple of `stride`; replaces `out`.
  void search(std::size_t block, std::uint32_t stride, NearLists& out) const;

 private:
  void find_cells(std::span<const Vec3> positions, const Executor& executor);
  void lay_blocks();

  CellGrid grid_;
  std::vector<std::uint32_t> cell_;       ///< of each point
  std::vector<Box> block_bounds_;         ///< of blocks of points
  std::vector<std::uint32_t> first_tile_{0};  ///< of each block, and the end
};

}  // namespace supple::core
