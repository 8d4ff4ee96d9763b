/// @file supple/implicit/march_cubes.h
/// Fast surface meshes of one body on the world lattice of polygonise.h: marching cubes with vertices at the roots of the
/// field on the lattice's edges. A body of Wyvill points is sampled in single precision, only where bounds admit a
/// surface; other fields are sampled through their view in double precision.
///
/// The mesh is closed and oriented, and cannot cross itself whatever the field: all triangles of a cell lie in it and are
/// fans that do not meet (see Lorensen & Cline 1987 for the method; faces are decided by the signs of their corners
/// alone). A node with F = 0 counts as outside. Vertices keep 2^-17 of a cell from the nodes, so no two coincide.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "supple/implicit/polygonise.h"

namespace supple::implicit {

struct MarchCounts {
  std::uint64_t blocks = 0;         ///< blocks of 16^3 cells within reach of the body
  std::uint64_t tiles = 0;          ///< tiles of 4^3 nodes that hold values
  std::uint64_t tiles_sampled = 0;  ///< positions of tiles that were processed in this call
  std::uint64_t nodes = 0;          ///< values held
  std::uint64_t kernel_values = 0;  ///< terms of the sums on nodes that this call took, in single precision
  std::uint64_t bytes = 0;          ///< held besides the mesh
  bool single_precision = false;    ///< the body is nothing but Wyvill points
  double cell = 0.0;                ///< edge of a cell that was used [m]
  int refinements = 0;
  double error = 0.0;               ///< with options.error: the largest found [m]
  std::uint64_t straight_edges = 0;  ///< of refined meshes: edges whose midpoints stay on them, as triangles would intersect
  std::uint64_t blunt_cells = 0;    ///< of march_creases: cells whose crease stays cut off, as triangles would intersect
};

/// Largest number of lattice nodes in the bounding box of a body.
inline constexpr std::uint64_t kMarchNodes = 1'000'000'000;
inline constexpr int kMostRefinements = 4;
/// Default limit of the data that a mesher keeps of trial meshes for an error [byte]. If the last one alone needs more,
/// nothing is kept.
inline constexpr std::uint64_t kMostKeptToError = std::uint64_t{1} << 30;

struct MarchOptions {
  Lattice lattice;
  int refinements = 0;  ///< times that every triangle is cut into four, new vertices moved to the surface; 0..4
  /// Largest distance of a triangle's centroid to the surface [m]; 0: as lattice and refinements give. Otherwise both are
  /// chosen, with cells of at most half the field's feature size and, if that is stated, lattice.cell; see `make`.
  double error = 0.0;
  /// Refined triangles are not checked for intersections: half to four fifths of the time, for a mesh that may intersect itself where the surface bends
  /// within a cell.
  bool may_cross = false;
  /// Sums of Wyvill points end where nodes are proved to be inside, unless the surface is next to them; failed repairs of creases are not repeated. Changes no bit.
  bool skip = true;
};

/// Meshes one body repeatedly. Memory is kept from call to call, and so are all parts of an unrefined mesh that no moved
/// primitive reaches; the result is that of a new mesher, bit by bit. Primitives are compared with those of the same number
/// in the last call. Everything is rebuilt when half of them moved or another lattice, iso value or blend is given. Refined meshes keep the
/// vertices that moved primitives do not reach. With options.error all trial meshes are kept, with the errors of their triangles: results,
/// trial meshes and refusals are those of a new mesher. Fields other than Field are sampled again in each call.
class CubeMesher {
 public:
  /// @param most_kept  limit of kept data of all trial meshes with options.error [byte]; beyond it the coarsest are rebuilt
  explicit CubeMesher(std::uint64_t most_kept = kMostKeptToError);
  ~CubeMesher();
  CubeMesher(CubeMesher&&) noexcept;
  CubeMesher& operator=(CubeMesher&&) noexcept;

  /// The closed surface F = 0, outward oriented, with the normals of the field; valid until the next call.
  /// Vertices are within 1e-4 of a cell of the surface (RMS). Refined vertices leave the lattice's edges; where triangles would then intersect, as
  /// at a neck about to close, they stay in the middle of the edge that they split.
  /// With options.error, a body of separate balls is found completely: half a support is a cell that no ball of its surface passes
  /// through. Triangles get shorter by sqrt(2) until the error is met, first by at most two refinements, then by smaller cells; as soon as dividing
  /// those that are too far from the surface takes fewer triangles, these alone are divided.
  /// Distances are |F| / |grad F|, or by Newton's method where the surface turns within a triangle.
  /// @throws Error{Limit} before taking memory when the box of the body holds more than kMarchNodes nodes; with options.error,
  /// as soon as no mesh within kMarchNodes nodes and 8 GB can be expected to meet it.
  const Mesh& make(const FieldView& field, const MarchOptions& options, const Executor& executor,
                   MarchCounts* counts = nullptr);
  /// Drops all kept data except allocated memory.
  void forget();
  /// Sets the constructor's limit from the next call on [byte]. Changes no bit of a mesh.
  void keep_at_most(std::uint64_t most_kept);
  /// Kept data of trial meshes, the last one included [byte].
  [[nodiscard]] std::uint64_t kept_to_error() const;
  /// Checks without meshes of about most_triangles or more. @throws Error{Limit} as make, as far as that follows from coarser meshes @pre options.error > 0
  void expect_error(const FieldView& field, const MarchOptions& options, const Executor& executor, std::uint64_t most_triangles);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The same, once.
[[nodiscard]] Mesh march_cubes(const FieldView& field, const MarchOptions& options, const Executor& executor,
                               MarchCounts* counts = nullptr);

}  // namespace supple::implicit
