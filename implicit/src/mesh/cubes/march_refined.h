/// @file march_refined.h
/// The meshes of marching cubes on one lattice: that of its cells, those whose triangles are repeatedly divided into four, and their
/// errors. From call to call a tile keeps the vertices that division adds, and its error, where its triangles and all of their vertices
/// are unchanged to the bit, and no changed primitive reaches the points at which the field was evaluated for them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mesh/cubes/march_mesher.h"
#include "mesh/cut_crossings.h"

namespace supple::implicit::march {

/// Buffers for dividing triangles; kept for their memory.
struct CutScratch {
  std::vector<std::array<std::uint32_t, 3>> middle;
  std::vector<std::uint32_t> start, target, edge;
  [[nodiscard]] std::uint64_t bytes() const {
    return middle.capacity() * sizeof(middle[0]) + (start.capacity() + target.capacity() + edge.capacity()) * sizeof(std::uint32_t);
  }
};

class RefinedMarcher {
 public:
  /// Makes the mesh of the cells. @param field  to be kept until the next call
  void march(const FieldView& field, const Lattice& lattice, bool skip, const Executor& executor);
  /// Rebuilds it: counts are then those of a new mesher. Meshes and errors stay valid.
  void march_anew(const Executor& executor);
  /// The next mesh of the cells reuses nothing of this one.
  void forget() { marcher_.kept = false; }

  /// Valid until the next call of march(). @param may_cross  itself; the same in all calls until then
  [[nodiscard]] const Mesh& mesh(int refinements, bool may_cross, const Executor& executor, CutScratch& scratch);
  /// centroid_error of that mesh. @pre the mesh was made since march()
  [[nodiscard]] double error(int refinements, const Executor& executor);

  /// Of the mesh of the cells, and edges of the last mesh.
  [[nodiscard]] const MarchCounts& counts() const { return counts_; }
  /// Whether no data were kept.
  [[nodiscard]] bool whole() const { return marcher_.whole(); }
  /// Largest counts of a new mesher.
  [[nodiscard]] MarchCounts most_counts() const { return marcher_.most_counts(counts_); }
  /// Size of all meshes and kept data [byte].
  [[nodiscard]] std::uint64_t bytes() const;
  [[nodiscard]] Mesh take_mesh(int refinements);

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  /// The vertices that dividing the triangles of a tile adds, and the box in which the field was evaluated for them.
  struct TileVertices {
    std::uint32_t first = 0, count = 0;
    Box evaluated;
  };
  struct TileError {
    double error = 0.0;  ///< [m]
    Box evaluated;
  };
  /// After this many divisions.
  struct Step {
    bool made = false, measured = false;
    Mesh mesh;                        ///< but for the first one, which is the marcher's
    std::vector<TileVertices> added;  ///< by tile
    std::vector<TileError> error;     ///< by tile
    std::vector<std::uint8_t> same;   ///< by vertex: bit for bit the one of the last call in its place
    std::vector<StraightEdge> straight;
  };

  void list();
  void find_changes();
  void cut(int step, bool may_cross, const Executor& executor, CutScratch& scratch);
  [[nodiscard]] Mesh& mesh_of(int step) { return step == 0 ? marcher_.mesh : now_[static_cast<std::size_t>(step)].mesh; }
  [[nodiscard]] bool differs(const Box& evaluated) const;
  /// Calls use(triangle number) for the triangles of a tile after this many divisions.
  template <class Use>
  static void for_triangles(const TileTriangles& tile, int step, const Use& use) {
    const std::size_t parts = std::size_t{1} << (2 * step);
    for (std::size_t n = parts * tile.first; n < parts * (tile.first + tile.count); ++n) use(n);
  }
  [[nodiscard]] bool is_same(const TileTriangles& tile, int step);

  Marcher marcher_;
  FieldView field_;
  bool skip_ = true;
  MarchCounts counts_;
  double feature_ = 0.0;              ///< of the field [m]
  bool listed_ = false;               ///< the following data are of this call
  std::vector<TileTriangles> tiles_;
  std::vector<std::size_t> first_, last_first_;  ///< of the triangles of tiles, now and in the last call
  std::vector<std::uint32_t> last_tile_;         ///< by tile: its number in the last call; kNone where its triangles are others
  ChangedTiles blob_changes_;         ///< of a body of Wyvill points
  std::vector<Reach> blob_reaches_;   ///< that these are of
  bool all_differs_ = true;
  std::array<Step, kMostRefinements + 1> now_, last_;
};

}  // namespace supple::implicit::march
