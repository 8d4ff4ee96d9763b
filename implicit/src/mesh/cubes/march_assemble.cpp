#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "mesh/cubes/march_assemble.h"
#include "mesh/cubes/march_cases.h"
#include "mesh/partition/polygonise_block_edges.h"

namespace supple::implicit::march {
namespace {

constexpr std::size_t kBlocksPerTask = 8;

/// Words of the tiles of a block and of those one step above it.
class TileFrame {
 public:
  static constexpr unsigned kSide = 5;
  static constexpr std::array<unsigned, 8> kStep{0, 1, 5, 6, 25, 26, 30, 31};
  [[nodiscard]] static constexpr unsigned at(unsigned x, unsigned y, unsigned z) { return (z * kSide + y) * kSide + x; }
  [[nodiscard]] static constexpr unsigned at(unsigned place) { return at(place & 3u, place >> 2 & 3u, place >> 4); }

  /// The nodes inside.
  explicit TileFrame(const BlocksAbove& above) {
    word_.fill(0);
    for (unsigned step = 0; step < 8; ++step) {
      if (above[step] == nullptr) continue;
      const Block& block = *above[step];
      const unsigned from = at(4 * (step & 1u), 4 * (step >> 1 & 1u), 4 * (step >> 2));
      const Bits face = first_of(step);
      for_bits(face & ~block.outside, [&](unsigned place) { word_[from + at(place)] = kAll; });
      for_bits(face & block.held & block.outside, [&](unsigned place) {
        word_[from + at(place)] = block.inside_nodes[block.rank(place)];
      });
    }
  }
  [[nodiscard]] Bits operator[](unsigned at) const { return word_[at]; }
  [[nodiscard]] Steps around(unsigned at) const {
    std::array<Bits, 8> words;
    for (std::size_t step = 0; step < 8; ++step) words[step] = word_[at + kStep[step]];
    return Steps(words);
  }

 private:
  std::array<Bits, kSide * kSide * kSide> word_;
};

/// A tile without values owns no crossed edge, or a bound was wrong.
void expect_owned(const TileFrame& frame, const Block& block) {
  for_bits(~block.held, [&](unsigned place) {
    const unsigned at = TileFrame::at(place);
    const Bits own = frame[at];
    if (own == frame[at + 1] && own == frame[at + 5] && own == frame[at + 25]) return;
    const Steps around = frame.around(at);
    if (((own ^ around.step[1]) | (own ^ around.step[2]) | (own ^ around.step[4])) != 0) lattice::throw_missing_block(block.coord);
  });
}

constexpr auto kTriangles = [] {
  std::array<std::uint8_t, 256> count{};
  for (std::size_t c = 0; c < 256; ++c) {
    for (std::size_t l = 0; l < kCellLoops[c].loops; ++l) {
      count[c] = static_cast<std::uint8_t>(count[c] + kCellLoops[c].loop[l].size - 2);
    }
  }
  return count;
}();

/// The corners inside of each cell: eight bits at a time from those of the nodes one step up the axes.
/// @param out  room for eight more than there are cells
void write_corners(const Steps& inside, Bits cells, std::uint8_t* out) {
  std::array<Bits, 8> bits;
  for (std::size_t step = 0; step < 8; ++step) bits[step] = _pext_u64(inside.step[step], cells);
  const int count = std::popcount(cells);
  for (int first = 0; first < count; first += 8) {
    std::uint64_t eight = 0;
    for (std::size_t step = 0; step < 8; ++step) {
      eight |= _pdep_u64(bits[step] >> first & 0xffu, std::uint64_t{0x0101010101010101} << step);
    }
    std::memcpy(out + first, &eight, sizeof eight);
  }
}

/// The words of a mask of tiles, of a block and those above it, moved down and joined: tiles that it or one step up holds.
template <class Mask>
Bits reached(const BlocksAbove& above, const Mask& mask) {
  std::array<Bits, 8> words;
  for (std::size_t step = 0; step < 8; ++step) words[step] = above[step] == nullptr ? Bits{0} : mask(*above[step]);
  return Steps(words).any();
}

/// Marks the edges and cells that the surface crosses, and counts the content of the tiles.
void count_block(const BlockTable& table, Block& block) {
  const BlocksAbove above = blocks_above(table, block);
  // A root depends on whether the value at the upper end is known.
  block.solve = block.changed | reached(above, [](const Block& b) { return b.flipped; });
  if (block.solve == 0) return;
  const TileFrame frame(above);
  expect_owned(frame, block);
  thread_local std::array<std::uint8_t, blobs::kTileNodes * blobs::kTileNodes + 8> corners;
  std::size_t cells = 0;
  block.vertices = 0;
  block.triangles = 0;
  for (Tile& tile : block.tile) {
    const std::size_t before = std::exchange(tile.first_cell, static_cast<std::uint16_t>(cells));
    if ((block.solve >> tile.place & 1u) != 0) {
      const Steps inside = frame.around(TileFrame::at(tile.place));
      for (std::size_t axis = 0; axis < 3; ++axis) tile.edges[axis] = inside.step[0] ^ inside.step[std::size_t{1} << axis];
      tile.cells = inside.any() & ~inside.all();
      tile.vertices = static_cast<std::uint8_t>(std::popcount(tile.edges[0]) + std::popcount(tile.edges[1]) +
                                                std::popcount(tile.edges[2]));
      write_corners(inside, tile.cells, corners.data() + cells);
      tile.triangles = 0;
      for (int k = 0; k < std::popcount(tile.cells); ++k) {
        tile.triangles = static_cast<std::uint16_t>(tile.triangles + kTriangles[corners[cells + static_cast<std::size_t>(k)]]);
      }
    } else {
      std::copy_n(block.corners.data() + before, std::popcount(tile.cells), corners.data() + cells);
    }
    cells += static_cast<std::size_t>(std::popcount(tile.cells));
    tile.old_vertex = std::exchange(tile.first_vertex, static_cast<std::uint16_t>(block.vertices));
    tile.old_triangle = std::exchange(tile.first_triangle, static_cast<std::uint16_t>(block.triangles));
    block.vertices += tile.vertices;
    block.triangles += tile.triangles;
  }
  block.corners.assign(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(cells));
}

/// Updates the counts of a block in the table.
void count_held(BlockTable& table, std::size_t index) {
  Block& block = table.block[index];
  table.holds[index] = block.uniform() ? 0 : 1;
  if (block.uniform()) block.vertices = block.triangles = block.point_room = 0;
  const Held held{block.tile.size(), sizeof(Block) + block.inside_nodes.capacity() * sizeof(Bits) + block.tile.capacity() * sizeof(Tile) +
                                         block.values.capacity() * sizeof(float) + block.corners.capacity()};
  table.held.tiles += held.tiles - block.counted.tiles;
  table.held.bytes += held.bytes - block.counted.bytes;
  block.counted = held;
}

}  // namespace

void assemble(BlockTable& table, const Sampler& sampler, const Lattice& lattice, const Executor& executor,
              MeshScratch& scratch, Mesh& mesh) {
  // Vertices follow the nodes of a tile and its upper neighbours, triangles the vertices of these.
  const auto reach_down = [&] {
    const std::vector<std::uint8_t> from = table.touched;
    for (std::size_t b = 0; b < from.size() && !table.all; ++b) {
      if (from[b] != 0) for_blocks_below(table, table.block[b], [&](std::size_t below) { table.touched[below] = 1; });
    }
    std::vector<std::uint32_t> list;
    for (std::size_t b = 0; b < from.size(); ++b) {
      if (table.touched[b] != 0 && !table.block[b].uniform()) list.push_back(static_cast<std::uint32_t>(b));
    }
    return list;
  };
  const std::vector<std::uint32_t> counted = reach_down(), emitting = reach_down();
  const auto for_each = [&](const std::vector<std::uint32_t>& list, const auto& use) {
    executor.for_blocks(list.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) use(table.block[list[i]]);
    });
  };
  for_each(counted, [&](Block& block) { count_block(table, block); });
  for_each(emitting, [&](Block& block) {
    block.emit = block.held & reached(blocks_above(table, block), [](const Block& b) { return b.solve; });
  });
  std::vector<std::uint32_t> blocks;
  for (std::size_t b = 0; b < table.block.size(); ++b) {
    if (table.touched[b] != 0) count_held(table, b);
    if (table.holds[b] != 0) blocks.push_back(static_cast<std::uint32_t>(b));
  }
  std::size_t vertices = 0, triangles = 0;
  std::vector<Run> same_triangles;
  scratch.stayed.clear();
  BlockShifts shifts(table);
  for (const std::uint32_t b : blocks) {
    Block& block = table.block[b];
    block.old_vertex = std::exchange(block.first_vertex, static_cast<std::uint32_t>(vertices));
    block.old_triangle = std::exchange(block.first_triangle, static_cast<std::uint32_t>(triangles));
    if (block.solve == 0) {
      add_run(scratch.stayed, {block.old_vertex, vertices, block.vertices});
    } else {
      for_bits(block.held & ~block.solve, [&](unsigned place) {
        const Tile& tile = block.tile[block.rank(place)];
        add_run(scratch.stayed, {std::size_t{block.old_vertex} + tile.old_vertex, vertices + tile.first_vertex, tile.vertices});
      });
    }
    shifts.set(b, block);
    vertices += block.vertices;
    triangles += block.triangles;
  }
  for (const std::uint32_t b : blocks) {
    const Block& block = table.block[b];
    const auto add_same = [&](std::size_t from, std::size_t to, std::size_t count) {
      add_run(same_triangles, shifts.with_shift(b, {block.old_triangle + from, block.first_triangle + to, count, &block}));
    };
    if (block.solve == 0 && block.emit == 0) {
      add_same(0, 0, block.triangles);
      continue;
    }
    for_bits(block.held & ~block.emit, [&](unsigned place) {
      const Tile& tile = block.tile[block.rank(place)];
      add_same(block.solve == 0 ? tile.first_triangle : tile.old_triangle, tile.first_triangle, tile.triangles);
    });
  }
  lattice::expect_indexable(std::max(vertices, triangles), lattice);
  mesh.columns.clear();
  move_runs(scratch.stayed, vertices, mesh.position);
  move_runs(scratch.stayed, vertices, mesh.normal);
  place_points(table, blocks, counted, vertices, scratch.stayed.empty(), scratch.point);
  move_triangles(table, same_triangles, triangles, mesh);
  sampler.solve(executor, table, counted, mesh, scratch.point);
  for_each(emitting, [&](const Block& block) { emit_triangles(table, block, scratch.point.data(), mesh); });
}

}  // namespace supple::implicit::march
