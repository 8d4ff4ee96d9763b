/// @file frame_columns.h
/// Tables of one frame, by columns: what measures reduce.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "supple/scenes/simulation.h"
#include "sweep/measures.h"

namespace supple::scenes {

struct FrameColumns {
  std::vector<std::string> name;
  std::vector<std::vector<double>> value;           ///< shape [columns][rows]
  std::vector<std::array<std::string, 2>> members;  ///< of each row: its object, or the two of a contact
};

/// The rows of the present frame. Columns of particles and contacts are those of the tables that a run writes; arrays of vectors are also there as their lengths.
/// energies: kinetic_j, interaction_j, contact_j, total_j, dissipated_j, external_work_j
/// objects: x_m, y_m, z_m, vx_m_s, vy_m_s, vz_m_s, speed_m_s of the centre of mass; deformation: RMS distance after the best rigid fit over the rest diameter [1]
[[nodiscard]] FrameColumns frame_columns(FrameTableName table, Simulation& simulation);

}  // namespace supple::scenes
