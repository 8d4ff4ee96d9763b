/// @file point_tree.h
/// Nearest and farthest points of a set, by a tree of halves (Bentley 1975).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::scenes {

class PointTree {
 public:
  /// @param points  finite, anywhere; n log n operations
  explicit PointTree(std::span<const Vec3> points);

  /// Distance of each point to its nearest neighbour, in the order given; infinite for a single one.
  [[nodiscard]] std::vector<double> nearest_distances() const;
  /// The largest distance of two points; 0 for fewer. Nodes are skipped that cannot hold a point farther away than the largest
  /// distance so far: by their boxes, and by their cones about the middle of all, which are as close as it takes on a sphere, where every
  /// point may have an opposite one.
  [[nodiscard]] double largest_distance() const;

 private:
  struct Node {
    Eigen::Index axis = 0;
    double at = 0.0;  ///< of the plane between its halves
    Box box;
    // Seen from the middle of all points:
    double radius = 0.0;            ///< no point is farther away
    Vec3 axis_of_cone = Vec3::UnitZ();
    double cos = -1.0, sin = 0.0;   ///< of the half angle of the cone that holds all points
  };
  /// The point whose farthest one is searched.
  struct From {
    Vec3 at, direction;  ///< the latter from the middle, a unit vector or zero
    double radius = 0.0;
  };
  struct Range {
    std::size_t begin = 0, end = 0, node = 0;
    [[nodiscard]] std::size_t middle() const { return begin + (end - begin) / 2; }
    [[nodiscard]] Range lower() const { return {begin, middle(), 2 * node + 1}; }
    [[nodiscard]] Range upper() const { return {middle(), end, 2 * node + 2}; }
    [[nodiscard]] bool is_leaf() const;
  };

  void divide(const Range& range);
  void set_cone(const Range& range, Node& node) const;
  void search_nearest(std::size_t own, const Range& range, double& least) const;
  void search_farthest(const From& from, const Range& range, double& largest) const;
  [[nodiscard]] double reach(const From& from, const Range& range) const;

  Vec3 middle_ = Vec3::Zero();      ///< of the box of all
  std::vector<Vec3> points_;        ///< in the order of the leaves
  std::vector<std::size_t> index_;  ///< of each of these
  std::vector<Node> node_;
};

}  // namespace supple::scenes
