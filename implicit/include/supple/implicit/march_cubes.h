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
  std::uint64_t tiles_sampled = 0;  ///< places of tiles that were looked at in this call
  std::uint64_t nodes = 0;          ///< values held
  std::uint64_t kernel_values = 0;  ///< terms of the sums on nodes that this call took, in single precision
  std::uint64_t bytes = 0;          ///< held besides the mesh
  bool single_precision = false;    ///< the body is nothing but Wyvill points
  double cell = 0.0;                ///< edge of a cell that was used [m]
  int refinements = 0;
  double error = 0.0;               ///< when one was asked for: the largest found [m]
  std::uint64_t straight_edges = 0;  ///< of refined meshes: edges whose middles stay on them, as triangles would cross
  std::uint64_t blunt_cells = 0;    ///< of march_creases: cells whose crease stays cut off, as triangles would cross
};

/// Lattice nodes in the box of a body that may be asked for.
inline constexpr std::uint64_t kMarchNodes = 1'000'000'000;
inline constexpr int kMostRefinements = 4;
/// What a mesher of a body keeps at most of the meshes that it tried to reach an error [byte], unless it is told otherwise. If the last alone needs more,
/// nothing is kept.
inline constexpr std::uint64_t kMostKeptToError = std::uint64_t{1} << 30;

struct MarchOptions {
  Lattice lattice;
  int refinements = 0;  ///< times that every triangle is cut into four, new vertices moved to the surface; 0..4
  /// Largest distance of a triangle's centroid to the surface [m]; 0: as lattice and refinements give. Otherwise both are
  /// chosen, with cells of at most half the field's feature size and, if that is stated, lattice.cell; see `make`.
  double error = 0.0;
  /// Refined triangles are not looked at for crossings: half to four fifths of the time, for a mesh that may cross itself where the surface turns
  /// within a cell.
  bool may_cross = false;
  /// Sums of Wyvill points end where they are sure to be inside, unless the surface is next to them; what failed to mend creases is not tried again. Changes no bit.
  bool skip = true;
};

/// Meshes one body again and again. Memory is kept from call to call, and so is all of an unrefined mesh that no moved
/// primitive reaches; the result is what a fresh mesher gives, bit by bit. Primitives are compared by their numbers with those
/// of the last call. All is made anew when half of them moved or another lattice, iso value or blend is given. Refined meshes keep the
/// vertices that such primitives do not reach. With options.error all meshes that are tried are kept, and errors of their triangles: meshes,
/// what is tried and what is refused are those of a fresh mesher. Fields that are no Field are sampled anew in each call.
class CubeMesher {
 public:
  /// @param most_kept  of all meshes that were tried with options.error [byte]; where they need more, the coarsest are made anew
  explicit CubeMesher(std::uint64_t most_kept = kMostKeptToError);
  ~CubeMesher();
  CubeMesher(CubeMesher&&) noexcept;
  CubeMesher& operator=(CubeMesher&&) noexcept;

  /// The closed surface F = 0, outward oriented, with the normals of the field; valid until the next call.
  /// Vertices are within 1e-4 of a cell of the surface (RMS). Refined vertices leave the lattice's edges; where triangles would then cross, as
  /// at a neck about to close, they stay in the middle of the edge that they cut.
  /// With options.error, a body of separate balls is found whole: half a support is a cell that no ball of its surface passes
  /// through. Triangles get shorter by sqrt(2) until the error is met, first by refinements, twice at most, then by smaller cells.
  /// Distances are |F| / |grad F|, or by Newton's method where the surface turns within a triangle.
  /// @throws Error{Limit} before taking memory when the box of the body holds more than kMarchNodes nodes; with options.error,
  /// as soon as no mesh within kMarchNodes nodes and 8 GB is to be expected to reach it.
  const Mesh& make(const FieldView& field, const MarchOptions& options, const Executor& executor,
                   MarchCounts* counts = nullptr);
  /// The next call keeps nothing but memory.
  void forget();
  /// From the next call on, as the constructor's. Changes no bit of a mesh. [byte]
  void keep_at_most(std::uint64_t most_kept);
  /// What is kept of meshes that were tried [byte], the last one among them.
  [[nodiscard]] std::uint64_t kept_to_error() const;
  /// Makes no mesh of about most_triangles or more. @throws Error{Limit} as make, as far as that follows from coarser ones @pre options.error > 0
  void expect_error(const FieldView& field, const MarchOptions& options, const Executor& executor, std::uint64_t most_triangles);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The same, once.
[[nodiscard]] Mesh march_cubes(const FieldView& field, const MarchOptions& options, const Executor& executor,
                               MarchCounts* counts = nullptr);

}  // namespace supple::implicit
