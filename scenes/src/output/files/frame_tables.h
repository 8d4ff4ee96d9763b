/// Particles and contacts of one frame as tables.
#pragma once

#include "supple/core/io/vtk_files.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Every particle with object, mass, pose, motion and its contact loads; one line per bond.
[[nodiscard]] io::PointSet particle_points(Simulation& simulation);

/// Every quadrature point of the contact surfaces with bodies, normal, area, pressure and the elastic force on body A.
[[nodiscard]] io::PointSet contact_points(Simulation& simulation);
/// One point per pair in contact, at its centre of pressure.
[[nodiscard]] io::PointSet contact_pairs(Simulation& simulation);

}  // namespace supple::scenes
