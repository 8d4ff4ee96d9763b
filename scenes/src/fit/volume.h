/// @file volume.h
/// Volumes of voxels, and the surface of what lies inside.
#pragma once

#include <array>
#include <filesystem>
#include <limits>
#include <optional>
#include <vector>

#include "supple/core/executor.h"
#include "supple/fit/fit.h"

namespace supple::fit {

/// Values at the points of a lattice: index (i, j, k) lies at origin + axes (i, j, k).
struct Volume {
  std::array<std::size_t, 3> count{};  ///< i runs fastest
  Mat3 axes = Mat3::Identity();        ///< from one voxel to the next, by columns [m]
  Vec3 origin = Vec3::Zero();          ///< [m]
  std::vector<float> value;
  bool level_set = false;              ///< values are signed distances, less than 0 inside

  [[nodiscard]] std::size_t size() const { return count[0] * count[1] * count[2]; }
};

/// Voxels that a volume has at most.
inline constexpr double kMostVoxels = 4e8;

/// Refuses sizes that are none, and more than kMostVoxels voxels, before memory is taken. @param count  along the axes
void expect_voxels(const std::filesystem::path& file, const std::array<double, 3>& count);
/// Refuses axes that lie in a plane or are not finite.
void expect_axes(const std::filesystem::path& file, const Volume& volume);

/// NIfTI by libnifti, NRRD by teem, where these were found at build time; MetaImage. Millimetres count as such, and so do lengths without a unit. @throws as `fit`
[[nodiscard]] Volume read_image(const std::filesystem::path& file);
/// The first grid of numbers of an OpenVDB file; lengths count as metres.
[[nodiscard]] Volume read_vdb(const std::filesystem::path& file);

/// The surface of the voxels that the options choose: marching cubes on values averaged over a third of the error. Cavities are filled, what the border of the
/// volume cuts is closed there. Of several pieces (by faces of voxels) the largest is kept where `pieces` says so. @throws as `fit`
[[nodiscard]] Mesh surface_of_volume(const std::filesystem::path& file, Volume volume, const FitOptions& options, Repair& repair, const Executor& executor);

}  // namespace supple::fit
