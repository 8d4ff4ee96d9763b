/// @file supple/render/glyphs.h
/// Simple bodies for items without a surface: arrows for the axes of particles, rods for bonds, balls.
#pragma once

#include <array>
#include <span>

#include "supple/core/mesh.h"
#include "supple/core/types.h"

namespace supple::render {

/// A closed ball of 80 triangles. @pre radius > 0
void add_ball(Mesh& mesh, const Vec3& centre, double radius);
/// A closed rod of 12 sides; nothing where its ends coincide. @pre radius > 0
void add_rod(Mesh& mesh, const Vec3& from, const Vec3& to, double radius);
/// A closed arrow of 12 sides: a rod, and a cone over the last third. @pre length > 0
void add_arrow(Mesh& mesh, const Vec3& from, const Vec3& direction, double length);

/// Arrows of `length` [m] along the x, y and z axes of poses: a mesh for each axis.
[[nodiscard]] std::array<Mesh, 3> frame_glyphs(std::span<const Pose> poses, double length);

}  // namespace supple::render
