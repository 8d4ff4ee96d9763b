#include "fit/point_grid.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "supple/core/error.h"

namespace supple::fit {
namespace {

constexpr std::size_t kLeaf = 8;  // most points of a leaf

}  // namespace

PointGrid::PointGrid(std::span<const Vec3> points, double cell) : points_(points.begin(), points.end()), cell_(cell) {
  SUPPLE_EXPECTS(!points.empty() && cell > 0.0);
  Box box;
  for (const Vec3& p : points) box.include(p);
  lower_ = box.lower;
  constexpr double kMostCells = 256.0;  // along a side
  cell_ = std::max(cell_, box.extent().maxCoeff() / kMostCells);
  count_ = (box.extent() / cell_).array().floor().cast<int>() + 1;
  first_.assign(static_cast<std::size_t>(count_.prod()) + 1, 0);
  const auto number = [this](const Vec3& p) {
    const Cell c = cell_of(p);
    return static_cast<std::size_t>((c.z() * count_.y() + c.y()) * count_.x() + c.x());
  };
  for (const Vec3& p : points) ++first_[number(p) + 1];
  for (std::size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  index_.resize(points.size());
  for (std::uint32_t k = 0; k < points.size(); ++k) index_[next[number(points[k])]++] = k;
  order_.resize(points.size());
  std::iota(order_.begin(), order_.end(), 0U);
  divide({0, points.size(), 0});
}

PointGrid::Cell PointGrid::cell_of(const Vec3& place) const {
  const Vec3 at = ((place - lower_) / cell_).array().floor();
  return at.cwiseMax(0.0).cwiseMin((count_.cast<double>().array() - 1.0).matrix()).cast<int>();
}

std::span<const std::uint32_t> PointGrid::content(int x, int y, int z) const {
  const auto k = static_cast<std::size_t>((z * count_.y() + y) * count_.x() + x);
  return {index_.data() + first_[k], first_[k + 1] - first_[k]};
}

void PointGrid::divide(const Range& range) {
  if (box_.size() <= range.node) box_.resize(2 * range.node + 1);
  Box box;
  for (std::size_t k = range.begin; k < range.end; ++k) box.include(points_[order_[k]]);
  box_[range.node] = box;
  if (range.end - range.begin <= kLeaf) return;
  Eigen::Index axis = 0;
  box.extent().maxCoeff(&axis);
  const std::size_t middle = range.begin + (range.end - range.begin) / 2;
  const auto at = [&](std::size_t k) { return order_.begin() + static_cast<std::ptrdiff_t>(k); };
  std::nth_element(at(range.begin), at(middle), at(range.end), [&](std::uint32_t a, std::uint32_t b) { return std::pair(points_[a][axis], a) < std::pair(points_[b][axis], b); });
  divide({range.begin, middle, 2 * range.node + 1});
  divide({middle, range.end, 2 * range.node + 2});
}

void PointGrid::search(const Vec3& place, const Range& range, Best& best) const {
  const auto distance = [&](std::size_t node) { return (place - place.cwiseMax(box_[node].lower).cwiseMin(box_[node].upper)).squaredNorm(); };
  if (distance(range.node) > best.least) return;
  if (range.end - range.begin <= kLeaf) {
    for (std::size_t k = range.begin; k < range.end; ++k) {
      const double d = (points_[order_[k]] - place).squaredNorm();
      if (d < best.least || (d == best.least && order_[k] < best.index)) best = {order_[k], d};
    }
    return;
  }
  const std::size_t middle = range.begin + (range.end - range.begin) / 2;
  Range first{range.begin, middle, 2 * range.node + 1}, second{middle, range.end, 2 * range.node + 2};
  if (distance(second.node) < distance(first.node)) std::swap(first, second);
  search(place, first, best);
  search(place, second, best);
}

std::uint32_t PointGrid::nearest(const Vec3& place, double most) const {
  Best best{kNone, most > 0.0 ? most * most : 0.0};
  search(place, {0, points_.size(), 0}, best);
  return best.index;
}

void PointGrid::within(const Vec3& place, double distance, std::vector<std::uint32_t>& out) const {
  out.clear();
  const Cell from = cell_of(place - Vec3::Constant(distance)), to = cell_of(place + Vec3::Constant(distance));
  for (int z = from.z(); z <= to.z(); ++z) {
    for (int y = from.y(); y <= to.y(); ++y) {
      for (int x = from.x(); x <= to.x(); ++x) {
        for (const std::uint32_t k : content(x, y, z)) {
          if ((points_[k] - place).squaredNorm() <= distance * distance) out.push_back(k);
        }
      }
    }
  }
}

}  // namespace supple::fit
