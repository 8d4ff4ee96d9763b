/// Columns of a body's mesh that its look asks for: rest coordinates for textures, stretch of bonds, speed.
#pragma once

#include "supple/core/executor.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// @param poses  of the body's particles
void add_look_columns(const Model& model, const Body& body, const core::ParticleState& particles,
                      const core::Interactions& laws, const implicit::FieldView& field, std::span<const Pose> poses,
                      const Executor& executor, Mesh& mesh);

}  // namespace supple::scenes
