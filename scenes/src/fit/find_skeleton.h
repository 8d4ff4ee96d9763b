/// @file find_skeleton.h
/// Few primitives whose summed field has the data as its surface.
#pragma once

#include <vector>

#include "fit/faults.h"

namespace supple::fit {

/// The error that primitives are found for: up to 2 % that asked, from there on the next lower one of a few, each of which starts from the primitives of the one before.
/// So a coarser error never takes more primitives.
[[nodiscard]] double level_of(double error);
/// The finest error that its primitives start with.
[[nodiscard]] double first_level_of(double error);

struct FoundSkeleton {
  std::vector<Blob> blobs;
  double cell = 0.0;      ///< of meshes that show its errors
  double thinnest = 0.0;  ///< radius of the surface of the thinnest primitive that is allowed
  bool full = false;      ///< more primitives were needed than allowed
};

/// @param data  of `first_level_of` the error   @param error  over the diagonal   @param most  primitives
[[nodiscard]] FoundSkeleton find_skeleton(const Data& data, double error, std::uint32_t most, const Executor& executor);

}  // namespace supple::fit
