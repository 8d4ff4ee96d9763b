/// @file search_choice.h
/// Selects the meshes that are searched for pieces between the nodes of their lattice.
#pragma once

#include <cstddef>
#include <optional>

#include "supple/implicit/mesh_routes.h"
#include "supple/scenes/mesh_search.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Largest estimated cost of an automatic search over that of meshing.
inline constexpr double kSearchTimesMesh = 2.0;
/// An automatic search of this cost is always made [ms], for all bodies of an object: little relative to drawing or saving a frame.
inline constexpr double kShortSearch = 10.0;

/// Whether the scene switches searches off.
[[nodiscard]] inline bool search_is_off(const MeshingDesc& d) { return d.search && !*d.search; }

/// Why `search: auto` does not search a mesh; none: it does. @param bodies  number of equal bodies
[[nodiscard]] inline std::optional<Unsearched> why_left_out(const implicit::SearchEstimate& estimate, std::size_t bodies) {
  if (!estimate.decides) return Unsearched::Undecided;
  const bool affordable = estimate.search_ms <= kSearchTimesMesh * estimate.mesh_ms ||
                          estimate.search_ms * static_cast<double>(bodies) <= kShortSearch;
  return affordable ? std::nullopt : std::optional(Unsearched::Cost);
}

}  // namespace supple::scenes
