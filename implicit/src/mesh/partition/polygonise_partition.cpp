// Interfaces between labels are made once, as triangles between two labels, and given to both bodies. A tetrahedron with
// two labels is cut as for one body. With three or four labels, its faces are divided around their face points and the
// interfaces are the cones over those segments from an interior point: faces of a subdivision of the tetrahedron, so
// they cannot intersect. A tetrahedron with two labels in which these interfaces meet two others is divided in
// the same way.

#include "mesh/partition/polygonise_partition.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "mesh/partition/partition_keep.h"
#include "mesh/partition/polygonise_block_edges.h"
#include "supple/core/error.h"
#include "supple/implicit/partition_mesher.h"

namespace supple::implicit {
namespace {

using namespace lattice;

constexpr std::size_t kBlocksPerTask = 16;

/// The corner opposite the face that holds two edges of a tetrahedron, or none.
constexpr auto kFaceOfEdges = [] {
  std::array<std::array<unsigned, 6>, 6> faces{};
  for (std::size_t d = 0; d < 6; ++d) {
    for (std::size_t e = 0; e < 6; ++e) {
      unsigned corners = 0;
      for (const std::uint8_t corner : {kTetEdges[d][0], kTetEdges[d][1], kTetEdges[e][0], kTetEdges[e][1]}) corners |= 1u << corner;
      faces[d][e] = std::popcount(corners) == 3 ? static_cast<unsigned>(std::countr_one(corners)) : Facet::kInside;
    }
  }
  return faces;
}();

BodyCount& count_of(std::vector<BodyCount>& counts, std::uint32_t body) {
  for (BodyCount& c : counts) {
    if (c.body == body) return c;
  }
  return counts.emplace_back(BodyCount{.body = body});
}

const BlockCoord& coord_of(const LabelledBlock* block) { return block->coord; }

/// Writes the facets of one block.
class FacetMaker {
 public:
  FacetMaker(std::span<const LabelledBlock* const> blocks, std::size_t self, std::span<const std::uint8_t> has_mesh,
             std::vector<Facet>& out)
      : blocks_(blocks), block_(*blocks[self]), has_mesh_(has_mesh),
        neighbour_(upper_neighbours(blocks, self, coord_of)), out_(out),
        next_interior_(block_.first_vertex + block_.edge_count + static_cast<std::uint32_t>(block_.face_key.size())) {}

  void run() {
    for_all_cells([&](const Cell& cell) {
      const Label first = block_.label[cell.node(0)];
      bool uniform = true;
      for (unsigned corner = 1; corner < 8 && uniform; ++corner) uniform = block_.label[cell.node(corner)] == first;
      if (uniform) return;
      for (std::size_t t = 0; t < kTetrahedra.size(); ++t) cut(cell, t);
    });
  }

 private:
  void cut(const Cell& cell, std::size_t t) {
    std::array<Label, 4> label{};
    LabelSet labels;
    for (std::size_t v = 0; v < 4; ++v) {
      label[v] = block_.label[cell.node(kTetrahedra[t][v])];
      labels.insert(label[v]);
    }
    if (labels.count == 1) return;
    if (labels.count > 2 || std::binary_search(block_.lone_key.begin(), block_.lone_key.end(), tetrahedron_key(cell, t))) {
      cone(cell, t, label);
      return;
    }
    const auto [low, high] = std::pair(labels.label[0], labels.label[1]);
    if (!wanted(low, high)) return;
    unsigned inside = 0;
    for (unsigned v = 0; v < 4; ++v) inside |= (label[v] == high ? 1u : 0u) << v;
    const TetCase& tet = kTetCases[t][inside];
    for (std::size_t k = 0; k < tet.count; ++k) {
      std::array<std::uint32_t, 3> vertex{};
      std::array<unsigned, 3> face{};
      for (std::size_t v = 0; v < 3; ++v) {
        vertex[v] = edge_vertex(cell, t, tet.triangle[k][v]);
        face[v] = kFaceOfEdges[tet.triangle[k][v]][tet.triangle[k][(v + 1) % 3]];
      }
      add(high, low, vertex, cell, t, face);
    }
  }

  /// Facets of a tetrahedron with three or four labels.
  void cone(const Cell& cell, std::size_t t, const std::array<Label, 4>& label) {
    const auto& chain = kTetrahedra[t];
    const std::uint32_t apex = next_interior_++;
    const auto corner = [&](std::size_t v) { return detail::corner_point(chain[v]); };
    // Reference positions, times twelve: centroids of the tetrahedron, of a face, of an edge.
    const auto centroid = [&](std::initializer_list<std::size_t> vertices) {
      detail::Point p{};
      for (const std::size_t v : vertices) p = detail::sum(p, corner(v));
      return detail::scaled(12 / static_cast<int>(vertices.size()), p);
    };
    const detail::Point top = centroid({0, 1, 2, 3});
    // The segment from point p to the vertex of edge (from, to), as facet that faces from `from` to `to`.
    const auto facet = [&](std::uint32_t p, const detail::Point& p_at, std::size_t from, std::size_t to, std::size_t opposite) {
      if (!wanted(label[from], label[to])) return;
      const std::uint32_t e = edge_vertex(cell, t, tet_edge(from, to));
      const detail::Point to_p = detail::difference(p_at, top);
      const detail::Point to_e = detail::difference(centroid({from, to}), top);
      const bool faces_to = detail::triple(detail::difference(detail::scaled(12, corner(to)), top), to_p, to_e) > 0;
      add(label[from], label[to], faces_to ? std::array{apex, p, e} : std::array{apex, e, p}, cell, t,
          {Facet::kInside, static_cast<unsigned>(opposite), Facet::kInside});
    };
    for (std::size_t opposite = 0; opposite < 4; ++opposite) {
      std::array<std::size_t, 3> v{};
      for (std::size_t k = 0, n = 0; k < 4; ++k) {
        if (k != opposite) v[n++] = k;
      }
      const bool same01 = label[v[0]] == label[v[1]], same02 = label[v[0]] == label[v[2]],
                 same12 = label[v[1]] == label[v[2]];
      if (same01 && same02) continue;
      if (!same01 && !same02 && !same12) {
        const std::uint32_t p = face_vertex(cell, chain[v[0]], chain[v[1]], chain[v[2]]);
        const detail::Point at = centroid({v[0], v[1], v[2]});
        facet(p, at, v[0], v[1], opposite);
        facet(p, at, v[0], v[2], opposite);
        facet(p, at, v[1], v[2], opposite);
        continue;
      }
      const std::size_t alone = same01 ? v[2] : same02 ? v[1] : v[0];
      const std::size_t a = alone == v[0] ? v[1] : v[0], b = alone == v[2] ? v[1] : v[2];
      if (!wanted(label[a], label[alone])) continue;
      facet(edge_vertex(cell, t, tet_edge(a, alone)), centroid({a, alone}), b, alone, opposite);
    }
  }

  static std::size_t tet_edge(std::size_t a, std::size_t b) { return static_cast<std::size_t>(kTetEdgeOf[a][b]); }

  [[nodiscard]] const LabelledBlock& owner(const OwnedNode& node) const {
    const std::int64_t at = neighbour_[node.neighbour];
    if (at < 0) missing(node);
    return *blocks_[static_cast<std::size_t>(at)];
  }
  [[noreturn]] void missing(const OwnedNode& node) const {
    BlockCoord coord = block_.coord;
    for (std::size_t k = 0; k < 3; ++k) coord[k] += static_cast<std::int32_t>(node.neighbour >> k & 1u);
    throw_missing_block(coord);
  }
  static OwnedNode owned(const Cell& cell, unsigned corner) {
    return {cell.x + static_cast<int>(corner & 1u), cell.y + static_cast<int>(corner >> 1 & 1u),
            cell.z + static_cast<int>(corner >> 2 & 1u)};
  }

  [[nodiscard]] std::uint32_t edge_vertex(const Cell& cell, std::size_t t, std::size_t edge) const {
    const auto [corner, mask] = kCellEdge[cell_edge(t, edge)];
    const OwnedNode node = owned(cell, corner);
    const LabelledBlock& block = owner(node);
    const std::size_t row = EdgeSet::row_of(node.y, node.z, mask);
    if (!block.edges.contains(row, node.x)) missing(node);
    return block.first_vertex + block.edges.rank(row, node.x);
  }
  [[nodiscard]] std::uint32_t face_vertex(const Cell& cell, unsigned a, unsigned b, unsigned c) const {
    const OwnedNode node = owned(cell, a);
    const LabelledBlock& block = owner(node);
    const std::uint16_t key = face_key({node.x, node.y, node.z}, kFaceOf[a ^ b][b ^ c]);
    const auto at = std::lower_bound(block.face_key.begin(), block.face_key.end(), key);
    if (at == block.face_key.end() || *at != key) missing(node);
    return block.first_vertex + block.edge_count + static_cast<std::uint32_t>(at - block.face_key.begin());
  }

  /// Does a body with a mesh lie on one side? Blocks beside other interfaces need not exist.
  [[nodiscard]] bool wanted(Label a, Label b) const {
    return (a != 0 && has_mesh_[a - 1] != 0) || (b != 0 && has_mesh_[b - 1] != 0);
  }

  /// @param face  of the edge from each vertex
  void add(Label from, Label to, std::array<std::uint32_t, 3> vertex, const Cell& cell, std::size_t t, std::array<unsigned, 3> face) {
    if (from == 0) {
      std::swap(from, to);
      std::swap(vertex[1], vertex[2]);
      std::swap(face[0], face[2]);
    }
    out_.push_back({.inner = from, .outer = to, .vertex = vertex, .tetrahedron = tetrahedron_key(cell, t),
                    .faces = static_cast<std::uint16_t>(face[0] | face[1] << 3 | face[2] << 6)});
  }

  std::span<const LabelledBlock* const> blocks_;
  const LabelledBlock& block_;
  std::span<const std::uint8_t> has_mesh_;
  std::array<std::int64_t, 8> neighbour_;
  std::vector<Facet>& out_;
  std::uint32_t next_interior_;  ///< interior points are numbered in the order in which tetrahedra are cut
};

/// Calls use(body, label beyond, vertex) for both sides of a facet that get a mesh.
template <class Use>
void for_sides(const Facet& facet, std::span<const std::uint8_t> has_mesh, const Use& use) {
  const auto& v = facet.vertex;
  if (has_mesh[facet.inner - 1] != 0) use(facet.inner - 1, facet.outer, std::array{v[0], v[1], v[2]});
  if (facet.outer != 0 && has_mesh[facet.outer - 1] != 0) use(facet.outer - 1, facet.inner, std::array{v[0], v[2], v[1]});
}

/// Numbers the vertices of all blocks and lists them. @param carried  gets the numbers of those that are kept, and which are new
/// @param keeps  whether the partition is needed after this call
AllVertices& join(KeptPartition& partition, bool keeps, Carried& carried, const Lattice& lattice, PolygoniseCounts& counts) {
  AllVertices& all = partition.all;
  all.clear();
  std::uint64_t vertices = 0, uses = 0, covers = 0;
  for (const KeptBlock& block : partition.block) {
    vertices += block.vertices.use_end.size();
    uses += block.vertices.use.size();
    covers += block.vertices.cover.size();
  }
  expect_indexable(vertices + uses, lattice);
  all.use_end.reserve(vertices + covers);  // those on boundary curves follow
  all.kind.reserve(vertices + covers);
  all.use.reserve(uses + 3 * covers);
  carried.number.assign(partition.vertices, kGone);
  carried.disturbed.assign(vertices, kNew);
  for (KeptBlock& kept : partition.block) {
    PartitionVertices& part = kept.vertices;
    counts.nodes += part.counts.nodes;
    counts.residual = std::max(counts.residual, part.counts.residual);
    counts.junctions += part.counts.junctions;
    counts.junctions_moved += part.counts.junctions_moved;
    counts.gaps += part.counts.gaps;
    part.counts.nodes = 0;
    if (part.block.empty()) continue;
    LabelledBlock& block = part.block.front();
    const auto first = static_cast<std::uint32_t>(all.use_end.size()), first_use = static_cast<std::uint32_t>(all.use.size());
    for (std::uint32_t v = 0; !kept.made && v < part.use_end.size(); ++v) {
      carried.number[block.first_vertex + v] = first + v;
      carried.disturbed[first + v] = 0;
    }
    block.first_vertex = first;
    all.block.push_back(&block);
    for (const std::uint32_t end : part.use_end) all.use_end.push_back(end + first_use);
    all.use.insert(all.use.end(), part.use.begin(), part.use.end());
    all.kind.insert(all.kind.end(), part.kind.begin(), part.kind.end());
    for (Cover cover : part.cover) {
      cover.vertex += first;
      all.cover.push_back(cover);
    }
    for (Meeting meeting : part.meeting) {
      meeting.vertex += first;
      all.meeting.push_back(meeting);
    }
    if (!keeps) part.use = {};
  }
  return all;
}

/// Makes the facets of all blocks, or takes those of the last call, and finds vertices at which they differ.
std::vector<FacetPart> join_facets(KeptPartition& partition, std::span<const ChangedBlock> changed, const AllVertices& all,
                                   std::span<const std::uint8_t> has_mesh, const Executor& executor, Carried& carried) {
  std::vector<FacetPart> parts;
  std::vector<std::uint8_t> made;
  parts.reserve(all.block.size());
  for (KeptBlock& block : partition.block) {
    if (block.vertices.block.empty()) continue;
    parts.push_back(std::move(block.facets));
    made.push_back(block.made ? 1 : 0);
  }
  carried.same = find_same_parts(changed, all.block);
  for (const ChangedBlock& block : changed) mark_last(block.facet, true, carried);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (carried.same[i] == 0) mark_last(parts[i].facet, false, carried);
  }
  executor.for_blocks(parts.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (carried.same[i] != 0) {
        renumber(carried.number, parts[i].facet);
        continue;
      }
      parts[i] = {};
      FacetMaker(all.block, i, has_mesh, parts[i].facet).run();
      parts[i].facet.shrink_to_fit();
    }
  });
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (carried.same[i] == 0) mark_now(parts[i].facet, made[i] != 0, carried);
  }
  return parts;
}

/// The number that a use of a vertex has in its body's mesh, with what finds it.
struct UseNumber {
  std::uint32_t body;
  Label other;
  std::uint32_t local;
  [[nodiscard]] bool is_for(std::uint32_t of, Label beyond) const { return body == of && (other == kAnyLabel || other == beyond); }
};

std::vector<Mesh> write_meshes(std::size_t bodies, const AllVertices& all, std::span<FacetPart> parts, std::span<const std::uint8_t> has_mesh,
                               const Executor& executor) {
  std::vector<std::uint32_t> vertex_count(bodies);
  std::vector<UseNumber> number(all.use.size());
  for (std::size_t u = 0; u < number.size(); ++u) {
    const VertexUse& use = all.use[u];
    number[u] = {use.body, use.other, use.body != kNoBody ? vertex_count[use.body]++ : 0};
  }
  executor.for_blocks(parts.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      if (!parts[p].body.empty()) continue;  // counted in the last call
      for (const Facet& facet : parts[p].whole()) {
        for_sides(facet, has_mesh, [&](std::uint32_t body, Label, const auto&) { ++count_of(parts[p].body, body).count; });
      }
    }
  });

  std::vector<Mesh> meshes(bodies);
  std::vector<std::uint64_t> triangle_count(bodies);
  for (FacetPart& part : parts) {
    for (BodyCount& body : part.body) {
      body.first = triangle_count[body.body];
      triangle_count[body.body] += body.count;
    }
  }
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    meshes[m].position.resize(vertex_count[m]);
    meshes[m].normal.resize(vertex_count[m]);
    meshes[m].columns.push_back({.name = "contact", .values = std::vector<double>(vertex_count[m])});
    meshes[m].triangle.resize(triangle_count[m]);
  }
  constexpr std::size_t kVerticesPerTask = 4096;
  executor.for_blocks(all.use_end.size(), kVerticesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin, u = begin == 0 ? 0 : all.use_end[begin - 1]; i < end; ++i) {
      for (; u < all.use_end[i]; ++u) {
        const VertexUse& use = all.use[u];
        if (use.body == kNoBody) continue;
        const std::uint32_t local = number[u].local;
        meshes[use.body].position[local] = use.position;
        meshes[use.body].normal[local] = use.normal;
        meshes[use.body].columns[0].values[local] = use.contact;
      }
    }
  });
  executor.for_blocks(parts.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      for (const Facet& facet : parts[p].whole()) {
        for_sides(facet, has_mesh, [&](std::uint32_t body, Label other, const std::array<std::uint32_t, 3>& v) {
          std::uint64_t& next = count_of(parts[p].body, body).first;
          const auto local = [&](std::uint32_t vertex) {
            std::uint32_t u = all.first_use(vertex);
            while (!number[u].is_for(body, other)) ++u;
            return number[u].local;
          };
          meshes[body].triangle[next++] = {local(v[0]), local(v[1]), local(v[2])};
        });
      }
    }
  });
  return meshes;
}

/// Fields, and for each a number that changes with it.
struct VersionedFields {
  std::span<const FieldView> fields;
  std::span<const std::uint64_t> version;
};

/// Divides space anew where `partition`, of the last call, does not hold; it becomes that of this one, or empty where that would take more.
/// @param most_kept  [byte]
std::vector<Mesh> divide(const VersionedFields& of, const Lattice& lattice, std::uint64_t most_kept, KeptPartition& partition,
                         const Executor& executor, PolygoniseCounts& count) {
  const std::span<const FieldView> fields = of.fields;
  count = {};
  std::vector<Box> surface;
  std::vector<std::uint8_t> has_mesh;
  for (const FieldView& field : fields) {
    surface.push_back(field.surface_box());
    has_mesh.push_back(surface.back().empty() || is_bounded(surface.back()) ? 1 : 0);
  }
  if (!fields.empty() && std::count(has_mesh.begin(), has_mesh.end(), 1) == 0) {
    (void)block_range(surface.front(), lattice, 1);  // refuses it
  }
  const BlockList list = find_label_blocks(fields, surface, lattice, executor, kMostBlocks, count);
  count.cell = lattice.cell;
  count.blocks = list.block.size();

  const std::vector<ChangedBlock> changed = take_blocks(partition, list, lattice, of.version);
  std::vector<std::uint32_t> to_make;
  for (std::uint32_t i = 0; i < partition.block.size(); ++i) {
    if (partition.block[i].made) to_make.push_back(i);
  }
  count.blocks_visited = to_make.size();
  executor.for_blocks(to_make.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
    Labeller labeller(fields, has_mesh, lattice);
    for (std::size_t i = begin; i < end; ++i) {
      KeptBlock& block = partition.block[to_make[i]];
      labeller.take_block(block.coord, block.candidate, block.vertices);
      block.vertices.use.shrink_to_fit();  // most of the kept data, with facets
    }
  });
  const bool keeps = most_kept > 0 && partition.bytes() <= most_kept;
  Carried carried;
  AllVertices& all = join(partition, keeps, carried, lattice, count);
  std::vector<FacetPart> parts = join_facets(partition, changed, all, has_mesh, executor, carried);
  cut_at_boundaries({fields, has_mesh, lattice, executor}, all, parts, carried, partition.boundaries, count);
  partition.vertices = static_cast<std::uint32_t>(all.use_end.size());
  std::vector<Mesh> meshes = write_meshes(fields.size(), all, parts, has_mesh, executor);
  auto part = parts.begin();
  for (KeptBlock& block : partition.block) {
    if (!block.vertices.block.empty()) block.facets = std::move(*part++);
  }
  count.bytes = keeps ? partition.bytes() : 0;
  if (!keeps || count.bytes > most_kept) {
    partition = {};
    count.bytes = 0;
  }
  return meshes;
}

}  // namespace

struct PartitionMesher::Impl {
  KeptPartition kept;
};

PartitionMesher::PartitionMesher() : impl_(std::make_unique<Impl>()) {}
PartitionMesher::~PartitionMesher() = default;
PartitionMesher::PartitionMesher(PartitionMesher&&) noexcept = default;
PartitionMesher& PartitionMesher::operator=(PartitionMesher&&) noexcept = default;

std::vector<Mesh> PartitionMesher::make(std::span<const FieldView> fields, std::span<const std::uint64_t> version, const Lattice& lattice,
                                        const Executor& executor, PolygoniseCounts* counts) {
  SUPPLE_EXPECTS(version.size() == fields.size());
  PolygoniseCounts local;
  PolygoniseCounts& count = counts != nullptr ? *counts : local;
  KeptPartition partition = std::exchange(impl_->kept, {});  // no data are kept of a call that throws
  std::vector<Mesh> meshes = divide({fields, version}, lattice, kMostKeptBytes, partition, executor, count);
  impl_->kept = std::move(partition);
  return meshes;
}

void PartitionMesher::forget() { impl_->kept = {}; }

std::vector<Mesh> polygonise_partition(std::span<const FieldView> fields, const Lattice& lattice, const Executor& executor,
                                       PolygoniseCounts* counts) {
  PolygoniseCounts local;
  std::vector<std::uint64_t> version(fields.size());
  std::iota(version.begin(), version.end(), std::uint64_t{0});
  KeptPartition none;
  return divide({fields, version}, lattice, 0, none, executor, counts != nullptr ? *counts : local);
}

}  // namespace supple::implicit
