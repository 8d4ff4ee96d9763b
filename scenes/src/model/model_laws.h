/// @file model_laws.h
/// The laws of a model: pair laws and their bonds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/model_faults.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// Adds the laws between particles of one object to the model. @param key  of the object
void add_laws(const std::vector<InteractionDesc>& interactions, const ObjectModel& object, const std::string& key, Model& model,
              ModelFaults& faults);

/// Range of a law without bonds [m]; nothing where its values are inconsistent. @pre d.geometric
[[nodiscard]] std::optional<double> geometric_range(const InteractionDesc& d);

}  // namespace supple::scenes
