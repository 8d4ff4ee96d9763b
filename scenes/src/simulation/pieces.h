/// Pieces that links held together: what they have of the bodies that they broke from.
#pragma once

#include <vector>

#include "simulation/frame.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Links that broke grow older by dt [s], up to the time in which their blend fades. @return whether any did
bool age_broken_links(const Model& model, double dt, State& state);

/// Two pieces are apart when those that they broke from were. @param before  the bodies until now, of the pairs in `apart`
[[nodiscard]] ApartPairs inherited_apart(const Model& model, const std::vector<Body>& before, const ApartPairs& apart,
                                         const std::vector<Body>& bodies);

/// Warm starts of bodies that are as they were; those of the others begin anew. @param samples  of `before`
[[nodiscard]] std::vector<implicit::SampleState> inherited_samples(const std::vector<Body>& before,
                                                                   const std::vector<implicit::SampleState>& samples,
                                                                   const std::vector<Body>& bodies);

/// Warm starts of a body that has none.
[[nodiscard]] implicit::SampleState fresh_samples(const Body& body);

/// Notes components of one object that overlap at the start. @param frame  of the contacts there, of bodies that all touch each other
/// @return whether there are any
bool note_overlapping(const std::vector<Body>& bodies, const Frame& frame, Model& model);

/// Adds bodies of one object that meet once they have been apart and whose surfaces are in separate boxes: they touch from then on.
/// @return whether there are any new ones
bool note_apart(const StageContext& context, const core::ParticleState& particles, Frame& frame, ApartPairs& apart);

}  // namespace supple::scenes
