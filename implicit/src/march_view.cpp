#include <algorithm>
#include <cmath>
#include <limits>

#include "march_changes.h"
#include "polygonise_block_edges.h"
#include "polygonise_blocks.h"
#include "supple/implicit/project.h"

namespace supple::implicit::march {
namespace {

using blobs::Cells;

constexpr std::size_t kBlocksPerTask = 8;
/// Leaves with surface, of about 7 kB each with their part of the mesh.
constexpr std::uint64_t kMostLeaves = 1'000'000;
/// Vertices stay this far from the nodes [cells].
constexpr double kLeast = 0x1p-17;

Vec3 position_of(const Lattice& lattice, const Block& block, int x, int y, int z, int axis, double t) {
  const Cells base = block.base();
  Vec3 p = lattice::node_position(lattice, base[0] + x, base[1] + y, base[2] + z);
  const double at = static_cast<double>(base[static_cast<std::size_t>(axis)] + std::array{x, y, z}[static_cast<std::size_t>(axis)]) + t;
  p[axis] = lattice.origin[axis] + lattice.cell * at;
  return p;
}

/// Any field, through its view in double precision.
class ViewSampler final : public Sampler {
 public:
  ViewSampler(const FieldView& field, const Lattice& lattice) : field_(field), lattice_(lattice) {}

  void prepare(const Executor& executor, BlockTable& table) override {
    Cells lower, upper;
    if (find_leaves(executor, lower, upper)) {
      lay_out(table, lower, upper, lattice_);
    } else {
      table = {};
    }
  }

  void expect_size(const Executor& executor) override {
    // As many leaves in any order have fewer nodes than fit.
    if (lattice::block_range(field_.surface_box(), lattice_, 1).count() <= kMostLeaves) return;
    Cells lower, upper;
    if (find_leaves(executor, lower, upper)) expect_nodes(lower, upper, lattice_);
  }

  void sample(const Executor& executor, BlockTable& table) override {
    for (Block& block : table.block) {
      block.clear();
      block.changed = kAll;
    }
    table.all = true;
    table.touched.assign(table.block.size(), 1);
    table.blank.assign(table.block.size(), 0);
    // By block, so that a block is written by one task.
    std::vector<std::uint8_t> leaves(table.block.size());
    for (const auto& leaf : leaves_.block) leaves[table.index(block_of(leaf))] |= static_cast<std::uint8_t>(1u << slot_of(leaf));
    executor.for_blocks(table.block.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      thread_local TileChanges changes;
      for (std::size_t b = begin; b < end; ++b) {
        if (leaves[b] == 0) continue;
        changes.begin(table.block[b]);
        for_bits(leaves[b], [&](unsigned leaf) { sample_leaf(table.block[b], leaf, changes); });
        changes.apply(table.block[b]);
      }
    });
    sign_inside(table);
  }

  void solve(const Executor& executor, const BlockTable& table, std::span<const std::uint32_t> blocks, Mesh& mesh,
             std::vector<EdgePoint>& points) const override {
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) solve(table, table.block[blocks[i]], mesh, points);
    });
  }

  void project(const Block&, unsigned, std::span<Vec3> points, std::span<Vec3> normals) const override {
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

  /// Fills `leaves_`. @return whether there are any, then with the nodes [lower, upper] that they hold
  bool find_leaves(const Executor& executor, Cells& lower, Cells& upper) {
    PolygoniseCounts counts;
    leaves_ = lattice::surface_blocks(field_, lattice_, executor, kMostLeaves, counts);
    lower.fill(std::numeric_limits<std::int64_t>::max());
    upper.fill(std::numeric_limits<std::int64_t>::min());
    for (const auto& leaf : leaves_.block) {
      for (std::size_t k = 0; k < 3; ++k) {
        lower[k] = std::min<std::int64_t>(lower[k], std::int64_t{kLeafNodes} * leaf[k]);
        upper[k] = std::max<std::int64_t>(upper[k], std::int64_t{kLeafNodes} * (leaf[k] + 1));
      }
    }
    return !leaves_.block.empty();
  }

  void solve(const BlockTable& table, const Block& block, Mesh& mesh, std::vector<EdgePoint>& points) const {
    thread_local lattice::EdgeRoots roots;
    for (const Tile& tile : block.tile) {
      if (tile.vertices == 0) continue;
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
      std::size_t i = 0, vertex = block.first_vertex + tile.first_vertex, to = block.first_point + tile.first_vertex;
      for_edges([&](int x, int y, int z, int axis) {
        const Vec3 start = position_of(lattice_, block, x, y, z, axis, 0.0);
        const Vec3 end = position_of(lattice_, block, x, y, z, axis, 1.0);
        Vec3 place = roots.point(i);
        double t = (place[axis] - start[axis]) / (end[axis] - start[axis]);
        if (!(t >= kLeast && t <= 1.0 - kLeast)) {
          t = std::clamp(t, kLeast, 1.0 - kLeast);
          place = position_of(lattice_, block, x, y, z, axis, t);
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

  static BlockCoord block_of(const BlockCoord& leaf) { return {leaf[0] >> 1, leaf[1] >> 1, leaf[2] >> 1}; }
  static unsigned slot_of(const BlockCoord& leaf) {
    return static_cast<unsigned>((leaf[0] & 1) | (leaf[1] & 1) << 1 | (leaf[2] & 1) << 2);
  }

  void sample_leaf(Block& block, unsigned leaf, TileChanges& changes) const {
    const Cells base = block.base();
    std::array<Vec3, 8 * kTileNodes> nodes;
    std::array<double, 8 * kTileNodes> values;
    std::size_t n = 0;
    for_bits(tiles_of(leaf), [&](unsigned tile) {
      const auto corner = corner_of(tile);
      for (unsigned node = 0; node < kTileNodes; ++node) {
        const auto [x, y, z] = coordinates(node);
        nodes[n++] = lattice::node_position(lattice_, base[0] + corner[0] + x, base[1] + corner[1] + y, base[2] + corner[2] + z);
      }
    });
    field_.evaluate(nodes, values);
    const double* value = values.data();
    for_bits(tiles_of(leaf), [&](unsigned tile) {
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
  lattice::BlockList leaves_;
};

}  // namespace

std::unique_ptr<Sampler> make_view_sampler(const FieldView& field, const Lattice& lattice) {
  return std::make_unique<ViewSampler>(field, lattice);
}

}  // namespace supple::implicit::march
