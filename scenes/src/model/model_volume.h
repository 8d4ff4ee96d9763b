/// Volume control of an object: targets, cells of the measurement, and checks for targets that kernels cannot reach.
#pragma once

#include "model/model_faults.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// Sets up an object's `volume`. @param given  target volume of each primitive, or 0 [m^3]
/// @pre the object has its skeleton and iso radius
void hold_volume(const ObjectDesc& d, const std::string& key, std::uint32_t n, std::vector<double> given, ObjectModel& object, ModelFaults& faults);

/// Checks that a primitive's own `volume` fits into its support at the largest scale.
void check_volume(const implicit::Primitive& primitive, double target, const std::string& key, ModelFaults& faults);

}  // namespace supple::scenes
