/// @file supple/collision/bodies.h
/// What contact needs of a body: its field, its material and how its parts move. Callers own everything viewed here.
/// The pressure inside body i is p_i = P_i F_i (F_i: the potential minus the iso value), so p_i = 0 on its surface.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "supple/core/types.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/skeleton.h"
#include "supple/implicit/surface_samples.h"

namespace supple::collision {

struct ContactMaterial {
  double modulus = 1e4;      ///< P [Pa], > 0
  double friction = 0.0;     ///< Coulomb coefficient mu [1], >= 0
  double dissipation = 0.0;  ///< Hunt & Crossley d [s/m], >= 0
};

/// Material of a pair: mu = sqrt(mu_A mu_B), d = (d_A P_B + d_B P_A) / (P_A + P_B).
struct PairMaterial {
  double friction = 0.0;
  double dissipation = 0.0;
};
[[nodiscard]] PairMaterial combine(const ContactMaterial& a, const ContactMaterial& b);

/// How readily a part gives way to an impulse, at most over all directions; both are 0 for what is held.
struct PartYield {
  double inverse_mass = 0.0;     ///< [1/kg]
  double inverse_inertia = 0.0;  ///< [1/(kg m^2)]
};

struct ContactBody {
  implicit::FieldView field;
  ContactMaterial material;
  std::span<const Pose> pose;                ///< of the parts, shape [parts]
  std::span<const Vec3> velocity;            ///< of the parts' centres [m/s], shape [parts]
  std::span<const Vec3> angular_velocity;    ///< of the parts, world axes [rad/s], shape [parts]
  const implicit::SurfaceSamples* samples = nullptr;  ///< null: the body offers no seeds (a half-space)
  const implicit::Skeleton* skeleton = nullptr;  ///< what its field comes from, placed by `pose`; null: an obstacle or another field
  std::span<const PartYield> yield;          ///< of the parts, shape [parts]; empty: the body does not give way
  bool fixed = false;                        ///< takes forces without moving; two fixed bodies do not touch
  double core_value = std::numeric_limits<double>::infinity();  ///< F where the body is deepest [1], or less; for hard cores
};

/// A pair of bodies, a < b.
struct BodyPair {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  friend bool operator==(const BodyPair&, const BodyPair&) = default;
  friend auto operator<=>(const BodyPair&, const BodyPair&) = default;
};

/// Loads on the parts of one body: force [N] and torque about the part's centre [N m], shape [parts].
struct PartLoads {
  std::vector<Vec3> force;
  std::vector<Vec3> torque;
};

/// Which pairs may touch, and materials that differ from `combine`.
struct ContactRules {
  struct Override {
    BodyPair pair;
    PairMaterial material;
  };
  std::vector<Override> overrides;                          ///< sorted by pair
  std::function<bool(std::uint32_t, std::uint32_t)> allowed;  ///< empty: every pair
};

/// The override of a pair, or what its materials combine to.
[[nodiscard]] PairMaterial material_of(std::span<const ContactBody> bodies, const ContactRules& rules, const BodyPair& pair);

}  // namespace supple::collision
