#include "supple/implicit/march_cubes.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <numeric>
#include <utility>

#include "field_index.h"
#include "march_cases.h"
#include "march_sampling.h"
#include "polygonise_block_edges.h"
#include "polygonise_blocks.h"
#include "supple/core/error.h"
#include "supple/implicit/field.h"

namespace supple::implicit {
namespace march {
namespace {

constexpr std::size_t kBlocksPerTask = 8;

/// The first along the axes in the mask `step`.
constexpr Bits first_of(unsigned step) {
  return ((step & 1u) != 0 ? kFirstX : kAll) & ((step & 2u) != 0 ? kFirstY : kAll) & ((step & 4u) != 0 ? kFirstZ : kAll);
}

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
        word_[from + at(place)] = block.tile[block.rank(place)].inside;
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

/// Tiles and those one step up in the block.
constexpr Bits with_next(Bits tiles) {
  tiles |= tiles << 1 & ~kFirstX;
  tiles |= tiles << 4 & ~kFirstY;
  return tiles | tiles << 16;
}

/// Marks the edges and cells that the surface crosses, and counts what the tiles will hold.
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

/// Brings up to date what the table counts of a block.
void count_held(BlockTable& table, std::size_t index) {
  Block& block = table.block[index];
  table.holds[index] = block.uniform() ? 0 : 1;
  if (block.uniform()) block.vertices = block.triangles = block.point_room = 0;
  const Held held{block.tile.size(), sizeof(Block) + block.tile.capacity() * sizeof(Tile) +
                                         block.values.capacity() * sizeof(float) + block.corners.capacity()};
  table.held.tiles += held.tiles - block.counted.tiles;
  table.held.bytes += held.bytes - block.counted.bytes;
  block.counted = held;
}

/// Where the nodes of a block and of its upper faces (0..16) stand in a table with three entries for each.
constexpr int kTableSide = kBlockNodes + 1;
constexpr int node_place(int x, int y, int z) { return 3 * ((z * kTableSide + y) * kTableSide + x); }
/// Those of a word of bits that are `edge` nodes apart.
template <int edge>
constexpr auto kPlaces = [] {
  std::array<int, 64> places{};
  for (unsigned bit = 0; bit < 64; ++bit) {
    const auto [x, y, z] = coordinates(bit);
    places[bit] = node_place(edge * x, edge * y, edge * z);
  }
  return places;
}();
constexpr auto kTilePlace = kPlaces<blobs::kTile>, kNodePlace = kPlaces<1>;

/// Vertices on the edges of a block's cells: those of the block by their order, then those that its upper neighbours own. What a
/// cell asks for is small enough to stay in the nearest cache.
class LocalVertices {
 public:
  using Number = std::uint16_t;

  /// @param own     tiles of the block that are needed
  /// @param points  of all blocks
  void fill(const BlocksAbove& above, Bits own, const EdgePoint* points) {
    const Block& block = *above[0];
    const std::size_t most = block.vertices + kMostBeyond;
    if (point_.size() < most) {
      point_.resize(most);
      vertex_.resize(most);
    }
    for (const Tile& tile : block.tile) {
      if ((own >> tile.place & 1u) != 0) add_own(tile, points + block.first_point);
    }
    std::iota(vertex_.begin(), vertex_.begin() + block.vertices, block.first_vertex);
    count_ = block.vertices;
    for (unsigned step = 1; step < 7; ++step) {
      if (above[step] == nullptr) continue;
      const int from = node_place(kBlockNodes * static_cast<int>(step & 1u), kBlockNodes * static_cast<int>(step >> 1 & 1u),
                                  kBlockNodes * static_cast<int>(step >> 2));
      for_bits(above[step]->held & first_of(step), [&](unsigned at) {
        add_beyond(*above[step], above[step]->tile[above[step]->rank(at)], from + kTilePlace[at], step, points);
      });
    }
  }
  /// From a node on, by kEdgePlace.
  [[nodiscard]] const Number* from(int node) const { return number_.data() + node; }
  [[nodiscard]] const EdgePoint* points() const { return point_.data(); }
  /// Numbers in the mesh. @param from  readable seven beyond its end
  void translate(const Number* from, std::size_t count, std::uint32_t* to) const {
    constexpr std::size_t kWide = 8;
    const auto* vertex = reinterpret_cast<const int*>(vertex_.data());
    std::size_t i = 0;
    for (; i + kWide <= count; i += kWide) {
      const __m256i at = _mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from + i)));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + i), _mm256_i32gather_epi32(vertex, at, 4));
    }
    for (; i < count; ++i) to[i] = vertex_[from[i]];
  }

 private:
  /// Edges in the upper faces of a block.
  static constexpr std::size_t kMostBeyond = std::size_t{3} * 2 * kTableSide * kTableSide;

  void add_own(const Tile& tile, const EdgePoint* points) {
    std::copy_n(points + tile.first_vertex, tile.vertices, point_.data() + tile.first_vertex);
    Number number = tile.first_vertex;
    Number* table = number_.data() + kTilePlace[tile.place];
    for (unsigned axis = 0; axis < 3; ++axis) {
      for_bits(tile.edges[axis], [&](unsigned node) { table[static_cast<unsigned>(kNodePlace[node]) + axis] = number++; });
    }
  }
  /// Edges on the face, or edge, that a tile of the block in the direction `without` has in common with this one.
  void add_beyond(const Block& block, const Tile& tile, int from, unsigned without, const EdgePoint* points) {
    std::uint32_t first = tile.first_vertex;
    Number* table = number_.data() + from;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const Bits edges = tile.edges[axis];
      if ((without >> axis & 1u) == 0) {
        for_bits(edges & first_of(without), [&](unsigned node) {
          const std::uint32_t at = first + static_cast<std::uint32_t>(std::popcount(edges & ((Bits{1} << node) - 1)));
          point_[count_] = points[block.first_point + at];
          vertex_[count_] = block.first_vertex + at;
          table[static_cast<unsigned>(kNodePlace[node]) + axis] = static_cast<Number>(count_++);
        });
      }
      first += static_cast<std::uint32_t>(std::popcount(edges));
    }
  }

  std::array<Number, std::size_t{3} * kTableSide * kTableSide * kTableSide> number_;
  std::vector<EdgePoint> point_;       ///< by number
  std::vector<std::uint32_t> vertex_;  ///< of the mesh, by number
  std::size_t count_ = 0;
};

/// From the place of a cell to that of its edges.
constexpr auto kEdgePlace = [] {
  std::array<int, kCellEdges> places{};
  for (std::size_t e = 0; e < kCellEdges; ++e) {
    const auto [corner, axis] = kCellEdge[e];
    places[e] = node_place(corner & 1, corner >> 1 & 1, corner >> 2) + axis;
  }
  return places;
}();

/// A point on an edge of a cell is start + t along, behind an unused number [cells].
struct EdgeLine {
  alignas(16) std::array<float, 4> start{}, along{};
};
constexpr auto kEdgeLine = [] {
  std::array<EdgeLine, kCellEdges> lines{};
  for (std::size_t e = 0; e < kCellEdges; ++e) {
    for (unsigned k = 0; k < 3; ++k) lines[e].start[k + 1] = static_cast<float>(kCellEdge[e].corner >> k & 1);
    lines[e].along[kCellEdge[e].axis + std::size_t{1}] = 1.0F;
  }
  return lines;
}();

/// The triangles of a cell as places of their edges. A cell with one loop of four or more vertices has a choice of fans.
struct alignas(64) CellTriangles {  // the fans of most cells lie in two lines
  static constexpr std::size_t kMostFans = 7;
  std::array<std::uint16_t, kMostFans> corner{};  ///< of the loop
  std::array<std::uint8_t, kMostFans> edge{};     ///< on which they lie
  std::uint8_t count = 0;
  std::uint8_t size = 0;    ///< of the only loop
  std::uint8_t apices = 0;  ///< bit k: its fan around corner k is allowed
  std::array<std::array<std::uint16_t, 3 * kMostTriangles>, kMostFans> place{};  ///< by the apex of the fan
};

constexpr CellTriangles make_triangles(const CellLoops& loops) {
  CellTriangles result;
  for (std::size_t variant = 0; variant < CellTriangles::kMostFans; ++variant) {
    std::size_t n = 0;
    for (std::size_t l = 0; l < loops.loops; ++l) {
      const Loop& loop = loops.loop[l];
      std::size_t apex = static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(loop.apices)));
      if (loops.loops == 1 && (loop.apices >> variant & 1) != 0) apex = variant;
      for (std::size_t d = 1; d + 1 < loop.size; ++d) {
        for (const std::size_t k : {apex, apex + d, apex + d + 1}) {
          result.place[variant][n++] = static_cast<std::uint16_t>(kEdgePlace[loop.edge[k % loop.size]]);
        }
      }
    }
    result.count = static_cast<std::uint8_t>(n / 3);
  }
  const Loop& loop = loops.loop[0];
  for (std::size_t k = 0; k < CellTriangles::kMostFans; ++k) {
    result.edge[k] = loop.edge[k % std::max<std::size_t>(loop.size, 1)];
    result.corner[k] = static_cast<std::uint16_t>(kEdgePlace[result.edge[k]]);
  }
  if (loops.loops == 1) {
    result.size = loop.size;
    result.apices = loop.apices;
  }
  return result;
}

constexpr auto kCellTriangles = [] {
  std::array<CellTriangles, 256> cases{};
  for (std::size_t c = 0; c < 256; ++c) cases[c] = make_triangles(kCellLoops[c]);
  return cases;
}();

/// Corners of a cell's loop and their normals, behind an unused number.
struct LoopCorner {
  __m128 place, normal;
  LoopCorner(const CellTriangles& c, std::size_t k, const LocalVertices::Number* point, const EdgePoint* points) {
    const EdgeLine& line = kEdgeLine[c.edge[k]];
    normal = _mm_load_ps(&points[point[c.corner[k]]].t);
    const __m128 t = _mm_permute_ps(normal, 0);
    place = _mm_add_ps(_mm_load_ps(line.start.data()), _mm_mul_ps(t, _mm_load_ps(line.along.data())));
  }
};

/// How far two chords of the surface lie off it, in the first and second number, times eight: |d . (n1 - n0)| for a chord d with
/// the normals n at its ends; where the surface is flat, the longer chord is the worse one.
__m128 bends(const LoopCorner& a0, const LoopCorner& a1, const LoopCorner& b0, const LoopCorner& b1) {
  constexpr float kFlat = 1e-3F;  // curvature [1 / cell]
  const __m128 a = _mm_sub_ps(a1.place, a0.place), b = _mm_sub_ps(b1.place, b0.place);
  const __m128 turns = _mm_hadd_ps(_mm_mul_ps(a, _mm_sub_ps(a1.normal, a0.normal)), _mm_mul_ps(b, _mm_sub_ps(b1.normal, b0.normal)));
  const __m128 lengths = _mm_hadd_ps(_mm_mul_ps(a, a), _mm_mul_ps(b, b));
  const __m128 turn = _mm_andnot_ps(_mm_set1_ps(-0.0F), _mm_hadd_ps(turns, turns));
  return _mm_add_ps(turn, _mm_mul_ps(_mm_set1_ps(kFlat), _mm_hadd_ps(lengths, lengths)));
}

/// The fan of a cell whose chords lie closest to the surface.
std::size_t best_fan(const CellTriangles& c, const LocalVertices::Number* point, const EdgePoint* points) {
  const LoopCorner first(c, 0, point, points), second(c, 1, point, points), third(c, 2, point, points), fourth(c, 3, point, points);
  if (c.size != 5) {
    const __m128 bend = bends(first, third, second, fourth);
    return _mm_comilt_ss(_mm_movehdup_ps(bend), bend) != 0 ? 1 : 0;
  }
  const LoopCorner fifth(c, 4, point, points);
  alignas(16) std::array<std::array<float, 4>, 3> chord;  // from corner k to k + 2
  _mm_store_ps(chord[0].data(), bends(first, third, second, fourth));
  _mm_store_ps(chord[1].data(), bends(third, fifth, fourth, first));
  _mm_store_ps(chord[2].data(), bends(fifth, second, fifth, second));
  const std::array<float, 5> b{chord[0][0], chord[0][1], chord[1][0], chord[1][1], chord[2][0]};
  const std::array<float, 5> sum{b[0] + b[3], b[1] + b[4], b[2] + b[0], b[3] + b[1], b[4] + b[2]};
  return static_cast<std::size_t>(std::min_element(sum.begin(), sum.end()) - sum.begin());
}

/// From the number `first` on, numbers move by `more` further than before it.
struct Shift {
  std::uint32_t first, more;
};

/// How the vertices move that stay and that triangles of a block may have, in rising order.
void find_shifts(const BlockTable& table, const Block& block, std::vector<Shift>& shifts) {
  shifts.clear();
  std::uint32_t total = 0;
  const auto add = [&](std::uint32_t from, std::uint32_t to) {
    if (!shifts.empty() && to - from == total) return;
    shifts.push_back({from, to - from - total});
    total = to - from;
  };
  const BlocksAbove above = blocks_above(table, block);
  for (unsigned step = 0; step < 7; ++step) {
    if (above[step] == nullptr) continue;
    const Block& other = *above[step];
    if (other.solve == 0) {
      if (other.vertices > 0) add(other.old_vertex, other.first_vertex);
      continue;
    }
    for_bits(other.held & ~other.solve & first_of(step), [&](unsigned place) {
      const Tile& tile = other.tile[other.rank(place)];
      if (tile.vertices > 0) add(other.old_vertex + tile.old_vertex, other.first_vertex + tile.first_vertex);
    });
  }
}

/// A run of numbers that moves as a whole.
struct Run {
  std::size_t from, to, count;
  const Block* block = nullptr;  ///< of triangles whose vertices move by different shifts
  std::uint32_t more = 0;        ///< of all others
};

void add_run(std::vector<Run>& runs, const Run& run) {
  if (run.count == 0) return;
  if (!runs.empty()) {
    Run& last = runs.back();
    if (last.from + last.count == run.from && last.to + last.count == run.to && last.block == run.block && last.more == run.more) {
      last.count += run.count;
      return;
    }
  }
  runs.push_back(run);
}

/// Calls move(run) for those that move down or stay in rising order, then for those that move up in falling order, so that
/// nothing is overwritten before it has moved.
template <class Move>
void for_runs(const std::vector<Run>& runs, const Move& move) {
  for (const Run& run : runs) {
    if (run.to <= run.from) move(run);
  }
  for (auto run = runs.rbegin(); run != runs.rend(); ++run) {
    if (run->to > run->from) move(*run);
  }
}

/// Moves items in place, page by page, each with the next one under way from memory: a processor foresees no other page.
template <class Item>
void move_run(const Run& run, Item* items) {
  constexpr std::size_t kPage = 4096, kLine = 64, kItems = kPage / sizeof(Item);
  const auto move = [&](std::size_t i, std::size_t count, std::ptrdiff_t next) {
    const char* ahead = reinterpret_cast<const char*>(items + run.from + i) + next;
    for (std::size_t byte = 0; byte < kPage; byte += kLine) _mm_prefetch(ahead + byte, _MM_HINT_T0);
    std::memmove(static_cast<void*>(items + run.to + i), static_cast<const void*>(items + run.from + i), count * sizeof(Item));
  };
  if (run.to < run.from) {
    for (std::size_t i = 0; i < run.count; i += kItems) move(i, std::min(kItems, run.count - i), kPage);
  } else if (run.to > run.from) {
    for (std::size_t left = run.count; left > 0; left -= std::min(kItems, left)) {
      move(left - std::min(kItems, left), std::min(kItems, left), -static_cast<std::ptrdiff_t>(kPage));
    }
  }
}

template <class Item>
void move_runs(const std::vector<Run>& runs, std::size_t count, std::vector<Item>& items) {
  if (items.size() < count) items.resize(count);
  for_runs(runs, [&](const Run& run) { move_run(run, items.data()); });
  items.resize(count);
}

/// Copies numbers of vertices, moved by their shifts; may be in place. @pre there is a shift, and none is before the first
void move_numbers(const std::uint32_t* from, std::uint32_t* to, std::size_t count, std::span<const Shift> shifts) {
  constexpr std::size_t kWide = 16;
  const std::uint32_t base = shifts[0].more;
  const std::span<const Shift> further = shifts.subspan(1);
  const auto move_one = [&](std::size_t i) {
    std::uint32_t moved = from[i] + base;
    for (const Shift& shift : further) moved += from[i] >= shift.first ? shift.more : 0;
    to[i] = moved;
  };
  const std::ptrdiff_t ahead = to <= from ? 1024 : -1024;  // a page, as in move_run
  const __m256i first_more = _mm256_set1_epi32(static_cast<int>(base));
  const auto move_line = [&](std::size_t i) {
    _mm_prefetch(reinterpret_cast<const char*>(from + i + ahead), _MM_HINT_T0);
    const auto load = [&](std::size_t k) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from + i + k)); };
    const auto store = [&](std::size_t k, __m256i v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + i + k), v); };
    const __m256i low = load(0), high = load(8);
    __m256i moved_low = _mm256_add_epi32(low, first_more), moved_high = _mm256_add_epi32(high, first_more);
    for (const Shift& shift : further) {
      const __m256i first = _mm256_set1_epi32(static_cast<int>(shift.first)), more = _mm256_set1_epi32(static_cast<int>(shift.more));
      const auto reached = [&](__m256i v) { return _mm256_and_si256(_mm256_cmpeq_epi32(_mm256_max_epu32(v, first), v), more); };
      moved_low = _mm256_add_epi32(moved_low, reached(low));
      moved_high = _mm256_add_epi32(moved_high, reached(high));
    }
    store(0, moved_low);
    store(8, moved_high);
  };
  const std::size_t whole = count / kWide * kWide;
  if (to <= from) {
    for (std::size_t i = 0; i < whole; i += kWide) move_line(i);
    for (std::size_t i = whole; i < count; ++i) move_one(i);
  } else {
    for (std::size_t i = count; i > whole; --i) move_one(i - 1);
    for (std::size_t i = whole; i > 0; i -= kWide) move_line(i - kWide);
  }
}

/// By how much the vertices of blocks move, where all of one do by the same.
class BlockShifts {
 public:
  explicit BlockShifts(const BlockTable& table)
      : row_(static_cast<std::size_t>(table.count[0])), plane_(row_ * static_cast<std::size_t>(table.count[1])),
        shift_(table.block.size() + plane_ + row_ + 1, kNone) {}
  void set(std::size_t index, const Block& block) {
    if (block.vertices > 0) shift_[index] = block.solve == 0 ? std::int64_t{block.first_vertex - block.old_vertex} : kMany;
  }
  /// The run with the shift of all vertices that triangles of the block may have, if they have one.
  [[nodiscard]] Run with_shift(std::size_t index, const Run& run) const {
    std::int64_t found = kNone;
    for (const std::size_t step : {std::size_t{0}, std::size_t{1}, row_, row_ + 1, plane_, plane_ + 1, plane_ + row_}) {
      const std::int64_t other = shift_[index + step];
      if (other == kNone || other == found) continue;
      if (other == kMany || found != kNone) return run;
      found = other;
    }
    return {run.from, run.to, run.count, nullptr, found == kNone ? 0 : static_cast<std::uint32_t>(found)};
  }

 private:
  static constexpr std::int64_t kNone = -1, kMany = -2;
  std::size_t row_, plane_;
  std::vector<std::int64_t> shift_;
};

/// Triangles that stay.
void move_triangles(const BlockTable& table, const std::vector<Run>& runs, std::size_t count, Mesh& mesh) {
  if (mesh.triangle.size() < count) mesh.triangle.resize(count);
  std::uint32_t* vertex = mesh.triangle.data()->data();
  std::vector<Shift> shifts;
  const Block* block = nullptr;
  for_runs(runs, [&](const Run& run) {
    if (run.block == nullptr) {
      shifts.assign(1, {0, run.more});
    } else if (run.block != block) {
      find_shifts(table, *run.block, shifts);
    }
    block = run.block;
    if (run.to == run.from && shifts.size() == 1 && shifts[0].more == 0) return;
    move_numbers(vertex + 3 * run.from, vertex + 3 * run.to, 3 * run.count, shifts);
  });
  mesh.triangle.resize(count);
}

/// The triangles of the tiles marked `emit`.
void emit_triangles(const BlockTable& table, const Block& block, const EdgePoint* points, Mesh& mesh) {
  if (block.emit == 0 || block.triangles == 0) return;
  using Triangle = std::array<LocalVertices::Number, 3>;
  thread_local std::vector<Triangle> thread_found;
  thread_local LocalVertices vertices;
  vertices.fill(blocks_above(table, block), with_next(block.emit), points);
  thread_found.resize(block.triangles + kMostTriangles);
  std::size_t begin = 0, end = 0;  // of those that follow each other without a gap
  const auto place_run = [&] {
    if (begin == end) return;
    vertices.translate(thread_found[begin].data(), 3 * (end - begin), mesh.triangle[block.first_triangle + begin].data());
  };
  for (const Tile& tile : block.tile) {
    if ((block.emit >> tile.place & 1u) == 0) continue;
    if (tile.first_triangle != end) {
      place_run();
      begin = tile.first_triangle;
    }
    Triangle* out = thread_found.data() + tile.first_triangle;
    const std::uint8_t* corners = block.corners.data() + tile.first_cell;
    const LocalVertices::Number* first = vertices.from(kTilePlace[tile.place]);
    for (Bits cells = tile.cells; cells != 0; cells &= cells - 1) {
      const CellTriangles& c = kCellTriangles[*corners++];
      const LocalVertices::Number* point = first + kNodePlace[static_cast<std::size_t>(std::countr_zero(cells))];
      const std::uint16_t* place = c.place[best_fan(c, point, vertices.points())].data();
      // As many as most cells have or more: cheaper than a branch that cannot be foreseen.
      constexpr std::size_t kOften = 3;
      for (std::size_t k = 0; k < kOften; ++k, place += 3) out[k] = {point[place[0]], point[place[1]], point[place[2]]};
      if (c.count > kOften) {
        for (std::size_t k = kOften; k < kMostTriangles; ++k, place += 3) {
          out[k] = {point[place[0]], point[place[1]], point[place[2]]};
        }
      }
      out += c.count;
    }
    end = tile.first_triangle + std::size_t{tile.triangles};
  }
  place_run();
}

/// Room for the points of all vertices. Those that stay are where they are looked for.
/// @param blocks   that hold vertices
/// @param counted  of these, those whose vertices may be others
void place_points(BlockTable& table, std::span<const std::uint32_t> blocks, std::span<const std::uint32_t> counted, std::size_t vertices,
                  bool none_stays, std::vector<EdgePoint>& points) {
  const auto for_kept = [](const Block& block, const auto& use) {
    for_bits(block.held & ~block.solve, [&](unsigned place) { use(block.tile[block.rank(place)]); });
  };
  if (none_stays || 2 * points.size() > 3 * vertices) {  // in the order of vertices
    std::vector<EdgePoint> last;
    if (!none_stays) last = points;
    points.resize(vertices);
    for (const std::uint32_t b : blocks) {
      Block& block = table.block[b];
      const std::uint32_t from = std::exchange(block.first_point, block.first_vertex);
      block.point_room = block.vertices;
      for_kept(block, [&](const Tile& tile) {
        const std::uint16_t old = block.solve == 0 ? tile.first_vertex : tile.old_vertex;
        std::copy_n(last.data() + from + old, tile.vertices, points.data() + block.first_point + tile.first_vertex);
      });
    }
    return;
  }
  std::vector<EdgePoint> last;
  for (const std::uint32_t b : counted) {
    Block& block = table.block[b];
    if (block.solve == 0) continue;
    last.assign(points.data() + block.first_point, points.data() + block.first_point + block.point_room);
    if (block.vertices > block.point_room) {
      block.first_point = static_cast<std::uint32_t>(points.size());
      block.point_room = block.vertices + block.vertices / 8;
      points.resize(points.size() + block.point_room);
    }
    for_kept(block, [&](const Tile& tile) {
      std::copy_n(last.data() + tile.old_vertex, tile.vertices, points.data() + block.first_point + tile.first_vertex);
    });
  }
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
  std::vector<Run> same_vertices, same_triangles;
  BlockShifts shifts(table);
  for (const std::uint32_t b : blocks) {
    Block& block = table.block[b];
    block.old_vertex = std::exchange(block.first_vertex, static_cast<std::uint32_t>(vertices));
    block.old_triangle = std::exchange(block.first_triangle, static_cast<std::uint32_t>(triangles));
    if (block.solve == 0) {
      add_run(same_vertices, {block.old_vertex, vertices, block.vertices});
    } else {
      for_bits(block.held & ~block.solve, [&](unsigned place) {
        const Tile& tile = block.tile[block.rank(place)];
        add_run(same_vertices, {std::size_t{block.old_vertex} + tile.old_vertex, vertices + tile.first_vertex, tile.vertices});
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
  move_runs(same_vertices, vertices, mesh.position);
  move_runs(same_vertices, vertices, mesh.normal);
  place_points(table, blocks, counted, vertices, same_vertices.empty(), scratch.point);
  move_triangles(table, same_triangles, triangles, mesh);
  sampler.solve(executor, table, counted, mesh, scratch.point);
  for_each(emitting, [&](const Block& block) { emit_triangles(table, block, scratch.point.data(), mesh); });
}

void list_tiles(const BlockTable& table, std::vector<TileTriangles>& tiles) {
  tiles.clear();
  for (const Block& block : table.block) {
    for (const Tile& tile : block.tile) {
      if (tile.triangles > 0) tiles.push_back({&block, tile.place, block.first_triangle + tile.first_triangle, tile.triangles});
    }
  }
}

void refine(const Sampler& sampler, const Lattice& lattice, const Executor& executor, MeshScratch& scratch, Mesh& mesh) {
  constexpr std::size_t kTilesPerTask = 64;
  const std::size_t vertices = mesh.vertex_count(), triangles = mesh.triangle_count();
  const auto& triangle = mesh.triangle;
  const auto end_of = [&](const std::array<std::uint32_t, 3>& t, std::size_t k) { return t[k == 2 ? 0 : k + 1]; };
  // Every edge runs once from its lower vertex to its higher one: there it gets its number, in the order of triangles,
  // and the triangle on the other side finds it among the edges of the lower vertex.
  scratch.start.assign(vertices + 1, 0);
  for (const auto& t : triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] < end_of(t, k)) ++scratch.start[t[k] + 1];
    }
  }
  for (std::size_t v = 0; v < vertices; ++v) scratch.start[v + 1] += scratch.start[v];
  const std::size_t edges = scratch.start[vertices];
  lattice::expect_indexable(vertices + edges, lattice);
  scratch.target.resize(edges);
  scratch.edge.resize(edges);
  scratch.middle.resize(triangles);
  auto number = static_cast<std::uint32_t>(vertices);
  for (std::size_t i = 0; i < triangles; ++i) {
    const auto& t = triangle[i];
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] >= end_of(t, k)) continue;
      const std::uint32_t at = scratch.start[t[k]]++;
      scratch.target[at] = end_of(t, k);
      scratch.edge[at] = number;
      scratch.middle[i][k] = number++;
    }
  }
  mesh.position.resize(vertices + edges);
  mesh.normal.resize(vertices + edges);
  scratch.triangle.resize(4 * triangles);
  executor.for_blocks(scratch.tiles.size(), kTilesPerTask, [&](std::size_t begin, std::size_t end) {
    thread_local std::vector<Vec3> points, normals;
    sampler.begin_projection();
    for (std::size_t i = begin; i < end; ++i) {
      const TileTriangles& tile = scratch.tiles[i];
      std::size_t first = 0;
      points.clear();
      for (std::size_t n = tile.first; n < tile.first + tile.count; ++n) {
        const auto& t = triangle[n];
        auto& middle = scratch.middle[n];
        for (std::size_t k = 0; k < 3; ++k) {
          const std::uint32_t a = t[k], b = end_of(t, k);
          if (a < b) {
            if (points.empty()) first = middle[k];
            // Middle of the cubic that is perpendicular to both normals (Vlachos et al. 2001, "Curved PN triangles").
            const Vec3 edge = mesh.position[b] - mesh.position[a];
            points.push_back(0.5 * (mesh.position[a] + mesh.position[b]) -
                             0.125 * (edge.dot(mesh.normal[a]) * mesh.normal[a] - edge.dot(mesh.normal[b]) * mesh.normal[b]));
          } else {
            std::uint32_t at = b == 0 ? 0 : scratch.start[b - 1];  // starts have moved to the ends
            while (scratch.target[at] != a) ++at;
            middle[k] = scratch.edge[at];
          }
        }
        scratch.triangle[4 * n] = {t[0], middle[0], middle[2]};
        scratch.triangle[4 * n + 1] = {middle[0], t[1], middle[1]};
        scratch.triangle[4 * n + 2] = {middle[2], middle[1], t[2]};
        scratch.triangle[4 * n + 3] = middle;
      }
      normals.resize(points.size());
      sampler.project(*tile.block, tile.tile, points, normals);
      std::copy(points.begin(), points.end(), mesh.position.begin() + static_cast<std::ptrdiff_t>(first));
      std::copy(normals.begin(), normals.end(), mesh.normal.begin() + static_cast<std::ptrdiff_t>(first));
    }
  });
  mesh.triangle.swap(scratch.triangle);
  for (TileTriangles& tile : scratch.tiles) {
    tile.first *= 4;
    tile.count *= 4;
  }
}

}  // namespace march

struct CubeMesher::Impl {
  blobs::BlobGrid grid;
  march::BlockTable table;
  march::MeshScratch scratch;
  Mesh mesh, refined;
  std::unique_ptr<march::Sampler> sampler;  ///< of the last mesh
  Lattice cell_lattice;
  double iso = 0.0;
  bool kept = false;  ///< table and mesh are those of the grid's last build

  const Mesh& march(const FieldView& field, const Lattice& lattice, bool skip, const Executor& executor, MarchCounts& counts);
  /// The last mesh, refined.
  const Mesh& refine(int refinements, const Executor& executor, MarchCounts& counts);
};

CubeMesher::CubeMesher() : impl_(std::make_unique<Impl>()) {}
CubeMesher::~CubeMesher() = default;
CubeMesher::CubeMesher(CubeMesher&&) noexcept = default;
CubeMesher& CubeMesher::operator=(CubeMesher&&) noexcept = default;

namespace {

/// Largest distance of the centroids to the surface.
double centroid_error(const FieldView& field, const Mesh& mesh, const Executor& executor) {
  constexpr std::size_t kBatch = 512;
  std::vector<double> largest((mesh.triangle_count() + kBatch - 1) / kBatch, 0.0);
  executor.for_blocks(mesh.triangle_count(), kBatch, [&](std::size_t begin, std::size_t end) {
    std::array<Vec3, kBatch> points, gradients;
    std::array<double, kBatch> values;
    const std::size_t n = end - begin;
    for (std::size_t i = 0; i < n; ++i) {
      const auto& t = mesh.triangle[begin + i];
      points[i] = (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0;
    }
    field.evaluate(std::span(points).first(n), std::span(values).first(n), std::span(gradients).first(n));
    for (std::size_t i = 0; i < n; ++i) {
      const double slope = gradients[i].norm();
      if (slope > 0.0) largest[begin / kBatch] = std::max(largest[begin / kBatch], std::abs(values[i]) / slope);
    }
  });
  return largest.empty() ? 0.0 : *std::max_element(largest.begin(), largest.end());
}

}  // namespace

const Mesh& CubeMesher::make(const FieldView& field, const MarchOptions& options, const Executor& executor,
                             MarchCounts* counts) {
  SUPPLE_EXPECTS(options.refinements >= 0 && options.refinements <= kMostRefinements && options.error >= 0.0);
  MarchCounts local;
  MarchCounts& count = counts != nullptr ? *counts : local;
  if (options.error == 0.0) {
    const Mesh& mesh = impl_->march(field, options.lattice, options.skip, executor, count);
    return options.refinements == 0 ? mesh : impl_->refine(options.refinements, executor, count);
  }
  constexpr int kRefinements = 2, kHalvings = 6;  // cells of 1/2 to 1/64 of the feature size
  Lattice lattice = options.lattice;
  lattice.cell = 0.5 * field.feature_size();
  double found = 0.0;
  for (int halving = 0; halving < kHalvings; ++halving, lattice.cell *= 0.5) {
    const Mesh& mesh = impl_->march(field, lattice, options.skip, executor, count);
    count.error = found = centroid_error(field, mesh, executor);
    if (found <= options.error) return mesh;
    if (found > std::pow(4.0, kRefinements) * options.error) continue;  // a refinement divides errors by four
    for (int level = 1; level <= kRefinements; ++level) {
      const Mesh& refined = impl_->refine(level, executor, count);
      count.error = found = centroid_error(field, refined, executor);
      if (found <= options.error) return refined;
    }
  }
  throw Error(ErrorKind::Limit, {.place = "",
                                 .key = "mesh.error",
                                 .expected = "expected an error of at most " + lattice::three_digits(options.error) + " m",
                                 .found = lattice::three_digits(found) + " m with cells of " +
                                          lattice::three_digits(2.0 * lattice.cell) + " m",
                                 .hint = "allow at least " + lattice::three_digits(1.05 * found) + " m"});
}

const Mesh& CubeMesher::Impl::march(const FieldView& field, const Lattice& lattice, bool skip, const Executor& executor,
                                    MarchCounts& counts) {
  const Field* points = field.as_field();
  const double level = points != nullptr ? points->packed().iso : 0.0;
  if (!kept || level != iso) grid.forget();
  kept = false;
  iso = level;
  sampler = march::make_sampler(field, lattice, skip, grid);
  sampler->prepare(executor, table);
  table.begin_call();
  sampler->sample(executor, table);
  march::assemble(table, *sampler, lattice, executor, scratch, mesh);
  kept = sampler->single_precision();
  cell_lattice = lattice;
  counts = {};
  counts.blocks = table.block.size();
  counts.single_precision = sampler->single_precision();
  counts.cell = lattice.cell;
  for (std::size_t b = 0; b < table.block.size(); ++b) {
    if (table.touched[b] == 0) continue;
    counts.tiles_sampled += static_cast<std::uint64_t>(std::popcount(table.block[b].changed));
    counts.kernel_values += table.block[b].kernel_values;
  }
  counts.tiles = table.held.tiles;
  counts.nodes = blobs::kTileNodes * counts.tiles;
  counts.bytes = table.held.bytes;
  counts.bytes += scratch.bytes() + grid.bytes();
  return mesh;
}

const Mesh& CubeMesher::Impl::refine(int refinements, const Executor& executor, MarchCounts& counts) {
  refined = mesh;
  march::list_tiles(table, scratch.tiles);
  for (int level = 0; level < refinements; ++level) {
    march::refine(*sampler, cell_lattice, executor, scratch, refined);
  }
  counts.refinements = refinements;
  return refined;
}

void CubeMesher::forget() { impl_->kept = false; }

Mesh march_cubes(const FieldView& field, const MarchOptions& options, const Executor& executor, MarchCounts* counts) {
  CubeMesher mesher;
  return mesher.make(field, options, executor, counts);
}

}  // namespace supple::implicit
