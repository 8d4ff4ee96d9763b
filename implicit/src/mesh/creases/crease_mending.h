/// @file crease_mending.h
/// Where edges of a mesh still cross a crease once every cell has been seen to by itself, the triangles around are made anew.
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

/// In a valley that is steep for the cells, what was nearest to an edge need not follow on the crease as edges follow on the mesh: cutting
/// all of them would turn triangles over. Here the triangles at such an edge are taken out, up to four times with all around the vertices
/// at which their border meets the crease, until that border meets the crease twice and the two sides of the hole can be filled by ears
/// (Meisters 1975), with vertices on the crease a cell apart between them. What that cannot fill with triangles that face outward stays.
/// Each hole is a step. The result depends on the triangles around such edges, at most kMostTaken to a hole, and where holes would meet,
/// on the order of triangles.
/// @param mesh   vertices; its triangles are those of the steps
/// @param owner  the node of each of the first vertices; all others lie on the crease
/// @param cell   [m]
/// @param skip   whether attempts that would fail again are left out
void mend_creases(const Mesh& mesh, std::span<const std::uint32_t> owner, double cell, bool skip, const CreaseVertex& add_vertex, TriangleSteps& steps);

}  // namespace supple::implicit
