/// @file march_sampling.h
/// Access of marching cubes to a field: values on the blocks that may contain surface, and roots on crossed edges.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "mesh/cubes/march_leaves.h"
#include "mesh/cubes/march_tiles.h"
#include "supple/core/executor.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit::march {

/// A vertex where it lies on its edge, 0 < t < 1, and its normal.
struct alignas(16) EdgePoint {
  float t, x, y, z;
};

class Sampler {
 public:
  virtual ~Sampler() = default;
  /// Lays out the table: every block that the surface may enter. @throws Error{Limit} before taking memory
  virtual void prepare(const Executor& executor, BlockTable& table) = 0;
  /// @throws as prepare(), which it leaves to be called
  virtual void expect_size(const Executor& executor) = 0;
  /// Fills tiles with signs and values, those that are not as in the last call, and marks them as changed.
  virtual void sample(const Executor& executor, BlockTable& table) = 0;
  /// Vertices of the tiles marked `solve` at their place in the mesh: positions, normals, and, among the points of their block, both
  /// as seen from the edge. @param blocks  ascending
  virtual void solve(const Executor& executor, const BlockTable& table, std::span<const std::uint32_t> blocks, Mesh& mesh,
                     std::vector<EdgePoint>& points) const = 0;
  /// Called on a thread before it projects points.
  virtual void begin_projection() const {}
  /// Moves points near a tile to the surface. @param evaluated  grows by a box: where they come depends on the field in it, and its feature size
  virtual void project(const Block& block, unsigned tile, std::span<Vec3> points, std::span<Vec3> normals, Box& evaluated) const = 0;
  /// Blocks that the table of any mesher has for this field at most, whatever is kept. @param table  that was laid out
  [[nodiscard]] virtual std::uint64_t most_blocks(const BlockTable& table) const = 0;
  [[nodiscard]] virtual bool single_precision() const = 0;
};

/// Data that samplers keep from call to call.
struct SamplerMemory {
  blobs::BlobGrid grid;  ///< of a body of Wyvill points
  ViewMemory view;       ///< of any other
  void forget() {
    grid.forget();
    view.forget();
  }
  [[nodiscard]] std::size_t bytes() const { return grid.bytes() + view.bytes(); }
};

/// In single precision for a body of Wyvill points, through the view for any other.
/// @param memory  kept by the caller
/// @param skip    whether sums may end early where they are sure to be inside
[[nodiscard]] std::unique_ptr<Sampler> make_sampler(const FieldView& field, const Lattice& lattice, bool skip, SamplerMemory& memory);

/// F at a node of the block or of one beyond its upper faces, 0 where only the sign is known. @pre 0 <= x, y, z <= 16
[[nodiscard]] float value_at(const BlockTable& table, const Block& block, int x, int y, int z);

/// @param far  the largest of the coordinates of nodes, whatever its sign   @throws Error{Limit} when it is too large for the lattice
void expect_near_nodes(double far, const Lattice& lattice);

/// @throws Error{Limit} when these nodes are too many
void expect_nodes(const blobs::Cells& lower, const blobs::Cells& upper, const Lattice& lattice);

/// Lays out the table for the nodes [lower, upper]; blocks that stay are kept.
void lay_out(BlockTable& table, const blobs::Cells& lower, const blobs::Cells& upper, const Lattice& lattice);

/// The triangles of one tile, a range of the mesh.
struct TileTriangles {
  static constexpr std::size_t kNone = ~std::size_t{0};
  const Block* block;
  unsigned tile;
  std::size_t first, count;
  std::size_t last;  ///< where they began in the last mesh, if they and their vertices are as they were; else kNone
};

/// A run of numbers that moves as a whole.
struct Run {
  std::size_t from, to, count;
  const Block* block = nullptr;  ///< of triangles whose vertices move by different shifts
  std::uint32_t more = 0;        ///< of all others
};

/// Buffers for building a mesh; kept for their memory.
struct MeshScratch {
  std::vector<EdgePoint> point;      ///< of the vertices, block by block from Block::first_point on
  std::vector<Run> stayed;           ///< vertices that are those of the last mesh, in rising order
  [[nodiscard]] std::size_t bytes() const { return point.capacity() * sizeof(EdgePoint) + stayed.capacity() * sizeof(Run); }
};

/// Counts, numbers, solves and joins everything; unchanged data come from the last mesh.
void assemble(BlockTable& table, const Sampler& sampler, const Lattice& lattice, const Executor& executor,
              MeshScratch& scratch, Mesh& mesh);

}  // namespace supple::implicit::march
