/// @file squeezed_region.h
/// Quadrature through all that one body of a pair loses, {p_other >= p_own >= 0}, whatever its shape.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "surface/pair_pressure.h"
#include "surface/patch_points.h"

namespace supple::collision {

/// Least cosine between the fall of a body's pressure on Sigma and the column that begins there: columns of bodies that are not convex hold what
/// these lose where all of them lead out.
inline constexpr double kLeastFall = 0.25;

/// Gives the points from `begin` on to a side, and adds them to its volume and energy. @param value  room
void add_to_region(PairPressure& pressure, int side, std::size_t begin, std::vector<double>& value, PatchPoints& points);

/// Parallel columns over the cells of a plane, with Gauss points in every piece of the region that they meet; cells are quartered where
/// their sums and those of their quarters differ most.
class SqueezedRegion {
 public:
  struct Lost {
    PairPressure& pressure;
    int side;                                  ///< whose space it is
    Thirds third;  ///< bodies that take space from the pair, too
    double error;                              ///< relative, of its volume and of the integral of the pressure
    bool equal = false;                        ///< the pressures are the same everywhere: all that the body has
  };
  /// Appends points of the region, and its sums.
  /// @param overlap  finite, holds the region   @param across  normal of Sigma where it matters most: columns run along the axis nearest to it
  void fill(const Lost& lost, const Box& overlap, const Vec3& across, PatchPoints& points);

 private:
  struct Sums {
    double energy = 0.0, volume = 0.0;
    void add(const Sums& other) {
      energy += other.energy;
      volume += other.volume;
    }
  };
  struct Cell {
    std::array<double, 2> corner{}, width{};  // in the plane [m]
    Sums sums{}, off{};                       // of its columns, and what they may miss
    std::size_t begin = 0, end = 0;           // of its points
  };
  /// Where a margin changes its sign along a column, between two places, and its values there.
  struct Change {
    std::size_t column, margin;
    double low, high;  // [m]
    double at_low, at_high;
    [[nodiscard]] double at() const { return low + (high - low) * at_low / (at_low - at_high); }
  };

  static std::size_t margins(const Lost& lost) { return lost.third.empty() ? 2 : 3; }
  void find_margins(const Lost& lost, std::span<const Vec3> at);
  void find_changes(const Lost& lost);
  void add_turn(std::size_t column, std::size_t margin, double at, double step, const std::array<double, 3>& value);
  void find_pairs_of_changes(const Lost& lost, double step);
  void measure(const Lost& lost, std::span<Cell> cells);
  void measure_block(const Lost& lost, std::span<Cell> cells);
  void add_piece(std::size_t column, double low, double high);
  void quarter(const Lost& lost);
  bool choose(double error);
  void add_empty_neighbours();

  Vec3 origin_, along_;
  std::array<Vec3, 2> across_;
  double length_ = 0.0, feature_ = 0.0;  // of columns, of the bodies [m]
  double longest_piece_ = 0.0;           // of columns, that Gauss points are laid on [m]
  int along_piece_ = 0;                  // of these points
  std::vector<Vec3> from_;    // where columns begin
  std::vector<double> area_;  // that they stand for [m^2]
  std::vector<std::size_t> positive_;  // margins of columns where they begin
  std::vector<Change> change_;         // sorted along each column
  std::vector<Change> turn_;           // from a place to where the margin turns towards the other sign
  std::vector<Vec3> place_, point_;
  std::vector<double> margin_, third_, value_, volume_;
  std::vector<Cell> leaf_, split_, quarter_;
};

}  // namespace supple::collision
