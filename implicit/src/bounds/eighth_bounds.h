/// @file eighth_bounds.h
/// Bounds on the eighths of a box, side by side: the first two steps of field_box_bounds.h for sums of boxes, ellipsoids, segments,
/// rectangles and discs with Wyvill's or Gascuel's kernel.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "supple/implicit/field.h"

namespace supple::implicit {

class EighthBounds {
 public:
  /// Whether it supports a field.
  [[nodiscard]] static bool know(const Field& field);

  struct Verdict {
    unsigned one_sign = 0;  ///< bits of the eighths, x + 2 y + 4 z, on which F keeps its sign,
    unsigned sloped = 0;    ///< and of others on which F rises along some direction
    [[nodiscard]] unsigned settled() const { return one_sign | sloped; }
  };
  /// @param ids  of all primitives that may add to F on the box, ascending  @pre know(field)
  [[nodiscard]] Verdict operator()(const Field& field, const Box& box, std::span<const std::uint32_t> ids);
  /// The primitives that may add to F on an eighth of the last box.
  void narrow(unsigned eighth, std::vector<std::uint32_t>& ids) const;

 private:
  using Lanes = Eigen::Array<double, 8, 1>;  // an eighth each
  struct Term {
    std::uint32_t id = 0;
    double radius2 = 0.0;                 ///< R^2, a little more [m^2]
    Lanes near2;                          ///< least squared distance
    Lanes steepest, flattest;             ///< least and largest 2 df/dq
    std::array<Lanes, 3> low, high;       ///< between which the vectors from nearest points lie, along the axes of the shape
    double across = 0.0;                  ///< and across its axis so far away from there
  };
  struct Sums {
    Lanes lower = Lanes::Zero(), upper = Lanes::Zero();
    std::array<Lanes, 3> gradient{Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
    double scale = 0.0;  ///< of round-off
  };
  static void add(const Field::Index& index, const Box& box, Term& term, Sums& sums);
  /// Sloped bits. @param slack  round-off of slopes [1/m]
  [[nodiscard]] unsigned find_sloped(const Field::Index& index, const std::array<Lanes, 3>& gradient, double slack) const;

  std::vector<Term> term_;
};

}  // namespace supple::implicit
