/// @file march_rule.h
/// Quadrature on any Sigma, of order 2: tetrahedra over the overlap box, linear pieces of {p_A = p_B} clipped by p >= 0
/// and by third bodies, their centroids moved onto Sigma; likewise linear pieces of the squeezed regions.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "pair_pressure.h"
#include "patch_points.h"

namespace supple::collision {

/// Pressures at a vertex: of A, of B, and the largest of all third bodies.
struct MarchVertex {
  Vec3 x;
  double a, b, third;
};

class MarchRuleSolver {
 public:
  /// Doubles the cells until two consecutive grids agree to `error`, at most `refinements` times (never beyond
  /// kFinestCells along the longest side).
  /// @param third  bodies whose larger pressure takes space away from the pair
  /// @param reference  origin of the moments in `sums`
  /// @return whether Sigma was met
  bool solve(PairPressure& pressure, std::span<const ContactBody* const> third, const Box& overlap, double error,
             int refinements, const Vec3& reference, PatchPoints& points);

  [[nodiscard]] const PatchSums& sums() const noexcept { return sums_; }
  [[nodiscard]] double estimate() const noexcept { return estimate_; }
  [[nodiscard]] double thickness() const noexcept { return thickness_; }  ///< about the point of largest pressure [m]

  static constexpr int kFirstCells = 16;
  static constexpr int kFinestCells = 64;

 private:
  using Polygon = std::array<MarchVertex, 10>;
  using Tetrahedron = std::array<MarchVertex, 4>;

  /// The facets of one grid. @return the box of the cells that hold anything
  Box march(PairPressure& pressure, std::span<const ContactBody* const> third, const Box& box, int cells);
  /// The space that the bodies take from each other, of the last grid. Apart from the facets, because only the grid that is
  /// kept needs it.
  void squeeze();
  /// Calls visit(tetrahedron) wherever both bodies may be. @return the box of these cells
  template <class Visit>
  Box for_tetrahedra(const Visit& visit);
  void cut_tetrahedron(const Tetrahedron& corner);
  void add_facet(Polygon& polygon, int count);
  void add_squeezed(const Tetrahedron& corner, int side);
  /// The line through the point of largest pressure along Sigma's normal there.
  struct PeakLine {
    Vec3 point = Vec3::Zero(), normal = Vec3::Zero();
  };
  static double depth(PairPressure& pressure, int side, const PeakLine& peak, double cell);
  void place_on_sigma(PairPressure& pressure, double cell, const Vec3& reference, PatchPoints& points);

  PressureBatch node_, facet_;
  std::array<std::size_t, 3> cells_{};  ///< of `node_` along x, y, z
  std::vector<double> third_, value_;
  std::vector<Vec3> facet_normal_;
  std::vector<double> facet_area_;
  std::vector<Vec3> volume_point_;
  std::vector<double> volume_weight_;
  std::vector<std::uint8_t> volume_side_;
  std::vector<Tetrahedron> pieces_, kept_;
  PatchSums sums_;
  double estimate_ = 1.0;
  double thickness_ = 0.0;
};

}  // namespace supple::collision
