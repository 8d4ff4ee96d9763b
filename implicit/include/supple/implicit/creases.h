/// @file supple/implicit/creases.h
/// Meshes of bodies whose blend leaves creases: where nodes of a blending graph unite without blending, their surfaces
/// meet at an angle along a curve. Other meshers cut it off within a cell.
#pragma once

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit {

/// Whether two nodes of a graph whose supports overlap have a weight below 1.
[[nodiscard]] bool has_creases(const Field& field);

/// The surface of march_cubes with vertices on its creases. F is the largest of the fields
/// F_k = f_k + sum over j of w_kj min(f_j, f_k) - c of its nodes; a cell whose vertices belong to two or three of them gets a
/// vertex where their fields vanish together, and edges that cross the crease are turned onto it (Kobbelt et al. 2001).
/// Where that point lies more than half a cell beyond its cell, or a triangle would turn over, the cell stays as it was:
/// there the crease is cut off as by march_cubes. Closed and oriented. A vertex on a crease has the mean of the normals of
/// its sides. @pre the rule of the field's blend is Graph
[[nodiscard]] Mesh march_creases(const Field& field, const Lattice& lattice, const Executor& executor,
                                 MarchCounts* counts = nullptr);

}  // namespace supple::implicit
