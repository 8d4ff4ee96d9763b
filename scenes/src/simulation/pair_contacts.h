/// @file pair_contacts.h
/// Contact of each two objects, step by step: peak force, impulse, contact time, and the speeds before and after the first contact.
#pragma once

#include <string>

#include "simulation/frame.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// A step whose contacts are booked.
struct BookedStep {
  double end = 0.0;          ///< [s]
  double size = 0.0;         ///< [s]
  bool mean_forces = false;  ///< forces are the means over the step, not those at its end
};

/// Adds the contacts of `frame.surface` with the forces `frame.traction_force` to `state.record.pair_contacts`. A contact begins and ends within a step where its
/// depth, continued at the rate of the two nearest ends of steps, is zero. Pairs that sleep keep their contact and its force.
/// Contact between bodies of one object is not booked.
void book_pair_contacts(const StageContext& context, const Frame& frame, const BookedStep& step, State& state);

/// Name of an object by the number that PairContact has, or of an obstacle.
[[nodiscard]] const std::string& pair_member_name(const Model& model, std::uint32_t number);

}  // namespace supple::scenes
