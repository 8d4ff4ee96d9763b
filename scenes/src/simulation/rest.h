/// What sleep asks about bodies, and does to them (supple/collision/sleep.h).
#pragma once

#include <vector>

#include "supple/collision/sleep.h"
#include "supple/core/interactions.h"
#include "supple/scenes/model.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Motion of one body over its mass, under gravity alone. @param set  the particles with what pins them now
[[nodiscard]] collision::BodyMotion motion_of(const Body& body, const core::ParticleSet& set, const core::ParticleState& state,
                                              const core::Interactions& laws);

/// The same for bodies that are awake, under the loads of that time [s] too; the others are still. Shape [bodies].
[[nodiscard]] std::vector<collision::BodyMotion> motions_of(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& awake,
                                                            const core::ParticleSet& set, const core::ParticleState& state,
                                                            const core::Interactions& laws, double time);

/// Bodies that laws act between, which makes them one island: the first of two objects with all others.
[[nodiscard]] std::vector<collision::BodyPair> tied_bodies(const std::vector<Body>& bodies, const core::Interactions& laws);

/// Bodies under a load that changes between two times [s], once for each such load.
[[nodiscard]] std::vector<std::uint32_t> newly_loaded(const std::vector<Body>& bodies, const core::Interactions& laws, double from, double to);

/// Takes the motion of a body that falls asleep, and books it as held and dissipated.
void still(const Body& body, const core::ParticleSet& set, State& state);

/// Gives a body that woke in a step of velocity Verlet the half kick that its pins took, and takes it back from their ledger.
/// @param loads  at the end of the step  @param dt  of it [s]
void give_half_kick(const Body& body, const core::ParticleSet& set, const core::Loads& loads, double dt, State& state);

}  // namespace supple::scenes
