/// @file field_box_bounds.h
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "supple/implicit/field.h"
#include "supple/implicit/kernel.h"

namespace supple::implicit {

/// Field::box_bounds, and where the gradient points.
struct GradientBounds : Field::BoxBounds {
  struct Ball {
    Vec3 gradient = Vec3::Zero();  ///< [1/m]
    double turn = 0.0;             ///< radius [1/m]
  };
  /// Of a sum all of whose second derivatives are bounded: what bounds on parts of the box take besides value and
  /// gradient at their middles.
  struct Curved {
    bool known = false;
    CurvatureRange curvature{};  ///< on the box [1/m^2]
  };
  Curved curved;
  /// One primitive's part of a sum. Its gradient is `factor` times a vector A^T v and lies within `turn` of `gradient`; v is up to `spread` away
  /// from the box [low, high] or, of curves, from the hull of some points. A support that ends in the box leaves the first of some use.
  struct Term {
    std::uint32_t id = 0;
    double near2 = 0.0, far2 = 0.0;  ///< of squared distances
    Interval value{};
    Interval factor{};               ///< twice df/dq, at most 0
    double at_middle = 0.0;          ///< f
    Vec3 gradient = Vec3::Zero();    ///< at the middle [1/m]
    Mat3 to_local = Mat3::Zero();    ///< A
    Vec3 low = Vec3::Zero(), high = Vec3::Zero();
    std::array<Vec3, 4> gap{};       ///< corners of the hull
    std::size_t gaps = 0;
    double spread = 0.0, turn = 0.0;
    double across = 1.0;             ///< share of the third axis in the spread: 0 where v is known exactly along it
  };
  std::vector<Ball> hull{};  ///< of these balls holds Clarke's gradients of F on all of the box; several where parts win in turn, empty: not known
  std::size_t convex = 0;  ///< primitives that may add to a sum on the box, if the squared distances to all of them are convex
  std::vector<Term> term{};  ///< of a sum; empty: unknown, or none
  double scale = 0.0;        ///< of round-off of the sum [1]
  double round_off = 0.0;    ///< of values, where the hull is known [1]
  double slack = 0.0;        ///< and of slopes [1/m]
  bool stepwise = false;     ///< add_slopes and add_curvature provide more bounds
};

[[nodiscard]] GradientBounds bounds_with_gradient(const Field& field, const Box& box);

/// What rounding of their corners may leave out between boxes side by side, far from the origin [m].
inline Vec3 rounding_of(const Box& box) { return 4e-15 * (box.lower.cwiseAbs() + box.upper.cwiseAbs()); }

/// The same in steps, of which each costs more than the one before. `bounds` keeps its memory.
/// First by distances alone: the value, and as terms the primitives that may add to it; of a blend all at once.
/// @param ids  of all primitives that may add to F on the box, ascending
void start_bounds(const Field& field, const Box& box, std::span<const std::uint32_t> ids, GradientBounds& bounds);
/// Then by nearest points: slope_along.
void add_slopes(const Field& field, const Box& box, GradientBounds& bounds);
/// And by second derivatives: all bounds of bounds_with_gradient.
void add_curvature(const Field& field, const Box& box, GradientBounds& bounds);

/// Whether fields are sums, whose bounds come in steps.
[[nodiscard]] bool is_sum(const Field& field);
/// Ids of the primitives whose supports meet a box, ascending, behind those there.
void find_primitives(const Field& field, const Box& box, std::vector<std::uint32_t>& ids);

/// Of grad F along a unit vector, on the box of these bounds [1/m]. @pre the hull is not empty
[[nodiscard]] Interval slope_along(const GradientBounds& bounds, const Vec3& direction);

}  // namespace supple::implicit
