/// @file supple/implicit/partition_mesher.h
/// Repeated meshes of bodies that touch: results of lattice blocks near which no body changed are kept.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "supple/implicit/polygonise.h"

namespace supple::implicit {

/// Limit of kept data of a mesher of bodies that touch [byte], about 100 kB per block of a dense pile; a division that needs more keeps nothing.
inline constexpr std::uint64_t kMostKeptBytes = std::uint64_t{1} << 30;

/// polygonise_partition from frame to frame. A block is divided again only where the fields that can be largest in it are not those of
/// the last call; boundary curves are recomputed around such blocks. The result is that of polygonise_partition, bit by bit.
class PartitionMesher {
 public:
  PartitionMesher();
  ~PartitionMesher();
  PartitionMesher(PartitionMesher&&) noexcept;
  PartitionMesher& operator=(PartitionMesher&&) noexcept;

  /// The meshes of polygonise_partition. On another lattice, or where the order of remaining bodies changed, everything is recomputed.
  /// @param version  of each field, no two the same: where one is that of a field of the last call, both are equal bit for bit,
  /// values and bounds (see core/content_versions.h)
  /// @param counts  blocks_visited and nodes are those of this call, bytes what is kept
  [[nodiscard]] std::vector<Mesh> make(std::span<const FieldView> fields, std::span<const std::uint64_t> version, const Lattice& lattice,
                                       const Executor& executor, PolygoniseCounts* counts = nullptr);
  /// Drops all kept data.
  void forget();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// polygonise_partition_within from frame to frame, by a PartitionMesher for each trial mesh. The error of a body's mesh is kept, too,
/// while the mesh and the fields that it is measured with are unchanged. Results, trial meshes and refusals are those of
/// polygonise_partition_within, bit by bit.
class PartitionErrorMesher {
 public:
  /// @param most_kept  limit of kept data of all trial meshes [byte]; beyond it the coarsest are rebuilt
  explicit PartitionErrorMesher(std::uint64_t most_kept = kMostKeptBytes);
  ~PartitionErrorMesher();
  PartitionErrorMesher(PartitionErrorMesher&&) noexcept;
  PartitionErrorMesher& operator=(PartitionErrorMesher&&) noexcept;

  /// The meshes of polygonise_partition_within. @param version  as for PartitionMesher::make
  /// @param counts  blocks_visited and nodes are those of this call, bytes the kept data of all trial meshes
  [[nodiscard]] std::vector<Mesh> make(std::span<const FieldView> fields, std::span<const std::uint64_t> version, const Lattice& coarsest,
                                       const PartitionError& error, const Executor& executor, PolygoniseCounts* counts = nullptr);
  /// Drops all kept data.
  void forget();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple::implicit
