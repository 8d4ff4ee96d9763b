/// @file arrangement.h
/// Initial positions of the particles of an object.
#pragma once

#include <string>

#include "model/model_faults.h"
#include "supple/core/arrange.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Returns no particles and adds a fault where their file cannot be read or has too many.
/// @param key  key of these particles
[[nodiscard]] core::Arrangement arrange(const Scene& scene, const ParticlesDesc& d, const std::string& key, ModelFaults& faults);

}  // namespace supple::scenes
