/// @file smooth_normals.h
/// Normals of meshes with smooth and sharp edges.
#pragma once

#include "supple/core/mesh.h"

namespace supple::scenes {

/// Every corner of a triangle gets the mean normal of the triangles at its place that differ from its own by less than an angle, weighted by their angles
/// there (Thuermer & Wuethrich 1998). Triangles of no area keep their normals.
/// @param mesh   with three vertices of its own for each triangle   @param angle  [rad], >= 0
void smooth_normals(double angle, Mesh& mesh);

}  // namespace supple::scenes
