// What a neighbour list keeps: its particles and their images sorted by cell, staged rows and the lists.
#pragma once

#include <algorithm>
#include <functional>

#include "packed_lanes.h"
#include "supple/core/neighbour_list.h"

namespace supple::core {

inline constexpr std::size_t kListBlock = 256;

struct NeighbourList::Impl {
  double range = 0.0;
  double skin = 0.0;
  std::optional<PeriodicBox> box;

  std::vector<Vec3> reference;  ///< State; everything below follows from it
  bool built = false;

  packed::CellGrid grid;
  std::vector<std::uint32_t> source;       ///< particle of each point, shape [points]
  std::vector<Vec3> shift;                 ///< from the particle to the point; empty in open space
  std::vector<packed::ListBlock> block;
  std::size_t blocks = 0;
  std::vector<packed::Row> position;       ///< of the points, and one far away to fill batches
  std::vector<packed::Row> normal;

  std::vector<Vec3> image_shift;           ///< of the points before they are sorted
  std::vector<std::uint32_t> image_source;
  std::vector<std::uint32_t> cell;
  std::vector<double> block_move2;

  void build(const Executor& executor);
  void stage(std::span<const Vec3> positions, const Executor& executor);
  void stage_normals(std::span<const Vec3> normals, const Executor& executor);
  /// Calls use(block, begin, end) for all lists, at most kListBlock at a time and in any order.
  template <class Use>
  void for_lists(const Executor& executor, const Use& use) const {
    const auto body = [&](std::size_t first, std::size_t last) {
      for (std::size_t b = first; b < last; ++b) {
        const std::size_t count = block[b].point.size();
        for (std::size_t begin = 0; begin < count; begin += kListBlock) {
          use(block[b], begin, std::min(count, begin + kListBlock));
        }
      }
    };
    executor.for_blocks(blocks, 1, std::cref(body));
  }

 private:
  void find_points();
  void lay_cells();
};

}  // namespace supple::core
