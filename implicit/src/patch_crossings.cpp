#include "patch_crossings.h"

#include <algorithm>
#include <numeric>

#include "supple/core/types.h"

namespace supple::implicit {
namespace {

using Corners = std::array<Vec3, 3>;

/// Six times the signed volume of a tetrahedron.
double volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) { return (b - a).cross(c - a).dot(d - a); }

bool pierces(const Vec3& p, const Vec3& q, const Corners& t) {
  constexpr double kRounding = 1e-12;
  const double length = std::max({(q - p).norm(), (t[1] - t[0]).norm(), (t[2] - t[0]).norm()}), least = kRounding * length * length * length;
  const double at_p = volume(t[0], t[1], t[2], p), at_q = volume(t[0], t[1], t[2], q);
  if (!((at_p > least && at_q < -least) || (at_p < -least && at_q > least))) return false;
  const double u = volume(p, q, t[0], t[1]), v = volume(p, q, t[1], t[2]), w = volume(p, q, t[2], t[0]);
  return (u > least && v > least && w > least) || (u < -least && v < -least && w < -least);
}

/// Boxes of triangles, halved along their longest side.
class Boxes {
 public:
  explicit Boxes(const PatchComplex& complex) : complex_(complex), box_(complex.triangles().size()) {
    for (std::uint32_t t = 0; t < box_.size(); ++t) {
      if (!complex.triangle(t).alive) continue;
      for (const Vec3& p : complex.corners(t)) box_[t].include(p);
      order_.push_back(t);
    }
    if (!order_.empty()) build(0, order_.size());
  }

  [[nodiscard]] std::vector<std::array<std::uint32_t, 2>> crossings() const {
    std::vector<std::array<std::uint32_t, 2>> found;
    std::vector<std::uint32_t> stack;
    for (const std::uint32_t t : order_) {
      for (stack.assign(1, 0); !stack.empty();) {
        const std::uint32_t at = stack.back();
        const Node& node = node_[at];
        stack.pop_back();
        if (!node.box.overlaps(box_[t])) continue;
        if (node.second != 0) {
          stack.push_back(at + 1);
          stack.push_back(node.second);
          continue;
        }
        for (std::size_t i = node.begin; i < node.end; ++i) {
          const std::uint32_t s = order_[i];
          if (t < s && box_[t].overlaps(box_[s]) && (passes(t, s) || passes(s, t))) found.push_back({t, s});
        }
      }
    }
    std::sort(found.begin(), found.end());
    return found;
  }

 private:
  struct Node {
    Box box;
    std::size_t begin, end;
    std::uint32_t second = 0;  ///< child; the first one follows its parent. 0: a leaf
  };

  void build(std::size_t begin, std::size_t end) {
    constexpr std::size_t kLeaf = 8;
    const auto at = static_cast<std::uint32_t>(node_.size());
    Box box;
    for (std::size_t i = begin; i < end; ++i) box = box.united(box_[order_[i]]);
    node_.push_back({box, begin, end});
    if (end - begin <= kLeaf) return;
    Eigen::Index axis = 0;
    box.extent().maxCoeff(&axis);
    const std::size_t middle = (begin + end) / 2;
    const auto place = [this](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(place(begin), place(middle), place(end), [&](std::uint32_t a, std::uint32_t b) {
      const double ca = box_[a].centre()[axis], cb = box_[b].centre()[axis];
      return ca != cb ? ca < cb : a < b;
    });
    build(begin, middle);
    node_[at].second = static_cast<std::uint32_t>(node_.size());
    build(middle, end);
  }

  /// Whether an edge of s passes through t.
  [[nodiscard]] bool passes(std::uint32_t s, std::uint32_t t) const {
    const auto& edge = complex_.triangle(s).vertex;
    const Corners corners = complex_.corners(t);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = edge[k], b = edge[(k + 1) % 3];
      if (complex_.triangle(t).has(a) || complex_.triangle(t).has(b)) continue;
      if (pierces(complex_.position(a), complex_.position(b), corners)) return true;
    }
    return false;
  }

  const PatchComplex& complex_;
  std::vector<Box> box_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> node_;
};

}  // namespace

std::vector<std::array<std::uint32_t, 2>> find_crossings(const PatchComplex& complex) { return Boxes(complex).crossings(); }

}  // namespace supple::implicit
