#include "model/point_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace supple::scenes {
namespace {

constexpr std::size_t kLeaf = 8;
/// Bounds of distances are raised by more than their round-off.
constexpr double kRoundOff = 1.0 + 0x1p-40;

}  // namespace

bool PointTree::Range::is_leaf() const { return end - begin <= kLeaf; }

PointTree::PointTree(std::span<const Vec3> points) : points_(points.begin(), points.end()), index_(points.size()) {
  std::iota(index_.begin(), index_.end(), std::size_t{0});
  Box all;
  for (const Vec3& x : points_) all.include(x);
  if (!points_.empty()) middle_ = all.centre();
  divide({0, points_.size(), 0});
  for (std::size_t i = 0; i < index_.size(); ++i) points_[i] = points[index_[i]];
}

void PointTree::divide(const Range& range) {
  if (range.begin == range.end) return;
  Node node;
  for (std::size_t i = range.begin; i < range.end; ++i) node.box.include(points_[index_[i]]);
  node.box.extent().maxCoeff(&node.axis);
  if (!range.is_leaf()) {
    const auto at = [&](std::size_t i) { return index_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(range.begin), at(range.middle()), at(range.end),
                     [&](std::size_t a, std::size_t b) { return points_[a][node.axis] < points_[b][node.axis]; });
    node.at = points_[index_[range.middle()]][node.axis];
  }
  set_cone(range, node);
  if (node_.size() <= range.node) node_.resize(range.node + 1);
  node_[range.node] = node;
  if (range.is_leaf()) return;
  divide(range.lower());
  divide(range.upper());
}

std::vector<double> PointTree::nearest_distances() const {
  std::vector<double> out(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    search_nearest(i, {0, points_.size(), 0}, least);
    out[index_[i]] = std::sqrt(least);
  }
  return out;
}

/// Squared distance; points beyond a plane farther away than the least distance so far are skipped.
void PointTree::search_nearest(std::size_t own, const Range& range, double& least) const {
  if (range.is_leaf()) {
    for (std::size_t i = range.begin; i < range.end; ++i) {
      if (i != own) least = std::min(least, (points_[i] - points_[own]).squaredNorm());
    }
    return;
  }
  const double beyond = points_[own][node_[range.node].axis] - node_[range.node].at;
  const Range near = beyond < 0.0 ? range.lower() : range.upper(), far = beyond < 0.0 ? range.upper() : range.lower();
  search_nearest(own, near, least);
  if (beyond * beyond < least) search_nearest(own, far, least);
}

void PointTree::set_cone(const Range& range, Node& node) const {
  const Vec3 axis = node.box.centre() - middle_;
  const double length = axis.norm();
  bool has_cone = length > 0.0;
  if (has_cone) node.axis_of_cone = axis / length;
  double cos = 1.0;
  for (std::size_t i = range.begin; i < range.end; ++i) {
    const Vec3 x = points_[index_[i]] - middle_;
    const double radius = x.norm();
    node.radius = std::max(node.radius, radius);
    has_cone = has_cone && radius > 0.0;
    if (has_cone) cos = std::min(cos, node.axis_of_cone.dot(x) / radius);
  }
  if (!has_cone || !(cos > 0.0)) return;  // wide cones give no better bound than boxes
  node.cos = cos;
  node.sin = std::sqrt(std::max(0.0, 1.0 - cos * cos));
}

/// No point of the range is farther away than this.
double PointTree::reach(const From& from, const Range& range) const {
  const Node& node = node_[range.node];
  const double by_box = (from.at - node.box.lower).cwiseAbs().cwiseMax((from.at - node.box.upper).cwiseAbs()).norm();
  // The law of cosines: the angle to the opposite direction is at least that of the axis less that of the cone.
  const double cos = -from.direction.dot(node.axis_of_cone);
  double least_angle_cos = 1.0;
  if (cos < node.cos) least_angle_cos = cos * node.cos + std::sqrt(std::max(0.0, 1.0 - cos * cos)) * node.sin;
  const double a = from.radius, b = node.radius;
  // Beyond a right angle a point nearer to the middle may be farther away.
  const double by_cone = least_angle_cos > 0.0 ? std::sqrt(a * a + b * b + 2.0 * a * b * least_angle_cos) : by_box;
  return kRoundOff * std::min(by_box, by_cone);
}

double PointTree::largest_distance() const {
  double largest = 0.0;
  for (const Vec3& at : points_) {
    const Vec3 out = at - middle_;
    const double radius = out.norm();
    const From from{.at = at, .direction = radius > 0.0 ? Vec3(out / radius) : Vec3(Vec3::Zero()), .radius = radius};
    search_farthest(from, {0, points_.size(), 0}, largest);
  }
  return largest;
}

void PointTree::search_farthest(const From& from, const Range& range, double& largest) const {
  if (!(reach(from, range) > largest)) return;
  if (range.is_leaf()) {
    for (std::size_t i = range.begin; i < range.end; ++i) largest = std::max(largest, (from.at - points_[i]).norm());
    return;
  }
  // The farther half first: its result may exclude the other.
  Range first = range.lower(), second = range.upper();
  if (reach(from, second) > reach(from, first)) std::swap(first, second);
  search_farthest(from, first, largest);
  search_farthest(from, second, largest);
}

}  // namespace supple::scenes
