/// What presses harder than a pair can hold: noticed while stepping, and turned back where the scene asks for hard cores.
#pragma once

#include <map>
#include <vector>

#include "simulation/frame.h"
#include "supple/collision/approach.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Looks at every pair that touches. A pair is overloaded when the kinetic energy of its approach (with the masses of the
/// whole bodies) and its contact energy are more than half of what it can hold (`collision::contact_capacity`).
class OverloadWatch {
 public:
  void look(const StageContext& context, const Frame& frame, double time, RunRecord& record);
  /// The same of bodies that lie in others with all of them: their pairs have no force, but an energy. @param frame  with energies
  static void look_within(const StageContext& context, const Frame& frame, double time, RunRecord& record);
  /// Bodies have other indices from now on.
  void forget();

 private:
  /// The entry of `capacity_` for a pair.
  [[nodiscard]] static collision::BodyPair kinds_of(const StageContext& context, const collision::BodyPair& pair);

  std::vector<std::uint8_t> looked_at_;  // 1: a pair whose energy is near what it can hold, or that is new
  std::map<collision::BodyPair, double> capacity_;  ///< when the pair, or one like it, was first seen [J]
  std::map<collision::BodyPair, double> worst_;     ///< energy when the capacity was last measured [J]
};

/// Mass of a whole body [kg]; infinite when a pin holds it, and of a fixed one.
[[nodiscard]] double mass_of(const StageContext& context, std::uint32_t body);

/// What moves the parts of the bodies that touch, by contact body; fixed ones stay empty.
void find_mobility(const StageContext& context, const core::ParticleState& particles, const Frame& frame,
                   std::vector<collision::PartMobility>& mobility);

/// Turns back what approaches beyond its core (`collision::hold_cores`); books what pins and fixed bodies take, and what
/// sweeps that only stopped an approach took away. @return whether any velocity changed
bool hold_cores(const StageContext& context, Frame& frame, core::ParticleState& particles, core::Ledger& ledger,
                RunRecord& record);

}  // namespace supple::scenes
