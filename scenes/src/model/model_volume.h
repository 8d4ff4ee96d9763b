/// Volumes that an object holds: targets, cells that measure them, and targets that no kernels reach.
#pragma once

#include "model/model_faults.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// What an object's `volume` asks for. @param given  what the scene says that each primitive holds, or 0 [m^3]
/// @pre the object has its skeleton and iso radius
void hold_volume(const ObjectDesc& d, const std::string& key, std::uint32_t n, std::vector<double> given, ObjectModel& object, ModelFaults& faults);

/// What a primitive's own `volume` asks for must fit into its support at the largest scale.
void check_volume(const implicit::Primitive& primitive, double target, const std::string& key, ModelFaults& faults);

}  // namespace supple::scenes
