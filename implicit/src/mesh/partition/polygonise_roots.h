/// @file polygonise_roots.h
/// Vertices of the mesh: the exact roots of a field, or of the difference of two, on many lattice edges at once.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "supple/implicit/field_view.h"

namespace supple::implicit::lattice {

/// |f| that counts as a root at `point`: 1e-13 of the size of the values around, and what the rounding of the
/// coordinates alone does to f.
[[nodiscard]] inline double root_tolerance(double scale, const Vec3& point, const Vec3& gradient) {
  return 1e-13 * scale +
         4.0 * std::numeric_limits<double>::epsilon() * gradient.norm() * point.cwiseAbs().maxCoeff();
}

/// A root between two neighbouring nodes whose values differ in sign, as fraction t of the way: of the cubic through
/// the nodes at t = -1, 0, 1, 2, of the parabola when an outer one is missing (NaN), of the line when both are.
[[nodiscard]] double guess_root(double before, double f0, double f1, double after);

/// Finds the roots of f = plus - minus (or plus alone) on segments. Holds capacity between uses.
class EdgeRoots {
 public:
  void clear();
  /// A segment with f(start) and f(end) of different sign (zero is either), and a guess of the root in [0, 1].
  void add(const Vec3& start, const Vec3& end, double f_start, double f_end, double guess);
  [[nodiscard]] std::size_t size() const { return start_.size(); }

  /// Newton's method in brackets, first step by the cubic through both ends; every root stays on its segment.
  /// @param minus  empty: f = plus   @param scale  size of the values of f around [1]
  void solve(const FieldView& plus, const FieldView& minus, double scale);

  // Of segment i, after solve():
  [[nodiscard]] const Vec3& point(std::size_t i) const { return point_[i]; }
  [[nodiscard]] const Vec3& gradient(std::size_t i) const { return gradient_[i]; }  ///< grad f at the root [1/m]
  [[nodiscard]] double value(std::size_t i) const { return value_[i]; }             ///< f at the root
  [[nodiscard]] double plus_value(std::size_t i) const { return plus_value_[i]; }   ///< `plus` at the root

 private:
  struct Bracket {
    double low, high, f_low, f_high, t, last_step;
  };
  std::vector<Vec3> start_, end_;
  std::vector<Bracket> bracket_;
  std::vector<Vec3> point_, gradient_;
  std::vector<double> value_, plus_value_;
  // One round's batch.
  std::vector<std::uint32_t> active_;
  std::vector<Vec3> batch_point_, batch_gradient_, batch_gradient_minus_;
  std::vector<double> batch_value_, batch_minus_;
};

}  // namespace supple::implicit::lattice
