#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mesh/cubes/march_changes.h"
#include "mesh/partition/polygonise_block_edges.h"
#include "mesh/partition/polygonise_blocks.h"
#include "mesh/partition/range_of_surface.h"
#include "supple/implicit/project.h"

namespace supple::implicit::march {
namespace {

using blobs::Cells;

constexpr std::size_t kBlocksPerTask = 8;
/// Vertices stay this far from the nodes [cells].
constexpr double kLeast = 0x1p-17;

/// The point at t along the edge that leaves a node of the block along an axis.
Vec3 position_of(const Lattice& lattice, const Block& block, const std::array<int, 3>& node, int axis, double t) {
  const Cells base = block.base();
  Vec3 p = lattice::node_position(lattice, base[0] + node[0], base[1] + node[1], base[2] + node[2]);
  const auto k = static_cast<std::size_t>(axis);
  const double at = static_cast<double>(base[k] + node[k]) + t;
  p[axis] = lattice.origin[axis] + lattice.cell * at;
  return p;
}

/// Any field, through its view in double precision.
class ViewSampler final : public Sampler {
 public:
  ViewSampler(const FieldView& field, const Lattice& lattice, ViewMemory& memory) : field_(field), lattice_(lattice), memory_(memory) {}

  void prepare(const Executor& executor, BlockTable& table) override {
    memory_.compare(field_, lattice_);
    if (!memory_.all) look_again(executor);
    if (memory_.all) {
      leaves_ = find_leaves(executor);
      memory_.leaf = leaves_.block;
    }
    if (memory_.leaf.empty()) {
      table = {};
      return;
    }
    const auto [lower, upper] = nodes_of(memory_.leaf);
    lay_out(table, lower, upper, lattice_);
  }

  void expect_size(const Executor& executor) override {
    // As many leaves in any order have fewer nodes than fit.
    if (lattice::block_range(field_.surface_box(), lattice_, 1).count() <= kMostLeaves) return;
    if (const std::optional<lattice::BlockRange> around = lattice::range_of_surface(field_, lattice_)) {
      if (around->count() <= kMostLeaves) return;
      // Leaves are listed only where a surface as large as a side of that box has too many of them: other boxes have too many nodes first.
      std::array<std::uint64_t, 3> side;
      for (std::size_t k = 0; k < 3; ++k) side[k] = static_cast<std::uint64_t>(std::int64_t{around->upper[k]} - around->lower[k] + 1);
      std::sort(side.begin(), side.end());
      if (side[1] * side[2] <= kMostLeaves) {
        const std::array<BlockCoord, 2> ends{around->lower, around->upper};
        const auto [lower, upper] = nodes_of(ends);
        expect_nodes(lower, upper, lattice_);
      }
    }
    const std::vector<BlockCoord> leaves = find_leaves(executor).block;
    if (leaves.empty()) return;
    const auto [lower, upper] = nodes_of(leaves);
    expect_nodes(lower, upper, lattice_);
  }

  void sample(const Executor& executor, BlockTable& table) override {
    if (memory_.all) {
      for (Block& block : table.block) {
        block.clear();
        block.changed = kAll;
      }
      table.all = true;
      table.touched.assign(table.block.size(), 1);
      table.blank.assign(table.block.size(), 0);
      sign_inside(table);
    } else {
      mark_changed(table);
    }
    // By block, so that a block is written by one task.
    std::vector<std::uint8_t> leaves(table.block.size());
    for (const auto& leaf : memory_.leaf) leaves[table.index(block_of(leaf))] |= static_cast<std::uint8_t>(1u << slot_of(leaf));
    executor.for_blocks(table.block.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) {
        if (table.block[b].changed != 0) sample_block(table.block[b], leaves[b]);
      }
    });
  }

  void solve(const Executor& executor, const BlockTable& table, std::span<const std::uint32_t> blocks, Mesh& mesh,
             std::vector<EdgePoint>& points) const override {
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) solve(table, table.block[blocks[i]], mesh, points);
    });
  }

  void project(const Block&, unsigned, std::span<Vec3> points, std::span<Vec3> normals, Box& evaluated) const override {
    constexpr int kIterations = 50;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Projection found = project_to_surface(field_, points[i], kIterations, &evaluated);
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

  [[nodiscard]] std::uint64_t most_blocks(const BlockTable&) const override {
    const lattice::BlockRange range = lattice::block_range(field_.surface_box(), lattice_, 1);
    if (range.empty()) return 0;
    const auto [lower, upper] = nodes_of(std::array{range.lower, range.upper});
    std::uint64_t blocks = 1;
    for (std::size_t k = 0; k < 3; ++k) blocks *= static_cast<std::uint64_t>((upper[k] >> 4) - (lower[k] >> 4) + 1);
    return blocks;
  }

  [[nodiscard]] bool single_precision() const override { return false; }

 private:
  static constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

  [[nodiscard]] lattice::BlockList find_leaves(const Executor& executor) const {
    PolygoniseCounts counts;
    return lattice::surface_blocks(field_, lattice_, executor, kMostLeaves, counts);
  }

  /// The node range [lower, upper] of leaves.
  static std::pair<Cells, Cells> nodes_of(std::span<const BlockCoord> leaves) {
    Cells lower, upper;
    lower.fill(std::numeric_limits<std::int64_t>::max());
    upper.fill(std::numeric_limits<std::int64_t>::min());
    for (const BlockCoord& leaf : leaves) {
      for (std::size_t k = 0; k < 3; ++k) {
        lower[k] = std::min<std::int64_t>(lower[k], std::int64_t{kLeafNodes} * leaf[k]);
        upper[k] = std::max<std::int64_t>(upper[k], std::int64_t{kLeafNodes} * (leaf[k] + 1));
      }
    }
    return {lower, upper};
  }

  [[nodiscard]] lattice::Verdict verdict(const Box& box, const Box& surface) const {
    if (!surface.overlaps(box)) return lattice::Verdict::Outside;
    const Interval value = field_.bound(box);
    if (!(value.upper > 0.0)) return lattice::Verdict::Outside;
    return value.lower > 0.0 ? lattice::Verdict::Inside : lattice::Verdict::Keep;
  }

  /// Evaluates bounds again on leaves in reach of changes, block by block. The results for the others are still valid. Bounds of a leaf may be
  /// tighter or wider than in a search from above, which does not affect the mesh: see `upper_value`.
  void look_again(const Executor& executor) {
    looked_ = memory_.changed.leaves();
    std::stable_sort(looked_.begin(), looked_.end(), [](const BlockCoord& a, const BlockCoord& b) { return lattice::before(block_of(a), block_of(b)); });
    std::vector<std::size_t> start;
    for (std::size_t i = 0; i < looked_.size(); ++i) {
      if (i == 0 || block_of(looked_[i]) != block_of(looked_[i - 1])) start.push_back(i);
    }
    start.push_back(looked_.size());
    verdict_.resize(looked_.size());
    const Box surface = field_.surface_box();
    executor.for_blocks(start.size() - 1, kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) {
        Box whole;
        for (std::size_t i = start[b]; i < start[b + 1]; ++i) whole = whole.united(leaf_box(looked_[i], lattice_));
        const lattice::Verdict all = verdict(whole, surface);
        for (std::size_t i = start[b]; i < start[b + 1]; ++i) {
          verdict_[i] = all == lattice::Verdict::Keep ? verdict(leaf_box(looked_[i], lattice_), surface) : all;
        }
      }
    });
    std::erase_if(memory_.leaf, [&](const BlockCoord& leaf) { return memory_.changed[leaf] != 0; });
    for (std::size_t i = 0; i < looked_.size(); ++i) {
      if (verdict_[i] == lattice::Verdict::Keep) memory_.leaf.push_back(looked_[i]);
    }
  }

  void solve(const BlockTable& table, const Block& block, Mesh& mesh, std::vector<EdgePoint>& points) const {
    thread_local lattice::EdgeRoots roots;
    for (const Tile& tile : block.tile) {
      if (tile.vertices == 0 || (block.solve >> tile.place & 1u) == 0) continue;
      roots.clear();
      double scale = 0.0;
      const auto corner = corner_of(tile.place);
      const auto for_edges = [&](const auto& use) {
        for_tile_edges(tile, [&](unsigned node, unsigned axis) {
          const auto [x, y, z] = coordinates(node);
          use(corner[0] + x, corner[1] + y, corner[2] + z, static_cast<int>(axis));
        });
      };
      for_edges([&](int x, int y, int z, int axis) {
        const Vec3 start = position_of(lattice_, block, {x, y, z}, axis, 0.0);
        const Vec3 end = position_of(lattice_, block, {x, y, z}, axis, 1.0);
        const int dx = axis == 0, dy = axis == 1, dz = axis == 2;
        const double f0 = static_cast<double>(value_at(table, block, x, y, z));
        const double f1 = upper_value(static_cast<double>(value_at(table, block, x + dx, y + dy, z + dz)), f0, end);
        scale = std::max({scale, std::abs(f0), std::abs(f1)});
        roots.add(start, end, f0, f1, lattice::guess_root(kMissing, f0, f1, kMissing));
      });
      roots.solve(field_, {}, scale);
      std::size_t i = 0, vertex = block.first_vertex + tile.first_vertex, to = block.first_point + tile.first_vertex;
      for_edges([&](int x, int y, int z, int axis) {
        const Vec3 start = position_of(lattice_, block, {x, y, z}, axis, 0.0);
        const Vec3 end = position_of(lattice_, block, {x, y, z}, axis, 1.0);
        Vec3 place = roots.point(i);
        double t = (place[axis] - start[axis]) / (end[axis] - start[axis]);
        if (!(t >= kLeast && t <= 1.0 - kLeast)) {
          t = std::clamp(t, kLeast, 1.0 - kLeast);
          place = position_of(lattice_, block, {x, y, z}, axis, t);
        }
        const bool inside = value_at(table, block, x, y, z) > 0.0F;
        const Vec3 normal = lattice::outward(roots.gradient(i), inside ? Vec3(end - start) : Vec3(start - end));
        mesh.position[vertex] = place;
        mesh.normal[vertex] = normal;
        points[to++] = {static_cast<float>(t), static_cast<float>(normal.x()), static_cast<float>(normal.y()),
                        static_cast<float>(normal.z())};
        ++i;
        ++vertex;
      });
    }
  }

  /// F at the upper end of an edge that the surface crosses: as a tile stores it or, if none does, would store it, so that roots do not
  /// depend on which tiles the bounds kept. @param held  0 if none does or the value is no other  @param lower  F at the lower end
  [[nodiscard]] double upper_value(double held, double lower, const Vec3& end) const {
    if (held != 0.0) return held;
    const double exact = field_.value(end), rounded = static_cast<double>(static_cast<float>(exact));
    if (rounded != 0.0) return rounded;
    return lower > 0.0 ? std::min(exact, 0.0) : exact;
  }

  static BlockCoord block_of(const BlockCoord& leaf) { return {leaf[0] >> 1, leaf[1] >> 1, leaf[2] >> 1}; }
  static unsigned slot_of(const BlockCoord& leaf) {
    return static_cast<unsigned>((leaf[0] & 1) | (leaf[1] & 1) << 1 | (leaf[2] & 1) << 2);
  }

  /// Marks the tiles whose values may be different, and gives a sign to the leaves that hold none.
  void mark_changed(BlockTable& table) const {
    for (std::size_t i = 0; i < looked_.size(); ++i) {
      if (table.find(block_of(looked_[i])) == nullptr) continue;  // beyond all that hold values: outside
      const std::size_t b = table.index(block_of(looked_[i]));
      const Bits own = tiles_of(slot_of(looked_[i]));
      table.block[b].changed |= _pdep_u64(memory_.changed[looked_[i]], own);
      table.touched[b] = 1;
      table.blank[b] = 0;
      if (verdict_[i] != lattice::Verdict::Keep) set_sign(table.block[b], own, verdict_[i] == lattice::Verdict::Inside);
    }
  }

  /// @param leaves  that get values
  void sample_block(Block& block, std::uint8_t leaves) const {
    thread_local TileChanges changes;
    changes.begin(block);
    for (unsigned leaf = 0; leaf < kLeaves; ++leaf) {
      const Bits own = tiles_of(leaf);
      if ((leaves >> leaf & 1u) == 0) {
        changes.drop(own);
        continue;
      }
      const Bits tiles = (block.held & own) != 0 ? own & block.changed : own;
      block.changed |= tiles;
      if (tiles != 0) sample_tiles(block, tiles, changes);
    }
    changes.apply(block);
  }

  void sample_tiles(Block& block, Bits tiles, TileChanges& changes) const {
    const Cells base = block.base();
    std::array<Vec3, 8 * kTileNodes> nodes;
    std::array<double, 8 * kTileNodes> values;
    std::size_t n = 0;
    for_bits(tiles, [&](unsigned tile) {
      const auto corner = corner_of(tile);
      for (unsigned node = 0; node < kTileNodes; ++node) {
        const auto [x, y, z] = coordinates(node);
        nodes[n++] = lattice::node_position(lattice_, base[0] + corner[0] + x, base[1] + corner[1] + y, base[2] + corner[2] + z);
      }
    });
    field_.evaluate(std::span(nodes).first(n), std::span(values).first(n));
    const double* value = values.data();
    for_bits(tiles, [&](unsigned tile) {
      Bits inside = 0;
      float* out = changes.room(tile);
      for (std::size_t i = 0; i < kTileNodes; ++i) {
        out[i] = static_cast<float>(*value++);
        inside |= Bits{out[i] > 0.0F} << i;
      }
      changes.make(tile, inside);
      set_sign(block, Bits{1} << tile, inside == kAll);
    });
  }

  /// Leaves without surface: the others lie outside.
  void sign_inside(BlockTable& table) const {
    for (const lattice::BlockBox& box : leaves_.inside) {
      for (std::int32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
        for (std::int32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
          for (std::int32_t x = box.lower[0]; x <= box.upper[0]; ++x) {
            const BlockCoord leaf{x, y, z};
            if (table.find(block_of(leaf)) == nullptr) continue;
            set_sign(table.block[table.index(block_of(leaf))], tiles_of(slot_of(leaf)), true);
          }
        }
      }
    }
  }

  FieldView field_;
  Lattice lattice_;
  ViewMemory& memory_;
  lattice::BlockList leaves_;               ///< where everything is different
  std::vector<BlockCoord> looked_;          ///< elsewhere: leaves whose bounds were evaluated
  std::vector<lattice::Verdict> verdict_;   ///< on them
};

}  // namespace

std::unique_ptr<Sampler> make_view_sampler(const FieldView& field, const Lattice& lattice, ViewMemory& memory) {
  return std::make_unique<ViewSampler>(field, lattice, memory);
}

}  // namespace supple::implicit::march
