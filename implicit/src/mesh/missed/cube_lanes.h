/// @file cube_lanes.h
/// Bounds of a sum of Wyvill points on small cubes: in single precision, one cube per lane, as in
/// blob_lanes.h. The bounds include round-off.
#pragma once

#include <cstddef>
#include <vector>

#include "mesh/blob_lanes.h"

namespace supple::implicit::blobs {

/// Cubes of one size by their middles, in the frame of a list's block of at most 16 cells.
struct CubeBatch {
  std::vector<float> x, y, z;
  std::vector<float> one_sign;  ///< after bound_values: not 0 where F keeps its sign on all of the cube
  /// At the middles after bound_values: -grad F / 6, and sum s^2 t^2 with the scale s and t = 1 - |s x - centre|^2.
  std::vector<float> slope_x, slope_y, slope_z, bend;
  std::size_t count = 0;

  /// Makes room for this many, and for the lanes that vectors write beyond them.
  void reserve(std::size_t cubes);
  void clear() { count = 0; }
  void add(float at_x, float at_y, float at_z) {
    x[count] = at_x;
    y[count] = at_y;
    z[count++] = at_z;
  }
};

/// What may be left of the blobs' terms by rounding, in sums of values and of slopes.
struct CubeRoundOff {
  float value = 0.0F, slope = 0.0F;
  bool bounded = false;  ///< only then the bounds hold: supports are larger than a cell
};
[[nodiscard]] CubeRoundOff cube_round_off(const BlobList& list, float iso);

/// Whether F keeps its sign on cubes. @param half of their edges, <= 1/2 @param drop those on which it does are left
/// out, and sums inside end early @pre round_off.bounded
void bound_values(const BlobList& list, float iso, const CubeRoundOff& round_off, float half, bool drop,
    CubeBatch& cubes);

/// Drops the cubes on which F rises along one direction everywhere. @pre bound_values with the same list and `half`
void drop_sloped(const BlobList& list, const CubeRoundOff& round_off, float half, CubeBatch& cubes);

}  // namespace supple::implicit::blobs
