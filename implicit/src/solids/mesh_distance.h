/// @file mesh_distance.h
/// Signed distances to the boundary of the solid that a mesh encloses, smooth where it is thick.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "solids/exact_distance.h"

namespace supple::implicit {

/// Distances d on a lattice are the coefficients of a cubic B-spline, which is C^2 and rounds edges over about a cell. Where its surface would be off by
/// more than three quarters of a cell, or where the solid or a gap is thinner than a cell and a half, the exact distance takes its place, with a weight that is another
/// such spline: 1 in all of those cells, 0 beyond their neighbours. Far from the surface a distance of the lattice is found when it is asked for first.
class MeshDistance {
 public:
  explicit MeshDistance(ClosedSurface surface);

  /// [m], < 0 inside; beyond a few cells outside it stays what it is there. @param slope  receives its gradient; null: none
  [[nodiscard]] double at(const Vec3& x, Vec3* slope) const;
  /// Bound of the length of the gradient in a box.
  [[nodiscard]] double steepest(const Box& box) const;
  /// Of all distances: from the deepest place, bounded by the box of the mesh, to what they stay at outside.
  [[nodiscard]] Interval range() const { return {-0.5 * exact_.box().extent().minCoeff(), kBand * cell_}; }
  /// Of all places inside, at most.
  [[nodiscard]] Box inside_box() const { return exact_.box().inflated(kMixed * cell_); }
  [[nodiscard]] const ExactDistance& exact() const { return exact_; }
  /// Largest distance that it has on the mesh, at its vertices and at places as dense as cells [m].
  [[nodiscard]] double deviation() const { return deviation_; }

 private:
  static constexpr double kBand = 6.0;   // cells outside in which distances are kept
  static constexpr double kMixed = 2.0;  // cells from which the spline mixes distances
  enum class Part : std::uint8_t { Spline, Both, Exact };
  struct Place;

  [[nodiscard]] std::size_t node(std::size_t i, std::size_t j, std::size_t k) const { return (k * size_[1] + j) * size_[0] + i; }
  [[nodiscard]] Vec3 place_of(std::size_t i, std::size_t j, std::size_t k) const;
  [[nodiscard]] Place cell_at(const Vec3& x) const;
  template <class Number>
  [[nodiscard]] double spline(const std::vector<Number>& coefficient, const Place& place, Vec3* slope) const;
  [[nodiscard]] double smoothed(const Place& place, Vec3* slope) const;
  void lay_lattice();
  void search(std::size_t i, std::size_t j, std::size_t k, std::size_t side);
  void find(std::size_t i, std::size_t j, std::size_t k) const;
  void find_around(const Place& place) const;
  [[nodiscard]] bool may_be_poor(const Place& middle) const;
  void find_poor_cells();
  void find_thin_cells(std::size_t places);
  void keep_exact(const Vec3& x, int beyond);
  void sort_cells();

  ExactDistance exact_;
  Vec3 corner_ = Vec3::Zero();  // node (0, 0, 0)
  double cell_ = 0.0;
  std::array<std::size_t, 3> size_{};
  double unit_ = 1.0;                 // the power of two below `cell_`, so that floats hold distances of any size [m]
  mutable std::vector<float> distance_;      // at the nodes, x fastest, over `unit_`
  mutable std::vector<std::uint8_t> known_;  // whether all distances are that the spline in the cell above each node takes
  std::vector<std::uint8_t> weight_;  // of the exact distance, at the nodes
  std::vector<Part> part_;            // of the cell above each node
  Box exact_box_;                     // of the cells where the exact distance has a part
  double deviation_ = 0.0;
};

}  // namespace supple::implicit
