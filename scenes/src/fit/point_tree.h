/// @file point_tree.h
/// Nearest points of a set and those within a distance, by a tree of halves (Bentley 1975).
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::fit {

class PointTree {
 public:
  /// @pre !points.empty()
  explicit PointTree(std::span<const Vec3> points);

  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  /// Index of the nearest point, of equally near ones the lowest; kNone where none is nearer than `most`.
  [[nodiscard]] std::uint32_t nearest(const Vec3& place, double most = std::numeric_limits<double>::infinity()) const;
  /// Indices of the points within a distance, in the order of the tree; replaces the content of `out`.
  void within(const Vec3& place, double distance, std::vector<std::uint32_t>& out) const;

 private:
  /// Half of the points of its parent.
  struct Range {
    std::size_t begin, end, node;

    [[nodiscard]] Range first() const { return {begin, middle(), 2 * node + 1}; }
    [[nodiscard]] Range second() const { return {middle(), end, 2 * node + 2}; }
    [[nodiscard]] std::size_t middle() const { return begin + (end - begin) / 2; }
  };
  struct Best {
    std::uint32_t index;
    double least;
  };
  void divide(const Range& range);
  void search(const Vec3& place, const Range& range, Best& best) const;
  void collect(const Vec3& place, double square, const Range& range, std::vector<std::uint32_t>& out) const;
  [[nodiscard]] double least_square(const Vec3& place, std::size_t node) const;
  [[nodiscard]] double most_square(const Vec3& place, std::size_t node) const;

  std::vector<Vec3> points_;
  std::vector<std::uint32_t> order_;  ///< of the leaves
  std::vector<Box> box_;              ///< of the nodes
};

}  // namespace supple::fit
