/// @file search_choice.h
/// Which meshes are searched for the pieces that their lattice misses.
#pragma once

#include <cstddef>
#include <optional>

#include "supple/implicit/mesh_routes.h"
#include "supple/scenes/mesh_search.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// A search that takes so many times as long as the mesh is still made unasked, by counts.
inline constexpr double kSearchTimesMesh = 2.0;
/// And one that takes no longer, of all bodies of an object [ms]: little beside drawing or saving a frame.
inline constexpr double kShortSearch = 10.0;

/// Whether the scene wants no search at all.
[[nodiscard]] inline bool search_is_off(const MeshingDesc& d) { return d.search && !*d.search; }

/// Why `search: auto` leaves out a mesh, if it does. @param bodies  of so many alike this is one
[[nodiscard]] inline std::optional<Unsearched> why_left_out(const implicit::SearchEstimate& estimate, std::size_t bodies) {
  if (!estimate.decides) return Unsearched::Undecided;
  const bool affordable = estimate.search_ms <= kSearchTimesMesh * estimate.mesh_ms ||
                          estimate.search_ms * static_cast<double>(bodies) <= kShortSearch;
  return affordable ? std::nullopt : std::optional(Unsearched::Cost);
}

}  // namespace supple::scenes
