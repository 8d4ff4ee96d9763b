/// Detects contacts for which steps fixed by the scene (`time_step.substeps`) are too coarse. Automatic steps keep bounds that
/// exclude this; a fixed step may exceed the bounds and still be accurate, so only certain errors count.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "simulation/frame.h"

namespace supple::scenes {

/// A pair for which a step is too coarse, and the evidence in words.
struct TooCoarse {
  collision::BodyPair bodies;
  std::string how;  ///< after the names of both
};

/// Particles before and after a step, and its time.
struct TakenStep {
  const core::ParticleState& before;
  const core::ParticleState& after;
  double end = 0.0;   ///< [s]
  double size = 0.0;  ///< [s]
};

/// Contacts at both ends of a step, with energies.
struct EndContacts {
  const std::vector<collision::ContactSurface::Summary>&before, &after;
};

/// The first pair that met within the step while its ends do not show so: on the straight way between them its contact holds
/// more energy than at both ends, or it gains more from end to end than the two bodies' motion has; by more than energies
/// err. Paths shorter than the thinner body's iso radius are not checked.
/// @param seen  bodies after the step  @param ends  absent: found here  @param trial  scratch for trial states; may be `seen`
[[nodiscard]] std::optional<TooCoarse> find_missed_contact(const StageContext& context, const TakenStep& step,
                                                           const std::vector<implicit::SampleState>& samples, const Frame& seen,
                                                           const EndContacts* ends, Frame& trial);

/// The first pair to which the push of half a step would give more energy than it has: from rest more than its contact energy (for a
/// linear spring, omega step > 2, the limit of velocity Verlet), or by damping more than its contact and kinetic energy.
/// @param seen  with the contact surface after the step  @param limit  of (omega step)^2 of the method
/// @param trial  scratch for energies; may be `seen`
[[nodiscard]] std::optional<TooCoarse> find_unstable_contact(const StageContext& context, const TakenStep& step,
                                                             const std::vector<implicit::SampleState>& samples, const Frame& seen,
                                                             double limit, Frame& trial);

}  // namespace supple::scenes
