#include "march_sampling.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "field_index.h"
#include "polygonise_block_edges.h"
#include "polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/field.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/project.h"

namespace supple::implicit::march {
namespace {

using blobs::BlobList;
using blobs::Cells;
using blobs::kTile;
using blobs::kTileNodes;

constexpr std::size_t kBlocksPerTask = 8;
/// Vertices stay this far from the nodes [cells].
constexpr double kLeast = 0x1p-17;

std::array<int, 3> corner_of(unsigned mask, int edge) {
  return {edge * static_cast<int>(mask & 1u), edge * static_cast<int>(mask >> 1 & 1u), edge * static_cast<int>(mask >> 2)};
}

/// The 16 signs of a plane of a tile as bits of the plane of its leaf.
Plane spread(std::uint64_t tile_plane, int tx, int ty) {
  const std::uint64_t m = tile_plane & 0xffffu;
  const Plane rows = (m & 0xfu) | (m & 0xf0u) << 4 | (m & 0xf00u) << 8 | (m & 0xf000u) << 12;
  return rows << tx << (8 * ty);
}

/// Of a tile in a leaf.
std::array<int, 3> corner_in(const std::array<int, 3>& leaf_corner, unsigned tile) {
  const auto at = corner_of(tile, kTile);
  return {leaf_corner[0] + at[0], leaf_corner[1] + at[1], leaf_corner[2] + at[2]};
}

/// The signs of a tile, bit x + 4 y + 16 z.
std::uint64_t tile_inside(const Leaf& leaf, unsigned tile) {
  std::uint64_t inside = 0;
  for (std::size_t k = 0; k < kTile; ++k) {
    inside |= _pext_u64(leaf.inside[kTile * (tile >> 2) + k], tile_plane(tile)) << (16 * k);
  }
  return inside;
}

void set_tile(Leaf& leaf, unsigned tile, std::uint64_t inside) {
  const auto at = corner_of(tile, kTile);
  for (int k = 0; k < kTile; ++k) {
    leaf.inside[static_cast<std::size_t>(at[2] + k)] |= spread(inside >> (16 * k), at[0], at[1]);
  }
}

Vec3 position_of(const Lattice& lattice, const Block& block, int x, int y, int z, int axis, double t) {
  const Cells base = block.base();
  Vec3 p = lattice::node_position(lattice, base[0] + x, base[1] + y, base[2] + z);
  const double at = static_cast<double>(base[static_cast<std::size_t>(axis)] + std::array{x, y, z}[static_cast<std::size_t>(axis)]) + t;
  p[axis] = lattice.origin[axis] + lattice.cell * at;
  return p;
}

/// The tiles around those of a block.
class TileSurroundings {
 public:
  TileSurroundings(const BlockTable& table, const Block& block) {
    for (std::size_t n = 0; n < 27; ++n) {
      const auto [dx, dy, dz] = step_of(n);
      around_[n] = table.find({block.coord[0] + dx, block.coord[1] + dy, block.coord[2] + dz});
      const std::uint64_t outside = around_[n] != nullptr ? around_[n]->outside : ~std::uint64_t{0};
      if (outside == 0) continue;
      for (int z = first(dz); z <= last(dz); ++z) {
        for (int y = first(dy); y <= last(dy); ++y) {
          const std::uint64_t row = outside >> (4 * y + 16 * z) & 0xfu;
          const std::uint64_t seen = dx < 0 ? row >> 3 : dx > 0 ? (row & 1u) << 5 : row << 1;
          outside_[at(z, dz)] |= seen << (kSide * at(y, dy));
        }
      }
    }
  }

  /// Those of `tiles` that have a node outside one step away, along the axes or diagonals.
  [[nodiscard]] std::uint64_t next_to_outside(std::uint64_t tiles) const {
    std::array<std::uint64_t, kSide> near = outside_;
    for (std::uint64_t& plane : near) {
      plane |= plane << 1 | plane >> 1;
      plane |= plane << kSide | plane >> kSide;
    }
    std::uint64_t found = 0;
    for (; tiles != 0; tiles &= tiles - 1) {
      const int bit = std::countr_zero(tiles), x = bit & 3, y = bit >> 2 & 3, z = bit >> 4;
      const auto above = static_cast<std::size_t>(z);
      if (((near[above] | near[above + 1] | near[above + 2]) >> (x + 1 + kSide * (y + 1)) & 1u) == 0) continue;
      for (std::size_t n = 0; n < 27; ++n) {
        const auto [dx, dy, dz] = step_of(n);
        if ((outside_[static_cast<std::size_t>(z + dz + 1)] >> (x + dx + 1 + kSide * (y + dy + 1)) & 1u) == 0) continue;
        if ((outside_nodes(x + dx, y + dy, z + dz) & facing(dx, dy, dz)) == 0) continue;
        found |= std::uint64_t{1} << bit;
        break;
      }
    }
    return found;
  }

 private:
  static constexpr int kSide = 6;  // a block's four tiles and one on each side
  static std::array<int, 3> step_of(std::size_t n) {
    const int i = static_cast<int>(n);
    return {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
  }
  static int first(int step) { return step < 0 ? 3 : 0; }
  static int last(int step) { return step > 0 ? 0 : 3; }
  static std::size_t at(int tile, int step) { return static_cast<std::size_t>(tile + 4 * step + 1); }

  /// The nodes of a tile that face the tile from which it lies these steps away.
  static std::uint64_t facing(int dx, int dy, int dz) {
    std::uint64_t nodes = ~std::uint64_t{0};
    if (dx != 0) nodes &= dx > 0 ? 0x1111111111111111u : 0x8888888888888888u;
    if (dy != 0) nodes &= dy > 0 ? 0x000f000f000f000fu : 0xf000f000f000f000u;
    if (dz != 0) nodes &= dz > 0 ? 0xffffu : std::uint64_t{0xffff} << 48;
    return nodes;
  }
  [[nodiscard]] std::uint64_t outside_nodes(int x, int y, int z) const {
    const auto step = [](int tile) { return static_cast<std::size_t>((tile + 4) >> 2); };
    const Block* block = around_[step(x) + 3 * step(y) + 9 * step(z)];
    if (block == nullptr) return ~std::uint64_t{0};
    const auto bits = [](int a, int b, int c) { return static_cast<unsigned>((a & 1) | (b & 1) << 1 | (c & 1) << 2); };
    const std::int8_t index = block->leaf_of[bits(x >> 1, y >> 1, z >> 1)];
    if (index < 0) return index == kInside ? 0 : ~std::uint64_t{0};
    return ~tile_inside(block->leaf[static_cast<std::size_t>(index)], bits(x, y, z));
  }

  std::array<const Block*, 27> around_{};
  std::array<std::uint64_t, kSide> outside_{};  ///< tiles with nodes outside, bit x + 6 y
};

/// Bodies of Wyvill points, in single precision.
class BlobSampler final : public Sampler {
 public:
  BlobSampler(const Field::Index& index, const Lattice& lattice, bool skip, blobs::BlobGrid& grid)
      : index_(index), lattice_(lattice), skip_(skip), iso_(static_cast<float>(index.iso)), grid_(grid) {}

  void prepare(const Executor&, BlockTable& table) override {
    grid_.build(index_.primitive, lattice_);
    if (grid_.support().empty() || !(index_.iso > 0.0)) {
      table = {};
      return;
    }
    lay_out(table, grid_.support().lower, grid_.support().upper, lattice_);
  }

  void sample(const Executor& executor, BlockTable& table) override {
    const std::vector<std::uint32_t> blocks = grid_.change().all ? all_blocks(table) : changed_blocks(table);
    // A node that touches one outside lies a cell's slope above the iso value at most, but for rare places.
    sure_ = skip_ ? iso_ + static_cast<float>(kSteepest / grid_.reach()) : std::numeric_limits<float>::infinity();
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      Workspace& work = Workspace::of_thread();
      for (std::size_t i = begin; i < end; ++i) sample_block(table.block[blocks[i]], work);
    });
    if (skip_) evaluate_needed(executor, blocks, table);
  }

  void solve(const BlockTable& table, const Block& block, Mesh& mesh, std::vector<float>& along) const override {
    const auto wanted = [](const Leaf& leaf) { return leaf.solve && leaf.vertices > 0; };
    if (std::none_of(block.leaf.begin(), block.leaf.end(), wanted)) return;
    Workspace& work = Workspace::of_thread();
    const blobs::Placement placement = placement_of(block);
    grid_.gather(block.base(), kBlockNodes, 0, work.block);
    for (const Leaf& leaf : block.leaf) {
      if (!wanted(leaf)) continue;
      const auto corner = corner_of(leaf.slot, kLeafNodes);
      (void)blobs::select(work.block, centre_of(corner, kLeafNodes), 0.5F * kLeafNodes, work.leaf);
      for (unsigned tile = 0; tile < 8; ++tile) {
        if ((leaf.active >> tile & 1u) == 0) continue;
        const std::uint32_t count = leaf.tile_vertex[tile + 1] - leaf.tile_vertex[tile];
        if (count == 0) continue;
        const auto tile_corner = corner_in(corner, tile);
        collect_edges(table, block, leaf, tile, corner, work.edges);
        (void)blobs::select(work.leaf, centre_of(tile_corner, kTile), 0.5F * kTile, work.tile);
        blobs::solve_edges(work.tile, iso_, work.edges);
        const std::size_t first = leaf.first_vertex + leaf.tile_vertex[tile];
        blobs::place_vertices(work.edges, placement, mesh.position[first].data(), mesh.normal[first].data());
        std::copy_n(work.edges.t.begin(), count, along.begin() + static_cast<std::ptrdiff_t>(first));
      }
    }
  }

  void begin_projection() const override {
    Workspace& work = Workspace::of_thread();
    work.near_block = nullptr;
    work.near_leaf = nullptr;
  }

  void project(const Block& block, const Leaf& leaf, unsigned tile, std::span<Vec3> points,
               std::span<Vec3> normals) const override {
    if (points.empty()) return;
    // Points may lie this far beyond the tile's cells; leaves and blocks are cut to it too.
    constexpr int kAround = 1;
    Workspace& work = Workspace::of_thread();
    if (work.near_block != &block) {
      grid_.gather(block.base(), kBlockNodes, kAround, work.around_block);
      work.near_block = &block;
      work.near_leaf = nullptr;
    }
    const auto corner = corner_of(leaf.slot, kLeafNodes);
    if (work.near_leaf != &leaf) {
      (void)blobs::select(work.around_block, centre_of(corner, kLeafNodes), 0.5F * kLeafNodes + static_cast<float>(kAround),
                          work.around_leaf);
      work.near_leaf = &leaf;
    }
    (void)blobs::select(work.around_leaf, centre_of(corner_in(corner, tile), kTile),
                        0.5F * kTile + static_cast<float>(kAround), work.tile);
    blobs::project_points(work.tile, iso_, placement_of(block), points.data()->data(), normals.data()->data(),
                          points.size(), work.near);
  }

  [[nodiscard]] bool single_precision() const override { return true; }

 private:
  struct Workspace {
    blobs::TileBlobs tile_blobs;
    BlobList gathered, block, leaf, tile, near, far;
    std::uint64_t sure = 0;                // tiles of the block at work that are sure to be inside
    BlobList around_block, around_leaf;    // of the block and leaf that points were last projected near
    const Block* near_block = nullptr;
    const Leaf* near_leaf = nullptr;
    blobs::EdgeBatch edges;
    // Of the block at work; copied into it at the end, so that blocks hold no more than they need.
    std::vector<Leaf> leaves;
    std::vector<float> values;
    static Workspace& of_thread() {
      thread_local Workspace work;
      return work;
    }
  };

  static std::array<float, 3> centre_of(const std::array<int, 3>& corner, int edge) {
    const float half = 0.5F * static_cast<float>(edge);
    return {static_cast<float>(corner[0]) + half, static_cast<float>(corner[1]) + half,
            static_cast<float>(corner[2]) + half};
  }

  [[nodiscard]] blobs::Placement placement_of(const Block& block) const {
    const Cells low = block.base();
    return {.origin = {lattice_.origin.x(), lattice_.origin.y(), lattice_.origin.z()},
            .base = {static_cast<double>(low[0]), static_cast<double>(low[1]), static_cast<double>(low[2])},
            .cell = lattice_.cell};
  }

  static void collect_edges(const BlockTable& table, const Block& block, const Leaf& leaf, unsigned tile,
                            const std::array<int, 3>& corner, blobs::EdgeBatch& edges) {
    const float* values = tile_values(block, leaf, tile);
    std::array<const float*, 3> next{};  // of the tiles above
    for (unsigned axis = 0; axis < 3; ++axis) {
      std::array<int, 3> above = corner_in(corner, tile);
      above[axis] += kTile;
      next[axis] = tile_at(table, block, above[0], above[1], above[2]);
    }
    std::size_t n = 0;
    for_tile_edges(leaf, tile, [&](int bit, int z, int axis) {
      const int x = bit & 7, y = bit >> 3;
      const int node = (x & 3) | (y & 3) << 2 | (z & 3) << 4, shift = 2 * axis;
      edges.x[n] = static_cast<float>(corner[0] + x);
      edges.y[n] = static_cast<float>(corner[1] + y);
      edges.z[n] = static_cast<float>(corner[2] + z);
      edges.axis[n] = static_cast<float>(axis);
      edges.low[n] = values[node];
      const float* above = next[static_cast<std::size_t>(axis)];
      edges.high[n] = (node >> shift & 3) != 3 ? values[node + (1 << shift)]
                      : above != nullptr       ? above[node - (3 << shift)]
                                               : 0.0F;
      ++n;
    });
    edges.count = n;
  }

  /// Calls use(block index) for the blocks that hold the cells and lie in the table.
  template <class Use>
  static void for_blocks_in(const BlockTable& table, const blobs::CellBox& cells, const Use& use) {
    BlockCoord low{}, high{};
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::max(static_cast<std::int32_t>(cells.lower[k] >> 4), table.lower[k]);
      high[k] = std::min(static_cast<std::int32_t>(cells.upper[k] >> 4), table.lower[k] + table.count[k] - 1);
    }
    for (std::int32_t z = low[2]; z <= high[2]; ++z) {
      for (std::int32_t y = low[1]; y <= high[1]; ++y) {
        for (std::int32_t x = low[0]; x <= high[0]; ++x) use(table.index({x, y, z}));
      }
    }
  }

  /// Empties the table; @return the blocks that a support may enter, all leaves marked.
  [[nodiscard]] std::vector<std::uint32_t> all_blocks(BlockTable& table) const {
    for (Block& block : table.block) block.clear();
    const auto reach = static_cast<std::int64_t>(std::ceil(grid_.reach())) + 1;
    grid_.for_bins([&](const blobs::CellBox& bin) {
      blobs::CellBox around = bin;
      for (std::size_t k = 0; k < 3; ++k) {
        around.lower[k] -= reach;
        around.upper[k] += reach + 1;
      }
      for_blocks_in(table, around, [&](std::size_t b) { table.block[b].changed = 0xff; });
    });
    return marked_blocks(table);
  }

  /// Marks the leaves whose closed boxes meet what has changed; a leaf's box ends at the next leaf's first node.
  [[nodiscard]] std::vector<std::uint32_t> changed_blocks(BlockTable& table) const {
    for (Block& block : table.block) {
      block.changed = 0;
      block.kernel_values = 0;
    }
    for (const blobs::BlobGrid::Ball& ball : grid_.change().balls) {
      blobs::CellBox cells;
      for (std::size_t k = 0; k < 3; ++k) {
        cells.lower[k] = static_cast<std::int64_t>(std::floor(ball.centre[k] - ball.radius)) - 1;
        cells.upper[k] = static_cast<std::int64_t>(std::ceil(ball.centre[k] + ball.radius));
      }
      for_blocks_in(table, cells, [&](std::size_t b) {
        Block& block = table.block[b];
        const Cells base = block.base();
        for (unsigned slot = 0; slot < 8; ++slot) {
          const auto corner = corner_of(slot, kLeafNodes);
          double distance2 = 0.0;
          for (std::size_t k = 0; k < 3; ++k) {
            const double low = static_cast<double>(base[k] + corner[k]);
            const double off = std::max({low - ball.centre[k], ball.centre[k] - low - kLeafNodes, 0.0});
            distance2 += off * off;
          }
          if (distance2 <= ball.radius * ball.radius) block.changed = static_cast<std::uint8_t>(block.changed | 1u << slot);
        }
      });
    }
    return marked_blocks(table);
  }

  static std::vector<std::uint32_t> marked_blocks(const BlockTable& table) {
    std::vector<std::uint32_t> list;
    for (std::size_t b = 0; b < table.block.size(); ++b) {
      if (table.block[b].changed != 0) list.push_back(static_cast<std::uint32_t>(b));
    }
    return list;
  }

  enum class Verdict : std::uint8_t { Outside, Inside, Unknown };
  [[nodiscard]] Verdict verdict(const blobs::PotentialBounds& bounds) const {
    if (bounds.upper <= iso_) return Verdict::Outside;
    return bounds.lower > iso_ ? Verdict::Inside : Verdict::Unknown;
  }

  /// Samples the marked leaves; the others are kept.
  void sample_block(Block& block, Workspace& work) const {
    gather(block, work);
    work.sure = 0;
    if (skip_ && has_sure(kSureTiles) && work.block.count > 0) {
      const blobs::SureCubes sure = blobs::find_sure_cubes(work.block, {0.0F, 0.0F, 0.0F}, kTile, iso_);
      block.kernel_values += kTileNodes * sure.added;
      work.sure = sure.inside;
    }
    rebuild(block, work, [&](unsigned slot, const Leaf* old) {
      if ((block.changed >> slot & 1u) == 0) {
        if (old != nullptr) keep_leaf(block, *old, 0, work);
        return;
      }
      block.leaf_of[slot] = kOutside;
      block.outside |= block_tiles(slot);
      block.early &= ~block_tiles(slot);
      if (work.block.count > 0) sample_leaf(block, slot, work);
    });
  }

  void gather(const Block& block, Workspace& work) const {
    if (!has_sure(kSureTiles)) {
      grid_.gather(block.base(), kBlockNodes, 0, work.block);
      return;
    }
    grid_.gather(block.base(), kBlockNodes, 0, work.gathered);
    blobs::select_near_first(work.gathered, centre_of({0, 0, 0}, kBlockNodes), 0.5F * kBlockNodes, work.block, work.far);
  }

  [[nodiscard]] Verdict select_leaf(const std::array<int, 3>& corner, Workspace& work) const {
    const auto centre = centre_of(corner, kLeafNodes);
    return verdict(!has_sure(kSureCubes)
                       ? blobs::select(work.block, centre, 0.5F * kLeafNodes, work.leaf)
                       : blobs::select_near_first(work.block, centre, 0.5F * kLeafNodes, work.leaf, work.far));
  }
  [[nodiscard]] Verdict select_tile(const std::array<int, 3>& corner, Workspace& work) const {
    return verdict(blobs::select_tile(work.leaf, centre_of(corner, kTile), work.tile_blobs));
  }

  /// Calls make(slot, leaf of the last call or null), which may add a leaf to those at work.
  template <class Make>
  void rebuild(Block& block, Workspace& work, const Make& make) const {
    const auto old_leaf_of = block.leaf_of;
    work.leaves.clear();
    work.values.clear();
    for (unsigned slot = 0; slot < 8; ++slot) {
      make(slot, old_leaf_of[slot] >= 0 ? &block.leaf[static_cast<std::size_t>(old_leaf_of[slot])] : nullptr);
    }
    block.leaf.resize(work.leaves.size());
    std::copy(work.leaves.begin(), work.leaves.end(), block.leaf.begin());
    block.values.assign(work.values.begin(), work.values.end());
  }

  /// Adds a leaf as it was, with values for `more` of its tiles where bounds do not decide them.
  void keep_leaf(Block& block, const Leaf& old, unsigned more, Workspace& work) const {
    const auto corner = corner_of(old.slot, kLeafNodes);
    if (more != 0 && select_leaf(corner, work) != Verdict::Unknown) more = 0;
    Leaf& leaf = work.leaves.emplace_back(old);
    leaf.first_tile = static_cast<std::uint32_t>(work.values.size() / kTileNodes);
    for (unsigned tile = 0; tile < 8; ++tile) {
      const std::size_t first = work.values.size();
      if ((old.active >> tile & 1u) != 0) {
        const float* values = tile_values(block, old, tile);
        work.values.insert(work.values.end(), values, values + kTileNodes);
      } else if ((more >> tile & 1u) != 0) {
        const auto tile_corner = corner_in(corner, tile);
        if (select_tile(tile_corner, work) != Verdict::Unknown) continue;
        work.values.resize(first + kTileNodes);
        block.kernel_values += kTileNodes * work.tile_blobs.count();
        blobs::evaluate_tile(work.leaf, work.tile_blobs, point(tile_corner), iso_, std::numeric_limits<float>::infinity(),
                             work.values.data() + first);
        leaf.active = static_cast<std::uint8_t>(leaf.active | 1u << tile);
      }
    }
    finish_leaf(block, work);
  }

  /// The leaf made last stays when something in it is needed.
  static void finish_leaf(Block& block, Workspace& work) {
    const Leaf& leaf = work.leaves.back();
    if (leaf.active == 0 && is_uniform(leaf)) {
      block.leaf_of[leaf.slot] = leaf.inside[0] != 0 ? kInside : kOutside;
      work.leaves.pop_back();
    } else {
      block.leaf_of[leaf.slot] = static_cast<std::int8_t>(work.leaves.size() - 1);
    }
  }

  static std::array<float, 3> point(const std::array<int, 3>& node) {
    return {static_cast<float>(node[0]), static_cast<float>(node[1]), static_cast<float>(node[2])};
  }

  static void set_inside(Block& block, unsigned slot) {
    block.leaf_of[slot] = kInside;
    block.outside &= ~block_tiles(slot);
  }

  void sample_leaf(Block& block, unsigned slot, Workspace& work) const {
    const std::uint64_t own = block_tiles(slot);
    if ((work.sure & own) == own) {
      block.early |= own;
      set_inside(block, slot);
      return;
    }
    const auto corner = corner_of(slot, kLeafNodes);
    const Verdict whole = select_leaf(corner, work);
    if (whole != Verdict::Unknown) {
      block.leaf_of[slot] = kOutside;
      if (whole == Verdict::Inside) set_inside(block, slot);
      return;
    }
    std::uint64_t sure = 0;  // of its cubes of 2^3 nodes
    if (skip_ && has_sure(kSureCubes)) {
      const blobs::SureCubes cubes = blobs::find_sure_cubes(work.leaf, point(corner), kTile / 2, iso_);
      block.kernel_values += kTileNodes * cubes.added;
      sure = cubes.inside;
    }
    Leaf& leaf = work.leaves.emplace_back();
    leaf.slot = static_cast<std::uint8_t>(slot);
    leaf.first_tile = static_cast<std::uint32_t>(work.values.size() / kTileNodes);
    for (unsigned tile = 0; tile < 8; ++tile) {
      const std::uint64_t bit = block_tile(slot, tile);
      std::uint64_t inside = ~std::uint64_t{0};
      if ((work.sure & bit) != 0 || (~sure & block_tiles(tile)) == 0) {
        block.early |= bit;
      } else {
        inside = sample_tile(block, leaf, tile, work);
      }
      set_tile(leaf, tile, inside);
      if (inside == ~std::uint64_t{0}) block.outside &= ~bit;
    }
    finish_leaf(block, work);
  }

  /// @return bit per node: F > 0
  std::uint64_t sample_tile(Block& block, Leaf& leaf, unsigned tile, Workspace& work) const {
    const auto corner = corner_in(corner_of(leaf.slot, kLeafNodes), tile);
    const Verdict here = select_tile(corner, work);
    if (here != Verdict::Unknown) return here == Verdict::Inside ? ~std::uint64_t{0} : 0;
    const std::size_t first = work.values.size();
    work.values.resize(first + kTileNodes);
    const blobs::TileSums sums = blobs::evaluate_tile(work.leaf, work.tile_blobs, point(corner), iso_, sure_, work.values.data() + first);
    block.kernel_values += kTileNodes * sums.added;
    if (sums.added < work.tile_blobs.count()) {
      work.values.resize(first);
      block.early |= block_tile(leaf.slot, tile);
    } else {
      leaf.active = static_cast<std::uint8_t>(leaf.active | 1u << tile);
    }
    return sums.inside;
  }

  static bool is_uniform(const Leaf& leaf) {
    return (leaf.inside[0] == 0 || leaf.inside[0] == ~Plane{0}) &&
           std::all_of(leaf.inside.begin(), leaf.inside.end(), [&](Plane plane) { return plane == leaf.inside[0]; });
  }

  /// Gives values to the tiles whose sums ended early where a node next to them is outside.
  /// @param sampled  blocks that were, in this call: only next to them can an outside node be new
  void evaluate_needed(const Executor& executor, std::span<const std::uint32_t> sampled, BlockTable& table) const {
    std::vector<std::uint8_t> near(table.block.size());
    for (const std::uint32_t b : sampled) {
      const Cells low = table.block[b].base();
      const blobs::CellBox around{{low[0] - 1, low[1] - 1, low[2] - 1},
                                  {low[0] + kBlockNodes, low[1] + kBlockNodes, low[2] + kBlockNodes}};
      for_blocks_in(table, around, [&](std::size_t n) { near[n] = 1; });
    }
    std::vector<std::uint32_t> blocks;
    for (std::size_t b = 0; b < table.block.size(); ++b) {
      if (near[b] != 0 && table.block[b].early != 0) blocks.push_back(static_cast<std::uint32_t>(b));
    }
    // Signs of all blocks are read before a block is written.
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Block& block = table.block[blocks[i]];
        block.needed = TileSurroundings(table, block).next_to_outside(block.early);
      }
    });
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      Workspace& work = Workspace::of_thread();
      for (std::size_t i = begin; i < end; ++i) {
        if (table.block[blocks[i]].needed != 0) evaluate_needed(table.block[blocks[i]], work);
      }
    });
  }

  void evaluate_needed(Block& block, Workspace& work) const {
    gather(block, work);
    rebuild(block, work, [&](unsigned slot, const Leaf* old) {
      unsigned more = 0;
      for (unsigned tile = 0; tile < 8; ++tile) more |= (block.needed & block_tile(slot, tile)) != 0 ? 1u << tile : 0u;
      if (old != nullptr) {
        keep_leaf(block, *old, more, work);
      } else if (more != 0) {
        keep_leaf(block, whole_leaf(block, slot, work), more, work);
      }
    });
    block.early &= ~block.needed;
  }

  /// A leaf inside, numbered as if it had been in the last mesh: without vertices, behind the leaf before it.
  static Leaf whole_leaf(const Block& block, unsigned slot, const Workspace& work) {
    Leaf leaf;
    leaf.slot = static_cast<std::uint8_t>(slot);
    leaf.inside.fill(~Plane{0});
    const auto after = std::find_if(block.leaf.begin(), block.leaf.end(), [&](const Leaf& l) { return l.slot > slot; });
    if (!work.leaves.empty()) {
      leaf.first_vertex = work.leaves.back().first_vertex + work.leaves.back().vertices;
      leaf.first_triangle = work.leaves.back().first_triangle + work.leaves.back().triangles;
    } else if (after != block.leaf.end()) {
      leaf.first_vertex = after->first_vertex;
      leaf.first_triangle = after->first_triangle;
    }
    return leaf;
  }

  /// Largest slope of a sum of Wyvill points next to its surface, times their radius.
  static constexpr double kSteepest = 3.5;
  /// Radii in cells from which bounds show that cubes of 2^3 and of 4^3 nodes lie inside.
  static constexpr double kSureCubes = 5.0, kSureTiles = 9.0;
  /// Beyond this bounds of tiles and leaves decide nearly as much.
  static constexpr double kSureMost = 16.0;
  [[nodiscard]] bool has_sure(double from) const { return grid_.reach() >= from && grid_.reach() <= kSureMost; }

  const Field::Index& index_;
  Lattice lattice_;
  bool skip_;
  float iso_, sure_ = 0.0F;
  blobs::BlobGrid& grid_;
};

/// Any field, through its view in double precision.
class ViewSampler final : public Sampler {
 public:
  ViewSampler(const FieldView& field, const Lattice& lattice) : field_(field), lattice_(lattice) {}

  void prepare(const Executor& executor, BlockTable& table) override {
    leaves_ = find_surface_blocks(field_, lattice_, executor);
    if (leaves_.empty()) {
      table = {};
      return;
    }
    Cells lower, upper;
    lower.fill(std::numeric_limits<std::int64_t>::max());
    upper.fill(std::numeric_limits<std::int64_t>::min());
    for (const auto& leaf : leaves_) {
      for (std::size_t k = 0; k < 3; ++k) {
        lower[k] = std::min<std::int64_t>(lower[k], std::int64_t{kLeafNodes} * leaf[k]);
        upper[k] = std::max<std::int64_t>(upper[k], std::int64_t{kLeafNodes} * (leaf[k] + 1));
      }
    }
    lay_out(table, lower, upper, lattice_);
  }

  void sample(const Executor& executor, BlockTable& table) override {
    for (Block& block : table.block) {
      block.clear();
      block.changed = 0xff;
    }
    // By block, so that a block is written by one task.
    struct Place {
      std::size_t block;
      unsigned slot;
    };
    std::vector<Place> place;
    for (const auto& leaf : leaves_) {
      const auto slot = static_cast<unsigned>((leaf[0] & 1) | (leaf[1] & 1) << 1 | (leaf[2] & 1) << 2);
      place.push_back({table.index({leaf[0] >> 1, leaf[1] >> 1, leaf[2] >> 1}), slot});
    }
    std::sort(place.begin(), place.end(),
              [](const Place& a, const Place& b) { return a.block != b.block ? a.block < b.block : a.slot < b.slot; });
    std::vector<std::size_t> first;
    for (std::size_t i = 0; i < place.size(); ++i) {
      if (i == 0 || place[i].block != place[i - 1].block) first.push_back(i);
    }
    executor.for_blocks(first.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) {
        const std::size_t last = b + 1 < first.size() ? first[b + 1] : place.size();
        for (std::size_t i = first[b]; i < last; ++i) sample_leaf(table.block[place[i].block], place[i].slot);
      }
    });
    sign_neighbours(table);
  }

  void solve(const BlockTable& table, const Block& block, Mesh& mesh, std::vector<float>& along) const override {
    thread_local lattice::EdgeRoots roots;
    for (const Leaf& leaf : block.leaf) {
      if (leaf.vertices == 0) continue;
      roots.clear();
      double scale = 0.0;
      const auto corner = corner_of(leaf.slot, kLeafNodes);
      const auto for_edges = [&](const auto& use) {
        for (unsigned tile = 0; tile < 8; ++tile) {
          for_tile_edges(leaf, tile, [&](int bit, int z, int axis) {
            use(corner[0] + (bit & 7), corner[1] + (bit >> 3), corner[2] + z, axis);
          });
        }
      };
      for_edges([&](int x, int y, int z, int axis) {
        const Vec3 start = position_of(lattice_, block, x, y, z, axis, 0.0);
        const Vec3 end = position_of(lattice_, block, x, y, z, axis, 1.0);
        const int dx = axis == 0, dy = axis == 1, dz = axis == 2;
        const double f0 = static_cast<double>(value_at(table, block, x, y, z));
        double f1 = static_cast<double>(value_at(table, block, x + dx, y + dy, z + dz));
        if (f1 == 0.0) f1 = f0 > 0.0 ? std::min(field_.value(end), 0.0) : field_.value(end);
        scale = std::max({scale, std::abs(f0), std::abs(f1)});
        roots.add(start, end, f0, f1, lattice::guess_root(kMissing, f0, f1, kMissing));
      });
      roots.solve(field_, {}, scale);
      std::size_t i = 0, vertex = leaf.first_vertex;
      for_edges([&](int x, int y, int z, int axis) {
        const Vec3 start = position_of(lattice_, block, x, y, z, axis, 0.0);
        const Vec3 end = position_of(lattice_, block, x, y, z, axis, 1.0);
        Vec3 point = roots.point(i);
        const double t = (point[axis] - start[axis]) / (end[axis] - start[axis]);
        if (!(t >= kLeast && t <= 1.0 - kLeast)) {
          point = position_of(lattice_, block, x, y, z, axis, std::clamp(t, kLeast, 1.0 - kLeast));
        }
        const bool inside = value_at(table, block, x, y, z) > 0.0F;
        mesh.position[vertex] = point;
        along[vertex] = static_cast<float>(std::clamp(t, kLeast, 1.0 - kLeast));
        mesh.normal[vertex] = lattice::outward(roots.gradient(i), inside ? Vec3(end - start) : Vec3(start - end));
        ++i;
        ++vertex;
      });
    }
  }

  void project(const Block&, const Leaf&, unsigned, std::span<Vec3> points, std::span<Vec3> normals) const override {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Projection found = project_to_surface(field_, points[i]);
      if (!found.converged) {  // left where it is, in the middle between two vertices
        Vec3 gradient;
        (void)field_.value(points[i], gradient);
        normals[i] = lattice::outward(gradient, Vec3::UnitZ());
        continue;
      }
      points[i] = found.point;
      normals[i] = found.normal;
    }
  }

  [[nodiscard]] bool single_precision() const override { return false; }

 private:
  static constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

  void sample_leaf(Block& block, unsigned slot) const {
    Leaf leaf;
    leaf.slot = static_cast<std::uint8_t>(slot);
    leaf.active = 0xff;
    leaf.first_tile = static_cast<std::uint32_t>(block.values.size() / kTileNodes);
    const auto corner = corner_of(slot, kLeafNodes);
    const Cells base = block.base();
    std::array<Vec3, 8 * kTileNodes> nodes;
    std::array<double, 8 * kTileNodes> values;
    std::size_t n = 0;
    for (unsigned tile = 0; tile < 8; ++tile) {
      const auto at = corner_of(tile, kTile);
      for (int z = 0; z < kTile; ++z) {
        for (int y = 0; y < kTile; ++y) {
          for (int x = 0; x < kTile; ++x) {
            nodes[n++] = lattice::node_position(lattice_, base[0] + corner[0] + at[0] + x, base[1] + corner[1] + at[1] + y,
                                                base[2] + corner[2] + at[2] + z);
          }
        }
      }
    }
    field_.evaluate(nodes, values);
    for (unsigned tile = 0; tile < 8; ++tile) {
      std::uint64_t inside = 0;
      for (std::size_t i = 0; i < kTileNodes; ++i) {
        const auto f = static_cast<float>(values[tile * kTileNodes + i]);
        block.values.push_back(f);
        inside |= std::uint64_t{f > 0.0F} << i;
      }
      set_tile(leaf, tile, inside);
    }
    block.leaf_of[slot] = static_cast<std::int8_t>(block.leaf.size());
    block.leaf.push_back(leaf);
  }

  /// Leaves without surface next to those with it: the sign at one node.
  void sign_neighbours(BlockTable& table) const {
    std::vector<Vec3> points;
    std::vector<std::int8_t*> slots;
    for (const auto& leaf : leaves_) {
      for (int step = 1; step < 8; ++step) {
        const BlockCoord at{leaf[0] + (step & 1), leaf[1] + (step >> 1 & 1), leaf[2] + (step >> 2)};
        Block& block = table.block[table.index({at[0] >> 1, at[1] >> 1, at[2] >> 1})];
        std::int8_t& slot = block.leaf_of[static_cast<std::size_t>((at[0] & 1) | (at[1] & 1) << 1 | (at[2] & 1) << 2)];
        if (slot >= 0) continue;
        slots.push_back(&slot);
        points.push_back(lattice::node_position(lattice_, std::int64_t{kLeafNodes} * at[0],
                                                std::int64_t{kLeafNodes} * at[1], std::int64_t{kLeafNodes} * at[2]));
      }
    }
    std::vector<double> values(points.size());
    field_.evaluate(points, values);
    for (std::size_t i = 0; i < slots.size(); ++i) *slots[i] = values[i] > 0.0 ? kInside : kOutside;
  }

  FieldView field_;
  Lattice lattice_;
  std::vector<BlockCoord> leaves_;
};

}  // namespace

std::unique_ptr<Sampler> make_sampler(const FieldView& field, const Lattice& lattice, bool skip, blobs::BlobGrid& grid) {
  SUPPLE_EXPECTS(std::isfinite(lattice.cell) && lattice.cell > 0.0 && lattice.origin.allFinite());
  if (const Field* points = field.as_field()) {
    const Field::Index& index = points->packed();
    if (index.size() > 0 && index.uniform && index.primitive[0].kind == PackedKind::PointWyvill && !index.blend.active()) {
      return std::make_unique<BlobSampler>(index, lattice, skip, grid);
    }
  }
  return std::make_unique<ViewSampler>(field, lattice);
}

const float* tile_at(const BlockTable& table, const Block& block, int x, int y, int z) {
  const Block* owner = &block;
  if (((x | y | z) & kBlockNodes) != 0) {
    owner = table.find({block.coord[0] + (x >> 4), block.coord[1] + (y >> 4), block.coord[2] + (z >> 4)});
    if (owner == nullptr) return nullptr;
  }
  const auto slot = static_cast<std::size_t>((x >> 3 & 1) | (y >> 3 & 1) << 1 | (z >> 3 & 1) << 2);
  const std::int8_t index = owner->leaf_of[slot];
  if (index < 0) return nullptr;
  const Leaf& leaf = owner->leaf[static_cast<std::size_t>(index)];
  const auto tile = static_cast<unsigned>((x >> 2 & 1) | (y >> 2 & 1) << 1 | (z >> 2 & 1) << 2);
  return (leaf.active >> tile & 1u) != 0 ? tile_values(*owner, leaf, tile) : nullptr;
}

float value_at(const BlockTable& table, const Block& block, int x, int y, int z) {
  const float* values = tile_at(table, block, x, y, z);
  return values != nullptr ? values[(x & 3) | (y & 3) << 2 | (z & 3) << 4] : 0.0F;
}

void lay_out(BlockTable& table, const Cells& lower, const Cells& upper, const Lattice& lattice) {
  constexpr double kLargestNode = 1 << 30;
  double nodes = 1.0;
  double far = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    nodes *= static_cast<double>(upper[k] - lower[k] + 1);
    far = std::max({far, std::abs(static_cast<double>(lower[k])), std::abs(static_cast<double>(upper[k]))});
  }
  const auto refuse = [&](const std::string& expected, const std::string& found, double factor) {
    throw Error(ErrorKind::Limit, {.place = "",
                                   .key = "lattice.cell",
                                   .expected = expected,
                                   .found = found + " with cells of " + lattice::three_digits(lattice.cell) + " m",
                                   .hint = "use cells of at least " +
                                           lattice::three_digits(1.05 * factor * lattice.cell) + " m"});
  };
  if (far > kLargestNode) {
    refuse("expected node numbers up to " + lattice::three_digits(kLargestNode), lattice::three_digits(far),
           far / kLargestNode);
  }
  if (nodes > static_cast<double>(kMarchNodes)) {
    refuse("expected at most " + std::to_string(kMarchNodes) + " lattice nodes around the body",
           "about " + lattice::three_digits(nodes), std::cbrt(nodes / static_cast<double>(kMarchNodes)));
  }
  std::size_t blocks = 1;
  BlockCoord first{}, count{};
  for (std::size_t k = 0; k < 3; ++k) {
    first[k] = static_cast<std::int32_t>(lower[k] >> 4);
    count[k] = static_cast<std::int32_t>(upper[k] >> 4) - first[k] + 1;
    blocks *= static_cast<std::size_t>(count[k]);
  }
  if (first == table.lower && count == table.count) return;
  BlockTable old;
  std::swap(old, table);
  table.lower = first;
  table.count = count;
  table.block.assign(blocks, Block{});
  std::size_t b = 0;
  for (std::int32_t z = 0; z < table.count[2]; ++z) {
    for (std::int32_t y = 0; y < table.count[1]; ++y) {
      for (std::int32_t x = 0; x < table.count[0]; ++x) {
        const BlockCoord coord{table.lower[0] + x, table.lower[1] + y, table.lower[2] + z};
        if (old.find(coord) != nullptr) table.block[b] = std::move(old.block[old.index(coord)]);
        table.block[b++].coord = coord;
      }
    }
  }
}

}  // namespace supple::implicit::march
