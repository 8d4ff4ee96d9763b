/// @file crease_mending.h
/// Where edges of a mesh still cross a crease after every cell was treated alone, the triangles around them are rebuilt.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "mesh/triangle_steps.h"
#include "supple/core/mesh.h"

namespace supple::implicit {

/// Adds a vertex on the crease of two nodes, near a point. @return its number, unless there is none
using CreaseVertex = std::function<std::optional<std::uint32_t>(const std::array<std::uint32_t, 2>& nodes, const Vec3& near)>;

/// In a valley that is steep for the cells, the points nearest to successive edges need not be in order along the crease: splitting
/// all of these edges would invert triangles. Here the triangles at such an edge are removed, up to four times with all triangles around the
/// vertices at which their border meets the crease, until the border meets the crease twice and the two sides of the hole can be filled by ears
/// (Meisters 1975), with vertices on the crease a cell apart between them. A hole that cannot be filled with outward triangles is left as it was.
/// Each hole is a step. The result depends on the triangles around such edges, at most kMostTaken per hole, and where holes would meet,
/// on the order of triangles.
/// @param mesh   vertices; its triangles are those of the steps
/// @param owner  the node of each of the first vertices; all others lie on the crease
/// @param cell   [m]
/// @param skip   whether attempts that would fail again are skipped
void mend_creases(const Mesh& mesh, std::span<const std::uint32_t> owner, double cell, bool skip, const CreaseVertex& add_vertex, TriangleSteps& steps);

}  // namespace supple::implicit
