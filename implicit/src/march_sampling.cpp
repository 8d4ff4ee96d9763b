#include "march_sampling.h"

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

/// Bodies of Wyvill points, in single precision.
class BlobSampler final : public Sampler {
 public:
  BlobSampler(const Field::Index& index, const Lattice& lattice, blobs::BlobGrid& grid)
      : index_(index), lattice_(lattice), iso_(static_cast<float>(index.iso)), grid_(grid) {}

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
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      Workspace& work = Workspace::of_thread();
      for (std::size_t i = begin; i < end; ++i) sample_block(table.block[blocks[i]], work);
    });
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
        const auto at = corner_of(tile, kTile);
        const std::array<int, 3> tile_corner{corner[0] + at[0], corner[1] + at[1], corner[2] + at[2]};
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
    const auto at = corner_of(tile, kTile);
    (void)blobs::select(work.around_leaf, centre_of({corner[0] + at[0], corner[1] + at[1], corner[2] + at[2]}, kTile),
                        0.5F * kTile + static_cast<float>(kAround), work.tile);
    blobs::project_points(work.tile, iso_, placement_of(block), points.data()->data(), normals.data()->data(),
                          points.size(), work.near);
  }

  [[nodiscard]] bool single_precision() const override { return true; }

 private:
  struct Workspace {
    BlobList block, leaf, tile, near;
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
    const auto at = corner_of(tile, kTile);
    std::array<const float*, 3> next{};  // of the tiles above
    for (unsigned axis = 0; axis < 3; ++axis) {
      std::array<int, 3> above{corner[0] + at[0], corner[1] + at[1], corner[2] + at[2]};
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
    for (Block& block : table.block) block.changed = 0;
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
    const auto old_leaf_of = block.leaf_of;
    work.leaves.clear();
    work.values.clear();
    grid_.gather(block.base(), kBlockNodes, 0, work.block);
    for (unsigned slot = 0; slot < 8; ++slot) {
      if ((block.changed >> slot & 1u) != 0) {
        block.leaf_of[slot] = kOutside;
        if (work.block.count > 0) sample_leaf(block, slot, work);
      } else if (old_leaf_of[slot] >= 0) {
        block.leaf_of[slot] = static_cast<std::int8_t>(work.leaves.size());
        Leaf& leaf = work.leaves.emplace_back(block.leaf[static_cast<std::size_t>(old_leaf_of[slot])]);
        const auto from = block.values.begin() + static_cast<std::ptrdiff_t>(leaf.first_tile * kTileNodes);
        leaf.first_tile = static_cast<std::uint32_t>(work.values.size() / kTileNodes);
        work.values.insert(work.values.end(), from,
                           from + static_cast<std::ptrdiff_t>(kTileNodes * static_cast<std::size_t>(std::popcount(leaf.active))));
      }
    }
    block.leaf.resize(work.leaves.size());
    std::copy(work.leaves.begin(), work.leaves.end(), block.leaf.begin());
    block.values.assign(work.values.begin(), work.values.end());
  }

  void sample_leaf(Block& block, unsigned slot, Workspace& work) const {
    const auto corner = corner_of(slot, kLeafNodes);
    const auto centre = centre_of(corner, kLeafNodes);
    const Verdict whole = verdict(blobs::select(work.block, centre, 0.5F * kLeafNodes, work.leaf));
    if (whole != Verdict::Unknown) {
      block.leaf_of[slot] = whole == Verdict::Inside ? kInside : kOutside;
      return;
    }
    Leaf& leaf = work.leaves.emplace_back();
    leaf.slot = static_cast<std::uint8_t>(slot);
    leaf.first_tile = static_cast<std::uint32_t>(work.values.size() / kTileNodes);
    bool inside = false;
    for (unsigned tile = 0; tile < 8; ++tile) {
      const auto at = corner_of(tile, kTile);
      const std::array<int, 3> tile_corner{corner[0] + at[0], corner[1] + at[1], corner[2] + at[2]};
      const auto tile_centre = centre_of(tile_corner, kTile);
      const Verdict here = verdict(blobs::select(work.leaf, tile_centre, 0.5F * kTile, work.tile));
      if (here != Verdict::Unknown) {
        inside = here == Verdict::Inside;
        set_tile(leaf, tile, inside ? ~std::uint64_t{0} : 0);
        continue;
      }
      const std::size_t first = work.values.size();
      work.values.resize(first + kTileNodes);
      set_tile(leaf, tile,
               blobs::evaluate_tile(work.tile,
                                    {static_cast<float>(tile_corner[0]), static_cast<float>(tile_corner[1]),
                                     static_cast<float>(tile_corner[2])},
                                    iso_, work.values.data() + first));
      leaf.active = static_cast<std::uint8_t>(leaf.active | 1u << tile);
    }
    if (leaf.active == 0) {
      block.leaf_of[slot] = inside ? kInside : kOutside;
      work.leaves.pop_back();
      return;
    }
    block.leaf_of[slot] = static_cast<std::int8_t>(work.leaves.size() - 1);
  }

  const Field::Index& index_;
  Lattice lattice_;
  float iso_;
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

std::unique_ptr<Sampler> make_sampler(const FieldView& field, const Lattice& lattice, blobs::BlobGrid& grid) {
  SUPPLE_EXPECTS(std::isfinite(lattice.cell) && lattice.cell > 0.0 && lattice.origin.allFinite());
  if (const Field* points = field.as_field()) {
    const Field::Index& index = points->packed();
    if (index.size() > 0 && index.uniform && index.primitive[0].kind == PackedKind::PointWyvill && !index.blend.active()) {
      return std::make_unique<BlobSampler>(index, lattice, grid);
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
