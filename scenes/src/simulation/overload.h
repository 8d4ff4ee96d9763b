/// Overloaded pairs: detected while stepping, and pushed back where the scene has contact.core: barrier.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "simulation/frame.h"
#include "supple/collision/approach.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// Checks every pair in contact. A pair is overloaded when the kinetic energy of its approach (with the masses of the
/// whole bodies) and its contact energy exceed half of its capacity (`collision::contact_capacity`). Its bodies pass through each other when its contact
/// energy alone exceeds half of the capacity and, with the kinetic energy of the masses that the contact moves (`collision::approach_inverse_mass`), all of it.
class OverloadWatch {
 public:
  /// @return the first pair that passes
  std::optional<RunRecord::Overload> look(const StageContext& context, const core::ParticleState& particles, const Frame& frame, double time,
                                          RunRecord& record);
  /// The same for bodies that lie entirely inside others: their pairs have an energy, but no force. They pass if they were overloaded before; those that are
  /// found so began so, and are recorded. @param frame  with energies
  static std::optional<RunRecord::Overload> look_within(const StageContext& context, const Frame& frame, double time, RunRecord& record);
  /// Renumbers the bodies.
  void forget();

 private:
  /// The entry of `capacity_` for a pair.
  [[nodiscard]] static collision::BodyPair kinds_of(const StageContext& context, const collision::BodyPair& pair);

  std::vector<std::uint8_t> looked_at_;  // 1: a pair whose energy is near its capacity, or a new pair
  /// Coarse, of a pair.
  struct Capacity {
    double energy = 0.0;  ///< [J]
    bool whole = false;   ///< false: `energy` is a lower bound
  };
  std::map<collision::BodyPair, Capacity> capacity_;  ///< a lower bound is measured when the pair, or an equivalent one, is first in contact
  std::map<collision::BodyPair, double> worst_;     ///< energy when the capacity was last measured [J]
};

/// Mass of a whole body [kg]; infinite when a pin holds it, and of a fixed one.
[[nodiscard]] double mass_of(const StageContext& context, std::uint32_t body);

/// Mobility of the parts of touching bodies, by contact body; empty for fixed ones.
void find_mobility(const StageContext& context, const core::ParticleState& particles, const Frame& frame,
                   std::vector<collision::PartMobility>& mobility);

/// Pushes back bodies that approach beyond the barrier (`collision::hold_cores`); books the impulses of pins and fixed bodies, and the energy that
/// sweeps without rebound dissipated. @return whether any velocity changed
bool hold_cores(const StageContext& context, Frame& frame, core::ParticleState& particles, core::Ledger& ledger,
                RunRecord& record);

}  // namespace supple::scenes
