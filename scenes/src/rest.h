/// What sleep asks about bodies (supple/collision/sleep.h).
#pragma once

#include <vector>

#include "supple/collision/sleep.h"
#include "supple/core/interactions.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// Motion of one body over its mass, under gravity alone. @param set  the particles with what pins them now
[[nodiscard]] collision::BodyMotion motion_of(const Body& body, const core::ParticleSet& set, const core::ParticleState& state,
                                              const core::Interactions& laws);

/// The same for bodies that are awake, under the loads of that time [s] too; the others are still. Shape [bodies].
[[nodiscard]] std::vector<collision::BodyMotion> motions_of(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& awake,
                                                            const core::ParticleSet& set, const core::ParticleState& state,
                                                            const core::Interactions& laws, double time);

}  // namespace supple::scenes
