#include "mesh/triangle_crossings.h"

#include <algorithm>
#include <numeric>

namespace supple::implicit {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

/// Six times the signed volume of a tetrahedron.
double volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) { return (b - a).cross(c - a).dot(d - a); }

/// Whether an edge of s passes through t.
bool passes(std::span<const Vec3> position, const Triangle& s, const Triangle& t) {
  constexpr double kRounding = 1e-12;
  const Vec3 &a = position[t[0]], &b = position[t[1]], &c = position[t[2]];
  std::array<double, 3> at{};
  for (std::size_t k = 0; k < 3; ++k) at[k] = volume(a, b, c, position[s[k]]);
  if (std::min({at[0], at[1], at[2]}) >= 0.0 || std::max({at[0], at[1], at[2]}) <= 0.0) return false;
  const auto has = [&](std::uint32_t v) { return t[0] == v || t[1] == v || t[2] == v; };
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    if (has(s[k]) || has(s[next])) continue;
    const Vec3 &p = position[s[k]], &q = position[s[next]];
    const double length = std::max({(q - p).norm(), (b - a).norm(), (c - a).norm()}), least = kRounding * length * length * length;
    if (!((at[k] > least && at[next] < -least) || (at[k] < -least && at[next] > least))) continue;
    const double u = volume(p, q, a, b), v = volume(p, q, b, c), w = volume(p, q, c, a);
    // On an edge of t, too: else one could pass between two triangles that share it.
    if ((u > -least && v > -least && w > -least) || (u < least && v < least && w < least)) return true;
  }
  return false;
}

}  // namespace

bool triangles_cross(std::span<const Vec3> position, const Triangle& s, const Triangle& t) {
  return passes(position, s, t) || passes(position, t, s);
}

TriangleBoxes::TriangleBoxes(std::span<const Vec3> position, std::span<const Triangle> triangle, std::vector<std::uint32_t> number) {
  std::vector<Box> box;
  box.reserve(number.size());
  for (const std::uint32_t t : number) box.push_back(box_of(position, triangle[t]));
  std::vector<std::uint32_t> order(number.size());
  std::iota(order.begin(), order.end(), 0u);
  if (!order.empty()) build(box, order, 0, order.size());
  number_.reserve(order.size());
  box_.reserve(order.size());
  for (const std::uint32_t i : order) {
    number_.push_back(number[i]);
    box_.push_back(box[i]);
  }
}

void TriangleBoxes::build(std::span<const Box> box, std::vector<std::uint32_t>& order, std::size_t begin, std::size_t end) {
  constexpr std::size_t kLeaf = 8;
  const auto at = static_cast<std::uint32_t>(node_.size());
  Box all;
  for (std::size_t i = begin; i < end; ++i) all = all.united(box[order[i]]);
  node_.push_back({all, begin, end});
  if (end - begin <= kLeaf) return;
  Eigen::Index axis = 0;
  all.extent().maxCoeff(&axis);
  const std::size_t middle = (begin + end) / 2;
  const auto place = [&](std::size_t i) { return order.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(place(begin), place(middle), place(end), [&](std::uint32_t a, std::uint32_t b) {
    const double ca = box[a].centre()[axis], cb = box[b].centre()[axis];
    return ca != cb ? ca < cb : a < b;
  });
  build(box, order, begin, middle);
  node_[at].second = static_cast<std::uint32_t>(node_.size());
  build(box, order, middle, end);
}

}  // namespace supple::implicit
