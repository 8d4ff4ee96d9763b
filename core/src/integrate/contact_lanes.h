// Sums over the contact points of an implicit step, eight points at a time.
#pragma once

#include <cstddef>
#include <vector>

#include "integrate/block_cholesky.h"
#include "supple/core/types.h"

namespace supple::core {

inline constexpr std::size_t kContactLanes = 8;

struct LaneVectors {
  std::vector<double> x, y, z;

  void assign(std::size_t count) {
    for (std::vector<double>* axis : {&x, &y, &z}) axis->assign(count, 0.0);
  }
  void set(std::size_t i, const Vec3& v) {
    x[i] = v.x();
    y[i] = v.y();
    z[i] = v.z();
  }
  [[nodiscard]] Vec3 at(std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// Contact points, one array per attribute. Each group begins at a multiple of `kContactLanes` and is filled up by points without weight.
struct ContactLanes {
  LaneVectors local;            ///< place, from the group's origin [m]
  LaneVectors normal;           ///< unit, out of A and into B
  LaneVectors start_velocity;   ///< of A relative to B at the begin of the step [m/s]
  LaneVectors led;              ///< displacement of A relative to B that an obstacle's own motion adds [m]
  std::vector<double> weight;           ///< [m^2]
  std::vector<double> slope;            ///< g of the pressure in the approach [Pa/m]
  std::vector<double> offset_pressure;  ///< p - g u_p . n [Pa]
  // At the pose of the last `place_points`.
  std::vector<double> approach;  ///< displacement of A relative to B along the normal [m]
  LaneVectors slip;              ///< velocity across the normal [m/s]
  std::vector<double> speed;     ///< of the slip [m/s]
  // Friction.
  std::vector<double> lagged;                  ///< normal force [N]
  LaneVectors direction, next_direction;       ///< friction over its largest value: dual variables [1]

  void assign(std::size_t count);
};

/// Points of one pair that move as one rigid body.
struct LaneGroup {
  std::size_t begin = 0, end = 0;  ///< multiples of `kContactLanes`
  double friction = 0.0;           ///< coefficient [1]
  double damping = 0.0;            ///< dissipation over the step [1/m]
  double slow = 0.0;               ///< speed below which friction fades out [m/s]
};

/// Displacement of A relative to B: of the group's origin [m], and rotation [rad].
struct Twist {
  Vec3 moved = Vec3::Zero(), turning = Vec3::Zero();
};

/// Force [N], and moment about the group's origin [N m].
struct Wrench {
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
};

struct LagSums {
  double change = 0.0, all = 0.0;  ///< of normal forces [N]
};

struct PowerSums {
  double dissipated = 0.0;  ///< by damping and friction [W]
  double led = 0.0;         ///< of the forces on A with the velocity `led` [N m]
};

/// Sets approach, slip and speed. The velocity of a point is `slip_rate` u - `back` v, u its displacement and v its velocity at the begin.
void place_points(ContactLanes& lanes, const LaneGroup& group, const Twist& twist, double slip_rate, double back);
/// Friction acts with the normal forces of the pose from here on.
LagSums lag_forces(ContactLanes& lanes, const LaneGroup& group);
/// Of normal forces and friction [J].
[[nodiscard]] double potential_of(const ContactLanes& lanes, const LaneGroup& group, double slip_rate);
/// Gradient of the potential in the displacement.
[[nodiscard]] Wrench gradient_of(const ContactLanes& lanes, const LaneGroup& group);
/// Second derivatives in displacement and rotation about a point, from which the group's origin lies at `offset`:
/// of each point (k - a) n n^T + a 1 - b (f v^T + v f^T), f the direction of friction, v the slip.
[[nodiscard]] Mat6 stiffness_of(const ContactLanes& lanes, const LaneGroup& group, const Vec3& offset, double slip_rate);
/// Sets `next_direction` to the directions of friction after a correction of the displacement. @return the largest change of a slip [m/s]
double predict_directions(ContactLanes& lanes, const LaneGroup& group, const Twist& correction, double slip_rate);
/// Normal force without damping [N].
[[nodiscard]] double elastic_force_of(const ContactLanes& lanes, const LaneGroup& group);
/// Powers with the velocity `rate` u + `start_share` v.
[[nodiscard]] PowerSums powers_of(const ContactLanes& lanes, const LaneGroup& group, const Twist& twist, double rate, double start_share);

}  // namespace supple::core
