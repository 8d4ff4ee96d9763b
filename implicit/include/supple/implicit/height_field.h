/// @file supple/implicit/height_field.h
/// Terrain: a solid under heights on a regular grid.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

using Vec2 = Eigen::Vector2d;

/// Bicubic Hermite function through values at the points (i, j) of a unit grid, C^1, that stays within the corners' values in every cell and is
/// exact for a + b u + c v + d u v. Slopes at the points are central differences, parabolas through three points at the borders, limited to
/// 3/2 of the smaller one-sided difference, and 0 where these change sign (Fritsch & Carlson 1980; limits as of van Leer 1977); mixed
/// derivatives are limited in the same way. All Bezier points of a cell then lie within the values of its corners.
class LimitedBicubic {
 public:
  /// @param values  row after row, shape [rows][columns]   @pre columns, rows >= 2
  LimitedBicubic(std::size_t columns, std::size_t rows, std::span<const double> values);

  /// Value and derivatives by u and v at a point of [0, columns - 1] x [0, rows - 1].
  [[nodiscard]] Vec3 at(double u, double v) const;
  /// Of the values in [u_first, u_last] x [v_first, v_last], both within the grid.
  [[nodiscard]] Interval range(const Interval& u, const Interval& v) const;
  [[nodiscard]] double largest() const;
  [[nodiscard]] double least() const;
  /// Bound of the length of (d/du, d/dv).
  [[nodiscard]] double steepest() const { return steepest_; }
  /// The derivatives by u and v at a point of the grid.
  [[nodiscard]] Vec2 slope(std::size_t i, std::size_t j) const { return node_[j * columns_ + i].slope; }

 private:
  struct Node {
    double value;
    Vec2 slope;
    double twist;  // d2/du dv
  };
  [[nodiscard]] const Node& node(std::size_t i, std::size_t j) const { return node_[j * columns_ + i]; }
  [[nodiscard]] double limited_twist(std::size_t i, std::size_t j) const;
  [[nodiscard]] double steepest_in(std::size_t i, std::size_t j) const;

  std::size_t columns_, rows_;
  std::vector<Node> node_;
  double steepest_ = 0.0;
};

/// Ground of varying height with upright sides, {z <= h(x, y)} over the rectangle of a regular grid and nothing beyond it. F is -slope times a
/// distance: to the sides, to the edges beyond them, and over the ground (z - h) w, w the cosine of its slope, interpolated as h is. So F is the
/// signed distance exactly where h is a plane, and else to first order near the points of the grid. Where the ground and a side are equally near,
/// the gradient jumps.
class HeightField {
 public:
  /// @param heights  h at corner + spacing (i, j), row j after row, shape [rows][columns] [m]
  /// @pre columns, rows >= 2, spacing > 0, slope > 0
  HeightField(const Vec3& corner, double spacing, std::size_t columns, std::size_t rows, std::span<const double> heights,
              double slope);

  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;
  /// h and its slopes dh/dx, dh/dy at (x, y), or at the nearest point of the grid's rectangle.
  [[nodiscard]] Vec3 height(double x, double y) const;
  /// The surface over the grid, `finer` quadrangles along each side of a cell of it, and its sides down to the lowest height.
  [[nodiscard]] Mesh mesh(int finer) const;

 private:
  /// Of a point or box over the grid, in its units; those beyond it are moved to its border.
  [[nodiscard]] double column(double x) const;
  [[nodiscard]] double row(double y) const;
  [[nodiscard]] Vec2 half() const;
  [[nodiscard]] Vec2 middle() const;
  double evaluate(const Vec3& point, Vec3* gradient) const;
  [[nodiscard]] Interval above_ground(const Box& box) const;
  void add_sides(std::size_t across, std::size_t along, Mesh& mesh) const;

  Vec3 corner_;
  double spacing_;
  std::size_t columns_, rows_;
  LimitedBicubic height_;  // less that of `corner_`
  LimitedBicubic cosine_;
  double slope_;
};

}  // namespace supple::implicit
