/// @file stages.h
/// Stages 2 to 7 of docs/architecture.md: from particles to loads of contact on them. Each is a function named after the function of
/// the module that does its work. It measures itself in the profile, and does nothing where bounds of the stages before show that
/// nothing can touch.
#pragma once

#include "simulation/frame.h"

namespace supple::scenes {

namespace stages {

/// Stage 2. Also finds the pairs of bodies whose supports reach one another.
void place_skeleton(const StageContext& context, const core::ParticleState& particles, Frame& frame);

/// Stage 3: fields of bodies that another one reaches. @param all  contact looks at the other bodies too
void index_field(const StageContext& context, const core::ParticleState& particles, bool all, Frame& frame);

/// Stage 4: pairs whose surface boxes overlap, and samples where they may meet. Kept distances are read from and written to `samples`.
void sample_surface(const StageContext& context, std::vector<implicit::SampleState>& samples, Frame& frame);

/// Stage 5.
void find_contacts(const StageContext& context, Frame& frame);

/// Stage 6. @param energy  is computed too
void solve_contact_surface(const StageContext& context, bool energy, Frame& frame);

/// Stage 7: loads of the contact surface on particles; the loads on fixed bodies are added to the sample apart.
void react(const StageContext& context, Frame& frame, core::ForceSample& out);

/// Stage 7 of implicit steps: the contact surface as points whose pressure is linear in the approach.
void linearise(const StageContext& context, Frame& frame, core::ContactPoints& out);

}  // namespace stages

/// Stages 2 to 6: from particles to the contact surface, with its energy if asked for.
void find_contact_surface(const StageContext& context, const core::ParticleState& particles,
                          std::vector<implicit::SampleState>& samples, Frame& frame, bool energy);

}  // namespace supple::scenes
