/// @file supple/core/io/vtk_files.h
/// Points with data as VTK XML files (.vtp), and the list of a sequence of them with times (.pvd), for ParaView.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "supple/core/types.h"

namespace supple::io {

/// One named array of data at points.
struct PointData {
  std::string name;                    ///< with its unit, e.g. "velocity_m_s"
  std::vector<std::string> component;  ///< names of the components of a tuple, e.g. "vx_m_s"; empty: single numbers
  std::vector<double> values;          ///< shape [points][components]

  [[nodiscard]] std::size_t components() const { return component.empty() ? 1 : component.size(); }
};

struct PointSet {
  std::vector<Vec3> position;                          ///< [m]
  std::vector<std::array<std::uint32_t, 2>> line;      ///< lines between points, by index
  std::vector<PointData> data;

  /// Adds an array of zeros, one tuple per point.
  std::vector<double>& add(std::string name, std::vector<std::string> component = {});
};

/// VTK PolyData in XML: each point a vertex, and the lines. Arrays are appended raw with 64 bits per number, so they are
/// those of the state. @throws Error{Io}
void write_vtp(const std::filesystem::path& path, const PointSet& points);

/// The same points as CSV (see `write_csv`): x_m, y_m, z_m and every component of every array; lines are left out.
/// @throws Error{Io}
void write_points_csv(const std::filesystem::path& path, const PointSet& points);

struct TimedFile {
  double time = 0.0;                   ///< [s]
  std::filesystem::path file;          ///< relative to the folder of the list
};
/// @throws Error{Io}
void write_pvd(const std::filesystem::path& path, std::span<const TimedFile> files);

}  // namespace supple::io
