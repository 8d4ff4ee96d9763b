/// @file supple/collision/stick.h
/// Friction that holds: a spring in the contact plane of each pair, which yields at the Coulomb limit (Cundall & Strack 1979,
/// Geotechnique 29:47; the return mapping of Simo & Laursen 1992). Its ends are material points of the two bodies that
/// lie at one place, the centre of pressure, at the end of the last step; what they have moved apart since is added to
/// the displacement kept from before, which is carried with the mean rotation of the bodies. Force evaluations read the
/// springs, the end of a step writes them. A second spring holds the twist about the normal: a couple with the arm r, the
/// root of the mean square distance from the centre of pressure weighted with p dA.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/contact_surface.h"
#include "supple/core/hash.h"

namespace supple::collision {

struct StickRule {
  double stiffness = 0.0;  ///< k_t [N/m]; 0: no springs
  double damping = 0.0;    ///< the force is -k_t (displacement + damping times its rate) [s], >= 0
};

/// Between part `part[0]` of body pair.a and part `part[1]` of body pair.b.
struct StickSpring {
  BodyPair pair;
  std::uint32_t part[2] = {0, 0};
  Vec3 anchor[2] = {Vec3::Zero(), Vec3::Zero()};        ///< the same world point, in the part's frame [m]
  Vec3 displacement[2] = {Vec3::Zero(), Vec3::Zero()};  ///< of A against B, in the part's frame [m]
  Quat relative = Quat::Identity();                     ///< of B's part as seen from A's
  double arm = 0.0;                                     ///< r [m]
  double twist = 0.0;                                   ///< r times the angle that A is twisted by against B [m]
};

/// Part of State. Springs exist for the pairs that touched at the end of the last step.
struct StickState {
  std::vector<StickSpring> spring;  ///< sorted by pair
  [[nodiscard]] const StickSpring* find(const BodyPair& pair) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

/// The spring in a trial: where it acts, and how far it is stretched.
struct StickTrial {
  Vec3 point = Vec3::Zero();         ///< midway between the anchors [m]
  Vec3 displacement = Vec3::Zero();  ///< of A against B, in the plane across `normal` [m]
  double twist = 0.0;                ///< as in the spring [m]
};
/// @param normal  unit, of the contact
[[nodiscard]] StickTrial stretch(const StickSpring& spring, const ContactBody& a, const ContactBody& b, const Vec3& normal);

/// Distances of the points of one pair's Sigma from its centre of pressure across the normal, weighted with p dA [m].
struct StickArms {
  double root_mean_square = 0.0, mean = 0.0;
};
[[nodiscard]] StickArms arms_of(std::span<const Vec3> points, std::span<const double> area, std::span<const double> pressure,
                                const Vec3& centre, const Vec3& normal);

/// Energy of all springs [J].
[[nodiscard]] double stick_energy(const StickRule& rule, const StickState& state);

/// At the end of a step: displacements beyond mu N / k_t yield, anchors go to the new centres of pressure, pairs that touch
/// anew get springs and those that part lose theirs. @param surface  of the present poses
/// @param resting  bodies that `surface` leaves out because they sleep; their springs stay. Empty: none
void commit_sticks(std::span<const ContactBody> bodies, const ContactRules& rules, const ContactSurface& surface,
                   const StickRule& rule, const std::vector<std::uint8_t>& resting, StickState& state);

}  // namespace supple::collision
