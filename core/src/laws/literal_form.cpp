#include "supple/core/literal_form.h"

#include <algorithm>

#include "supple/core/interactions.h"

namespace supple::core {

LiteralFormLoad evaluate(const LiteralForm& law, const PairPose& pose) {
  const double gain = 2.0 * law.strength * law.weight.at(pose.r.norm()).psi;
  const auto force = [gain](const Vec3& r, double radius, const Vec3& own, const Vec3& other) -> Vec3 {
    return gain * (r + radius * (own - other));
  };
  const auto torque = [gain](const Vec3& r, double radius, const Vec3& own, const Vec3& other) -> Vec3 {
    return gain * radius * own.cross(Vec3(r - radius * other));
  };
  return {.force_a = force(pose.r, law.radius_a, pose.normal_a, pose.normal_b),
          .force_b = force(-pose.r, law.radius_b, pose.normal_b, pose.normal_a),
          .torque_a = torque(pose.r, law.radius_a, pose.normal_a, pose.normal_b),
          .torque_b = torque(-pose.r, law.radius_b, pose.normal_b, pose.normal_a)};
}

Stiffness stiffness(const LiteralForm& law) {
  const double radius = std::max(std::abs(law.radius_a), std::abs(law.radius_b));
  return {.translation = 2.0 * law.strength, .rotation = 2.0 * law.strength * radius * radius};
}

void accumulate_literal_form(const BondedLaw<LiteralForm>& list, const ParticleSet& set, const ParticleState& state,
                             Loads& loads) {
  for (std::size_t k = 0; k < list.law.size(); ++k) {
    const std::uint32_t a = list.first[k], b = list.second[k];
    const LiteralFormLoad load = evaluate(list.law[k], pair_pose(set, state, a, b));
    loads.force[a] += load.force_a;
    loads.force[b] += load.force_b;
    loads.torque[a] += load.torque_a;
    loads.torque[b] += load.torque_b;
  }
}

}  // namespace supple::core
