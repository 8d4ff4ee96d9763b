/// @file supple/scenes/query.h
/// Values of a scene's initial (or a saved) state as JSON text: `supple query WHAT SCENE`.
#pragma once

#include <filesystem>
#include <string>

#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Force, torque and energy by law, particle by particle; contact included as law "contact".
[[nodiscard]] std::string query_forces(Simulation& simulation);

/// For each pair: force, moment about the origin, area, centre of pressure, energy, points, and the error estimate, with the given error
/// and whether it is met; cpu_us of all pairs together.
[[nodiscard]] std::string query_contact(Simulation& simulation, bool samples);

/// Value, gradient and owner at each point of a CSV file, of each object. @throws Error{Io}, Error{Scene}
[[nodiscard]] std::string query_field(Simulation& simulation, const std::filesystem::path& points);

struct MeshQuery {
  int cells = 0;                   ///< cells along the longest side of all surfaces; 0: the scene's cell
  std::filesystem::path out;       ///< .ply or .obj file, or folder, for the meshes; empty: none
};
/// Counts, closed or not, area, volume, cpu_ms, by object, and the defects of the meshes as in result.json. @throws Error{Io}, Error{Usage} for a file of another kind
[[nodiscard]] std::string query_mesh(Simulation& simulation, const MeshQuery& query);

/// The plan as text (`supple explain`): stages with reasons, time step (or why none is possible), sizes, contacts.
[[nodiscard]] std::string explain(Simulation& simulation);

/// One line per mesh obstacle: its triangles, and the largest distance of its surface from them (`supple check`); empty without any.
[[nodiscard]] std::string describe_mesh_obstacles(const Model& model);

}  // namespace supple::scenes
