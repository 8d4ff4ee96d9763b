#include "supple/implicit/polygonise.h"

#include <algorithm>
#include <cmath>

#include "mesh/partition/polygonise_block_edges.h"
#include "mesh/partition/polygonise_blocks.h"
#include "mesh/partition/polygonise_lattice.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace lattice {

void throw_missing_block(const BlockCoord& block) {
  throw Error(ErrorKind::Internal,
              {.place = "",
               .key = "surface",
               .expected = "expected a field whose bounds hold its values",
               .found = "a surface in block (" + std::to_string(block[0]) + ", " + std::to_string(block[1]) + ", " +
                        std::to_string(block[2]) + "), which its bounds exclude",
               .hint = "this is a fault of the field's bound() or surface_box()"});
}

void expect_indexable(std::uint64_t vertices, const Lattice& lattice) {
  constexpr auto kLargest = std::numeric_limits<std::uint32_t>::max();
  if (vertices <= kLargest) return;
  const double factor = std::sqrt(static_cast<double>(vertices) / kLargest);
  throw Error(ErrorKind::Limit, {.place = "",
                                 .key = "lattice.cell",
                                 .expected = "expected at most " + std::to_string(kLargest) + " vertices",
                                 .found = std::to_string(vertices),
                                 .hint = "use cells of at least " + three_digits(1.05 * factor * lattice.cell) + " m"});
}

}  // namespace lattice

namespace {

using namespace lattice;

/// Blocks of one task: enough work to hide the cost of a task, few enough to share among threads.
constexpr std::size_t kBlocksPerTask = 16;

/// All triangles of a cell by the signs of its corners (bit set: inside), between edges of kCellEdge.
struct CellCase {
  std::uint32_t edges = 0;  ///< set of the edges used
  std::uint8_t count = 0;
  std::array<std::array<std::uint8_t, 3>, 12> triangle{};
};

constexpr auto kCellCases = [] {
  std::array<CellCase, 256> cases{};
  for (unsigned corners = 0; corners < 256; ++corners) {
    CellCase& c = cases[corners];
    for (std::size_t t = 0; t < kTetrahedra.size(); ++t) {
      unsigned inside = 0;
      for (unsigned v = 0; v < 4; ++v) inside |= (corners >> kTetrahedra[t][v] & 1u) << v;
      const TetCase& tet = kTetCases[t][inside];
      for (std::size_t k = 0; k < tet.count; ++k) {
        for (std::size_t v = 0; v < 3; ++v) {
          const std::uint8_t edge = cell_edge(t, tet.triangle[k][v]);
          c.triangle[c.count][v] = edge;
          c.edges |= 1u << edge;
        }
        ++c.count;
      }
    }
  }
  return cases;
}();

/// A block that the surface crosses.
struct Crossed {
  BlockCoord coord{};
  std::array<std::uint16_t, kNodes * kNodes> inside{};  ///< bit x of row z * kNodes + y: node inside
  EdgeSet edges;
  std::uint32_t first_vertex = 0;    ///< of those the block owns; within its task, then in the mesh
  std::uint64_t first_triangle = 0;
  std::uint32_t triangles = 0;

  [[nodiscard]] unsigned row(int y, int z) const { return inside[static_cast<std::size_t>(z * kNodes + y)]; }
  /// Corner signs of cell (x, y, z), bit = corner.
  [[nodiscard]] unsigned corners(int x, int y, int z) const {
    return (row(y, z) >> x & 3u) | (row(y + 1, z) >> x & 3u) << 2 | (row(y, z + 1) >> x & 3u) << 4 |
           (row(y + 1, z + 1) >> x & 3u) << 6;
  }
};

struct TaskPart {
  std::vector<Crossed> crossed;
  std::vector<Vec3> position, normal;
  double residual = 0.0;
};

const BlockCoord& coord_of(const Crossed& block) { return block.coord; }

/// Calls use(x, y, z, corners) for the cells of a block that the surface crosses.
template <class Use>
void for_cells(const Crossed& block, const Use& use) {
  for (int z = 0; z < kCells; ++z) {
    for (int y = 0; y < kCells; ++y) {
      const unsigned r0 = block.row(y, z), r1 = block.row(y + 1, z), r2 = block.row(y, z + 1),
                     r3 = block.row(y + 1, z + 1);
      const unsigned any = r0 | r1 | r2 | r3, all = r0 & r1 & r2 & r3;
      for (unsigned cells = (any | any >> 1) & ~(all & all >> 1) & 0xffu; cells != 0; cells &= cells - 1) {
        const int x = std::countr_zero(cells);
        use(x, y, z, block.corners(x, y, z));
      }
    }
  }
}

/// Fills the signs and the edge set. @return false when the surface does not cross the block
bool mark(std::span<const double> values, Crossed& block) {
  unsigned any = 0, all = 0x1ff;
  for (std::size_t row = 0; row < block.inside.size(); ++row) {
    unsigned bits = 0;
    for (std::size_t x = 0; x < kNodes; ++x) bits |= static_cast<unsigned>(values[row * kNodes + x] > 0.0) << x;
    block.inside[row] = static_cast<std::uint16_t>(bits);
    any |= bits;
    all &= bits;
  }
  if (any == 0 || all == 0x1ff) return false;
  for (int z = 0; z < kCells; ++z) {
    for (int y = 0; y < kCells; ++y) {
      for (unsigned mask = 1; mask <= kDirections; ++mask) {
        const unsigned there = block.row(y + static_cast<int>(mask >> 1 & 1u), z + static_cast<int>(mask >> 2 & 1u));
        const unsigned differ = block.row(y, z) ^ there >> (mask & 1u);
        block.edges.set_row(EdgeSet::row_of(y, z, mask), static_cast<std::uint8_t>(differ & 0xffu));
      }
    }
  }
  return true;
}

/// Buffers of one task besides its result.
struct Workspace {
  std::array<Vec3, kBlockNodes> nodes;
  std::array<double, kBlockNodes> values{};
  EdgeRoots roots;
};

void take_block(const FieldView& field, const Lattice& lattice, const BlockCoord& coord, Workspace& work,
                TaskPart& part) {
  block_nodes(lattice, coord, work.nodes);
  field.evaluate(work.nodes, work.values);
  Crossed block;
  block.coord = coord;
  if (!mark(work.values, block)) return;
  block.first_vertex = static_cast<std::uint32_t>(part.position.size());
  block.edges.close();
  for_cells(block, [&](int, int, int, unsigned corners) { block.triangles += kCellCases[corners].count; });

  work.roots.clear();
  for_edges(block.edges, [&](int x, int y, int z, unsigned mask) {
    add_edge({x, y, z, mask}, work.nodes, [&](int node) { return work.values[static_cast<std::size_t>(node)]; },
             work.roots);
  });
  double scale = 0.0;
  for (const double f : work.values) scale = std::max(scale, std::abs(f));
  work.roots.solve(field, {}, scale);
  std::size_t i = 0;
  for_edges(block.edges, [&](int x, int y, int z, unsigned mask) {
    const bool start_inside = (block.row(y, z) >> x & 1u) != 0;
    const auto node = static_cast<std::size_t>(node_index(x, y, z));
    const Vec3 along = work.nodes[node + static_cast<std::size_t>(node_stride(mask))] - work.nodes[node];
    part.position.push_back(work.roots.point(i));
    part.normal.push_back(outward(work.roots.gradient(i), start_inside ? along : Vec3(-along)));
    part.residual = std::max(part.residual, std::abs(work.roots.value(i)));
    ++i;
  });
  part.crossed.push_back(block);
}

/// Triangles of a block; their vertices may belong to its upper neighbours.
void emit_triangles(std::span<const Crossed> blocks, std::size_t self, Mesh& mesh) {
  const Crossed& block = blocks[self];
  const auto neighbour = upper_neighbours(blocks, self, coord_of);
  auto* out = mesh.triangle.data() + block.first_triangle;
  for_cells(block, [&](int x, int y, int z, unsigned corners) {
    const CellCase& c = kCellCases[corners];
    std::array<std::uint32_t, kCellEdges> vertex;
    for (std::uint32_t edges = c.edges; edges != 0; edges &= edges - 1) {
      const auto e = static_cast<std::size_t>(std::countr_zero(edges));
      const auto [corner, mask] = kCellEdge[e];
      const OwnedNode node(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2));
      const std::int64_t at = neighbour[node.neighbour];
      const std::size_t row = EdgeSet::row_of(node.y, node.z, mask);
      if (at < 0 || !blocks[static_cast<std::size_t>(at)].edges.contains(row, node.x)) {
        BlockCoord missing = block.coord;
        for (std::size_t k = 0; k < 3; ++k) missing[k] += static_cast<std::int32_t>(node.neighbour >> k & 1u);
        throw_missing_block(missing);
      }
      const Crossed& owner = blocks[static_cast<std::size_t>(at)];
      vertex[e] = owner.first_vertex + owner.edges.rank(row, node.x);
    }
    for (std::size_t k = 0; k < c.count; ++k) {
      *out++ = {vertex[c.triangle[k][0]], vertex[c.triangle[k][1]], vertex[c.triangle[k][2]]};
    }
  });
}

}  // namespace

Mesh polygonise(const FieldView& field, const Lattice& lattice, const Executor& executor, PolygoniseCounts* counts) {
  PolygoniseCounts local;
  PolygoniseCounts& count = counts != nullptr ? *counts : local;
  const std::vector<BlockCoord> coords = find_surface_blocks(field, lattice, executor, kMostBlocks, &count);

  std::vector<TaskPart> parts((coords.size() + kBlocksPerTask - 1) / kBlocksPerTask);
  executor.for_blocks(coords.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
    Workspace work;
    for (std::size_t i = begin; i < end; ++i) {
      take_block(field, lattice, coords[i], work, parts[begin / kBlocksPerTask]);
    }
  });

  std::vector<Crossed> blocks;
  std::vector<std::uint64_t> first_vertex(parts.size());
  std::uint64_t vertices = 0, triangles = 0;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    first_vertex[p] = vertices;
    for (Crossed& block : parts[p].crossed) {
      block.first_vertex += static_cast<std::uint32_t>(vertices);
      block.first_triangle = triangles;
      triangles += block.triangles;
      blocks.push_back(block);
    }
    vertices += parts[p].position.size();
    count.residual = std::max(count.residual, parts[p].residual);
    expect_indexable(vertices, lattice);
  }
  count.nodes = std::uint64_t{kBlockNodes} * coords.size();

  Mesh mesh;
  mesh.position.resize(vertices);
  mesh.normal.resize(vertices);
  mesh.triangle.resize(triangles);
  executor.for_blocks(parts.size(), 1, [&](std::size_t p, std::size_t) {
    const auto at = static_cast<std::ptrdiff_t>(first_vertex[p]);
    std::copy(parts[p].position.begin(), parts[p].position.end(), mesh.position.begin() + at);
    std::copy(parts[p].normal.begin(), parts[p].normal.end(), mesh.normal.begin() + at);
    parts[p] = {};
  });
  executor.for_blocks(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) emit_triangles(blocks, i, mesh);
  });
  return mesh;
}

}  // namespace supple::implicit
