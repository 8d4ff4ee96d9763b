#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <vector>

#include "mesh/cubes/march_assemble.h"
#include "mesh/cubes/march_cases.h"

namespace supple::implicit::march {
namespace {

/// Tiles and those one step up in the block.
constexpr Bits with_next(Bits tiles) {
  tiles |= tiles << 1 & ~kFirstX;
  tiles |= tiles << 4 & ~kFirstY;
  return tiles | tiles << 16;
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
/// cell requires is small enough to stay in the nearest cache.
class LocalVertices {
 public:
  using Number = std::uint16_t;

  /// @param own     tiles of the block that are needed
  /// @param points  of all blocks
  void fill(const BlocksAbove& above, Bits own, const EdgePoint* points) {
    const Block& block = *above[0];
    fetch_ahead(points + block.first_point, block.vertices);
    const std::size_t most = block.vertices + kMostBeyond;
    if (point_.size() < most) {
      point_.resize(most);
      vertex_.resize(most);
    }
    for (const Tile& tile : block.tile) {
      if ((own >> tile.place & 1u) != 0) add_own(tile);
    }
    std::copy_n(points + block.first_point, block.vertices, point_.data());
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
  /// Of the mesh.
  [[nodiscard]] std::uint32_t vertex(Number number) const { return vertex_[number]; }

 private:
  /// Edges in the upper faces of a block.
  static constexpr std::size_t kMostBeyond = std::size_t{3} * 2 * kTableSide * kTableSide;

  void add_own(const Tile& tile) {
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

/// Where a corner of a loop lies in its cell, two bits for each coordinate: kRoot, or that of the edge.
constexpr std::uint32_t kOne = 1, kRoot = 2;
constexpr unsigned kCodeBits = 6;

/// A cell of one loop: the triangles of a fan are corners of the loop.
struct alignas(32) CellLoop {
  static constexpr std::size_t kMost = 7;
  std::array<std::uint16_t, kMost> corner{};  ///< places of its edges, again from the first on behind the last
  std::uint8_t size = 0;                      ///< 0: there are several loops
  std::uint8_t triangles = 0;
  std::uint32_t code = 0;                     ///< of the first five
  std::array<std::uint8_t, kMost> apex{};     ///< of the fan to be taken where corner k is requested
};

constexpr std::size_t first_apex(const Loop& loop) { return static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(loop.apices))); }

constexpr auto kLoop = [] {
  std::array<CellLoop, 256> cases{};
  for (std::size_t c = 0; c < cases.size(); ++c) {
    const Loop& loop = kCellLoops[c].loop[0];
    for (std::size_t l = 0; l < kCellLoops[c].loops; ++l) {
      cases[c].triangles = static_cast<std::uint8_t>(cases[c].triangles + kCellLoops[c].loop[l].size - 2);
    }
    for (std::size_t k = 0; k < CellLoop::kMost && loop.size > 0; ++k) {
      const std::uint8_t edge = loop.edge[k % loop.size];
      cases[c].corner[k] = static_cast<std::uint16_t>(kEdgePlace[edge]);
      cases[c].apex[k] = static_cast<std::uint8_t>((loop.apices >> k & 1) != 0 ? k : first_apex(loop));
      for (unsigned axis = 0; axis < 3 && k < 5; ++axis) {
        const std::uint32_t at = axis == kCellEdge[edge].axis ? kRoot : (kCellEdge[edge].corner >> axis & 1u) * kOne;
        cases[c].code |= at << (kCodeBits * k + 2 * axis);
      }
    }
    if (kCellLoops[c].loops == 1) cases[c].size = loop.size;
  }
  return cases;
}();

/// Numbers of a cell's triangles as they may be written, whole vectors at a time.
constexpr std::size_t kRoom = 16;
static_assert(kRoom >= 3 * kMostTriangles);

/// Corners of a loop in the triangles of its fan, by its size and apex.
constexpr auto kFan = [] {
  std::array<std::array<std::array<std::uint32_t, kRoom>, CellLoop::kMost>, CellLoop::kMost + 1> fans{};
  for (std::size_t size = 3; size < fans.size(); ++size) {
    for (std::size_t apex = 0; apex < size; ++apex) {
      for (std::size_t d = 1; d + 1 < size; ++d) {
        for (std::size_t k = 0; k < 3; ++k) {
          fans[size][apex][3 * (d - 1) + k] = static_cast<std::uint32_t>((apex + (k == 0 ? 0 : d + k - 1)) % size);
        }
      }
    }
  }
  return fans;
}();

/// Places of the edges of all triangles of a cell with several loops.
constexpr auto kSeveral = [] {
  std::array<std::array<std::uint16_t, 3 * kMostTriangles>, 256> cases{};
  for (std::size_t c = 0; c < cases.size(); ++c) {
    std::size_t n = 0;
    for (std::size_t l = 0; l < kCellLoops[c].loops && kCellLoops[c].loops > 1; ++l) {
      const Loop& loop = kCellLoops[c].loop[l];
      const std::size_t apex = first_apex(loop);
      for (std::size_t d = 1; d + 1 < loop.size; ++d) {
        for (const std::size_t k : {apex, apex + d, apex + d + 1}) {
          cases[c][n++] = static_cast<std::uint16_t>(kEdgePlace[loop.edge[k % loop.size]]);
        }
      }
    }
  }
  return cases;
}();

constexpr std::size_t kWide = 8;

/// Cells whose triangles are to be written, in their order.
struct Cells {
  using Loop = std::array<std::uint32_t, 8>;
  static constexpr std::size_t kMost = std::size_t{kBlockNodes} * kBlockNodes * kBlockNodes;
  std::array<std::array<LocalVertices::Number, 8>, kMost + kWide> number;  ///< of the corners of its loop
  alignas(32) std::array<Loop, kMost> vertex;                              ///< the same in the mesh
  alignas(32) std::array<std::uint32_t, kMost + kWide> code;
  std::array<const CellLoop*, kMost> loop;
  std::array<std::uint16_t, kMost> place;
  alignas(32) std::array<std::uint32_t, kMost + kWide> fan;                ///< the corner that is requested as its apex
  std::array<std::uint32_t, kMost + kWide> pentagon;                       ///< cells of five corners
  std::size_t count = 0, pentagons = 0;

  void clear() { count = pentagons = 0; }
  void add(std::uint8_t corners, std::size_t at, const LocalVertices& vertices) {
    const CellLoop& c = kLoop[corners];
    const LocalVertices::Number* from = vertices.from(static_cast<int>(at));
    const auto look_up = [&](std::size_t k) {
      number[count][k] = from[c.corner[k]];
      vertex[count][k] = vertices.vertex(from[c.corner[k]]);
    };
    for (std::size_t k = 0; k < 5; ++k) look_up(k);
    if (c.size > 5) {
      for (std::size_t k = 5; k < CellLoop::kMost; ++k) look_up(k);
    }
    loop[count] = &c;
    code[count] = c.code;
    place[count] = static_cast<std::uint16_t>(at);
    pentagon[pentagons] = static_cast<std::uint32_t>(count);
    pentagons += c.size == 5 ? 1 : 0;
    ++count;
  }
  /// Finds for each loop the fan whose chords lie closest to the surface.
  void choose_fans(const EdgePoint* points);
};

/// Corner k of eight loops in their cells, and its normal.
struct LoopCorners {
  __m256 place[3], normal[3];
  /// @param number  number(j): that of loop j
  template <class Number>
  LoopCorners(std::size_t k, __m256i code, const EdgePoint* points, const Number& number) {
    const auto load = [&](std::size_t j) { return _mm_load_ps(&points[number(j)].t); };
    const auto pair = [&](std::size_t j) { return _mm256_insertf128_ps(_mm256_castps128_ps256(load(j)), load(j + 4), 1); };
    const __m256 a = pair(0), b = pair(1), c = pair(2), d = pair(3);
    const __m256 low = _mm256_unpacklo_ps(a, b), high = _mm256_unpackhi_ps(a, b), low2 = _mm256_unpacklo_ps(c, d), high2 = _mm256_unpackhi_ps(c, d);
    const auto join = [](__m256 x, __m256 y, bool upper) {
      return upper ? _mm256_shuffle_ps(x, y, _MM_SHUFFLE(3, 2, 3, 2)) : _mm256_shuffle_ps(x, y, _MM_SHUFFLE(1, 0, 1, 0));
    };
    const __m256 t = join(low, low2, false);
    normal[0] = join(low, low2, true);
    normal[1] = join(high, high2, false);
    normal[2] = join(high, high2, true);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int root = 30 - static_cast<int>(kCodeBits * k + 2 * axis);  // takes its bit to the sign
      const __m256 at_one = _mm256_castsi256_ps(_mm256_srai_epi32(_mm256_slli_epi32(code, root + 1), 31));
      const __m256 at_root = _mm256_castsi256_ps(_mm256_slli_epi32(code, root));
      place[axis] = _mm256_blendv_ps(_mm256_and_ps(at_one, _mm256_set1_ps(1.0F)), t, at_root);
    }
  }
};

/// How far chords of the surface lie off it, times eight: |d . (n1 - n0)| for a chord d with the normals n at its ends; where the
/// surface is flat, the longer chord is the worse one.
__m256 bends(const LoopCorners& from, const LoopCorners& to) {
  constexpr float kFlat = 1e-3F;  // curvature [1 / cell]
  __m256 turn[3], length[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const __m256 along = _mm256_sub_ps(to.place[axis], from.place[axis]);
    turn[axis] = _mm256_mul_ps(along, _mm256_sub_ps(to.normal[axis], from.normal[axis]));
    length[axis] = _mm256_mul_ps(along, along);
  }
  const auto sum = [](const __m256 (&v)[3]) { return _mm256_add_ps(v[0], _mm256_add_ps(v[1], v[2])); };
  return _mm256_add_ps(_mm256_andnot_ps(_mm256_set1_ps(-0.0F), sum(turn)), _mm256_mul_ps(_mm256_set1_ps(kFlat), sum(length)));
}

void Cells::choose_fans(const EdgePoint* points) {
  for (std::size_t i = count; i < count + kWide; ++i) {
    number[i] = {};
    code[i] = 0;
  }
  // The two fans of four corners; for three corners any apex will do, and for more it is a start.
  for (std::size_t i = 0; i < count; i += kWide) {
    const __m256i codes = _mm256_load_si256(reinterpret_cast<const __m256i*>(&code[i]));
    const auto corner = [&](std::size_t k) { return LoopCorners(k, codes, points, [&](std::size_t j) { return number[i + j][k]; }); };
    const __m256 first = bends(corner(0), corner(2)), second = bends(corner(1), corner(3));
    const __m256i better = _mm256_castps_si256(_mm256_cmp_ps(second, first, _CMP_LT_OQ));
    _mm256_store_si256(reinterpret_cast<__m256i*>(&fan[i]), _mm256_srli_epi32(better, 31));
  }
  for (std::size_t i = pentagons; i < pentagons + kWide; ++i) pentagon[i] = static_cast<std::uint32_t>(count);
  for (std::size_t i = 0; i < pentagons; i += kWide) {
    const __m256i cells = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&pentagon[i]));
    const __m256i codes = _mm256_i32gather_epi32(reinterpret_cast<const int*>(code.data()), cells, 4);
    const auto corner = [&](std::size_t k) { return LoopCorners(k, codes, points, [&](std::size_t j) { return number[pentagon[i + j]][k]; }); };
    const std::array<LoopCorners, 5> c{corner(0), corner(1), corner(2), corner(3), corner(4)};
    __m256 chord[5];
    for (std::size_t k = 0; k < 5; ++k) chord[k] = bends(c[k], c[(k + 2) % 5]);
    __m256 least = _mm256_add_ps(chord[0], chord[3]);
    __m256i best = _mm256_setzero_si256();
    for (std::size_t k = 1; k < 5; ++k) {
      const __m256 sum = _mm256_add_ps(chord[k], chord[(k + 3) % 5]);
      const __m256 better = _mm256_cmp_ps(sum, least, _CMP_LT_OQ);
      least = _mm256_blendv_ps(least, sum, better);
      best = _mm256_blendv_epi8(best, _mm256_set1_epi32(static_cast<int>(k)), _mm256_castps_si256(better));
    }
    alignas(32) std::array<std::uint32_t, kWide> found;
    _mm256_store_si256(reinterpret_cast<__m256i*>(found.data()), best);
    for (std::size_t j = 0; j < kWide; ++j) fan[pentagon[i + j]] = found[j];
  }
}

}  // namespace

void emit_triangles(const BlockTable& table, const Block& block, const EdgePoint* points, Mesh& mesh) {
  if (block.emit == 0 || block.triangles == 0) return;
  thread_local std::vector<std::uint32_t> thread_found;
  thread_local LocalVertices vertices;
  thread_local Cells cells;
  vertices.fill(blocks_above(table, block), with_next(block.emit), points);
  cells.clear();
  for (const Tile& tile : block.tile) {
    if ((block.emit >> tile.place & 1u) == 0) continue;
    const std::uint8_t* corners = block.corners.data() + tile.first_cell;
    for_bits(tile.cells, [&](unsigned node) {
      cells.add(*corners++, static_cast<std::size_t>(kTilePlace[tile.place] + kNodePlace[node]), vertices);
    });
  }
  cells.choose_fans(vertices.points());
  thread_found.resize(std::size_t{3} * block.triangles + kRoom);
  std::size_t begin = 0, end = 0, i = 0;  // triangles that follow each other without a gap, the cell
  const auto place_run = [&] {
    if (begin == end) return;
    std::copy_n(thread_found.data() + 3 * begin, 3 * (end - begin), mesh.triangle[block.first_triangle + begin].data());
  };
  for (const Tile& tile : block.tile) {
    if ((block.emit >> tile.place & 1u) == 0) continue;
    if (tile.first_triangle != end) {
      place_run();
      begin = tile.first_triangle;
    }
    end = tile.first_triangle + std::size_t{tile.triangles};
    std::uint32_t* out = thread_found.data() + std::size_t{3} * tile.first_triangle;
    for (const std::size_t last = i + static_cast<std::size_t>(std::popcount(tile.cells)); i < last; ++i) {
      const CellLoop& c = *cells.loop[i];
      if (c.size == 0) {
        const LocalVertices::Number* from = vertices.from(cells.place[i]);
        const auto& places = kSeveral[static_cast<std::size_t>(&c - kLoop.data())];
        for (std::size_t k = 0; k < std::size_t{3} * c.triangles; ++k) out[k] = vertices.vertex(from[places[k]]);
      } else {
        const __m256i loop = _mm256_load_si256(reinterpret_cast<const __m256i*>(cells.vertex[i].data()));
        const auto* fan = reinterpret_cast<const __m256i*>(kFan[c.size][c.apex[cells.fan[i]]].data());
        for (std::size_t half = 0; half < 2; ++half) {
          _mm256_storeu_si256(reinterpret_cast<__m256i*>(out) + half, _mm256_permutevar8x32_epi32(loop, _mm256_loadu_si256(fan + half)));
        }
      }
      out += std::size_t{3} * c.triangles;
    }
  }
  place_run();
}

}  // namespace supple::implicit::march
