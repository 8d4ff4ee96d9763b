/// @file measure.h
/// Distances between data and fit.
#pragma once

#include "fit/samples.h"
#include "supple/implicit/field_view.h"

namespace supple::fit {

/// The surface of a field. @param cell  of the lattice of marching cubes
[[nodiscard]] Mesh mesh_of(const implicit::FieldView& field, double cell, const Executor& executor);

/// Distances of points to a mesh.
[[nodiscard]] std::vector<double> distances(std::span<const Vec3> points, const SurfaceTree& tree, const Executor& executor);

/// RMS of samples even in area, and the one-sided Hausdorff distance within `error`.
[[nodiscard]] Distance measure(const Mesh& from, const Mesh& to, const SurfaceTree& tree_of_to, double error, const Executor& executor);

}  // namespace supple::fit
