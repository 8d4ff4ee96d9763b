/// Objects with volume control: measurement of volumes and scaling of kernels.
#pragma once

#include <vector>

#include "simulation/frame.h"

namespace supple::scenes {

/// Sets kernels and the reach of seeds of the bodies to the present scales. @param volumes  State::volumes
void scale_kernels(const Model& model, const std::vector<implicit::VolumeState>& volumes, std::vector<Body>& bodies);

/// Sets targets that the scene does not give to the volumes of the present surfaces. @param state  State::volumes
void measure_targets(const StageContext& context, const core::ParticleState& particles, const std::vector<implicit::VolumeState>& state, Frame& frame,
                     Model& model);

/// Advances the scales of kernels by a time dt [s] towards the target volume of their object, particle or primitive; resting bodies
/// do not change. @return whether any body was measured
bool control_volumes(const StageContext& context, const core::ParticleState& particles, double dt, Frame& frame,
                     std::vector<implicit::VolumeState>& volumes);

}  // namespace supple::scenes
