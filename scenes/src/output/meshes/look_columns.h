/// Columns of a body's mesh that its look needs: rest coordinates for textures, stretch of bonds, speed.
#pragma once

#include "supple/collision/contact_surface.h"
#include "supple/core/executor.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// A body as it is now.
struct LookedAt {
  const Body& body;
  const core::ParticleState& particles;
  const core::Interactions& laws;  ///< those that nothing has broken
  implicit::FieldView field;
  std::span<const Pose> poses;     ///< of the body's particles
};

void add_look_columns(const Model& model, const LookedAt& now, const Executor& executor, Mesh& mesh);

/// Adds the column "pressure" [Pa]: min(p_A, p_B) where the body's surface is pressed in by another one, 0 elsewhere. Fixed bodies do not cut the surface:
/// inside of them a vertex has the pressure of the contact surface that lies on its way out.
/// @param bodies  contact bodies   @param surface  their contact surfaces
void add_pressure(std::span<const collision::ContactBody> bodies, const collision::ContactSurface& surface, std::uint32_t body,
                  const Executor& executor, Mesh& mesh);

}  // namespace supple::scenes
