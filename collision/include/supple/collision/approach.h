/// @file supple/collision/approach.h
/// How hard two bodies come together, what their pair can hold, and hard cores that turn back what comes too deep.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/contact_surface.h"

namespace supple::collision {

/// What moves a body's parts: inverse masses by world axis [1/kg] and inverse inertia in world axes [1/(kg m^2)]; zero
/// where a part is held. Shape [parts] each; both empty: the body is fixed.
struct PartMobility {
  std::vector<Vec3> inverse_mass;
  std::vector<Mat3> inverse_inertia;
};

/// Two bodies at one place of their contact.
struct Approach {
  Vec3 point = Vec3::Zero();   ///< centre of pressure [m]
  Vec3 normal = Vec3::Zero();  ///< mean, unit, out of A and into B
  double speed = 0.0;          ///< at which they come closer there, by contributions [m/s]; < 0: they part
};
/// @param summary  of a pair with a force that is not zero
[[nodiscard]] Approach measure_approach(std::span<const ContactBody> bodies, const ContactSurface::Summary& summary);
/// By how much a unit impulse along the normal, shared out by contributions, changes that speed [1/kg].
/// @param mobility  of both, by body
[[nodiscard]] double approach_inverse_mass(std::span<const ContactBody> bodies, std::span<const PartMobility> mobility,
                                           const ContactSurface::Summary& summary);

/// Integral of [min(p_A, p_B)]+ dV [J] with A moved by `shift`: by midpoints of `cells` cubed cells of the overlap box, or, where a body is too thin for
/// these, as a plate or a shell may be, by some `cells` squared columns parallel to `along` (unit). Parts thinner than 2^-13 of the box may be missed.
[[nodiscard]] double shifted_energy(const ContactBody& a, const ContactBody& b, const Vec3& shift, const Vec3& along, int cells);

/// U_max: the largest contact energy [J] that the pair can reach when A is moved into B along `direction` (unit) until it
/// is through, or for an unbounded B, as deep as it still grows; not less than the energy where they are. What approaches with more kinetic energy passes,
/// if B has another side.
/// Two equal linear balls of pressure E (1 - r/R) hold pi E R^3 / 3. @param cells  see `shifted_energy` @param enough  [J]: a result above it may be any
/// energy on the way, which the capacity is not less than
[[nodiscard]] double contact_capacity(const ContactBody& a, const ContactBody& b, const Vec3& direction, int cells = 32,
                                      double enough = std::numeric_limits<double>::infinity());

/// Share of the core pressure beyond which a core turns back what still approaches.
inline constexpr double kCoreShare = 0.5;

/// The pressure at which a pair's hard core begins [Pa]: kCoreShare times the smaller P_i F_i of ContactBody::core_value.
[[nodiscard]] double core_pressure(const ContactBody& a, const ContactBody& b);

/// Hard cores: pairs whose largest pressure is beyond `core_pressure` and that still approach get an impulse along their
/// normal that turns the speed of approach back in full, so that kinetic energy and momenta are kept. Several pairs are
/// swept in order until none approaches; should many sweeps not do, further ones only stop the approach.
struct CoreImpulses {
  std::uint32_t turned = 0;  ///< pairs that got an impulse
  bool settled = true;       ///< no pair beyond its core approaches any more
};
/// @param impulses  by body, shape [parts]: impulse [N s] and angular impulse about the part's centre [N m s] that the
///                  bodies' velocities do not hold yet; added to
CoreImpulses hold_cores(std::span<const ContactBody> bodies, std::span<const PartMobility> mobility,
                        const ContactSurface& surface, std::span<PartLoads> impulses);

}  // namespace supple::collision
