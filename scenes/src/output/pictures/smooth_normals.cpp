#include "output/pictures/smooth_normals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>
#include <vector>

namespace supple::scenes {
namespace {

/// Of a triangle at one of its corners.
struct Corner {
  Vec3 normal = Vec3::Zero();  ///< of the triangle, unit length; zero without area
  double angle = 0.0;          ///< of the triangle here [rad]
};

std::vector<Corner> corners_of(const Mesh& mesh) {
  std::vector<Corner> corners(mesh.vertex_count());
  for (const auto& triangle : mesh.triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 a = mesh.position[triangle[(k + 1) % 3]] - mesh.position[triangle[k]], b = mesh.position[triangle[(k + 2) % 3]] - mesh.position[triangle[k]];
      const Vec3 across = a.cross(b);
      const double area2 = across.norm();
      if (area2 > 0.0) corners[triangle[k]] = {across / area2, std::atan2(area2, a.dot(b))};
    }
  }
  return corners;
}

}  // namespace

void smooth_normals(double angle, Mesh& mesh) {
  const std::vector<Corner> corners = corners_of(mesh);
  std::vector<std::uint32_t> order(mesh.vertex_count());
  std::iota(order.begin(), order.end(), 0U);
  const auto place = [&](std::uint32_t v) { return std::tuple(mesh.position[v].x(), mesh.position[v].y(), mesh.position[v].z(), v); };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return place(a) < place(b); });
  const double least = std::cos(angle);
  for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
    while (last < order.size() && mesh.position[order[last]] == mesh.position[order[first]]) ++last;
    for (std::size_t i = first; i < last; ++i) {
      const Corner& own = corners[order[i]];
      if (own.angle == 0.0) continue;
      Vec3 sum = own.angle * own.normal;
      for (std::size_t j = first; j < last; ++j) {
        const Corner& other = corners[order[j]];
        if (j != i && other.normal.dot(own.normal) > least) sum += other.angle * other.normal;
      }
      mesh.normal[order[i]] = sum.normalized();
    }
  }
}

}  // namespace supple::scenes
