/// Objects that hold volumes: what is measured of them, and how their kernels follow.
#pragma once

#include <vector>

#include "simulation/frame.h"

namespace supple::scenes {

/// Kernels and the reach of seeds of the bodies as the controllers of volume have them now. @param volumes  State::volumes
void scale_kernels(const Model& model, const std::vector<implicit::VolumeState>& volumes, std::vector<Body>& bodies);

/// Targets that the scene leaves to the start are the volumes of the present surfaces. @param state  State::volumes
void measure_targets(const StageContext& context, const core::ParticleState& particles, const std::vector<implicit::VolumeState>& state, Frame& frame,
                     Model& model);

/// Lets kernels grow or shrink for a time dt [s] towards the volume that their object, particle or primitive holds; bodies
/// that rest stay as they are. @return whether any body was looked at
bool control_volumes(const StageContext& context, const core::ParticleState& particles, double dt, Frame& frame,
                     std::vector<implicit::VolumeState>& volumes);

}  // namespace supple::scenes
