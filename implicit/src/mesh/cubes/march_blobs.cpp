#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "field/field_index.h"
#include "mesh/cubes/march_changes.h"
#include "supple/implicit/field.h"

namespace supple::implicit::march {
namespace {

using blobs::BlobList;
using blobs::Cells;

constexpr std::size_t kBlocksPerTask = 8;

/// Selects those of `tiles`, inside and without values, of which more than the sign is needed: a cell that they own has a node outside, or an
/// edge that starts at one, in the tile below along an axis, ends in them.
Bits next_to_outside(const BlockTable& table, const Block& block, Bits tiles) {
  const BlocksAbove above = blocks_above(table, block);
  BlocksAbove below{&block};
  std::array<Bits, 8> up{}, down{};
  for (std::size_t step = 0; step < 8; ++step) up[step] = above[step] != nullptr ? above[step]->outside : kAll;
  for (const unsigned axis : {0u, 1u, 2u}) {
    BlockCoord at = block.coord;
    --at[axis];
    const Block* other = below[std::size_t{1} << axis] = table.find(at);
    const unsigned shift = 1u << (2 * axis);
    const Bits first = std::array{kFirstX, kFirstY, kFirstZ}[axis], next = other != nullptr ? other->outside : kAll;
    down[std::size_t{1} << axis] = (block.outside << shift & ~first) | (next >> 3 * shift & first);
  }
  const Steps steps(up);
  Bits found = 0;
  // Whether a node outside faces a tile in the one that lies a step from it, along the axes in the bits of `step`.
  const auto look = [&](const BlocksAbove& blocks, Bits candidates, unsigned step, bool upwards) {
    for_bits(candidates & ~found, [&](unsigned place) {
      unsigned owner = 0, at = place;
      Bits facing = kAll;
      for (const unsigned axis : {0u, 1u, 2u}) {
        if ((step >> axis & 1u) == 0) continue;
        const unsigned unit = 1u << (2 * axis), last = 3 * unit;
        const Bits first = std::array{kFirstX, kFirstY, kFirstZ}[axis];
        const bool leaves = (place & last) == (upwards ? last : 0u);
        if (leaves) owner |= 1u << axis;
        at = upwards == leaves ? at - (leaves ? last : unit) : at + (leaves ? last : unit);
        facing &= upwards ? first : first << last;
      }
      const Bits inside = blocks[owner] == nullptr ? Bits{0} : blocks[owner]->inside(at);
      found |= Bits{(~inside & facing) != 0} << place;  // no jump: words that are far away are then waited for together
    });
  };
  for (unsigned step = 1; step < 8; ++step) look(above, tiles & steps.step[step], step, true);
  for (const unsigned step : {1u, 2u, 4u}) look(below, tiles & down[step], step, false);
  return found;
}

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

  void expect_size(const Executor&) override {
    grid_.build(index_.primitive, lattice_);
    if (!grid_.support().empty() && index_.iso > 0.0) expect_nodes(grid_.support().lower, grid_.support().upper, lattice_);
  }

  void sample(const Executor& executor, BlockTable& table) override {
    const bool all = grid_.change().all;
    const std::vector<std::uint32_t> blocks = all ? all_blocks(table) : changed_blocks(table);
    for (const std::uint32_t b : blocks) {
      table.touched[b] = 1;
      table.blank[b] = 0;
    }
    // A node that touches one outside lies a cell's slope above the iso value at most, but for rare places.
    sure_ = skip_ ? iso_ + static_cast<float>(kSteepest / grid_.reach()) : std::numeric_limits<float>::infinity();
    for_columns(executor, table, blocks, [&](Block& block, Workspace& work) {
      if (all) {
        block.clear();
        block.changed = kAll;
      }
      sample_block(block, work);
    });
    if (skip_) evaluate_needed(executor, blocks, table);
  }

  void solve(const Executor& executor, const BlockTable& table, std::span<const std::uint32_t> blocks, Mesh& mesh,
             std::vector<EdgePoint>& points) const override {
    // In the order of the mesh, not in columns: what is written lies close together.
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      Workspace& work = Workspace::of_thread();
      work.in_column = false;
      for (std::size_t i = begin; i < end; ++i) solve(table, table.block[blocks[i]], work, mesh, points);
    });
  }

  void begin_projection() const override {
    Workspace& work = Workspace::of_thread();
    work.near_block = nullptr;
  }

  void project(const Block& block, unsigned tile, std::span<Vec3> points, std::span<Vec3> normals, Box& evaluated) const override {
    if (points.empty()) return;
    // Points may lie this far beyond the tile's cells; leaves and blocks are cut to it too.
    constexpr int kAround = 1;
    Workspace& work = Workspace::of_thread();
    if (work.near_block != &block) {
      grid_.gather(block.base(), kBlockNodes, kAround, work.around_block);
      work.near_block = &block;
      work.near_leaf = kLeaves;
    }
    if (const unsigned leaf = leaf_of(tile); work.near_leaf != leaf) {
      (void)blobs::select(work.around_block, centre_of(leaf_corner(leaf), kLeafNodes),
                          0.5F * kLeafNodes + static_cast<float>(kAround), work.around_leaf);
      work.near_leaf = leaf;
    }
    (void)blobs::select(work.around_leaf, centre_of(corner_of(tile), kTile),
                        0.5F * kTile + static_cast<float>(kAround), work.tile);
    blobs::project_points(work.tile, iso_, placement_of(block), {points.data()->data(), normals.data()->data(), points.size()}, work.near);
    const Cells base = block.base();
    const auto corner = corner_of(tile);
    for (const int end : {-kAround, kTile + kAround}) {
      evaluated.include(lattice::node_position(lattice_, base[0] + corner[0] + end, base[1] + corner[1] + end, base[2] + corner[2] + end));
    }
  }

  [[nodiscard]] std::uint64_t most_blocks(const BlockTable& table) const override { return table.block.size(); }

  [[nodiscard]] bool single_precision() const override { return true; }

 private:
  struct Workspace {
    blobs::EdgeBatch edges;
    Bits sure = 0;                       // tiles of the block at work that are sure to be inside
    const Block* near_block = nullptr;   // that points were last projected near
    blobs::BlobGrid::Column column;      // around the block at work and others above or below it
    bool in_column = false;
    BlobList block, leaf, tile, near, far;
    BlobList around_block, around_leaf;  // of near_block and its leaf near_leaf
    blobs::LeafTiles tiles;
    TileChanges changes;
    std::array<BlobList, kLeaves> leaf_of_block;
    unsigned near_leaf = kLeaves;
    static Workspace& of_thread() {
      thread_local Workspace work;
      return work;
    }
  };

  /// Calls use(block, workspace) for blocks, those on each other one after the other: bins around them are then read once.
  template <class Table, class Use>
  void for_columns(const Executor& executor, Table& table, std::span<const std::uint32_t> blocks, const Use& use) const {
    constexpr std::size_t kPerTask = 16;
    constexpr std::int32_t kNear = 2;  // a gap that costs less than another column
    const auto columns = static_cast<std::size_t>(table.count[0]) * static_cast<std::size_t>(table.count[1]);
    std::vector<std::uint32_t> start(columns + 1), order(blocks.size());
    for (const std::uint32_t b : blocks) ++start[b % columns + 1];
    for (std::size_t c = 0; c < columns; ++c) start[c + 1] += start[c];
    for (const std::uint32_t b : blocks) order[start[b % columns]++] = b;
    executor.for_blocks(order.size(), kPerTask, [&](std::size_t begin, std::size_t end) {
      Workspace& work = Workspace::of_thread();
      for (std::size_t i = begin, next = begin; i < end; i = next) {
        const BlockCoord& low = table.block[order[i]].coord;
        std::int32_t top = low[2];
        for (next = i + 1; next < end && order[next] % columns == order[i] % columns; ++next) {
          const std::int32_t z = table.block[order[next]].coord[2];
          if (z > top + kNear) break;
          top = z;
        }
        work.in_column = next > i + 1 && grid_.reach() >= kColumns;
        if (work.in_column) {
          grid_.gather_column(table.block[order[i]].base(), kBlockNodes, std::int64_t{kBlockNodes} * (top - low[2] + 1), work.column);
        }
        for (std::size_t k = i; k < next; ++k) {
          if (k + 1 < end) fetch_ahead(&table.block[order[k + 1]], 1);
          use(table.block[order[k]], work);
        }
      }
    });
  }

  void solve(const BlockTable& table, const Block& block, Workspace& work, Mesh& mesh, std::vector<EdgePoint>& points) const {
    Bits wanted = 0;
    for (const Tile& tile : block.tile) wanted |= Bits{tile.vertices > 0} << tile.place;
    wanted &= block.solve;
    if (wanted == 0) return;
    const BlocksAbove above = blocks_above(table, block);
    for (const unsigned step : {0u, 2u, 4u}) {  // one step along x is the next block
      if (above[step] != nullptr) fetch_ahead(above[step]->values.data(), above[step]->values.size());
    }
    gather(block, work, nullptr);
    blobs::EdgeBatch& edges = work.edges;
    edges.count = 0;
    for (unsigned leaf = 0; leaf < kLeaves; ++leaf) {
      if ((wanted & tiles_of(leaf)) == 0) continue;
      (void)blobs::select(work.block, centre_of(leaf_corner(leaf), kLeafNodes), 0.5F * kLeafNodes, work.leaf_of_block[leaf]);
    }
    const blobs::Placement placement = placement_of(block);
    std::size_t begin = 0, to = 0;  // of the vertices that follow each other without a gap
    const auto place_run = [&] {
      if (edges.count == begin) return;
      blobs::place_vertices(edges, begin, edges.count, placement,
                            {mesh.position[to].data(), mesh.normal[to].data(), &points[block.first_point + (to - block.first_vertex)].t});
    };
    for_bits(wanted, [&](unsigned place) {
      const std::size_t rank = block.rank(place), first = edges.count;
      const Tile& tile = block.tile[rank];
      const std::size_t vertex = block.first_vertex + tile.first_vertex;
      if (vertex != to + (first - begin)) {
        place_run();
        begin = first;
        to = vertex;
      }
      collect_edges(above, tile, block.values.data() + kTileNodes * rank, edges);
      blobs::solve_edges(work.leaf_of_block[leaf_of(place)], iso_, edges, first, work.near);
    });
    place_run();
  }

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

  /// Appends those of a tile.
  static void collect_edges(const BlocksAbove& above, const Tile& tile, const float* values, blobs::EdgeBatch& edges) {
    static constexpr std::array<float, kTileNodes> kUnknown{};
    static constexpr auto kNode = [] {
      std::array<std::array<float, kTileNodes>, 3> at{};
      for (unsigned node = 0; node < kTileNodes; ++node) {
        for (std::size_t k = 0; k < 3; ++k) at[k][node] = static_cast<float>(coordinates(node)[k]);
      }
      return at;
    }();
    const auto corner = point(corner_of(tile.place));
    std::size_t n = edges.count;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const unsigned shift = 2 * axis;
      const Bits last = std::array{kFirstX << 3, kFirstY << 12, kFirstZ << 48}[axis];
      // The tile above holds the upper ends of the last edges.
      const bool beyond = (tile.place >> shift & 3u) == 3u;
      const unsigned next = beyond ? tile.place - (3u << shift) : tile.place + (1u << shift);
      const Block* owner = above[beyond ? std::size_t{1} << axis : 0];
      const float* further = owner != nullptr && (owner->held >> next & 1u) != 0
                                 ? owner->values.data() + kTileNodes * owner->rank(next)
                                 : kUnknown.data();
      const std::array<const float*, 2> high{values + (1u << shift), further - (3u << shift)};
      for_bits(tile.edges[axis], [&](unsigned node) {
        edges.x[n] = corner[0] + kNode[0][node];
        edges.y[n] = corner[1] + kNode[1][node];
        edges.z[n] = corner[2] + kNode[2][node];
        edges.axis[n] = static_cast<float>(axis);
        edges.low[n] = values[node];
        edges.high[n] = high[last >> node & 1u][node];
        ++n;
      });
    }
    edges.count = n;
  }

  /// Calls use(block index) for the blocks of the table that contain the cells.
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

  /// The blocks that a support may enter; empties the others.
  [[nodiscard]] std::vector<std::uint32_t> all_blocks(BlockTable& table) const {
    table.all = true;
    std::vector<std::uint8_t> entered(table.block.size());
    grid_.for_bins([&](const blobs::CellBox& bin) { for_blocks_in(table, bin, [&](std::size_t b) { entered[b] = 1; }); });
    const auto reach = static_cast<std::int64_t>(std::ceil(grid_.reach())) + 1;
    spread(entered, table.count, static_cast<std::size_t>((reach + kBlockNodes - 1) / kBlockNodes));
    std::vector<std::uint32_t> list;
    for (std::size_t b = 0; b < table.block.size(); ++b) {
      if (entered[b] != 0) {
        list.push_back(static_cast<std::uint32_t>(b));
      } else if (table.blank[b] == 0) {
        table.block[b].clear();
        table.touched[b] = table.blank[b] = 1;
      }
    }
    return list;
  }

  /// Marks everything up to `steps` from a mark along every axis.
  static void spread(std::vector<std::uint8_t>& marks, const BlockCoord& count, std::size_t steps) {
    std::vector<std::uint8_t> line;
    std::size_t stride = 1;
    for (const std::int32_t along : count) {
      const auto n = static_cast<std::size_t>(along);
      for (std::size_t l = 0; l * n < marks.size(); ++l) {
        std::uint8_t* mark = &marks[l / stride * stride * n + l % stride];
        line.assign(n, 0);
        for (std::size_t i = 0; i < n; ++i) {
          if (mark[i * stride] == 0) continue;
          for (std::size_t k = i - std::min(i, steps); k <= std::min(i + steps, n - 1); ++k) line[k] = 1;
        }
        for (std::size_t i = 0; i < n; ++i) mark[i * stride] = line[i];
      }
      stride *= n;
    }
  }

  /// Marks the tiles whose closed boxes meet what has changed; a tile's box ends at the next tile's first node.
  [[nodiscard]] std::vector<std::uint32_t> changed_blocks(BlockTable& table) const {
    std::vector<std::uint32_t> list;
    for (const blobs::BlobGrid::Ball& ball : grid_.change().balls) {
      blobs::CellBox cells;
      for (std::size_t k = 0; k < 3; ++k) {
        cells.lower[k] = static_cast<std::int64_t>(std::floor(ball.centre[k] - ball.radius)) - 1;
        cells.upper[k] = static_cast<std::int64_t>(std::ceil(ball.centre[k] + ball.radius));
      }
      for_blocks_in(table, cells, [&](std::size_t b) {
        Block& block = table.block[b];
        if (block.changed == kAll) return;
        const Cells base = block.base();
        alignas(32) std::array<std::array<double, 4>, 3> off2;  // squared distances along the axes, of the four tiles
        for (std::size_t k = 0; k < 3; ++k) {
          const __m256d centre = _mm256_set1_pd(ball.centre[k]);
          const __m256d low = _mm256_add_pd(_mm256_set1_pd(static_cast<double>(base[k])), _mm256_setr_pd(0, kTile, 2 * kTile, 3 * kTile));
          const __m256d beyond = _mm256_sub_pd(_mm256_sub_pd(centre, low), _mm256_set1_pd(kTile));
          const __m256d off = _mm256_max_pd(_mm256_max_pd(_mm256_sub_pd(low, centre), beyond), _mm256_setzero_pd());
          _mm256_store_pd(off2[k].data(), _mm256_mul_pd(off, off));
        }
        const __m256d along_x = _mm256_load_pd(off2[0].data());
        const bool marked = block.changed != 0;
        for (unsigned row = 0; row < 16; ++row) {
          const double left = ball.radius * ball.radius - off2[1][row & 3u] - off2[2][row >> 2];
          const int met = _mm256_movemask_pd(_mm256_cmp_pd(along_x, _mm256_set1_pd(left), _CMP_LE_OQ));
          block.changed |= static_cast<Bits>(met) << (4 * row);
        }
        if (!marked && block.changed != 0) list.push_back(static_cast<std::uint32_t>(b));
      });
    }
    std::sort(list.begin(), list.end());
    return list;
  }

  enum class Verdict : std::uint8_t { Outside, Inside, Unknown };
  [[nodiscard]] Verdict verdict(const blobs::PotentialBounds& bounds) const {
    if (bounds.upper <= iso_) return Verdict::Outside;
    return bounds.lower > iso_ ? Verdict::Inside : Verdict::Unknown;
  }

  /// Samples the marked tiles; the others are kept.
  void sample_block(Block& block, Workspace& work) const {
    gather_to_sample(block, work);
    work.sure = 0;
    if (sure_by_tiles() && work.block.count > 0) {
      // Where cells are small, bounds show as much of tiles next to the surface, and those are needed.
      const float level = grid_.reach() > kNearMost ? sure_ : iso_;
      const blobs::SureCubes sure = blobs::find_sure_cubes(work.block, {0.0F, 0.0F, 0.0F}, kTile, level);
      block.kernel_values += kTileNodes * sure.added;
      work.sure = sure.inside;
    }
    work.changes.begin(block);
    for (unsigned leaf = 0; leaf < kLeaves; ++leaf) {
      if ((block.changed & tiles_of(leaf)) != 0) sample_leaf(block, leaf, work);
    }
    work.changes.apply(block);
  }

  void gather(const Block& block, Workspace& work, BlobList* far) const {
    if (work.in_column) {
      grid_.gather(work.column, block.base(), kBlockNodes, work.block, far);
    } else {
      grid_.gather(block.base(), kBlockNodes, 0, work.block, far);
    }
  }
  void gather_to_sample(const Block& block, Workspace& work) const {
    gather(block, work, near_first(kSureTiles) ? &work.far : nullptr);
  }

  [[nodiscard]] Verdict select_leaf(unsigned leaf, Workspace& work) const {
    const auto centre = centre_of(leaf_corner(leaf), kLeafNodes);
    return verdict(!near_first(kSureCubes)
                       ? blobs::select(work.block, centre, 0.5F * kLeafNodes, work.leaf)
                       : blobs::select_near_first(work.block, centre, 0.5F * kLeafNodes, work.leaf, work.far));
  }
  /// Calls use(place, bounds show, blobs) for some tiles of the leaf at work.
  template <class Use>
  void select_tiles(unsigned leaf, Bits tiles, Workspace& work, const Use& use) const {
    const Bits own = tiles_of(leaf);
    blobs::select_tiles(work.leaf, centre_of(leaf_corner(leaf), kLeafNodes), static_cast<unsigned>(_pext_u64(tiles, own)), work.tiles);
    std::size_t t = 0;
    for_bits(own, [&](unsigned place) {
      if ((tiles >> place & 1u) != 0) use(place, verdict(work.tiles.bounds[t]), work.tiles.blobs[t]);
      ++t;
    });
  }

  static std::array<float, 3> point(const std::array<int, 3>& node) {
    return {static_cast<float>(node[0]), static_cast<float>(node[1]), static_cast<float>(node[2])};
  }

  /// Clears the values of these tiles.
  static void empty(Block& block, Bits tiles, bool inside, Workspace& work) {
    work.changes.drop(tiles);
    block.changed |= tiles;
    block.early &= ~tiles;
    set_sign(block, tiles, inside);
  }

  void sample_leaf(Block& block, unsigned leaf, Workspace& work) const {
    const Bits own = tiles_of(leaf);
    const auto bit = static_cast<std::uint8_t>(1u << leaf);
    const bool was_decided = (block.decided & bit) != 0;
    block.decided = static_cast<std::uint8_t>(block.decided & ~bit);
    if ((work.sure & own) == own) {
      empty(block, own, true, work);
      block.early |= own;
      return;
    }
    const Verdict whole = work.block.count > 0 ? select_leaf(leaf, work) : Verdict::Outside;
    if (whole != Verdict::Unknown) {
      empty(block, own, whole == Verdict::Inside, work);
      block.decided |= bit;
      return;
    }
    // Tiles of a leaf that bounds decided were not tested one by one.
    const Bits tiles = was_decided ? own : own & block.changed;
    empty(block, tiles, false, work);
    Bits inside = work.sure & tiles;
    if (sure_by_cubes()) {
      const blobs::SureCubes sure = blobs::find_sure_cubes(work.leaf, point(leaf_corner(leaf)), kTile / 2, iso_);
      block.kernel_values += kTileNodes * sure.added;
      unsigned t = 0;
      for_bits(own, [&](unsigned tile) {
        if ((~sure.inside & tiles_of(t++)) == 0) inside |= tiles & Bits{1} << tile;
      });
    }
    block.early |= inside;
    set_sign(block, inside, true);
    select_tiles(leaf, tiles & ~inside, work, [&](unsigned tile, Verdict here, const blobs::TileBlobs& reached) {
      const Bits at = Bits{1} << tile;
      if (here != Verdict::Unknown) {
        set_sign(block, at, here == Verdict::Inside);
        return;
      }
      const blobs::TileSums sums =
          blobs::evaluate_tile(work.leaf, reached, point(corner_of(tile)), iso_, sure_, work.changes.room(tile));
      block.kernel_values += kTileNodes * sums.added;
      set_sign(block, at, sums.inside == kAll);
      if (sums.added < reached.count()) {
        block.early |= at;
      } else {
        work.changes.make(tile, sums.inside);
      }
    });
  }

  /// Gives values to the tiles whose sums ended early where a node next to them is outside.
  /// @param sampled  blocks sampled in this call: only next to them can an outside node be new
  void evaluate_needed(const Executor& executor, std::span<const std::uint32_t> sampled, BlockTable& table) const {
    std::vector<std::uint8_t> near(table.block.size());
    for (const std::uint32_t b : sampled) {
      if (table.block[b].outside == 0) continue;
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
        block.needed = next_to_outside(table, block, block.early);
      }
    });
    std::erase_if(blocks, [&](std::uint32_t b) { return table.block[b].needed == 0; });
    for (const std::uint32_t b : blocks) table.touched[b] = 1;
    for_columns(executor, table, blocks, [&](Block& block, Workspace& work) { evaluate_needed(block, work); });
  }

  void evaluate_needed(Block& block, Workspace& work) const {
    gather_to_sample(block, work);
    work.changes.begin(block);
    for (unsigned leaf = 0; leaf < kLeaves; ++leaf) {
      const Bits tiles = block.needed & tiles_of(leaf);
      if (tiles == 0 || select_leaf(leaf, work) != Verdict::Unknown) continue;
      select_tiles(leaf, tiles, work, [&](unsigned tile, Verdict here, const blobs::TileBlobs& reached) {
        if (here != Verdict::Unknown) return;
        block.kernel_values += kTileNodes * reached.count();
        const blobs::TileSums sums = blobs::evaluate_tile(work.leaf, reached, point(corner_of(tile)), iso_,
                                                          std::numeric_limits<float>::infinity(), work.changes.room(tile));
        work.changes.make(tile, sums.inside);
      });
    }
    work.changes.apply(block);
    block.early &= ~block.needed;
  }

  /// Largest slope of a sum of Wyvill points next to its surface, times their radius.
  static constexpr double kSteepest = 3.5;
  /// Radii in cells from which bounds show that cubes of 2^3 and of 4^3 nodes lie inside.
  static constexpr double kSureCubes = 5.0, kSureTiles = 9.0;
  /// Below it rows of bins hold enough blobs to fill vectors.
  static constexpr double kColumns = 5.0;
  [[nodiscard]] bool sure_by_tiles() const { return skip_ && grid_.reach() >= kSureTiles; }
  [[nodiscard]] bool sure_by_cubes() const { return skip_ && !sure_by_tiles() && grid_.reach() >= kSureCubes; }
  /// Beyond this blobs are few, and bounds test all of them.
  static constexpr double kNearMost = 16.0;
  [[nodiscard]] bool near_first(double from) const { return grid_.reach() >= from && grid_.reach() <= kNearMost; }

  const Field::Index& index_;
  Lattice lattice_;
  bool skip_;
  float iso_, sure_ = 0.0F;
  blobs::BlobGrid& grid_;
};

}  // namespace

std::unique_ptr<Sampler> make_blob_sampler(const Field& field, const Lattice& lattice, bool skip, blobs::BlobGrid& grid) {
  return std::make_unique<BlobSampler>(field.packed(), lattice, skip, grid);
}

}  // namespace supple::implicit::march
