/// @file polygonise_partition.h
/// Space divided by the largest positive field, block by block: labels of the nodes and the vertices that follow from
/// them. Label 0 is outside, label m + 1 is body m.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mesh/partition/polygonise_junctions.h"
#include "mesh/partition/polygonise_lattice.h"
#include "mesh/partition/polygonise_roots.h"

namespace supple::implicit::lattice {

/// A cell of a block by its lowest node.
struct Cell {
  int x = 0, y = 0, z = 0;
  [[nodiscard]] std::size_t node(unsigned corner) const {
    return static_cast<std::size_t>(node_index(x, y, z) + node_stride(corner));
  }
};

template <class Use>
void for_all_cells(const Use& use) {
  for (int z = 0; z < kCells; ++z) {
    for (int y = 0; y < kCells; ++y) {
      for (int x = 0; x < kCells; ++x) use(Cell{x, y, z});
    }
  }
}

/// Number of a face point among those that a block can own: in the order of cells, then faces.
[[nodiscard]] inline std::uint16_t face_key(const Cell& base, std::size_t face) {
  return static_cast<std::uint16_t>(static_cast<std::size_t>((base.z * kCells + base.y) * kCells + base.x) * kFaces +
                                    face);
}

[[nodiscard]] inline std::uint16_t tetrahedron_key(const Cell& base, std::size_t tetrahedron) {
  return static_cast<std::uint16_t>(static_cast<std::size_t>((base.z * kCells + base.y) * kCells + base.x) * kTetrahedra.size() + tetrahedron);
}

[[nodiscard]] inline LabelSet labels_of(std::span<const Label> labels) {
  LabelSet set;
  for (const Label l : labels) set.insert(l);
  return set;
}

inline constexpr Label kAnyLabel = ~Label{0};
inline constexpr std::uint32_t kNoBody = ~std::uint32_t{0};

/// A vertex in the mesh of one body.
struct VertexUse {
  std::uint32_t body = 0;
  Label other = kAnyLabel;    ///< beyond the triangles that it is meant for
  std::uint32_t contact = 0;  ///< other body + 1, or 0
  Vec3 normal = Vec3::Zero();
  Vec3 position = Vec3::Zero();  ///< bit-equal for all bodies of a contact; each body's own across a gap
};

/// A vertex between two or three labels where another one is largest: the interfaces split there, one sheet on every side of it, and each has the
/// vertex at its own position. Between these and the vertices where it is not largest runs a boundary curve.
struct Cover {
  std::uint32_t vertex = 0;
  LabelSet between;             ///< those that would meet there
  Label by = 0;                 ///< the other
  Vec3 point = Vec3::Zero();    ///< where they would

  [[nodiscard]] bool parts(Label a, Label b) const { return between.has(a) && between.has(b); }
};

/// Labels that meet at a junction.
struct Meeting {
  std::uint32_t vertex = 0;
  LabelSet labels;
};

/// Uncovered: one that is covered, but has one place like a junction.
enum class VertexKind : std::uint8_t { Edge, Junction, Covered, Uncovered };

/// A block where labels meet. It owns the vertices of its edges, then its face points, then its interior points.
struct LabelledBlock {
  BlockCoord coord{};
  EdgeSet edges;
  std::uint32_t edge_count = 0;
  std::vector<std::uint16_t> face_key;   ///< of its face points, ascending
  std::vector<std::uint16_t> lone_key;   ///< of tetrahedra with nodes of two labels and an interior point, ascending
  std::vector<Label> label;              ///< of its nodes, shape [kBlockNodes]
  bool has_junctions = false;            ///< three or more labels in the block
  std::uint32_t first_vertex = 0;        ///< over all blocks
};

/// Vertices of some blocks; those of a block follow each other.
struct PartitionVertices {
  std::vector<LabelledBlock> block;
  std::vector<std::uint32_t> use_end;  ///< uses of vertex i end here and begin where those of i - 1 end
  std::vector<VertexUse> use;
  std::vector<VertexKind> kind;        ///< by vertex
  std::vector<Cover> cover;            ///< of those that are covered, by vertex
  std::vector<Meeting> meeting;        ///< of junctions, by vertex
  PolygoniseCounts counts;
};

/// Finds labels and vertices of blocks; one per task.
class Labeller {
 public:
  /// @param has_mesh  by body: 0 when only the others' meshes are wanted
  Labeller(std::span<const FieldView> fields, std::span<const std::uint8_t> has_mesh, const Lattice& lattice)
      : fields_(fields), has_mesh_(has_mesh), lattice_(lattice) {}

  /// @param candidates  bodies that can be the label of a node here, ascending
  void take_block(const BlockCoord& coord, std::span<const std::uint32_t> candidates, PartitionVertices& out);

 private:
  struct EdgeVertex {
    Label low, high;  ///< its labels, ascending
    Vec3 point, gradient;
    std::optional<Label> by;  ///< a third label that wins there
  };

  void label_nodes();
  void mark_edges(LabelledBlock& block);
  void solve_edges(const LabelledBlock& block, Label low, Label high, PartitionVertices& out);
  void add_edge_vertices(const LabelledBlock& block, PartitionVertices& out);
  void add_junctions(LabelledBlock& block, PartitionVertices& out);
  void add_junction(const Cell& cell, const std::array<std::uint8_t, 4>& chain, std::uint8_t size,
                    const LabelSet& labels, PartitionVertices& out);
  void add_junction(const LabelSet& labels, const Junction& junction, PartitionVertices& out) const;
  [[nodiscard]] Simplex simplex_of(const Cell& cell, const std::array<std::uint8_t, 4>& chain, std::uint8_t size) const;
  /// The uses of a covered vertex: its positions on the lines to its point from where each of the labels is the largest.
  void add_covered(const Cover& cover, std::span<const Vec3> at, PartitionVertices& out) const;
  void add_covered(const Cell& cell, std::span<const std::uint8_t> chain, const Cover& cover, PartitionVertices& out) const;
  /// Point where the labels of a simplex meet, and perhaps one more; or the label that covers that point.
  struct Met {
    Junction junction;
    LabelSet labels;
    std::optional<Cover> cover;
  };
  [[nodiscard]] Met meet_three(const Cell& cell, const Simplex& simplex, const LabelSet& labels, const Vec3& start) const;
  [[nodiscard]] Met meet_on_face(const Cell& cell, const Simplex& face, const LabelSet& labels) const;
  [[nodiscard]] std::optional<Cover> covered_by_fourth(const Cell& cell, const Simplex& simplex, const LabelSet& labels, const Vec3& middle) const;
  [[nodiscard]] Vec3 middle_of_crossings(const Cell& cell, const Simplex& simplex) const;
  [[nodiscard]] bool can_part(const LabelSet& labels) const;
  [[nodiscard]] bool wins_over(Label by, const LabelSet& labels, const Vec3& point) const;
  [[nodiscard]] Met meet_four(const Cell& cell, const Simplex& simplex, const LabelSet& labels, const Vec3& start) const;
  [[nodiscard]] std::optional<Junction> meet_with_others(const Cell& cell, const Simplex& simplex, LabelSet& labels) const;
  [[nodiscard]] std::optional<Vec3> linear_meeting(const Cell& cell, const Simplex& simplex, const LabelSet& labels) const;
  /// Other labels that may be largest inside a simplex.
  [[nodiscard]] std::vector<Label> others_near(const Cell& cell, std::span<const std::uint8_t> chain, const LabelSet& labels) const;
  [[nodiscard]] double scale_of(const LabelSet& labels) const;
  [[nodiscard]] std::optional<Label> winner_at(const LabelSet& labels, const Vec3& point) const;
  [[nodiscard]] std::optional<Cover> covered_pair(const Cell& cell, std::span<const std::uint8_t> chain,
                                                        const LabelSet& labels) const;
  [[nodiscard]] Vec3 middle_of(const Cell& cell, std::span<const std::uint8_t> chain, Label label) const;
  [[nodiscard]] bool has_mesh(Label label) const { return label != 0 && has_mesh_[label - 1] != 0; }
  [[nodiscard]] Vec3 crossing(std::size_t node_a, std::size_t node_b) const;
  [[nodiscard]] Vec3 own_root(Label label, const Vec3& inside, const Vec3& outside) const;
  [[nodiscard]] Vec3 own_junction(Label label, const Cell& cell, std::span<const std::uint8_t> chain,
                                  const Vec3& shared) const;
  [[nodiscard]] Vec3 own_normal(Label label, const Vec3& point, const Vec3& fallback) const;
  [[nodiscard]] std::size_t slot_of(Label label) const;
  [[nodiscard]] double value(std::size_t slot, std::size_t node) const { return values_[slot * kBlockNodes + node]; }

  std::span<const FieldView> fields_;
  std::span<const std::uint8_t> has_mesh_;
  Lattice lattice_;
  // Of the current block.
  std::span<const std::uint32_t> candidates_;
  std::array<Vec3, kBlockNodes> nodes_;
  std::array<Label, kBlockNodes> label_{};
  std::vector<double> values_, scale_;  ///< by candidate
  std::vector<EdgeVertex> edge_vertex_;
  EdgeRoots roots_;
};

}  // namespace supple::implicit::lattice
