/// @file pair_contacts.h
/// Contact of each two objects, step by step: peak force, impulse, contact time, and the speeds before and after the first contact.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "simulation/frame.h"
#include "supple/core/compliant_contact.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

/// A step whose contacts are booked.
struct BookedStep {
  double end = 0.0;          ///< [s]
  double size = 0.0;         ///< [s]
  bool mean_forces = false;  ///< forces are the means over the step, not those at its end
  std::span<const double> depths{};  ///< at its end, by pair of `frame.surface` [m]; empty: those of the surface
};

/// Depths at the end of an implicit step. Contact is found at a predicted pose; from there the bodies move on at the point of largest pressure as the step moves them.
class EndDepths {
 public:
  /// The last call counts.
  void predict(const core::ParticleState& pose, const core::ContactPoints& points);
  /// @param particles  at the end of the step   @return by pair [m], >= 0
  [[nodiscard]] std::vector<double> at_end(const core::ParticleState& particles, std::span<const collision::ContactSurface::Summary> pairs) const;

 private:
  struct Mover {
    std::uint32_t particle = 0;
    double share = 0.0;             ///< of A positive, of B negative
    Vec3 predicted = Vec3::Zero();  ///< [m]
  };
  struct Peak {
    Vec3 normal = Vec3::Zero();     ///< out of A and into B
    std::vector<Mover> movers;
  };
  std::vector<Peak> peaks_;
};

/// Adds the contacts of `frame.surface` with the forces `frame.traction_force` to `state.record.pair_contacts`. A contact begins and ends within a step where its
/// depth, continued at the rate of the two nearest ends of steps, is zero. Pairs that sleep keep their contact and its force.
/// Contact between bodies of one object is not booked.
void book_pair_contacts(const StageContext& context, const Frame& frame, const BookedStep& step, State& state);

/// Name of an object by the number that PairContact has, or of an obstacle.
[[nodiscard]] const std::string& pair_member_name(const Model& model, std::uint32_t number);

}  // namespace supple::scenes
