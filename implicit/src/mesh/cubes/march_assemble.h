/// @file march_assemble.h
/// The steps of march::assemble: vertices and triangles that stay move to their place in the mesh, those of tiles made anew are written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/cubes/march_sampling.h"

namespace supple::implicit::march {

/// Behind the last run, or as its continuation.
void add_run(std::vector<Run>& runs, const Run& run);
/// Moves items in place and makes room for `count`. @param runs  in rising order, before and after
void move_runs(const std::vector<Run>& runs, std::size_t count, std::vector<Vec3>& items);

/// By how much the vertices of blocks move, where all of one do by the same.
class BlockShifts {
 public:
  explicit BlockShifts(const BlockTable& table)
      : row_(static_cast<std::size_t>(table.count[0])), plane_(row_ * static_cast<std::size_t>(table.count[1])),
        shift_(table.block.size() + plane_ + row_ + 1, kNone) {}
  void set(std::size_t index, const Block& block) {
    if (block.vertices > 0) shift_[index] = block.solve == 0 ? std::int64_t{block.first_vertex - block.old_vertex} : kMany;
  }
  /// The run with the shift of all vertices that triangles of the block may have, if they have one.
  [[nodiscard]] Run with_shift(std::size_t index, const Run& run) const {
    std::int64_t found = kNone;
    for (const std::size_t step : {std::size_t{0}, std::size_t{1}, row_, row_ + 1, plane_, plane_ + 1, plane_ + row_}) {
      const std::int64_t other = shift_[index + step];
      if (other == kNone || other == found) continue;
      if (other == kMany || found != kNone) return run;
      found = other;
    }
    return {run.from, run.to, run.count, nullptr, found == kNone ? 0 : static_cast<std::uint32_t>(found)};
  }

 private:
  static constexpr std::int64_t kNone = -1, kMany = -2;
  std::size_t row_, plane_;
  std::vector<std::int64_t> shift_;
};

/// Triangles that stay.
void move_triangles(const BlockTable& table, const std::vector<Run>& runs, std::size_t count, Mesh& mesh);

/// Makes room for the points of all vertices. Those that stay are at their final index.
/// @param blocks   with vertices
/// @param counted  of these, those whose vertices may be others
void place_points(BlockTable& table, std::span<const std::uint32_t> blocks, std::span<const std::uint32_t> counted, std::size_t vertices,
                  bool none_stays, std::vector<EdgePoint>& points);

/// The triangles of the tiles marked `emit`.
/// @param points  of all blocks
void emit_triangles(const BlockTable& table, const Block& block, const EdgePoint* points, Mesh& mesh);

}  // namespace supple::implicit::march
