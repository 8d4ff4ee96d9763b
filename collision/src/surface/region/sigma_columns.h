/// @file sigma_columns.h
/// Columns from the points of Sigma through what a body loses to where it ends.
#pragma once

#include "surface/pair_pressure.h"
#include "surface/patch_points.h"
#include "surface/polar/apex.h"

namespace supple::collision {

struct ColumnJob {
  PairPressure& pressure;
  int side;       ///< whose space it is
  Thirds third;   ///< bodies that may take space from the pair, too
  Region region;
  double error;   ///< relative, of the load that the columns carry and of its moment
};

/// Columns from the points of Sigma, along its mean normal, or each down the slope of the own pressure, whatever way Sigma faces. As columns of no length begin at the
/// rim, they hold a region once where their ends change steadily along Sigma. The load that they carry tells whether they do.
/// @return whether columns of either kind do, and third bodies take nothing of the region; else nothing is added
bool add_columns(const ColumnJob& job, PatchPoints& points);

/// Adds to the sums of a side what flows out of an apex through the places of Sigma, and the whole body where the apex is lost. The integral of p_A over V_A, of
/// a body that every line out of a place leaves once, is the flux through Sigma of these lines times the integral of p_A from there to where A ends (Gauss).
/// @param error  relative, of what the body has
void add_flow(PairPressure& pressure, int side, const Apex& apex, double error, PatchPoints& points);

}  // namespace supple::collision
