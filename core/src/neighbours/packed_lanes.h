// The loops of neighbour lists on the widest vectors that the processor has. A batch is eight neighbours of one
// particle on every width; what they do to it is added in one order and then to its row: the width changes no bit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace supple::core::packed {

inline constexpr std::size_t kBatch = 8;
/// Floats that a vector reads or writes past the end of what it is given.
inline constexpr std::size_t kFloatRoom = 16;
/// Batches after the last of a list that may be read.
inline constexpr std::size_t kSpareBatches = 4;

/// A position or a normal; 32 bytes, so that a neighbour is one load.
struct alignas(32) Row {
  double x = 0.0, y = 0.0, z = 0.0, w = 0.0;
};

/// Cells are range / 2 wide and range / 4 high, so that few points are looked at in vain.
inline constexpr std::uint32_t kReach = 2;
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

/// Cells that lists are made of together: columns [begin, end) in x and y, from the lowest tile to the highest.
struct CellBlock {
  std::array<std::uint32_t, 2> begin{}, end{};
  std::uint32_t lowest = 0, highest = 0;
};

/// The pairs of the particles of some cells, each pair once: a particle has the points that follow it in its own column
/// of cells and those of the columns behind. Indices are four times those of rows, so that no product is needed.
struct ListBlock {
  std::uint32_t filler = 0;              ///< of the row that fills the last batch of a particle; no other block has it
  std::size_t batches = 0;
  std::vector<std::uint32_t> owner;      ///< the particle of each batch, shape [batches]; and room
  std::vector<std::uint32_t> neighbour;  ///< kBatch of each batch; and room

  std::vector<float> near_x, near_y, near_z;  ///< the points in reach of a tile
  std::vector<std::uint32_t> near_index;
};

/// Lists of the particles in some cells; sets all of `out` but the filler, which no particle has within its range.
void search_cells(const CellGrid& grid, const CellBlock& cells, ListBlock& out);

/// The force on a neighbour is r (twelve / d^14 - six / d^8), r pointing to it.
struct TwelveSixNumbers {
  double range2 = 0.0;
  double twelve = 0.0;  ///< 48 eps sigma^12
  double six = 0.0;     ///< 24 eps sigma^6
};
/// Adds the forces of the pairs of a block to the rows of both particles.
void twelve_six_forces(const TwelveSixNumbers& law, const ListBlock& list, const Row* position, Row* force);

/// Gains of the laws of surface elements; the weight vanishes at the range h.
struct SurfaceNumbers {
  double range = 0.0;           ///< h
  double inverse_h2 = 0.0;      ///< 1 / h^2
  double slope = 0.0;           ///< -3 / h^2
  double inverse_r0 = 0.0;
  double cohesion = 0.0;        ///< F0 r0
  double a = 0.0;
  double form4 = 0.0;           ///< 4 k_f
  double curvature = 0.0;       ///< kappa
  double half_curvature = 0.0;  ///< kappa / 2
  double form_offset2 = 0.0;    ///< 2 k_f kappa^2
  double flatness2 = 0.0;       ///< 2 (k_p + k_c)
  double conormality2 = 0.0;    ///< 2 k_n
  double conormality4 = 0.0;    ///< 4 k_n
  double cocircularity2 = 0.0;  ///< 2 k_c
};
/// Adds forces, and the derivatives dU/dn of the energy by the normals, to the rows of both particles of each pair.
/// @param normal  that of the filler is 0
void surface_loads(const SurfaceNumbers& law, const ListBlock& list, const Row* position, const Row* normal,
                   Row* force, Row* turn);

/// Positions for pairs in single precision: whole numbers of quanta, modulo 2^32, as the bits of floats. Neighbours are
/// so near each other that the difference modulo 2^32 is the true one: precision is relative to the range, not to the
/// extent of all particles.
struct alignas(16) SingleRow {
  float x = 0.0F, y = 0.0F, z = 0.0F, w = 0.0F;
};
struct Fixed {
  const float* rows = nullptr;  ///< of SingleRow
  float quantum = 0.0F;         ///< [m]
  float outside = 0.0F;         ///< a coordinate of r out of range [m]
};
/// The same laws in single precision; each pair acts on both particles with the same number, and sums are of doubles.
void twelve_six_forces(const TwelveSixNumbers& law, const ListBlock& list, const Fixed& fixed, Row* force);
void surface_loads(const SurfaceNumbers& law, const ListBlock& list, const Fixed& fixed, const float* normals,
                   Row* force, Row* turn);

/// Gay-Berne ellipsoids; powers are whole.
struct GayBerneNumbers {
  double range2 = 0.0;
  double epsilon4 = 0.0;  ///< 4 eps
  double slope = 0.0;     ///< 24 eps / sigma
  double sigma = 0.0;
  double shift = 0.0;     ///< gamma sigma
  double volume2 = 0.0;   ///< 2 l^2
  int upsilon = 0;
  int mu = 0;
};
/// Diagonals (xx, yy, zz) and other elements (yz, zx, xy) of the matrices G_X, then of B_X, of all points.
using EllipsoidRows = std::array<const Row*, 4>;
/// Adds forces and torques to the rows of both particles of each pair.
void gay_berne_loads(const GayBerneNumbers& law, const ListBlock& list, const Row* position,
                     const EllipsoidRows& ellipsoid, Row* force, Row* torque);

/// Largest squared distance of two sets of points, shape [points][3].
double largest_move2(const double* now, const double* before, std::size_t points);

}  // namespace supple::core::packed
