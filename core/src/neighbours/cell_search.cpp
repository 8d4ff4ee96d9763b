#include "neighbours/cell_search.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "supple/core/error.h"

namespace supple::core {
namespace {

constexpr std::size_t kPointBlock = 4096;
/// Points of a block of tiles, or a little more.
constexpr std::uint32_t kSearchBlock = 512;
/// Cells are a little wider than they need be, so that rounding of the coordinates cannot put neighbours a cell too far
/// apart while coordinates stay below kFarCell.
constexpr double kCellSlack = 1.0 + 0x1p-10;
constexpr double kFarCell = 0x1p40;
constexpr std::array<std::uint32_t, 3> kInReach{kCellsInReach, kCellsInReach, kCellsInReachUp};
/// Cells that a tile sees along each axis.
constexpr std::array<std::uint32_t, 3> kSeen{2 * kCellsInReach + 1, 2 * kCellsInReach + 1, kTile + 2 * kCellsInReachUp};
static_assert(kSeen[2] % kTile == 0);

double cell_limit(std::size_t points) { return 16.0 * static_cast<double>(points) + 8192.0; }

/// The remainder in [0, cells) of a whole number.
std::uint32_t wrapped(double c, std::uint32_t cells) {
  const double n = cells;
  return std::min(static_cast<std::uint32_t>(std::max(c - n * std::floor(c / n), 0.0)), cells - 1);
}

}  // namespace

void CellSearch::find_cells(std::span<const Vec3> positions, const Executor& executor) {
  const std::size_t n = positions.size();
  block_bounds_.assign((n + kPointBlock - 1) / kPointBlock, Box{});
  const auto bound = [&](std::size_t begin, std::size_t end) {
    Box bounds;
    for (std::size_t i = begin; i < end; ++i) bounds.include(positions[i]);
    block_bounds_[begin / kPointBlock] = bounds;
  };
  executor.for_blocks(n, kPointBlock, std::cref(bound));
  Box bounds;
  for (const Box& b : block_bounds_) bounds = bounds.united(b);

  std::array<double, 3> inverse{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<int>(k);
    const double farthest = std::max(std::abs(bounds.lower[axis]), std::abs(bounds.upper[axis]));
    inverse[k] = std::min(kInReach[k] / (grid_.reach * kCellSlack), kFarCell / farthest);
    // Cells without points between the first and the last, so that the box may repeat.
    const double cells = std::floor(bounds.upper[axis] * inverse[k]) - std::floor(bounds.lower[axis] * inverse[k]) + 1.0 + kInReach[k];
    grid_.cells[k] = static_cast<std::uint32_t>(std::clamp(cells, static_cast<double>(kSeen[k]), cell_limit(n)));
  }
  const auto all = [this] {
    return static_cast<double>(grid_.cells[0]) * static_cast<double>(grid_.cells[1]) * static_cast<double>(grid_.cells[2]);
  };
  while (all() > cell_limit(n)) {
    const auto most = static_cast<std::size_t>(std::max_element(grid_.cells.begin(), grid_.cells.end()) - grid_.cells.begin());
    if (grid_.cells[most] <= kSeen[most]) break;
    grid_.cells[most] = std::max(grid_.cells[most] / 2, kSeen[most]);
  }
  grid_.cells[2] = (grid_.cells[2] + kTile - 1) / kTile * kTile;

  cell_.resize(n);
  const auto place = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      std::array<std::uint32_t, 3> c;
      for (std::size_t k = 0; k < 3; ++k) {
        c[k] = wrapped(std::floor(positions[i][static_cast<int>(k)] * inverse[k]), grid_.cells[k]);
      }
      cell_[i] = (c[0] * grid_.cells[1] + c[1]) * grid_.cells[2] + c[2];
    }
  };
  executor.for_blocks(n, kPointBlock, std::cref(place));
}

void CellSearch::lay_blocks() {
  first_tile_.assign(1, 0);
  std::uint32_t first_point = 0;
  const std::uint32_t tiles = grid_.tiles();
  for (std::uint32_t tile = 1; tile <= tiles; ++tile) {
    const std::uint32_t point = grid_.start[tile * kTile];
    if (point - first_point < kSearchBlock && tile < tiles) continue;
    first_tile_.push_back(tile);
    first_point = point;
  }
}

void CellSearch::sort(std::span<const Vec3> positions, double reach, const Executor& executor) {
  SUPPLE_EXPECTS(reach > 0.0 && positions.size() < (std::size_t{1} << 28));
  grid_.reach = reach;
  first_tile_.assign(1, 0);
  const auto n = static_cast<std::uint32_t>(positions.size());
  if (n == 0) return;
  find_cells(positions, executor);
  grid_.start.assign(std::size_t{grid_.cells[0]} * grid_.cells[1] * grid_.cells[2] + 1, 0);
  for (const std::uint32_t c : cell_) ++grid_.start[c];
  std::uint32_t sum = 0;
  for (std::uint32_t& s : grid_.start) s = sum += s;
  // Filled from the back, which turns the ends in `start` into beginnings.
  for (std::vector<double>* v : {&grid_.x, &grid_.y, &grid_.z}) v->resize(n + kVectorRoom);
  grid_.index.resize(n + kVectorRoom);
  for (std::uint32_t i = n; i-- > 0;) {
    const std::uint32_t at = --grid_.start[cell_[i]];
    grid_.index[at] = i;
    grid_.x[at] = positions[i].x();
    grid_.y[at] = positions[i].y();
    grid_.z[at] = positions[i].z();
  }
  lay_blocks();
}

void CellSearch::search(std::size_t block, std::uint32_t stride, NearLists& out) const {
  out.clear();
  search_cells(grid_, first_tile_[block], first_tile_[block + 1], stride, out);
}

}  // namespace supple::core
