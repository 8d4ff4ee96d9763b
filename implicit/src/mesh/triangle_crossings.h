/// @file triangle_crossings.h
/// Where triangles of a mesh pass through each other.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::implicit {

/// Whether an edge of one triangle passes through the other by more than rounding; edges that end at a vertex of the other triangle are
/// left out.
[[nodiscard]] bool triangles_cross(std::span<const Vec3> position, const std::array<std::uint32_t, 3>& s, const std::array<std::uint32_t, 3>& t);

[[nodiscard]] inline Box box_of(std::span<const Vec3> position, const std::array<std::uint32_t, 3>& triangle) {
  Box box;
  for (const std::uint32_t v : triangle) box.include(position[v]);
  return box;
}

/// Boxes of triangles, halved along their longest side.
class TriangleBoxes {
 public:
  /// @param number  of those that are tested
  TriangleBoxes(std::span<const Vec3> position, std::span<const std::array<std::uint32_t, 3>> triangle, std::vector<std::uint32_t> number);

  /// Calls use(number) for each whose box overlaps another one.
  template <class Use>
  void each_near(const Box& box, const Use& use) const {
    if (node_.empty()) return;
    std::array<std::uint32_t, 64> stack{};  // halving leaves fewer levels
    for (std::size_t n = 1; n > 0;) {
      const std::uint32_t at = stack[--n];
      const Node& node = node_[at];
      if (!node.box.overlaps(box)) continue;
      if (node.second != 0) {
        stack[n++] = node.second;
        stack[n++] = at + 1;
        continue;
      }
      for (std::size_t i = node.begin; i < node.end; ++i) {
        if (box_[i].overlaps(box)) use(number_[i]);
      }
    }
  }

 private:
  struct Node {
    Box box;
    std::size_t begin, end;
    std::uint32_t second = 0;  ///< child; the first one follows its parent. 0: a leaf
  };
  void build(std::span<const Box> box, std::vector<std::uint32_t>& order, std::size_t begin, std::size_t end);

  std::vector<std::uint32_t> number_;
  std::vector<Box> box_;  ///< of number_
  std::vector<Node> node_;
};

}  // namespace supple::implicit
