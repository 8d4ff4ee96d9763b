// The search for neighbours on the widest vectors that the processor has: points in cells of a box that repeats, and the
// points near each of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace supple::core {

/// Cells are reach / 2 wide and reach / 4 high, so that few points are looked at in vain.
inline constexpr std::uint32_t kCellsInReach = 2;
inline constexpr std::uint32_t kCellsInReachUp = 4;
/// Cells above each other whose points are searched together; a column holds whole tiles.
inline constexpr std::uint32_t kTile = 4;
/// Numbers that a vector reads or writes past the end of what it is given.
inline constexpr std::size_t kVectorRoom = 16;

/// Points sorted by cell, z fastest, and by index within one. The box of cells repeats: points that are whole boxes apart
/// share a cell, and distances tell them apart.
struct CellGrid {
  std::array<std::uint32_t, 3> cells{};  ///< at least what a point reaches to both sides, so that none is seen twice
  double reach = 0.0;                    ///< [m]
  std::vector<std::uint32_t> start;      ///< first point of each cell, shape [cells + 1]
  std::vector<double> x, y, z;           ///< shape [points + kVectorRoom]
  std::vector<std::uint32_t> index;      ///< of each point before sorting, shape [points + kVectorRoom]

  [[nodiscard]] std::uint32_t tiles() const { return cells[0] * cells[1] * cells[2] / kTile; }
};

/// The points nearer than the reach to each of some points, in no order, and some up to 2^-18 of it farther.
struct NearLists {
  struct Owner {
    std::uint32_t index = 0;
    std::uint32_t count = 0;
    std::size_t begin = 0;  ///< of its list in `near`
  };
  std::vector<Owner> owner;
  std::vector<std::uint32_t> near;  ///< indices of points; and room
  std::size_t size = 0;             ///< of `near` without room
  std::uint64_t distances = 0;      ///< computed

  std::vector<float> x, y, z;       ///< the points in reach of a tile
  std::vector<std::uint32_t> index;
  std::vector<std::uint32_t> waiting;

  void clear() {
    owner.clear();
    size = 0;
    distances = 0;
  }
};

/// Appends the lists of the points of the tiles [begin, end) whose index is a multiple of `stride`.
void search_cells(const CellGrid& grid, std::uint32_t begin, std::uint32_t end, std::uint32_t stride, NearLists& out);

}  // namespace supple::core
