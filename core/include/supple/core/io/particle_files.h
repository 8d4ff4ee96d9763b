/// @file supple/core/io/particle_files.h
/// Particles from other tools: CSV, and the vertices of PLY files.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "supple/core/arrange.h"

namespace supple::io {

/// Columns of numbers by name; all have the same length.
struct NumberTable {
  std::vector<std::string> name;
  std::vector<std::vector<double>> column;
};

/// Properties of the vertices of a PLY file, text or binary; lists are left out.
/// @throws Error{Io} when absent, Error{Scene} naming the place of the fault
[[nodiscard]] NumberTable read_ply_vertices(const std::filesystem::path& path);

/// CSV with a line of names: numbers separated by commas or blanks, '#' comments.
/// @throws Error{Io} when absent, Error{Scene} with file:line for a line that has not as many finite numbers as there are names
[[nodiscard]] NumberTable read_csv_columns(const std::filesystem::path& path);

/// Particles of a CSV or PLY file (by its extension; others are CSV), by the names of their columns: x, y, z [m]; nx, ny, nz, normals in world axes;
/// radius, of inertia [m]; mass [kg]; qw, qx, qy, qz, body to world; vx, vy, vz [m/s]. Names may end in a unit, as those of tables that a run writes do: x_m, mass_kg,
/// vx_m_s. CSV without names holds x, y, z. Where an orientation is absent, body z is the normal; others are the identity.
/// @param most  particles
/// @throws Error{Io} when absent, Error{Scene} for faults of the format, of a PLY file that is named CSV, of an incomplete group, of values out of range
[[nodiscard]] core::Arrangement read_particles(const std::filesystem::path& path, std::size_t most);

}  // namespace supple::io
