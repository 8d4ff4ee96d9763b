/// Pieces of broken bodies, and the state that they inherit.
#pragma once

#include <vector>

#include "simulation/frame.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Advances the age of broken links by dt [s], up to the time in which their blend fades. @return whether any changed
bool age_broken_links(const Model& model, double dt, State& state);

/// Updates `apart`: two pieces are apart when the bodies that they broke from were. @param before  the former bodies
[[nodiscard]] ApartPairs inherited_apart(const Model& model, const std::vector<Body>& before, const ApartPairs& apart,
                                         const std::vector<Body>& bodies);

/// Keeps warm starts of unchanged bodies; the others start afresh. @param samples  of `before`
[[nodiscard]] std::vector<implicit::SampleState> inherited_samples(const std::vector<Body>& before,
                                                                   const std::vector<implicit::SampleState>& samples,
                                                                   const std::vector<Body>& bodies);

/// New warm starts of a body.
[[nodiscard]] implicit::SampleState fresh_samples(const Body& body);

/// Records components of one object that overlap at the start. @param frame  with contacts of bodies that all touch each other
/// @return whether there are any
bool note_overlapping(const std::vector<Body>& bodies, const Frame& frame, Model& model);

/// Adds pairs of one object of kind OnceApart whose bounding boxes are now disjoint: they touch from then on.
/// @return whether there are any new ones
bool note_apart(const StageContext& context, const core::ParticleState& particles, Frame& frame, ApartPairs& apart);

}  // namespace supple::scenes
