/// @file exact_distance.h
/// Signed distances to the boundary of the solid that a mesh encloses.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "solids/closed_surface.h"
#include "solids/triangle_tree.h"
#include "supple/core/interrupt.h"

namespace supple::implicit {

/// The side of the surface is that of the nearest place, by the mean of the normals about it, weighted by angles (Baerentzen & Aanaes 2005, "Signed
/// Distance Computation Using the Angle Weighted Pseudonormal"), or decides by winding number where triangles cross.
class ExactDistance {
 public:
  explicit ExactDistance(ClosedSurface surface);

  /// Signed distance [m], < 0 inside. @param slope  receives its gradient, a unit vector; null: none
  [[nodiscard]] double at(const Vec3& x, Vec3* slope) const;
  [[nodiscard]] const ClosedSurface& surface() const { return surface_; }
  [[nodiscard]] const Box& box() const { return box_; }
  /// Calls use(place, normal) at places spread over the triangles by a sequence of low discrepancy. @param count  of all of them
  template <class Use>
  void each_place(std::size_t count, const Use& use) const;
  /// Radius of the largest ball that touches the surface at a place, on the side that `normal` points away from, if the other place that it touches is
  /// nearly opposite, or that no larger one is looked for; else infinity (Ma, Bae & Choi 2012, "3D medial axis point approximation using nearest
  /// neighbors and the normal field").
  [[nodiscard]] double opposite_ball(const Vec3& on_surface, const Vec3& normal, double largest) const;
  /// Thickness that all but a share of the area has at least, by such balls inside. @param most  is not told apart from more: larger balls see more triangles at once
  [[nodiscard]] double thickness(double share, double most) const;

 private:
  void find_normals();

  ClosedSurface surface_;
  TriangleTree tree_;
  Box box_;
  std::vector<std::array<Vec3, 3>> edge_normal_, corner_normal_;  // of each triangle, unit; zero: the winding number decides
};

template <class Use>
void ExactDistance::each_place(std::size_t count, const Use& use) const {
  const auto corner = [&](std::uint32_t t, std::size_t k) -> const Vec3& { return surface_.position[surface_.triangle[t][k]]; };
  const auto area = [&](std::uint32_t t) { return 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm(); };
  double whole = 0.0, sum = 0.0;
  for (std::uint32_t t = 0; t < surface_.triangle.size(); ++t) whole += area(t);
  std::size_t made = 0;
  for (std::uint32_t t = 0; t < surface_.triangle.size(); ++t) {
    heed_scope();
    sum += area(t);
    // A number proportional to its area.
    for (; made < count && (static_cast<double>(made) + 0.5) * whole <= sum * static_cast<double>(count); ++made) {
      double u = std::fmod(0.5 + static_cast<double>(made) * 0.7548776662466927, 1.0), v = std::fmod(0.5 + static_cast<double>(made) * 0.5698402909980532, 1.0);
      if (u + v > 1.0) {
        u = 1.0 - u;
        v = 1.0 - v;
      }
      use(Vec3(corner(t, 0) + u * (corner(t, 1) - corner(t, 0)) + v * (corner(t, 2) - corner(t, 0))), tree_.normal(t));
    }
  }
}

}  // namespace supple::implicit
