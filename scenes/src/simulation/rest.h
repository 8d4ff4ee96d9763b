/// Sleep of bodies (supple/collision/sleep.h): their motion, islands and pins.
#pragma once

#include <vector>

#include "supple/collision/sleep.h"
#include "supple/core/interactions.h"
#include "supple/scenes/model.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Motion of one body over its mass, under gravity alone. @param set  the particles with their present pins
[[nodiscard]] collision::BodyMotion motion_of(const Body& body, const core::ParticleSet& set, const core::ParticleState& state,
                                              const core::Interactions& laws);

/// The same for awake bodies, under the loads of that time [s] too; zero for the others. Shape [bodies].
[[nodiscard]] std::vector<collision::BodyMotion> motions_of(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& awake,
                                                            const core::ParticleSet& set, const core::ParticleState& state,
                                                            const core::Interactions& laws, double time);

/// Pairs of bodies with laws between them, which join their islands: the first body of two objects with all others.
[[nodiscard]] std::vector<collision::BodyPair> tied_bodies(const std::vector<Body>& bodies, const core::Interactions& laws);

/// Bodies under a load that changes between two times [s], once for each such load.
[[nodiscard]] std::vector<std::uint32_t> newly_loaded(const std::vector<Body>& bodies, const core::Interactions& laws, double from, double to);

/// Stops a body that falls asleep, and books its motion as held and dissipated.
void still(const Body& body, const core::ParticleSet& set, State& state);

/// Gives a body that woke in a step of velocity Verlet the half kick that its pins took, and removes it from the ledger.
/// @param loads  at the end of the step  @param dt  of it [s]
void give_half_kick(const Body& body, const core::ParticleSet& set, const core::Loads& loads, double dt, State& state);

}  // namespace supple::scenes
