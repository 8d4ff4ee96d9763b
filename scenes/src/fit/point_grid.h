/// @file point_grid.h
/// Nearest points of a set, by a tree of halves (Bentley 1975), and those within a distance, by a grid of cubes.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::fit {

class PointGrid {
 public:
  /// @param cell  edge of the cubes; about the distance between neighbours is fastest   @pre !points.empty(), cell > 0
  PointGrid(std::span<const Vec3> points, double cell);

  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  /// Index of the nearest point, of equally near ones the lowest; kNone where none is nearer than `most`.
  [[nodiscard]] std::uint32_t nearest(const Vec3& place, double most = std::numeric_limits<double>::infinity()) const;
  /// Indices of the points within a distance, in the order of the cubes; replaces the content of `out`.
  void within(const Vec3& place, double distance, std::vector<std::uint32_t>& out) const;

 private:
  using Cell = Eigen::Vector3i;
  [[nodiscard]] Cell cell_of(const Vec3& place) const;
  [[nodiscard]] std::span<const std::uint32_t> content(int x, int y, int z) const;

  /// Half of the points of its parent.
  struct Range {
    std::size_t begin, end, node;
  };
  struct Best {
    std::uint32_t index;
    double least;
  };
  void divide(const Range& range);
  void search(const Vec3& place, const Range& range, Best& best) const;

  std::vector<Vec3> points_;
  std::vector<std::uint32_t> order_;  ///< of the leaves
  std::vector<Box> box_;              ///< of the nodes
  double cell_;
  Vec3 lower_;
  Cell count_;
  std::vector<std::uint32_t> first_, index_;
};

}  // namespace supple::fit
