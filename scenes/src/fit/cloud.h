/// @file cloud.h
/// Surfaces through points.
#pragma once

#include <filesystem>

#include "supple/core/executor.h"
#include "supple/fit/fit.h"

namespace supple::fit {

/// Poisson's surface (Kazhdan, Bolitho & Hoppe 2006) through points of a file .xyz or .ply. Normals that the file lacks are those of surfaces of second order
/// through neighbours (Cazals & Pouget 2005), turned alike along a minimum spanning tree (Hoppe et al. 1992). Of more than some ten thousand points one for each
/// cube of a quarter of the error is used. The function is sampled on a lattice of three quarters of the distance between points; cavities are filled. @throws as `fit`
[[nodiscard]] Mesh surface_through_points(const std::filesystem::path& file, double error, Repair& repair, const Executor& executor);

}  // namespace supple::fit
