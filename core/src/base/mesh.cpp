#include "supple/core/mesh.h"

#include <algorithm>
#include <numeric>

#include "supple/core/error.h"

namespace supple {
namespace {

/// One side of a triangle: its vertices in ascending order, and whether the triangle runs through it that way.
struct Side {
  std::uint32_t low;
  std::uint32_t high;
  bool ascending;
};

std::uint32_t find_root(std::vector<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

}  // namespace

void Mesh::clear() {
  position.clear();
  normal.clear();
  triangle.clear();
  columns.clear();
}

void add_quadrangle(Mesh& mesh, const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const auto first = static_cast<std::uint32_t>(mesh.position.size());
  const Vec3 normal = (b - a).cross(d - a).normalized();
  for (const Vec3& corner : {a, b, c, d}) {
    mesh.position.push_back(corner);
    mesh.normal.push_back(normal);
  }
  mesh.triangle.push_back({first, first + 1, first + 2});
  mesh.triangle.push_back({first, first + 2, first + 3});
}

void append(Mesh& mesh, const Mesh& other) {
  const auto offset = static_cast<std::uint32_t>(mesh.vertex_count());
  mesh.position.insert(mesh.position.end(), other.position.begin(), other.position.end());
  mesh.normal.insert(mesh.normal.end(), other.normal.begin(), other.normal.end());
  for (const auto& t : other.triangle) mesh.triangle.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  for (const Mesh::Column& column : other.columns) {
    auto own = std::find_if(mesh.columns.begin(), mesh.columns.end(),
                            [&column](const Mesh::Column& c) { return c.name == column.name; });
    if (own == mesh.columns.end()) own = mesh.columns.insert(own, {column.name, std::vector<double>(offset, 0.0)});
    own->values.insert(own->values.end(), column.values.begin(), column.values.end());
  }
  for (Mesh::Column& column : mesh.columns) column.values.resize(mesh.vertex_count(), 0.0);
}

MeshReport inspect(const Mesh& mesh) {
  MeshReport report;
  const std::size_t vertex_count = mesh.vertex_count();
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangle_count());
  std::vector<std::uint32_t> parent(vertex_count);
  std::iota(parent.begin(), parent.end(), 0U);
  std::vector<std::uint8_t> used(vertex_count, 0);
  bool degenerate = false;

  for (const auto& t : mesh.triangle) {
    for (const std::uint32_t v : t) SUPPLE_EXPECTS(v < vertex_count);
    degenerate = degenerate || t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k];
      const std::uint32_t b = t[(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), a < b});
      used[a] = 1;
      const std::uint32_t root_a = find_root(parent, a);
      const std::uint32_t root_b = find_root(parent, b);
      if (root_a != root_b) parent[std::max(root_a, root_b)] = std::min(root_a, root_b);
    }
    const Vec3& a = mesh.position[t[0]];
    const Vec3& b = mesh.position[t[1]];
    const Vec3& c = mesh.position[t[2]];
    report.area += 0.5 * (b - a).cross(c - a).norm();
    // Relative to one vertex of the mesh, so that a mesh far from the origin loses no digits.
    const Vec3& o = mesh.position[mesh.triangle.front()[0]];
    report.volume += (a - o).dot((b - o).cross(c - o)) / 6.0;
  }

  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return x.low != y.low ? x.low < y.low : x.high < y.high;
  });
  long edges = 0;
  report.closed = !mesh.triangle.empty() && !degenerate;
  report.oriented = report.closed;
  for (std::size_t begin = 0; begin < sides.size();) {
    std::size_t end = begin;
    long balance = 0;
    while (end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high) {
      balance += sides[end].ascending ? 1 : -1;
      ++end;
    }
    ++edges;
    if (end - begin != 2) report.closed = false;
    if (end - begin != 2 || balance != 0) report.oriented = false;
    begin = end;
  }

  long vertices = 0;
  for (std::uint32_t v = 0; v < vertex_count; ++v) {
    if (used[v] == 0) continue;
    ++vertices;
    if (find_root(parent, v) == v) ++report.components;
  }
  report.euler_characteristic = vertices - edges + static_cast<long>(mesh.triangle_count());
  return report;
}

}  // namespace supple
