#include "supple/implicit/march_cubes.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
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

/// A block and the seven above it, by the steps along x, y, z in bits; null where there is none.
using BlocksAbove = std::array<const Block*, 8>;
BlocksAbove blocks_above(const BlockTable& table, const Block& block) {
  BlocksAbove above{&block};
  for (unsigned step = 1; step < 8; ++step) {
    above[step] = table.find({block.coord[0] + static_cast<std::int32_t>(step & 1u),
                              block.coord[1] + static_cast<std::int32_t>(step >> 1 & 1u),
                              block.coord[2] + static_cast<std::int32_t>(step >> 2)});
  }
  return above;
}

/// A leaf and its upper neighbours as the marching of its cells sees them.
class Neighbourhood {
 public:
  Neighbourhood(const BlocksAbove& above, unsigned slot) {
    for (unsigned step = 0; step < 8; ++step) {
      const Block* owner = above[slot & step];
      const unsigned there = slot ^ step;
      const std::int8_t index = owner == nullptr ? kOutside : owner->leaf_of[there];
      if (owner != nullptr && (owner->changed >> there & 1u) != 0) changed_ = true;
      leaf_[step] = index >= 0 ? &owner->leaf[static_cast<std::size_t>(index)] : nullptr;
      whole_[step] = index == kInside ? ~Plane{0} : Plane{0};
    }
  }
  [[nodiscard]] const Leaf* leaf(unsigned step) const { return leaf_[step]; }
  /// Whether any of them was sampled anew.
  [[nodiscard]] bool changed() const { return changed_; }

  /// Signs of the 8 x 8 nodes that lie `step` (bits x, y) away from those of this leaf in plane z, 0..8.
  [[nodiscard]] Plane plane(unsigned step, int z) const {
    const unsigned up = z == kLeafNodes ? 4u : 0u;
    const int at = z % kLeafNodes;
    const auto signs = [&](unsigned s) {
      return leaf_[s | up] != nullptr ? leaf_[s | up]->inside[static_cast<std::size_t>(at)] : whole_[s | up];
    };
    constexpr Plane kFirstX = 0x0101010101010101, kFirstY = 0xff;
    const auto shifted_x = [&](Plane own, Plane next) { return (own >> 1 & ~(kFirstX << 7)) | (next & kFirstX) << 7; };
    const auto shifted_y = [&](Plane own, Plane next) { return own >> 8 | (next & kFirstY) << 56; };
    switch (step) {
      case 0: return signs(0);
      case 1: return shifted_x(signs(0), signs(1));
      case 2: return shifted_y(signs(0), signs(2));
      default: return shifted_y(shifted_x(signs(0), signs(1)), shifted_x(signs(2), signs(3)));
    }
  }

 private:
  std::array<const Leaf*, 8> leaf_{};
  std::array<Plane, 8> whole_{};
  bool changed_ = false;
};

/// Four bits for each node of a plane: its own sign and those one step along x, y and both; 16 nodes a word.
struct SquareSigns {
  std::array<std::uint64_t, 4> word;
  explicit SquareSigns(const std::array<Plane, 4>& step) {
    for (unsigned w = 0; w < 4; ++w) {
      word[w] = 0;
      for (unsigned s = 0; s < 4; ++s) {
        word[w] |= _pdep_u64(step[s] >> (16 * w) & 0xffffu, std::uint64_t{0x1111111111111111} << s);
      }
    }
  }
  [[nodiscard]] unsigned operator[](int bit) const {
    return static_cast<unsigned>(word[static_cast<std::size_t>(bit >> 4)] >> (4 * (bit & 15)) & 0xfu);
  }
};

constexpr auto kTriangles = [] {
  std::array<std::uint8_t, 256> count{};
  for (std::size_t c = 0; c < 256; ++c) {
    for (std::size_t l = 0; l < kCellLoops[c].loops; ++l) {
      count[c] = static_cast<std::uint8_t>(count[c] + kCellLoops[c].loop[l].size - 2);
    }
  }
  return count;
}();

/// Marks the edges and cells that the surface crosses and counts what a leaf will hold.
void count_leaf(const Neighbourhood& around, Leaf& leaf, std::vector<std::uint8_t>& corners) {
  const auto planes_at = [&](int z) {
    return std::array{around.plane(0, z), around.plane(1, z), around.plane(2, z), around.plane(3, z)};
  };
  std::array<Plane, 4> here, above = planes_at(0);
  SquareSigns low(above), high = low;
  std::array<std::uint8_t, 64 * kLeafNodes> inside;
  for (int z = 0; z < kLeafNodes; ++z) {
    here = above;
    low = high;
    above = planes_at(z + 1);
    high = SquareSigns(above);
    const auto at = static_cast<std::size_t>(z);
    leaf.edges[3 * at] = here[0] ^ here[1];
    leaf.edges[3 * at + 1] = here[0] ^ here[2];
    leaf.edges[3 * at + 2] = here[0] ^ above[0];
    const Plane any = here[0] | here[1] | here[2] | here[3] | above[0] | above[1] | above[2] | above[3];
    const Plane all = here[0] & here[1] & here[2] & here[3] & above[0] & above[1] & above[2] & above[3];
    leaf.cells[at] = any & ~all;
    for (Plane cells = leaf.cells[at]; cells != 0; cells &= cells - 1) {
      const int bit = std::countr_zero(cells);
      inside[64 * at + static_cast<std::size_t>(bit)] = static_cast<std::uint8_t>(low[bit] | high[bit] << 4);
    }
  }
  const std::size_t before = corners.size();
  corners.resize(before + inside.size());
  std::uint8_t* out = corners.data() + before;
  for (unsigned tile = 0; tile < 8; ++tile) {
    const Plane own = tile_plane(tile);
    const auto first = static_cast<std::size_t>(3 * blobs::kTile) * (tile >> 2);
    leaf.tile_vertex[tile] = static_cast<std::uint16_t>(leaf.vertices);
    for (std::size_t plane = first; plane < first + 3 * blobs::kTile; ++plane) {
      leaf.vertices += static_cast<std::uint32_t>(std::popcount(leaf.edges[plane] & own));
    }
    leaf.tile_triangle[tile] = static_cast<std::uint16_t>(leaf.triangles);
    for_tile_cells(leaf, tile, [&](int bit, int z) {
      *out = inside[static_cast<std::size_t>(64 * z + bit)];
      leaf.triangles += kTriangles[*out++];
    });
  }
  leaf.tile_vertex[8] = static_cast<std::uint16_t>(leaf.vertices);
  leaf.tile_triangle[8] = static_cast<std::uint16_t>(leaf.triangles);
  corners.resize(static_cast<std::size_t>(out - corners.data()));
}

/// Counts the leaves of a block and finds those whose vertices change.
void count_block(const BlockTable& table, Block& block) {
  const BlocksAbove above = blocks_above(table, block);
  block.touched = std::any_of(above.begin(), above.end(), [](const Block* b) { return b != nullptr && b->changed != 0; });
  if (!block.touched) {
    for (Leaf& leaf : block.leaf) leaf.solve = leaf.emit = false;
    return;
  }
  thread_local std::vector<std::uint8_t> last;
  last.swap(block.corners);
  block.corners.clear();
  for (Leaf& leaf : block.leaf) {
    const Neighbourhood around(above, leaf.slot);
    leaf.solve = around.changed();
    const auto first = last.begin() + leaf.first_cell;
    leaf.first_cell = static_cast<std::uint32_t>(block.corners.size());
    if (!leaf.solve) {
      std::ptrdiff_t cells = 0;
      for (const Plane plane : leaf.cells) cells += std::popcount(plane);
      block.corners.insert(block.corners.end(), first, first + cells);
      continue;
    }
    leaf.vertices = leaf.triangles = 0;
    count_leaf(around, leaf, block.corners);
  }
}

/// Triangles follow the vertices of a leaf and its upper neighbours.
void mark_triangles(const BlockTable& table, Block& block) {
  if (!block.touched) return;
  const BlocksAbove above = blocks_above(table, block);
  for (Leaf& leaf : block.leaf) {
    const Neighbourhood around(above, leaf.slot);
    leaf.emit = around.changed();
    for (unsigned step = 0; step < 8; ++step) {
      leaf.emit = leaf.emit || (around.leaf(step) != nullptr && around.leaf(step)->solve);
    }
  }
}

/// Vertices on the edges of a leaf's cells, by the edge's lower node within the leaf (0..8) and its axis.
class VertexTable {
 public:
  static constexpr int kSide = kLeafNodes + 1;
  static constexpr int kAxis = kSide * kSide * kSide;
  [[nodiscard]] static constexpr int place(int x, int y, int z) { return (z * kSide + y) * kSide + x; }

  void fill(const Neighbourhood& around) {
    const Leaf& own = *around.leaf(0);
    std::uint32_t vertex = first_of(around, 0);
    for (unsigned tile = 0; tile < 8; ++tile) {
      for_tile_edges(own, tile, [&](int bit, int z, int axis) { set(bit & 7, bit >> 3, z, axis, vertex++); });
    }
    for (unsigned step = 1; step < 7; ++step) add_beyond(around, step);
  }
  [[nodiscard]] std::uint32_t operator[](int at) const { return vertex_[static_cast<std::size_t>(at)]; }

 private:
  static std::uint32_t first_of(const Neighbourhood& around, unsigned step) {
    return static_cast<std::uint32_t>(around.leaf(step)->first_vertex);
  }
  void set(int x, int y, int z, int axis, std::uint32_t vertex) {
    vertex_[static_cast<std::size_t>(axis * kAxis + place(x, y, z))] = vertex;
  }
  /// Those of the leaf one step up that lie on this leaf's upper faces.
  void add_beyond(const Neighbourhood& around, unsigned step) {
    const Leaf* leaf = around.leaf(step);
    if (leaf == nullptr) return;
    constexpr Plane kFirstX = 0x0101010101010101, kFirstY = 0xff;
    const Plane face = ((step & 1u) != 0 ? kFirstX : ~Plane{0}) & ((step & 2u) != 0 ? kFirstY : ~Plane{0});
    const int x0 = kLeafNodes * static_cast<int>(step & 1u), y0 = kLeafNodes * static_cast<int>(step >> 1 & 1u),
              z0 = kLeafNodes * static_cast<int>(step >> 2);
    for (unsigned tile = 0; tile < 8; ++tile) {
      if ((tile & step) != 0) continue;
      std::uint32_t vertex = first_of(around, step) + leaf->tile_vertex[tile];
      const Plane own = tile_plane(tile);
      const int low = blobs::kTile * static_cast<int>(tile >> 2);
      for (int z = low; z < ((step & 4u) != 0 ? 1 : low + blobs::kTile); ++z) {
        for (int axis = 0; axis < 3; ++axis) {
          const Plane edges = leaf->edges[static_cast<std::size_t>(3 * z + axis)] & own;
          if ((step >> axis & 1u) == 0) {
            for (Plane left = edges & face; left != 0; left &= left - 1) {
              const int bit = std::countr_zero(left);
              set(x0 + (bit & 7), y0 + (bit >> 3), z0 + z, axis,
                  vertex + static_cast<std::uint32_t>(std::popcount(edges & ((Plane{1} << bit) - 1))));
            }
          }
          vertex += static_cast<std::uint32_t>(std::popcount(edges));
        }
      }
    }
  }
  std::array<std::uint32_t, 3 * kAxis> vertex_;
};

/// From the place of a cell to that of its edges.
constexpr auto kEdgePlace = [] {
  std::array<int, kCellEdges> places{};
  for (std::size_t e = 0; e < kCellEdges; ++e) {
    const auto [corner, axis] = kCellEdge[e];
    places[e] = axis * VertexTable::kAxis + VertexTable::place(corner & 1, corner >> 1 & 1, corner >> 2);
  }
  return places;
}();

/// The triangles of a cell as places of their edges. A cell whose only loop has four vertices has a choice of diagonals.
struct CellTriangles {
  std::uint8_t count = 0;
  bool choice = false;
  std::array<std::array<std::uint16_t, 3 * kMostTriangles>, 2> place{};  ///< with both diagonals
  std::array<std::uint16_t, 4> corner{};                                 ///< the four vertices
  std::array<float, 4> start{}, sense{};  ///< t from the same end on all four: start + sense t
  float product = 0.0F;                   ///< 1: the four edges are parallel
};

constexpr CellTriangles make_triangles(const CellLoops& loops) {
  CellTriangles result;
  for (std::size_t variant = 0; variant < 2; ++variant) {
    std::size_t n = 0;
    for (std::size_t l = 0; l < loops.loops; ++l) {
      const Loop& loop = loops.loop[l];
      std::size_t apex = static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(loop.apices)));
      if (loop.size == 4) apex = variant;
      for (std::size_t d = 1; d + 1 < loop.size; ++d) {
        for (const std::size_t k : {apex, apex + d, apex + d + 1}) {
          result.place[variant][n++] = static_cast<std::uint16_t>(kEdgePlace[loop.edge[k % loop.size]]);
        }
      }
    }
    result.count = static_cast<std::uint8_t>(n / 3);
  }
  if (loops.loops != 1 || loops.loop[0].size != 4) return result;
  result.choice = true;
  const Loop& loop = loops.loop[0];
  // The vertices lie on four parallel edges, or on two pairs that leave one edge of the cell at its ends.
  const bool parallel = kCellEdge[loop.edge[0]].axis == kCellEdge[loop.edge[1]].axis &&
                        kCellEdge[loop.edge[1]].axis == kCellEdge[loop.edge[2]].axis;
  result.product = parallel ? 1.0F : 0.0F;
  for (std::size_t k = 0; k < 4; ++k) {
    const CellEdge edge = kCellEdge[loop.edge[k]];
    // The other axis of the two pairs: the common edge lies at the end that both axes share.
    bool far = false;
    if (!parallel) {
      for (std::size_t m = 0; m < 4; ++m) {
        const CellEdge other = kCellEdge[loop.edge[m]];
        if (other.axis != edge.axis) far = (other.corner >> edge.axis & 1u) != 0;
      }
    }
    result.corner[k] = static_cast<std::uint16_t>(kEdgePlace[loop.edge[k]]);
    result.start[k] = far ? 1.0F : 0.0F;
    result.sense[k] = far ? -1.0F : 1.0F;
  }
  return result;
}

constexpr auto kCellTriangles = [] {
  std::array<CellTriangles, 256> cases{};
  for (std::size_t c = 0; c < 256; ++c) cases[c] = make_triangles(kCellLoops[c]);
  return cases;
}();

/// Whether the second diagonal of a cell's only loop is the shorter one.
bool second_diagonal(const CellTriangles& c, const VertexTable& table, int cell, const float* along) {
  std::array<float, 4> t;
  for (std::size_t k = 0; k < 4; ++k) t[k] = c.start[k] + c.sense[k] * along[table[cell + c.corner[k]]];
  // Squared lengths up to what both have in common.
  const float first = t[0] * t[0] + t[2] * t[2] - 2.0F * c.product * t[0] * t[2];
  const float second = t[1] * t[1] + t[3] * t[3] - 2.0F * c.product * t[1] * t[3];
  return second < first;
}

/// The edges of a leaf's cells that belong to leaves without values are free of surface, or a bound was wrong.
void expect_owned(const Neighbourhood& around, const BlockCoord& block) {
  constexpr Plane kLastX = 0x8080808080808080, kLastY = Plane{0xff} << 56;
  for (unsigned step = 1; step < 8; ++step) {
    if (around.leaf(step) != nullptr) continue;
    const Plane cells = ((step & 1u) != 0 ? kLastX : ~Plane{0}) & ((step & 2u) != 0 ? kLastY : ~Plane{0});
    for (int z = (step & 4u) != 0 ? kLeafNodes - 1 : 0; z < kLeafNodes; ++z) {
      for (unsigned axis = 0; axis < 3; ++axis) {
        if ((step >> axis & 1u) != 0) continue;
        const auto plane = [&](unsigned corner) { return around.plane(corner & 3u, z + static_cast<int>(corner >> 2)); };
        if (((plane(step) ^ plane(step | 1u << axis)) & cells) != 0) lattice::throw_missing_block(block);
      }
    }
  }
}

std::uint32_t shift_of(const Leaf& leaf) { return static_cast<std::uint32_t>(leaf.first_vertex - leaf.old_vertex); }

/// Vertices of the last call that move by `more` further than those of the triangles' own leaf.
struct Further {
  std::uint32_t first, count, more;
};

/// Triangles that stay: only the numbers of their vertices move, by their own leaf's shift or as `further` says.
void renumber(std::span<std::uint32_t> vertex, std::uint32_t own, std::span<const Further> further) {
  if (further.empty()) {
    if (own == 0) return;
    for (std::uint32_t& v : vertex) v += own;
    return;
  }
  thread_local std::vector<std::uint32_t> shift;
  shift.assign(vertex.size(), own);
  for (const Further& f : further) {
    for (std::size_t i = 0; i < vertex.size(); ++i) shift[i] += vertex[i] - f.first < f.count ? f.more : 0;
  }
  for (std::size_t i = 0; i < vertex.size(); ++i) vertex[i] += shift[i];
}

/// A leaf's, or those of leaves that follow each other.
std::span<std::uint32_t> vertices_of(const Leaf& first, const Leaf& last, Mesh& mesh) {
  const std::size_t count = last.first_triangle + last.triangles - first.first_triangle;
  if (count == 0) return {};
  return {mesh.triangle.data()->data() + 3 * first.first_triangle, 3 * count};
}

void renumber_leaf(const Neighbourhood& around, const Leaf& leaf, Mesh& mesh) {
  std::array<Further, 7> further;
  std::size_t n = 0;
  for (unsigned step = 1; step < 8; ++step) {
    const Leaf* other = around.leaf(step);
    if (other == nullptr || other->vertices == 0 || shift_of(*other) == shift_of(leaf)) continue;
    further[n++] = {static_cast<std::uint32_t>(other->old_vertex), other->vertices, shift_of(*other) - shift_of(leaf)};
  }
  renumber(vertices_of(leaf, leaf, mesh), shift_of(leaf), std::span(further).first(n));
}

/// The same for a block where all leaves stay; they move alike.
void renumber_block(const BlockTable& table, const Block& block, Mesh& mesh) {
  const std::uint32_t own = shift_of(block.leaf.front());
  std::array<Further, 7 * 8> further;
  std::size_t n = 0;
  for (const Block* above : blocks_above(table, block)) {
    if (above == nullptr || above == &block) continue;
    for (const Leaf& leaf : above->leaf) {
      if (leaf.solve || leaf.vertices == 0 || shift_of(leaf) == own) continue;
      const auto first = static_cast<std::uint32_t>(leaf.old_vertex);
      const std::uint32_t more = shift_of(leaf) - own;
      if (n > 0 && further[n - 1].first + further[n - 1].count == first && further[n - 1].more == more) {
        further[n - 1].count += leaf.vertices;
      } else {
        further[n++] = {first, leaf.vertices, more};
      }
    }
  }
  renumber(vertices_of(block.leaf.front(), block.leaf.back(), mesh), own, std::span(further).first(n));
}

void emit_triangles(const BlockTable& table, const Block& block, const std::vector<float>& along, Mesh& mesh) {
  if (!block.touched) {
    renumber_block(table, block, mesh);
    return;
  }
  thread_local VertexTable vertices;
  thread_local std::array<std::array<std::uint32_t, 3>, (512 + 1) * kMostTriangles> found;
  const BlocksAbove above = blocks_above(table, block);
  for (const Leaf& leaf : block.leaf) {
    if (leaf.triangles == 0) continue;
    const Neighbourhood around(above, leaf.slot);
    if (!leaf.emit) {
      renumber_leaf(around, leaf, mesh);
      continue;
    }
    expect_owned(around, block.coord);
    vertices.fill(around);
    std::array<std::uint32_t, 3>* out = found.data();
    const std::uint8_t* corners = block.corners.data() + leaf.first_cell;
    for (unsigned tile = 0; tile < 8; ++tile) {
      for_tile_cells(leaf, tile, [&](int bit, int z) {
        const CellTriangles& c = kCellTriangles[*corners++];
        const int cell = VertexTable::place(bit & 7, bit >> 3, z);
        const auto& place = c.place[c.choice && second_diagonal(c, vertices, cell, along.data()) ? 1 : 0];
        // All that a cell can have, whatever it has: cheaper than a branch that cannot be foreseen.
        for (std::size_t k = 0; k < kMostTriangles; ++k) {
          out[k] = {vertices[cell + place[3 * k]], vertices[cell + place[3 * k + 1]], vertices[cell + place[3 * k + 2]]};
        }
        out += c.count;
      });
    }
    std::copy(found.data(), out, mesh.triangle.data() + leaf.first_triangle);
  }
}

}  // namespace

namespace {

/// A run of numbers that moves as a whole.
struct Run {
  std::size_t from, to, count;
};

void add_run(std::vector<Run>& runs, std::size_t from, std::size_t to, std::size_t count) {
  if (!runs.empty()) {
    Run& last = runs.back();
    if (last.from + last.count == from && last.to + last.count == to) {
      last.count += count;
      return;
    }
  }
  runs.push_back({from, to, count});
}

/// Moves runs in place: those that move down in rising order, then those that move up in falling order, so that nothing
/// is overwritten before it has moved.
template <class Item>
void move_runs(const std::vector<Run>& runs, std::size_t count, std::vector<Item>& items) {
  if (items.size() < count) items.resize(count);
  const auto move = [&](const Run& run) {
    std::memmove(static_cast<void*>(items.data() + run.to), items.data() + run.from, run.count * sizeof(Item));
  };
  for (const Run& run : runs) {
    if (run.to < run.from) move(run);
  }
  for (auto run = runs.rbegin(); run != runs.rend(); ++run) {
    if (run->to > run->from) move(*run);
  }
  items.resize(count);
}

}  // namespace

void assemble(BlockTable& table, const Sampler& sampler, const Lattice& lattice, const Executor& executor,
              MeshScratch& scratch, Mesh& mesh) {
  std::vector<std::uint32_t> blocks;
  for (std::size_t b = 0; b < table.block.size(); ++b) {
    if (!table.block[b].uniform()) blocks.push_back(static_cast<std::uint32_t>(b));
  }
  const auto for_each_block = [&](const auto& use) {
    executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) use(table.block[blocks[i]]);
    });
  };
  for_each_block([&](Block& block) { count_block(table, block); });
  for_each_block([&](Block& block) { mark_triangles(table, block); });
  std::size_t vertices = 0, triangles = 0;
  std::vector<Run> same_vertices, same_triangles;
  for (const std::uint32_t b : blocks) {
    for (Leaf& leaf : table.block[b].leaf) {
      leaf.old_vertex = std::exchange(leaf.first_vertex, vertices);
      leaf.old_triangle = std::exchange(leaf.first_triangle, triangles);
      vertices += leaf.vertices;
      triangles += leaf.triangles;
      if (!leaf.solve) add_run(same_vertices, leaf.old_vertex, leaf.first_vertex, leaf.vertices);
      if (!leaf.emit) add_run(same_triangles, leaf.old_triangle, leaf.first_triangle, leaf.triangles);
    }
  }
  lattice::expect_indexable(vertices, lattice);
  mesh.columns.clear();
  move_runs(same_vertices, vertices, mesh.position);
  move_runs(same_vertices, vertices, mesh.normal);
  move_runs(same_vertices, vertices, scratch.along);
  move_runs(same_triangles, triangles, mesh.triangle);
  for_each_block([&](Block& block) {
    if (block.touched) sampler.solve(table, block, mesh, scratch.along);
  });
  for_each_block([&](const Block& block) { emit_triangles(table, block, scratch.along, mesh); });
}

void list_tiles(const BlockTable& table, std::vector<TileTriangles>& tiles) {
  tiles.clear();
  for (const Block& block : table.block) {
    for (const Leaf& leaf : block.leaf) {
      for (unsigned tile = 0; tile < 8; ++tile) {
        const std::size_t count = leaf.tile_triangle[tile + 1] - std::size_t{leaf.tile_triangle[tile]};
        if (count > 0) tiles.push_back({&block, &leaf, tile, leaf.first_triangle + leaf.tile_triangle[tile], count});
      }
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
      sampler.project(*tile.block, *tile.leaf, tile.tile, points, normals);
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
  sampler->sample(executor, table);
  march::assemble(table, *sampler, lattice, executor, scratch, mesh);
  kept = sampler->single_precision();
  cell_lattice = lattice;
  counts = {};
  counts.blocks = table.block.size();
  counts.single_precision = sampler->single_precision();
  counts.cell = lattice.cell;
  for (const march::Block& block : table.block) {
    counts.leaves += block.leaf.size();
    counts.leaves_sampled += static_cast<std::uint64_t>(std::popcount(block.changed));
    counts.nodes += block.values.size();
    counts.kernel_values += block.kernel_values;
    counts.bytes += sizeof(march::Block) + block.leaf.capacity() * sizeof(march::Leaf) +
                    block.values.capacity() * sizeof(float) + block.corners.capacity();
  }
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
