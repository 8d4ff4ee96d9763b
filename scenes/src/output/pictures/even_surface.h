/// @file even_surface.h
/// Surfaces without the dimples between particles, for pictures.
#pragma once

#include <span>
#include <vector>

#include "supple/core/mesh.h"

namespace supple::scenes {

/// Whether the vertices of a mesh are vertices of another one, too: where bodies touch, their meshes share them.
/// @param meshes  [bodies]  @param own  index of the mesh  @return [vertices]
[[nodiscard]] std::vector<bool> shared_vertices(std::span<const Mesh> meshes, std::size_t own);

/// Evens out waves shorter than `width`: a twentieth of them stays at most. Vertices go towards the middle of their neighbours, as in Taubin (1995), by steps whose
/// lengths are those of the Chebyshev iteration, so that their number grows with the edges in a wave, not with their square. Moves the surface along its normals until
/// its volume is what it was, and finds the normals anew. Columns stay.
/// @param fixed  vertices that stay; [vertices]  @pre width > 0, closed mesh
void even_surface(double width, const std::vector<bool>& fixed, Mesh& mesh);

}  // namespace supple::scenes
