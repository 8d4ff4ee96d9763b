/// @file blob_lanes.h
/// Sums of Wyvill points on the nodes and edges of a lattice, in single precision and in cells of the lattice: vector
/// loops for AVX2 and AVX-512, chosen at run time. Lanes hold points (or blobs, where they are selected) and a point's
/// sum runs in the order of the list by explicit fused operations, so neither the width of the vectors nor a blob that
/// adds an exact zero changes a bit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace supple::implicit::blobs {

inline constexpr int kTile = 4;  ///< nodes along the edge of a tile
inline constexpr std::size_t kTileNodes = std::size_t{kTile} * kTile * kTile;
inline constexpr std::size_t kLanes = 16;  ///< widest vector; lists may be read and written this far beyond their end

/// A support is kept when the box lies within this of it, squared and relative: more than round-off.
inline constexpr float kReach2 = 1.0001F;

/// Blobs near a block, f(x) = (1 - |scale x - centre|^2)^3 with x in cells from the block's lowest node,
/// scale = cell / R and centre already scaled.
struct BlobList {
  std::vector<float> scale, x, y, z;
  std::size_t count = 0;
  std::size_t near = 0;  ///< those that were put first, all where the order stayed

  void reserve(std::size_t blobs);
  /// Fills the slots that vectors read beyond the end with blobs without reach.
  void pad();
};

/// Blobs as a grid keeps them: centres in cells from the lattice's origin.
struct BlobArrays {
  const double *x, *y, *z;
  const float* scale;
};

/// Some of them, one after the other.
struct BlobRun {
  std::size_t begin, end;
};

/// A cube that reaches from `margin` below `base` to `size + margin` above it [cells].
struct CubeAround {
  std::array<double, 3> base;
  double size, margin;
};

/// Those whose support may meet the cube, in the frame of its base.
/// @param far  null: in their order; otherwise scratch, and those come first whose centre lies within half a radius of the cube
void gather(const BlobArrays& all, std::span<const BlobRun> runs, const CubeAround& cube, BlobList& list, BlobList* far);

/// Blobs around a column of cubes, by layers of bins: data that are read once for all of them.
struct BlobColumn {
  std::vector<float> scale, x, y;    ///< x and y as in a list of one of the cubes
  std::vector<double> z;             ///< [cells] from the lattice's origin
  std::vector<std::uint32_t> start;  ///< those of layer l are [start[l], start[l + 1])
};
/// Those whose support may meet some cube of `size` cells over x, y in `base`. @param layer  ends of the layers, numbers of runs
void gather_column(const BlobArrays& all, std::span<const BlobRun> runs, std::span<const std::uint32_t> layer,
                   const std::array<double, 2>& base, double size, BlobColumn& column);
/// A cube of a column [cells], and the layers [begin, end) of blobs that may reach it.
struct ColumnCube {
  std::size_t begin, end;
  double base_z, size;
};
/// What the other `gather` finds for the cube without a margin.
void gather(const BlobColumn& column, const ColumnCube& cube, BlobList& list, BlobList* far);

/// Bounds of the potential on a box from the nearest and farthest distance of each blob; round-off included.
struct PotentialBounds {
  float lower = 0.0F;
  float upper = 0.0F;
};

/// Those whose support may meet the cube of half edge `half` around `centre`, and bounds of the potential on it.
[[nodiscard]] PotentialBounds select(const BlobList& from, const std::array<float, 3>& centre, float half,
                                     BlobList& list);

/// The same, those first whose centre lies within half a radius of the cube: the most of the sum inside a body.
/// @param far  scratch
[[nodiscard]] PotentialBounds select_near_first(const BlobList& from, const std::array<float, 3>& centre, float half,
                                                BlobList& list, BlobList& far);

/// Places of blobs in a list.
struct BlobPlaces {
  std::vector<std::uint32_t> place;
  std::size_t count = 0;
};
/// Those that reach a tile; the near ones are the most of the sum inside a body.
struct TileBlobs {
  BlobPlaces near, far;
  [[nodiscard]] std::size_t count() const { return near.count + far.count; }
};

/// What reaches the eight tiles of a leaf, x + 2 y + 4 z.
struct LeafTiles {
  static constexpr std::size_t kTiles = 8;
  std::array<PotentialBounds, kTiles> bounds;
  std::array<TileBlobs, kTiles> blobs;
};
/// As select, for those of the tiles around `centre` whose bits are set, as places. Near are those whose centre lies within half a
/// radius of a tile.
void select_tiles(const BlobList& from, const std::array<float, 3>& centre, unsigned wanted, LeafTiles& tiles);

struct TileSums {
  std::uint64_t inside = 0;   ///< bit per node: F > 0
  std::size_t added = 0;      ///< blobs; fewer than there are when `sure` was reached
};
/// F = sum f - iso at the kTileNodes nodes of the tile whose lowest node is `corner`; x fastest. Near blobs come first.
/// Ends as soon as the partial sums of all nodes exceed `sure` >= iso: no term is negative and rounding is monotone, so
/// partial sums never fall and all nodes are inside. `values` is then not written.
TileSums evaluate_tile(const BlobList& list, const TileBlobs& tile, const std::array<float, 3>& corner, float iso, float sure,
                       float* values);

struct SureCubes {
  std::uint64_t inside = 0;  ///< bit per cube, x fastest
  std::size_t added = 0;     ///< blobs
};
/// Which of 4^3 cubes of `edge`^3 nodes are sure to lie inside, by bounds of the near blobs alone, from value, gradient and curvature
/// at the middles of the cubes: F > 0 at their nodes in evaluate_tile. @param corner  lowest node
SureCubes find_sure_cubes(const BlobList& list, const std::array<float, 3>& corner, int edge, float iso);

/// Edges of the tiles of a block that the surface crosses, tile after tile.
struct EdgeBatch {
  static constexpr std::size_t kRoom = 64 * 3 * kTileNodes + kLanes;
  using Row = std::array<float, kRoom>;
  alignas(64) Row x, y, z;     ///< lower end [cells]
  alignas(64) Row axis;        ///< 0, 1 or 2
  alignas(64) Row low, high;   ///< F at the ends, of different sign (zero is outside); high = 0: only the sign is known
  alignas(64) Row t;           ///< found: position of the root along the edge, inside (0, 1)
  alignas(64) Row nx, ny, nz;  ///< found: -grad F next to the root, up to a positive factor
  std::size_t count = 0;
};

/// Newton's method in brackets for the edges from `begin` on, first step by the cubic through both ends. Edges that follow
/// each other should be close: each vector of them has a list of its own.
/// @param near  scratch
void solve_edges(const BlobList& list, float iso, EdgeBatch& edges, std::size_t begin, BlobList& near);

/// Where the frame of a block lies in the world.
struct Placement {
  std::array<double, 3> origin;  ///< of the lattice [m]
  std::array<double, 3> base;    ///< lowest node of the block [cells]
  double cell;                   ///< [m]
};

/// Where vertices go: world positions and unit normals, three numbers each, and t and the normal, four numbers each.
struct VertexRows {
  double *positions, *normals;
  float* points;
};
/// The edges [begin, end). Where F has no gradient the normal is the direction of the edge. @param to  room for so many
void place_vertices(const EdgeBatch& edges, std::size_t begin, std::size_t end, const Placement& placement, const VertexRows& to);

/// Points [m] and unit normals, three numbers each.
struct PointRows {
  double *positions, *normals;
  std::size_t count;
};
/// Moves points that lie near the surface to it, by Newton's method along the gradient, and gives their normals. Steps are at
/// most half a cell. @param near  scratch
void project_points(const BlobList& list, float iso, const Placement& placement, const PointRows& points, BlobList& near);

}  // namespace supple::implicit::blobs
