/// @file arrangement.h
/// Where the particles of an object lie at the start.
#pragma once

#include <string>

#include "model/model_faults.h"
#include "supple/core/arrange.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Without particles, and with a fault, where the file that has them cannot be read or has too many.
/// @param key  of these particles
[[nodiscard]] core::Arrangement arrange(const Scene& scene, const ParticlesDesc& d, const std::string& key, ModelFaults& faults);

}  // namespace supple::scenes
