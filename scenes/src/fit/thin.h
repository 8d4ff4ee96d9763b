/// @file thin.h
/// Fewer primitives for the same surface.
#pragma once

#include <vector>

#include "fit/faults.h"

namespace supple::fit {

/// What makes a skeleton smaller by one: a blob that goes, or two in whose place one comes.
struct Change {
  std::vector<std::uint32_t> gone;
  std::vector<Blob> come;
  double need = 0.0;                   ///< sum of squares of the distances by which samples would move
  std::vector<std::uint32_t> samples;  ///< that the blobs carry
};

/// All changes, those first without which the surface moves least. One blob for two is an ellipsoid, or a segment where that is much nearer to their field.
[[nodiscard]] std::vector<Change> changes_of(const std::vector<Blob>& blobs, const Data& data, const SolveOptions& solving, const Executor& executor);

/// Makes changes of the least need, many at once and fewer where that fails, while the others can be moved, turned and resized so that the faults stay within a limit.
/// @param cell  of meshes that show faults   @param attempts  at most
void thin(const Data& data, const Faults& limit, double cell, int attempts, const SolveOptions& solving, const Executor& executor, Targets& targets, std::vector<Blob>& blobs);

}  // namespace supple::fit
