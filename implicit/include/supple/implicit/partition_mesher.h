/// @file supple/implicit/partition_mesher.h
/// Meshes of bodies that touch, again and again: where no body near a block of the lattice changed, what it gave is kept.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "supple/implicit/polygonise.h"

namespace supple::implicit {

/// What a mesher of bodies that touch keeps at most [byte], about 100 kB for each block of a dense pile; a division that needs more keeps nothing.
inline constexpr std::uint64_t kMostKeptBytes = std::uint64_t{1} << 30;

/// polygonise_partition from frame to frame. A block is divided anew only where the fields that can win in it are not those of
/// the last call; rims are cut anew around such blocks. The result is that of polygonise_partition, bit by bit.
class PartitionMesher {
 public:
  PartitionMesher();
  ~PartitionMesher();
  PartitionMesher(PartitionMesher&&) noexcept;
  PartitionMesher& operator=(PartitionMesher&&) noexcept;

  /// The meshes of polygonise_partition. On another lattice, or where bodies that stay do not follow each other as before, all is new.
  /// @param version  of each field, no two the same: where one is that of a field of the last call, both are equal bit for bit,
  /// values and bounds (see core/content_versions.h)
  /// @param counts  blocks_visited and nodes are those of this call, bytes what is kept
  [[nodiscard]] std::vector<Mesh> make(std::span<const FieldView> fields, std::span<const std::uint64_t> version, const Lattice& lattice,
                                       const Executor& executor, PolygoniseCounts* counts = nullptr);
  /// The next call keeps nothing.
  void forget();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// polygonise_partition_within from frame to frame, by a PartitionMesher for each mesh that is tried. The error of a body's mesh is kept, too,
/// while the mesh and the fields that it is measured by are the same. Meshes, what is tried and what is refused are those of
/// polygonise_partition_within, bit by bit.
class PartitionErrorMesher {
 public:
  /// @param most_kept  of all meshes that were tried [byte]; where they need more, the coarsest are made anew
  explicit PartitionErrorMesher(std::uint64_t most_kept = kMostKeptBytes);
  ~PartitionErrorMesher();
  PartitionErrorMesher(PartitionErrorMesher&&) noexcept;
  PartitionErrorMesher& operator=(PartitionErrorMesher&&) noexcept;

  /// The meshes of polygonise_partition_within. @param version  as for PartitionMesher::make
  /// @param counts  blocks_visited and nodes are those of this call, bytes what is kept of all meshes that were tried
  [[nodiscard]] std::vector<Mesh> make(std::span<const FieldView> fields, std::span<const std::uint64_t> version, const Lattice& coarsest,
                                       const PartitionError& error, const Executor& executor, PolygoniseCounts* counts = nullptr);
  /// The next call keeps nothing.
  void forget();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple::implicit
