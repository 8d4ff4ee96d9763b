#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <vector>

#include "march_assemble.h"
#include "march_cases.h"

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

}  // namespace

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

}  // namespace supple::implicit::march
