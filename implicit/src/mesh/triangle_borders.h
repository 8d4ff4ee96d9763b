/// @file triangle_borders.h
/// Borders of a few triangles of a mesh.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace supple::implicit {

/// From a vertex to the next, counter-clockwise around a triangle.
using BorderEdge = std::pair<std::uint32_t, std::uint32_t>;

/// Adds the edges of a triangle to the border of others, or takes them off it.
inline void join_border(const std::array<std::uint32_t, 3>& triangle, std::vector<BorderEdge>& open) {
  for (std::size_t k = 0; k < 3; ++k) {
    const BorderEdge edge{triangle[k], triangle[(k + 1) % 3]};
    const auto reverse = std::find(open.begin(), open.end(), BorderEdge{edge.second, edge.first});
    if (reverse != open.end()) {
      open.erase(reverse);
    } else {
      open.push_back(edge);
    }
  }
}

/// A border as a loop of vertices; empty when it is none, or not one.
[[nodiscard]] inline std::vector<std::uint32_t> loop_of(std::span<const BorderEdge> open) {
  if (open.empty()) return {};
  std::vector<std::uint32_t> loop{open.front().first};
  for (std::uint32_t v = open.front().second; v != loop.front();) {
    loop.push_back(v);
    const auto next = std::find_if(open.begin(), open.end(), [v](const BorderEdge& edge) { return edge.first == v; });
    if (next == open.end() || loop.size() > open.size()) return {};
    v = next->second;
  }
  return loop.size() == open.size() ? loop : std::vector<std::uint32_t>{};
}

}  // namespace supple::implicit
