/// @file supple/core/io/mesh_files.h
/// Surface meshes and tables as files other tools open.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "supple/core/mesh.h"

namespace supple::io {

/// Binary little-endian PLY with normals and every column as a float property. Positions are double: in single precision small
/// triangles far from the origin would degenerate or intersect. @throws Error{Io}
void write_ply(const std::filesystem::path& path, const Mesh& mesh);

/// Wavefront OBJ (ASCII) with normals, without columns. Positions in double precision, as in PLY. @throws Error{Io}
void write_obj(const std::filesystem::path& path, const Mesh& mesh);

/// One named column of a table; all columns of a table have the same length.
struct TableColumn {
  std::string name;               ///< with its unit, e.g. "pressure_pa"
  std::span<const double> values;
};

/// CSV with a header line; numbers have the shortest text that reads back as the same bits.
/// @throws Error{Io}
void write_csv(const std::filesystem::path& path, std::span<const TableColumn> columns);

/// Default limit of points for `read_points_csv`.
inline constexpr std::size_t kMostPoints = 2'000'000;

/// Points from a CSV file: three numbers per line, an optional header line, '#' comments.
/// @throws Error{Io} when absent, Error{Scene} with file:line for a line that is not three finite numbers, and for more than `most` points.
[[nodiscard]] std::vector<Vec3> read_points_csv(const std::filesystem::path& path, std::size_t most = kMostPoints);

}  // namespace supple::io
