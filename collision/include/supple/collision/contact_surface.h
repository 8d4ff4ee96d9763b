/// @file supple/collision/contact_surface.h
/// Stage 6: where bodies A and B overlap, the contact surface is Sigma = {p_A = p_B > 0} (Gascuel 1993, with pressures in
/// place of potentials so that stiffnesses may differ); with three or more bodies only where no other pressure is
/// larger. It is sampled by quadrature points: sums over them are integrals over Sigma.
#pragma once

#include <cstdint>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/find_contacts.h"
#include "supple/core/executor.h"

namespace supple::collision {

enum class ContactRule : std::uint8_t {
  None,   ///< no overlap was found
  Polar,  ///< Gauss-Legendre in radius times trapezoid in angle about the point of largest pressure
  March,  ///< tetrahedra over the overlap box, Gauss points on curved triangles of Sigma, refined where they err most
  Panels,  ///< Gauss points on panels across parallel rays, cut at the rim, third bodies and kinks; halved where they err most
};

/// Why a pair got its rule.
enum class RuleReason : std::uint8_t {
  Asked,       ///< `ContactSettings::only`
  Fits,        ///< polar: every patch is seen whole from its peak
  NoGraph,     ///< not polar: a patch is no graph over a disc, or has no peak
  ThirdBody,   ///< not polar: a third body presses on a patch of bodies with several parts, cuts it badly, or presses harder on all of Sigma
  Unmet,       ///< not polar: it fits, but marching has the smaller estimate
  ManyHills,   ///< panels: the pressure has more hills than it pays to look at one by one, or a wide patch lies on many primitives
  Within,      ///< no rule: one body lies in the other, which presses harder all over, or as hard: an energy without Sigma and force
};

struct ContactSettings {
  /// Error asked for, in [1e-10, 0.1]: of the force over the force, or over a thousandth of the load where it cancels to less; of the area over the
  /// area; of the centre of pressure over the root of the area.
  double error = 1e-4;
  bool energy = true;    ///< false: energy, displaced volumes and squeezed regions only where the parts of a body need them
  bool other_columns = false;  ///< energies by other columns, and finer where cells give them: what `estimate_energies` compares with
  int max_refinement = 6;  ///< refinements before the estimate is accepted as it is
  /// None: panels where the pressure has many hills and they meet the error; else polar where it fits; else marching, also where polar does not meet the
  /// error and marching has the smaller estimate. Otherwise this rule alone. A pair that it does not fit (polar: a patch that is no graph over a disc) then
  /// has no force, and an error estimate of 1.
  ContactRule only = ContactRule::None;
  /// Two balls, or a ball and a half-space, are the same all around one line: the polar rule then follows a single ray and
  /// turns it. Off: every ray is followed, for comparison.
  bool symmetry = true;
};

/// Quadrature points of all pairs, sorted by (pair, order of the rule); one array per attribute.
struct ContactSurface {
  // On Sigma.
  std::vector<std::uint32_t> pair;   ///< index into `summary`
  std::vector<Vec3> point;           ///< world [m]
  std::vector<Vec3> normal;          ///< unit, out of A and into B: -grad(p_A - p_B) / |.|
  std::vector<double> area;          ///< quadrature weight [m^2]
  std::vector<double> pressure;      ///< p_A = p_B [Pa], >= 0

  // In the two squeezed regions V_A = {0 < p_A < p_B} and V_B of bodies with several parts, for the energy rule.
  std::vector<std::uint32_t> volume_pair;
  std::vector<std::uint8_t> volume_side;  ///< 0: in V_A, 1: in V_B
  std::vector<Vec3> volume_point;         ///< world [m]
  std::vector<double> volume_weight;      ///< quadrature weight [m^3]

  struct Summary {
    BodyPair bodies;
    ContactRule rule = ContactRule::None;
    RuleReason reason = RuleReason::Fits;
    Vec3 force = Vec3::Zero();             ///< elastic force on A, -integral p N dA [N]; B gets the opposite
    Vec3 moment = Vec3::Zero();            ///< of the force on A about the world origin [N m]
    double area = 0.0;                     ///< [m^2]
    double load = 0.0;                     ///< integral of p dA [N]
    Vec3 centre_of_pressure = Vec3::Zero();  ///< integral x p dA / integral p dA [m]
    /// Integral of [min(p_A, p_B)]+ dV [J]; all pairs sum to that of all pressures but the largest. Beside third bodies it is the pair's share of that, which may
    /// be less than 0; displaced volumes likewise.
    double energy = 0.0;
    double energy_a = 0.0, energy_b = 0.0;  ///< of that, what A and B lose: integrals of their pressures over V_A and V_B [J]
    double largest_pressure = 0.0;         ///< at the peak; of faces on faces at the best of the points [Pa]
    double largest_overlap = 0.0;          ///< to first order without `ContactSettings::energy`: thickness of {p_A > 0, p_B > 0} through the point of largest pressure [m]
    double displaced_a = 0.0;              ///< volume of V_A [m^3]: what A loses to B
    double displaced_b = 0.0;              ///< volume of V_B [m^3]
    double residual = 0.0;                 ///< largest |p_A - p_B| / max(P_A, P_B) at the points [1]
    double error_estimate = 0.0;           ///< the largest of those of force, area and centre of pressure, as in ContactSettings::error
    std::uint32_t patches = 0;             ///< connected components found
    std::uint32_t kinks = 0;               ///< kinks of the fields (implicit/kinks.h) and third bodies that polar patches were parted at
    std::uint64_t points = 0;              ///< quadrature points on Sigma
    std::uint64_t evaluations = 0;         ///< field evaluations spent
  };
  /// One per candidate pair that touches, sorted by bodies. A body wholly within one that presses harder all over has no Sigma with it and no force, but the
  /// energy that it took to get there (`RuleReason::Within`); without `ContactSettings::energy` bodies of one part have no entry then.
  std::vector<Summary> summary;

  void clear();
};

/// Stage 6. @param bodies  all bodies (third ones bound Sigma too)
void solve_contact_surface(std::span<const ContactBody> bodies, const ContactCandidates& candidates,
                           const ContactSettings& settings, const Executor& executor, ContactSurface& out);

/// What energies may be off by: three times the difference of those of each body, in all its pairs together, and what another solution gives whose error is a hundredth,
/// 1e-6 at most, and whose columns begin elsewhere; and what both may miss alike, a fifth of the error, 2e-5 at most. It costs that finer solution.
/// @param bodies, candidates, settings  that `surface` is solved for, with energies   @return of each pair of `surface.summary`, of both of its bodies together [J]
[[nodiscard]] std::vector<double> estimate_energies(std::span<const ContactBody> bodies, const ContactCandidates& candidates, const ContactSettings& settings,
                                                    const Executor& executor, const ContactSurface& surface);

}  // namespace supple::collision
