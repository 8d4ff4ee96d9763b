/// @file crowded_start.h
/// Bodies that overlap many others at the start, counted before their contacts are solved.
#pragma once

#include <optional>
#include <string>

#include "supple/scenes/scene.h"

namespace supple::scenes {

struct CrowdedStart {
  std::string key;      ///< of the object with most of such bodies
  double pairs = 0.0;   ///< of bodies whose surfaces overlap, about
  double others = 0.0;  ///< that overlap with a body, on average, about
};

/// Finds whether so many bodies overlap at the start that solving their contacts once takes longer than a check: each pair is cut by all the others that
/// overlap with both. Considers bodies of one particle each, by their distances and the smallest support of their kernels.
[[nodiscard]] std::optional<CrowdedStart> find_crowd(const Scene& scene);

}  // namespace supple::scenes
