/// What steps that the scene fixes (`time_step.substeps`) are too coarse for. Automatic steps keep bounds that rule it out;
/// a fixed one may break these and still do well, so only what it certainly gets wrong counts.
#pragma once

#include <optional>

#include "simulation/frame.h"

namespace supple::scenes {

/// A pair that a step is too coarse for, and in words how that shows.
struct TooCoarse {
  collision::BodyPair bodies;
  std::string how;  ///< after the names of both
};

/// Where particles were and are, and when.
struct TakenStep {
  const core::ParticleState& before;
  const core::ParticleState& after;
  double end = 0.0;   ///< [s]
  double size = 0.0;  ///< [s]
};

/// The first pair that met within the step while its ends do not show so: on the straight way between them its contact holds
/// more energy than at both ends, or it gains more from end to end than the two bodies' motion has; by more than energies
/// err. Ways shorter than the thinner body's iso radius are not looked at.
/// @param seen  bodies after the step  @param trial  to be used for the looks; may be the same
[[nodiscard]] std::optional<TooCoarse> find_missed_contact(const StageContext& context, const TakenStep& step,
                                                           const std::vector<implicit::SampleState>& samples, const Frame& seen,
                                                           Frame& trial);

/// The first pair that half a step's push would give more energy than there is: from rest more than its contact holds (of a
/// linear spring, omega step > 2, the limit of velocity Verlet), or by damping more than it holds and comes with.
/// @param seen  with the contact surface after the step  @param limit  of (omega step)^2 of the method
/// @param trial  to be used for energies; may be `seen`
[[nodiscard]] std::optional<TooCoarse> find_unstable_contact(const StageContext& context, const TakenStep& step,
                                                             const std::vector<implicit::SampleState>& samples, const Frame& seen,
                                                             double limit, Frame& trial);

}  // namespace supple::scenes
