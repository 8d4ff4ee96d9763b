/// @file supple/core/compliant_contact.h
/// Contact as a part of an implicit step. The contact surface is given by quadrature points at a predicted pose; at each of
/// them the pressure is linear in the approach of the two bodies, and each body moves there as the weighted mean of
/// its particles. In addition to inertia and pair laws the step minimises
///   sum_q l_n(u_q . n) + sum_q l_t(v_q),
/// u_q the displacement of body A relative to B within the step, v_q their relative velocity along the surface (backward Euler: at its end; implicit midpoint: just after its middle):
///   l_n' = w [p + g (u - u_p) . n]_+ (1 + d u . n / h)_+     pressure, and damping (Hunt & Crossley 1975); increases, so l_n is convex,
///   l_t' = mu N f1(|v_q|) v_q / |v_q|                        Coulomb friction, N the normal force of the last iterate (Li et al. 2020),
/// with weight w, pressure p and approach u_p . n at the predicted pose, and the slope g of the pressure in the approach: for parallel
/// layers p = g_A d_A = g_B d_B, so g = g_A g_B / (g_A + g_B). Compare Castro, Permenter & Han 2022 ("unconstrained convex formulation").
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "supple/core/particles.h"

namespace supple::core {

/// Index of a body without particles: an obstacle.
enum class ObstacleSide : std::uint8_t { None, A, B };

/// The contacts of all pairs of bodies at one pose; one array per attribute.
struct ContactPoints {
  struct Pair {
    std::uint32_t begin = 0, end = 0;  ///< its points
    double friction = 0.0;             ///< mu [1]
    double dissipation = 0.0;          ///< d [s/m]
    ObstacleSide obstacle = ObstacleSide::None;
    std::uint32_t split_begin = 0, split_end = 0;  ///< its loads within bodies
  };
  std::vector<Pair> pair;

  std::vector<Vec3> point;        ///< X [m]
  std::vector<Vec3> normal;       ///< n, unit, out of A and into B
  std::vector<double> weight;     ///< w [m^2]
  std::vector<double> pressure;   ///< p [Pa]
  std::vector<double> slope;      ///< g [Pa/m], >= 0
  std::vector<Vec3> obstacle_velocity;  ///< of the obstacle at the point [m/s]; zero where there is none

  /// Row q, [offset[q], offset[q + 1]), lists the particles that move the bodies at point q. Shares of A are positive and sum to 1,
  /// those of B are negative and sum to -1.
  std::vector<std::uint32_t> offset;
  std::vector<std::uint32_t> particle;
  std::vector<double> share;

  /// What the pressure does to the particles beyond these shares, at this pose: the forces of a body follow from the energy of contact, which shares
  /// differently. Its forces and moments of each body sum to zero. It grows and falls with the normal force of the pair.
  std::vector<std::uint32_t> split_particle;
  std::vector<Vec3> split_force;   ///< [N]
  std::vector<Vec3> split_torque;  ///< about the particle's centre [N m]

  void clear();
};

/// Load of a pair in a step.
struct ContactPairLoad {
  Vec3 force = Vec3::Zero();  ///< on A [N]; B gets the opposite
  double dissipated = 0.0;    ///< by damping and friction in the step [J], >= 0
  double stick_speed = 0.0;   ///< below which friction faded out [m/s]
};

/// Computes the contacts at a pose and a time.
using ContactModel = std::function<void(const ParticleState& pose, double time, ContactPoints& out)>;

struct ImplicitContact {
  ContactModel find;
  /// Speed below which friction falls to zero [m/s]: bodies below the Coulomb limit creep at most at this speed, or at `slow_slip` times the pair's
  /// relative speed if that is more.
  double stick_speed = 1e-8;
  double slow_slip = 1e-3;  ///< that share of the pair's relative speed [1]
  std::vector<ContactPairLoad> load{};  ///< of the last step, by ContactPoints::pair
};

}  // namespace supple::core
