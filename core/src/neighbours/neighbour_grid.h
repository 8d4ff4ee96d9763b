// The cell grid behind find_neighbours, with buffers that a workspace keeps between steps.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/neighbours.h"

namespace supple::core {

class NeighbourGrid {
 public:
  /// Replaces `pairs` by all pairs nearer than `range`, sorted; returns the number of distances computed.
  std::uint64_t find(std::span<const Vec3> positions, double range, const Executor& executor,
                     std::vector<IndexPair>& pairs);
  /// How many pairs `find` would find whose first point is one of every `stride`, from 0 on, without keeping any.
  std::uint64_t count(std::span<const Vec3> positions, double range, std::size_t stride);

 private:
  /// Cell coordinates as doubles: a point may lie farther out than an integer reaches.
  using Cell = std::array<double, 3>;

  /// What the search of one point needs.
  struct Query {
    Vec3 x;
    std::uint32_t index;
    double cell_x, cell_y, home_z;
    double range2;
  };

  void sort_into_buckets(std::span<const Vec3> positions, double range);
  [[nodiscard]] std::uint32_t row(double x, double y) const;
  [[nodiscard]] std::uint32_t bucket(const Cell& cell) const;
  /// Appends the pairs of a point with later points among the entries [begin, end).
  void scan(const Query& query, std::uint32_t begin, std::uint32_t end, std::vector<IndexPair>& pairs) const;
  /// Appends the pairs of the points [begin, end) with later points.
  std::uint64_t search(std::span<const Vec3> positions, double range, std::uint32_t begin, std::uint32_t end,
                       std::vector<IndexPair>& pairs) const;

  std::vector<Cell> cell_;            ///< cell of each point
  std::vector<std::uint32_t> start_;  ///< first entry of each bucket, shape [buckets + 1]
  std::vector<std::uint32_t> index_;  ///< points by bucket, ascending within one
  std::vector<double> x_, y_, z_;     ///< their positions, with room to read a full lane past the end
  std::uint32_t mask_ = 0;            ///< buckets - 1, buckets a power of two
  bool far_ = false;                  ///< coordinates are so large that neighbouring cells are indistinguishable

  struct Block {
    std::vector<IndexPair> pairs;
    std::uint64_t visited = 0;
  };
  std::vector<Block> block_;
};

}  // namespace supple::core
