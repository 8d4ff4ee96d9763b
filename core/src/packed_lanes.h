// The loops of neighbour lists on the widest vectors that the processor has. A batch is eight neighbours on every
// width, lane k of each batch goes to sum k, and the eight sums are added in one order: the width changes no bit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace supple::core::packed {

inline constexpr std::size_t kBatch = 8;
/// Floats that a vector reads or writes past the end of what it is given.
inline constexpr std::size_t kFloatRoom = 16;

/// A position or a normal; 32 bytes, so that a neighbour is one load.
struct alignas(32) Row {
  double x = 0.0, y = 0.0, z = 0.0, w = 0.0;
};

/// Cells are range / 2 wide and range / 4 high, so that few points are looked at in vain.
inline constexpr int kReach = 2;
inline constexpr std::uint32_t kReachUp = 4;
/// Cells above each other that are searched together; a column holds whole tiles.
inline constexpr std::uint32_t kTile = 4;

/// Points in cells, those of a cell after each other, z fastest; the cells at the sides are empty or hold images.
struct CellGrid {
  std::array<std::uint32_t, 3> cells{};
  float range2 = 0.0F;               ///< squared range, with room for the rounding of the floats
  std::vector<std::uint32_t> start;  ///< first point of each cell, shape [cells + 1]
  std::vector<float> x, y, z;        ///< shape [points + kFloatRoom]
  std::vector<std::uint8_t> image;   ///< whether a point is an image, not a particle
};

/// The lists of some particles. Neighbours are four times the index of their row, so that no product is needed.
struct ListBlock {
  std::vector<std::uint32_t> point;      ///< row of each particle
  std::vector<std::uint32_t> first;      ///< first neighbour of each particle, shape [particles]
  std::vector<std::uint32_t> last;       ///< one past its last
  std::vector<std::uint32_t> neighbour;  ///< lists of whole batches, the last one filled with `filler`; and room

  std::vector<float> near_x, near_y, near_z;  ///< the points in reach of a tile
  std::vector<std::uint32_t> near_index;
};

/// Lists of the particles in the cells [begin, end), whole tiles.
/// @param filler  row that no particle has within its range
void search_cells(const CellGrid& grid, std::uint32_t begin, std::uint32_t end, std::uint32_t filler, ListBlock& out);

/// The force on a particle is the sum of r (six / d^8 - twelve / d^14), r pointing to the neighbour.
struct TwelveSixNumbers {
  double range2 = 0.0;
  double twelve = 0.0;  ///< 48 eps sigma^12
  double six = 0.0;     ///< 24 eps sigma^6
};
/// Forces on the particles [begin, end) of a block, shape [end - begin].
void twelve_six_forces(const TwelveSixNumbers& law, const ListBlock& list, std::size_t begin, std::size_t end,
                       const Row* position, Row* force);

/// Gains of the laws of surface elements; the weight vanishes at the range h.
struct SurfaceNumbers {
  double range2 = 0.0;       ///< h^2
  double inverse_h2 = 0.0;   ///< 1 / h^2
  double slope = 0.0;        ///< -6 / h^2
  double inverse_r0 = 0.0;
  double cohesion = 0.0;     ///< F0 r0
  double a = 0.0;
  double form = 0.0;         ///< k_f
  double curvature = 0.0;    ///< kappa
  double form_offset = 0.0;  ///< k_f kappa^2
  double coplanarity = 0.0;  ///< k_p
  double conormality = 0.0;  ///< k_n
  double conormality2 = 0.0; ///< 2 k_n
  double cocircularity = 0.0;///< k_c
};
/// Forces and torques on the particles [begin, end) of a block, shape [end - begin].
/// @param filler  four times the row that fills batches; its normal is 0
void surface_loads(const SurfaceNumbers& law, const ListBlock& list, std::size_t begin, std::size_t end,
                   std::uint32_t filler, const Row* position, const Row* normal, Row* force, Row* torque);

/// Largest squared distance of two sets of points, shape [points][3].
double largest_move2(const double* now, const double* before, std::size_t points);

}  // namespace supple::core::packed
