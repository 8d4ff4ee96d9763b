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

/// Evens out waves shorter than `width` by diffusion along the edges (Taubin 1995, without its second step), moves the surface along its normals until
/// its volume is what it was, and finds the normals anew. Columns stay.
/// @param fixed  vertices that stay; [vertices]  @pre width > 0, closed mesh
void even_surface(double width, const std::vector<bool>& fixed, Mesh& mesh);

}  // namespace supple::scenes
