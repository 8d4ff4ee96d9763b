#include "fit/point_tree.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "supple/core/error.h"

namespace supple::fit {
namespace {

constexpr std::size_t kLeaf = 8;  // most points of a leaf

}  // namespace

PointTree::PointTree(std::span<const Vec3> points) : points_(points.begin(), points.end()), order_(points.size()) {
  SUPPLE_EXPECTS(!points.empty());
  std::iota(order_.begin(), order_.end(), 0U);
  divide({0, points.size(), 0});
}

void PointTree::divide(const Range& range) {
  if (box_.size() <= range.node) box_.resize(2 * range.node + 1);
  Box box;
  for (std::size_t k = range.begin; k < range.end; ++k) box.include(points_[order_[k]]);
  box_[range.node] = box;
  if (range.end - range.begin <= kLeaf) return;
  Eigen::Index axis = 0;
  box.extent().maxCoeff(&axis);
  const auto at = [&](std::size_t k) { return order_.begin() + static_cast<std::ptrdiff_t>(k); };
  std::nth_element(at(range.begin), at(range.middle()), at(range.end), [&](std::uint32_t a, std::uint32_t b) { return std::pair(points_[a][axis], a) < std::pair(points_[b][axis], b); });
  divide(range.first());
  divide(range.second());
}

double PointTree::least_square(const Vec3& place, std::size_t node) const { return (place - place.cwiseMax(box_[node].lower).cwiseMin(box_[node].upper)).squaredNorm(); }

double PointTree::most_square(const Vec3& place, std::size_t node) const { return (place - box_[node].lower).cwiseAbs().cwiseMax((place - box_[node].upper).cwiseAbs()).squaredNorm(); }

void PointTree::search(const Vec3& place, const Range& range, Best& best) const {
  if (least_square(place, range.node) > best.least) return;
  if (range.end - range.begin <= kLeaf) {
    for (std::size_t k = range.begin; k < range.end; ++k) {
      const double d = (points_[order_[k]] - place).squaredNorm();
      if (d < best.least || (d == best.least && order_[k] < best.index)) best = {order_[k], d};
    }
    return;
  }
  Range near = range.first(), far = range.second();
  if (least_square(place, far.node) < least_square(place, near.node)) std::swap(near, far);
  search(place, near, best);
  search(place, far, best);
}

std::uint32_t PointTree::nearest(const Vec3& place, double most) const {
  Best best{kNone, most > 0.0 ? most * most : 0.0};
  search(place, {0, points_.size(), 0}, best);
  return best.index;
}

void PointTree::collect(const Vec3& place, double square, const Range& range, std::vector<std::uint32_t>& out) const {
  if (least_square(place, range.node) > square) return;
  if (most_square(place, range.node) <= square) {
    out.insert(out.end(), order_.begin() + static_cast<std::ptrdiff_t>(range.begin), order_.begin() + static_cast<std::ptrdiff_t>(range.end));
    return;
  }
  if (range.end - range.begin > kLeaf) {
    collect(place, square, range.first(), out);
    collect(place, square, range.second(), out);
    return;
  }
  for (std::size_t k = range.begin; k < range.end; ++k) {
    if ((points_[order_[k]] - place).squaredNorm() <= square) out.push_back(order_[k]);
  }
}

void PointTree::within(const Vec3& place, double distance, std::vector<std::uint32_t>& out) const {
  out.clear();
  if (distance >= 0.0) collect(place, distance * distance, {0, points_.size(), 0}, out);
}

}  // namespace supple::fit
