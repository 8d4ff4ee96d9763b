#include "picture/height_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "supple/core/error.h"

namespace supple::render {
namespace {

constexpr float kOnEdge = -1e-5F;  // a weight that rounding may leave of none: points of an edge belong to both of its triangles

/// A vertex in the map, in texels whose middles are whole numbers.
struct Corner {
  float x, y;
  float depth;   ///< in [0, 1] inside the box
  float height;  ///< above the ground [m]
};

/// Twice the area of a triangle, positive when it turns anticlockwise.
float turn(float ax, float ay, float bx, float by, float cx, float cy) { return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax); }

struct Range {
  int first, last;
};
/// Whole numbers between the least and the largest of three.
Range whole_between(float a, float b, float c, int size) {
  const float least = std::min(std::min(a, b), c), most = std::max(std::max(a, b), c);
  const auto edge = static_cast<float>(size);
  return {static_cast<int>(std::ceil(std::clamp(least, 0.0F, edge))), static_cast<int>(std::floor(std::clamp(most, -1.0F, edge - 1.0F)))};
}

}  // namespace

void fill_heights(const DrawList& list, const MapFit& fit, float ground, int size, std::vector<float>& out) {
  const auto edge = static_cast<float>(size);
  const auto width = static_cast<std::size_t>(size);
  out.assign(2 * width * width, kNoHeight);
  std::vector<Corner> corners(list.vertices.size() / 6);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const float* p = &list.vertices[6 * i];
    const Eigen::Vector4f at = fit.to_unit * Eigen::Vector4f(p[0], p[1], p[2], 1.0F);
    corners[i] = {.x = at.x() * edge - 0.5F, .y = at.y() * edge - 0.5F, .depth = at.z(), .height = p[2] - ground};
  }
  for (std::size_t t = 0; t + 3 <= list.indices.size(); t += 3) {
    const Corner &a = corners[list.indices[t]], &b = corners[list.indices[t + 1]], &c = corners[list.indices[t + 2]];
    const Range columns = whole_between(a.x, b.x, c.x, size);
    if (columns.first > columns.last) continue;
    const Range rows = whole_between(a.y, b.y, c.y, size);
    if (rows.first > rows.last) continue;
    const float area = turn(a.x, a.y, b.x, b.y, c.x, c.y);
    if (area == 0.0F) continue;  // seen edge on
    for (int row = rows.first; row <= rows.last; ++row)
      for (int column = columns.first; column <= columns.last; ++column) {
        const auto x = static_cast<float>(column), y = static_cast<float>(row);
        const float wa = turn(x, y, b.x, b.y, c.x, c.y) / area, wb = turn(a.x, a.y, x, y, c.x, c.y) / area;
        const float wc = 1.0F - wa - wb;
        const float depth = wa * a.depth + wb * b.depth + wc * c.depth;
        if (wa < kOnEdge || wb < kOnEdge || wc < kOnEdge || depth < 0.0F || depth > 1.0F) continue;
        const float height = std::max(wa * a.height + wb * b.height + wc * c.height, 0.0F);
        float* range = &out[2 * (static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column))];
        range[0] = std::max(range[0], -height);
        range[1] = std::max(range[1], height);
      }
  }
}

}  // namespace supple::render
