#include "supple/render/glyphs.h"

#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "supple/core/error.h"

namespace supple::render {
namespace {

constexpr int kSides = 12;

/// A point of the outline of a solid of revolution: height along the axis, radius, and the slope of its normal.
struct Outline {
  double height;
  double radius;
  double normal_along;   ///< part of the normal along the axis
  double normal_across;
};

/// Turns an outline about an axis. Every two outline points in turn bound one band, so that edges stay sharp.
void add_revolved(Mesh& mesh, const Vec3& from, const Vec3& axis, std::span<const Outline> outline) {
  const Vec3 w = axis.normalized();
  const Vec3 u = w.unitOrthogonal(), v = w.cross(u);
  for (std::size_t band = 0; band + 1 < outline.size(); band += 2) {
    const auto base = static_cast<std::uint32_t>(mesh.position.size());
    for (const Outline& o : {outline[band], outline[band + 1]})
      for (int k = 0; k < kSides; ++k) {
        const double angle = 2.0 * std::numbers::pi * k / kSides;
        const Vec3 out = std::cos(angle) * u + std::sin(angle) * v;
        mesh.position.push_back(from + o.height * w + o.radius * out);
        mesh.normal.push_back((o.normal_along * w + o.normal_across * out).normalized());
      }
    for (std::uint32_t k = 0; k < kSides; ++k) {
      const std::uint32_t next = (k + 1) % kSides;
      if (outline[band].radius > 0.0) mesh.triangle.push_back({base + k, base + next, base + kSides + next});
      if (outline[band + 1].radius > 0.0) mesh.triangle.push_back({base + k, base + kSides + next, base + kSides + k});
    }
  }
}

}  // namespace

void add_ball(Mesh& mesh, const Vec3& centre, double radius) {
  SUPPLE_EXPECTS(radius > 0.0);
  // An icosahedron, its faces cut in four.
  const double t = std::numbers::phi;
  std::vector<Vec3> p = {{-1, t, 0}, {1, t, 0}, {-1, -t, 0}, {1, -t, 0}, {0, -1, t}, {0, 1, t},
                         {0, -1, -t}, {0, 1, -t}, {t, 0, -1}, {t, 0, 1}, {-t, 0, -1}, {-t, 0, 1}};
  for (Vec3& q : p) q.normalize();
  constexpr std::array<std::array<std::uint32_t, 3>, 20> kFaces = {
      {{0, 11, 5}, {0, 5, 1}, {0, 1, 7}, {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
       {3, 9, 4}, {3, 4, 2}, {3, 2, 6}, {3, 6, 8}, {3, 8, 9}, {4, 9, 5}, {2, 4, 11}, {6, 2, 10}, {8, 6, 7}, {9, 8, 1}}};
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [at, fresh] = middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(p.size()));
    if (fresh) p.push_back((p[a] + p[b]).normalized());
    return at->second;
  };
  const auto base = static_cast<std::uint32_t>(mesh.position.size());
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) { mesh.triangle.push_back({base + a, base + b, base + c}); };
  for (const auto& [a, b, c] : kFaces) {
    const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    add(a, ab, ca);
    add(b, bc, ab);
    add(c, ca, bc);
    add(ab, bc, ca);
  }
  for (const Vec3& q : p) {
    mesh.position.push_back(centre + radius * q);
    mesh.normal.push_back(q);
  }
}

void add_rod(Mesh& mesh, const Vec3& from, const Vec3& to, double radius) {
  SUPPLE_EXPECTS(radius > 0.0);
  const double length = (to - from).norm();
  if (!(length > 0.0)) return;
  const std::array<Outline, 6> outline = {{{0, 0, -1, 0}, {0, radius, -1, 0}, {0, radius, 0, 1}, {length, radius, 0, 1},
                                           {length, radius, 1, 0}, {length, 0, 1, 0}}};
  add_revolved(mesh, from, to - from, outline);
}

void add_arrow(Mesh& mesh, const Vec3& from, const Vec3& direction, double length) {
  SUPPLE_EXPECTS(length > 0.0);
  const double shaft = 0.035 * length, head = 0.09 * length, neck = 0.68 * length;
  const double slope = head / (length - neck);
  const std::array<Outline, 8> outline = {{{0, 0, -1, 0}, {0, shaft, -1, 0}, {0, shaft, 0, 1}, {neck, shaft, 0, 1},
                                           {neck, shaft, -1, 0}, {neck, head, -1, 0}, {neck, head, slope, 1}, {length, 0, slope, 1}}};
  add_revolved(mesh, from, direction, outline);
}

std::array<Mesh, 3> frame_glyphs(std::span<const Pose> poses, double length) {
  std::array<Mesh, 3> out;
  for (const Pose& pose : poses)
    for (int k = 0; k < 3; ++k)
      add_arrow(out[static_cast<std::size_t>(k)], pose.position, pose.orientation * Vec3(Vec3::Unit(k)), length);
  return out;
}

}  // namespace supple::render
