#include "supple/core/neighbours.h"

#include <algorithm>
#include <cmath>

#include "neighbours/cell_search.h"
#include "supple/core/error.h"

namespace supple::core {

std::vector<IndexPair> find_neighbours(std::span<const Vec3> positions, double range) {
  SUPPLE_EXPECTS(range > 0.0);
  CellSearch cells;
  NearLists lists;
  std::vector<IndexPair> pairs;
  cells.sort(positions, range, Executor(1));
  for (std::size_t block = 0; block < cells.blocks(); ++block) {
    cells.search(block, 1, lists);
    for (const NearLists::Owner& owner : lists.owner) {
      const std::uint32_t i = owner.index;
      for (std::size_t k = owner.begin; k < owner.begin + owner.count; ++k) {
        const std::uint32_t j = lists.near[k];
        if (i < j && squared_distance(positions[i] - positions[j]) < range * range) pairs.push_back({i, j});
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::uint64_t count_near_points(std::span<const Vec3> positions, double range, std::uint32_t stride) {
  SUPPLE_EXPECTS(range > 0.0 && stride > 0);
  CellSearch cells;
  NearLists lists;
  std::uint64_t found = 0;
  cells.sort(positions, range, Executor(1));
  for (std::size_t block = 0; block < cells.blocks(); ++block) {
    cells.search(block, stride, lists);
    for (const NearLists::Owner& owner : lists.owner) {
      for (std::size_t k = owner.begin; k < owner.begin + owner.count; ++k) {
        if (squared_distance(positions[owner.index] - positions[lists.near[k]]) < range * range) ++found;
      }
    }
  }
  return found;
}

std::vector<IndexPair> find_neighbours_brute_force(std::span<const Vec3> positions, double range) {
  SUPPLE_EXPECTS(range > 0.0);
  std::vector<IndexPair> pairs;
  const auto n = static_cast<std::uint32_t>(positions.size());
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = i + 1; j < n; ++j) {
      if (squared_distance(positions[i] - positions[j]) < range * range) pairs.push_back({i, j});
    }
  }
  return pairs;
}

}  // namespace supple::core
