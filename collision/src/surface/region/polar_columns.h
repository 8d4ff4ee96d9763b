/// @file polar_columns.h
/// Columns from the nodes of a polar patch through what each body loses: along the axis of the patch, or spread about it where a body widens beyond Sigma.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/patch_points.h"
#include "surface/polar/apex.h"

namespace supple::collision {

/// The nodes of a patch on Sigma, where columns begin.
struct PatchNodes {
  const PeakFrame& frame;
  const Vec3& peak;          ///< where one more column begins
  const PressureBatch& at;
  std::span<const double> weight, pressure;  ///< weights over the plane across the axis [m^2]; [Pa]
  std::span<const Vec3> normal;
  std::size_t summit;        ///< node of the largest pressure; their number: the peak
  double extent;             ///< columns are no longer [m]
};

class PatchColumns {
 public:
  struct Asked {
    int nodes;            ///< of Gauss along a column, or as many as would be as exact
    Regions regions;
    double error;
    bool may_go_through;  ///< one body through the other: then they have another patch beyond this one
  };

  /// Forgets how columns spread.
  void forget() { spread_ = widest_ = {}; }
  /// Spreads the columns of both sides as far as the bodies lean away at a place of the rim.
  /// @param across  from the axis to the rim   @return false where that is too far
  bool reach_rim(const PeakFrame& frame, const AlongAxis& sigma, const Vec3& across);
  /// Adds energies, volumes and points of the squeezed regions. @return the thickness of the overlap at the summit [m]; nothing where columns do not fit
  std::optional<double> add(PairPressure& pressure, const PatchNodes& patch, const Asked& asked, PatchPoints& points);

 private:
  /// A line from a node through a squeezed region. Where columns spread, X = node + t way, across from the axis by 1 + t spread times as far as the
  /// node, and t has the area of the node's foot times (1 + t spread)(narrow + t spread).
  struct Column {
    Vec3 way;       // of length 1 along the axis
    Swept swept{};  // over the area across the axis
  };
  [[nodiscard]] const Column& column(std::size_t i) const { return column_[column_.size() == 1 ? 0 : i]; }
  bool widen(const PeakFrame& frame, int side, const Vec3& outward, const Vec3& across);
  bool start(const PatchNodes& patch, int side);
  [[nodiscard]] bool lead_out(const PatchNodes& patch, int side) const;
  bool find_ends(PairPressure& pressure, const PatchNodes& patch, int side, double tolerance, double inside);
  void evaluate_on_lines(PairPressure& pressure, int side);
  bool end_within(PairPressure& pressure, const PatchNodes& patch, int side);
  bool goes_through(PairPressure& pressure, const PatchNodes& patch, int side, bool ended);
  bool comes_out(PairPressure& pressure, double out, int side, Vec3 at);
  std::optional<double> add_side(PairPressure& pressure, const PatchNodes& patch, const Asked& asked, int side, PatchPoints& points);
  void add_energy_from_ends(PairPressure& pressure, const PatchNodes& patch, int nodes, int side, PatchPoints& points);
  void add_points(PairPressure& pressure, const PatchNodes& patch, int nodes, int side, PatchPoints& points);

  std::array<double, 2> spread_{};  // of the columns of each side, across over along [1/m], a metre from the axis
  std::array<double, 2> widest_{};  // the same at the rim [1]
  std::vector<Column> column_;      // by node, and that through the peak; one for all where they do not spread
  std::vector<double> end_[2], reached_, low_, high_;
  std::vector<Vec3> line_point_, line_slope_;
  std::vector<double> line_value_, other_value_;
  std::vector<std::size_t> open_;   // lines whose end is not found yet
  PressureBatch some_;              // at these
};

}  // namespace supple::collision
