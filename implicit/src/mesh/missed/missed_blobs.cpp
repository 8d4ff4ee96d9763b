#include "mesh/missed/missed_blobs.h"

#include <algorithm>
#include <cmath>

#include "field/field_index.h"
#include "mesh/blob_grid.h"
#include "mesh/cubes/march_sampling.h"
#include "mesh/missed/cube_lanes.h"

namespace supple::implicit {
namespace {

using blobs::BlobList;
using lattice::BlockCoord;

constexpr int kBlock = 16, kLeaf = 8, kTile = blobs::kTile, kGroup = 2;
/// Halvings of a cell before it counts as open.
constexpr int kHalvings = 4;

std::array<float, 3> middle_of(const std::array<int, 3>& corner, int edge) {
  const float half = 0.5F * static_cast<float>(edge);
  return {static_cast<float>(corner[0]) + half, static_cast<float>(corner[1]) + half,
      static_cast<float>(corner[2]) + half};
}
/// One of the eight cubes of `edge` at `corner`.
std::array<int, 3> part_of(const std::array<int, 3>& corner, int part, int edge) {
  return {corner[0] + edge * (part & 1), corner[1] + edge * (part >> 1 & 1), corner[2] + edge * (part >> 2)};
}

/// Blocks of 16^3 cells, cut into leaves of 8^3, tiles of 4^3 and groups of 2^3 cells, each with the blobs that reach
/// it.
class BlobSearch {
 public:
  BlobSearch(const blobs::BlobGrid& grid, float iso) : grid_(grid), iso_(iso) {}

  void search(const BlockCoord& block, std::vector<OpenCells>& open) {
    grid_.gather({std::int64_t{kBlock} * block[0], std::int64_t{kBlock} * block[1], std::int64_t{kBlock} * block[2]},
        kBlock, 0, block_);
    if (block_.count == 0) return;
    for (int l = 0; l < 8; ++l) {
      leaf_corner_ = part_of({0, 0, 0}, l, kLeaf);
      const auto middle = middle_of(leaf_corner_, kLeaf);
      if (settled(blobs::select_near_first(block_, middle, 0.5F * kLeaf, leaf_, far_))) continue;
      found_.block = {2 * block[0] + (l & 1), 2 * block[1] + (l >> 1 & 1), 2 * block[2] + (l >> 2)};
      found_.cell.clear();
      for (int t = 0; t < 8; ++t) {
        const std::array<int, 3> tile = part_of(leaf_corner_, t, kTile);
        const auto middle_of_tile = middle_of(tile, kTile);
        if (!settled(blobs::select_near_first(leaf_, middle_of_tile, 0.5F * kTile, tile_, far_))) search_tile(tile);
      }
      if (!found_.cell.empty()) open.push_back(found_);
    }
  }
  /// Number of cubes processed.
  [[nodiscard]] std::uint64_t cubes() const { return cubes_; }

 private:
  [[nodiscard]] bool settled(const blobs::PotentialBounds& bounds) const {
    return bounds.upper <= iso_ || bounds.lower > iso_;
  }

  void search_tile(const std::array<int, 3>& tile) {
    cells_.reserve(blobs::kTileNodes);
    cells_.clear();
    for (int g = 0; g < 8; ++g) {
      for (int c = 0; c < 8; ++c) {
        const auto at = middle_of(part_of(part_of(tile, g, kGroup), c, 1), 1);
        cells_.add(at[0], at[1], at[2]);
      }
    }
    cubes_ += cells_.count;
    round_off_ = blobs::cube_round_off(tile_, iso_);
    if (round_off_.bounded) {
      blobs::bound_values(tile_, iso_, round_off_, 0.5F, true, cells_);
      blobs::drop_sloped(tile_, round_off_, 0.5F, cells_);
    }
    // Cells of a group follow each other.
    for (std::size_t begin = 0, end = 0; begin < cells_.count; begin = end) {
      const auto group = group_at(begin);
      while (end < cells_.count && group_at(end) == group) ++end;
      parts_.reserve(end - begin);
      parts_.clear();
      for (std::size_t i = begin; i < end; ++i) parts_.add(cells_.x[i], cells_.y[i], cells_.z[i]);
      if (round_off_.bounded) search_group(group);
      add_cells();
    }
  }
  [[nodiscard]] std::array<int, 3> group_at(std::size_t cell) const {
    return {static_cast<int>(cells_.x[cell]) & -kGroup, static_cast<int>(cells_.y[cell]) & -kGroup,
        static_cast<int>(cells_.z[cell]) & -kGroup};
  }

  /// Halves the cells of a group that are left.
  void search_group(const std::array<int, 3>& group) {
    (void)blobs::select(tile_, middle_of(group, kGroup), 0.5F * kGroup, group_);
    float half = 0.5F;
    for (int halving = 1; halving <= kHalvings && parts_.count > 0; ++halving) {
      half *= 0.5F;
      halve(half);
      cubes_ += parts_.count;
      // An eighth of a cell holds one of its nodes: where F keeps its sign on it nothing is missed there. Smaller parts
      // must have a way.
      const bool has_node = halving == 1;
      blobs::bound_values(group_, iso_, round_off_, half, has_node, parts_);
      blobs::drop_sloped(group_, round_off_, half, parts_);
      if (!has_node) drop_joined();
    }
  }

  /// The eighths of the cubes left, in their order.
  void halve(float half) {
    halves_.reserve(8 * parts_.count);
    halves_.clear();
    for (std::size_t i = 0; i < parts_.count; ++i) {
      for (int c = 0; c < 8; ++c) {
        const auto moved = [&](float at, int axis) { return at + ((c >> axis & 1) != 0 ? half : -half); };
        halves_.add(moved(parts_.x[i], 0), moved(parts_.y[i], 1), moved(parts_.z[i], 2));
      }
    }
    std::swap(parts_, halves_);
  }

  /// Drops the parts on which F keeps its sign if it does so, too, on a way to a node of their cell.
  void drop_joined() {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < parts_.count; ++i) {
      if (parts_.one_sign[i] != 0.0F && has_way(parts_.x[i], parts_.y[i], parts_.z[i])) continue;
      parts_.x[kept] = parts_.x[i];
      parts_.y[kept] = parts_.y[i];
      parts_.z[kept++] = parts_.z[i];
    }
    parts_.count = kept;
  }

  /// By cubes one after the other on a straight line, which stays in the cell though they may not.
  [[nodiscard]] bool has_way(float x, float y, float z) {
    constexpr int kSteps = 16;
    way_.reserve(kSteps);
    for (int c = 0; c < 8; ++c) {  // the nearest first
      const auto node = [&](float at, int axis) {
        const float nearest = std::round(at);
        return (c >> axis & 1) == 0 ? nearest : at > nearest ? nearest + 1.0F : nearest - 1.0F;
      };
      const float dx = node(x, 0) - x, dy = node(y, 1) - y, dz = node(z, 2) - z;
      // Slightly more than half a step along each axis.
      const float half = 0.501F / kSteps * std::max({std::abs(dx), std::abs(dy), std::abs(dz)});
      way_.clear();
      for (int k = 0; k < kSteps; ++k) {
        const float f = (static_cast<float>(k) + 0.5F) / kSteps;
        way_.add(x + f * dx, y + f * dy, z + f * dz);
      }
      cubes_ += kSteps;
      blobs::bound_values(group_, iso_, round_off_, half, true, way_);
      if (way_.count == 0) return true;
    }
    return false;
  }

  /// The cells of the remaining parts.
  void add_cells() {
    for (std::size_t i = 0; i < parts_.count; ++i) {
      const auto in_leaf = [](float at, int corner) {
        return static_cast<std::uint8_t>(static_cast<int>(at) - corner);
      };
      const std::array cell{in_leaf(parts_.x[i], leaf_corner_[0]), in_leaf(parts_.y[i], leaf_corner_[1]),
          in_leaf(parts_.z[i], leaf_corner_[2])};
      if (found_.cell.empty() || found_.cell.back() != cell) found_.cell.push_back(cell);
    }
  }

  const blobs::BlobGrid& grid_;
  float iso_;
  BlobList block_, leaf_, tile_, group_, far_;
  blobs::CubeBatch cells_, parts_, halves_, way_;
  blobs::CubeRoundOff round_off_;
  std::array<int, 3> leaf_corner_{};
  OpenCells found_;
  std::uint64_t cubes_ = 0;
};

}  // namespace

bool is_sum_of_blobs(const Field& field) {
  const Field::Index& index = field.packed();
  return index.size() > 0 && index.uniform && index.primitive[0].kind == PackedKind::PointWyvill &&
      !index.blend.active();
}

std::vector<OpenCells> find_open_cells(const Field& field, const Lattice& lattice, const Executor& executor,
    std::uint64_t& cubes) {
  const Field::Index& index = field.packed();
  blobs::BlobGrid grid;
  grid.build(index.primitive, lattice);
  const blobs::CellBox& support = grid.support();
  if (support.empty() || !(index.iso > 0.0)) return {};
  march::expect_nodes(support.lower, support.upper, lattice);
  BlockCoord low{};
  std::array<std::size_t, 3> count{};
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = static_cast<std::int32_t>(support.lower[k] >> 4);
    count[k] = static_cast<std::size_t>((support.upper[k] >> 4) - low[k] + 1);
  }
  constexpr std::size_t kPerTask = 8;
  struct Part {
    std::vector<OpenCells> open;
    std::uint64_t cubes = 0;
  };
  const std::size_t blocks = count[0] * count[1] * count[2];
  std::vector<Part> parts((blocks + kPerTask - 1) / kPerTask);
  executor.for_blocks(blocks, kPerTask, [&](std::size_t begin, std::size_t end) {
    BlobSearch search(grid, static_cast<float>(index.iso));
    Part& part = parts[begin / kPerTask];
    for (std::size_t b = begin; b < end; ++b) {
      search.search({low[0] + static_cast<std::int32_t>(b % count[0]),
          low[1] + static_cast<std::int32_t>(b / count[0] % count[1]),
                     low[2] + static_cast<std::int32_t>(b / count[0] / count[1])}, part.open);
    }
    part.cubes = search.cubes();
  });
  std::vector<OpenCells> open;
  for (Part& part : parts) {
    cubes += part.cubes;
    for (OpenCells& cells : part.open) open.push_back(std::move(cells));
  }
  std::sort(open.begin(), open.end(),
      [](const OpenCells& a, const OpenCells& b) { return lattice::before(a.block, b.block); });
  return open;
}

}  // namespace supple::implicit
