/// @file supple/core/particles.h
/// Oriented particles (Lombardo & Puech 1995, sec. 2): rigid bodies with full frames, one array per attribute.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/hash.h"
#include "supple/core/types.h"

namespace supple::core {

/// What does not change while particles move; index i is the same particle in every array. Part of a Scene.
struct ParticleSet {
  std::vector<double> mass;            ///< [kg], > 0, shape [n]
  std::vector<Vec3> inertia;           ///< principal moments in body axes [kg m^2], > 0, shape [n]
  std::vector<Vec3> normal;            ///< the fixed unit body vector e, n = Q e, shape [n]
  std::vector<std::uint32_t> object;   ///< which object the particle belongs to, shape [n]
  std::vector<std::uint8_t> pinned;    ///< bit 0: position held, bit 1: orientation held, shape [n]

  [[nodiscard]] std::size_t size() const noexcept { return mass.size(); }
};

inline constexpr std::uint8_t kPinPosition = 1;
inline constexpr std::uint8_t kPinOrientation = 2;

/// What moves. Angular velocity is derived: omega = Q I^-1 Q^T L. Part of State.
struct ParticleState {
  std::vector<Vec3> position;          ///< [m], shape [n]
  std::vector<Quat> orientation;       ///< body to world, unit length, shape [n]
  std::vector<Vec3> velocity;          ///< [m/s], shape [n]
  std::vector<Vec3> angular_momentum;  ///< about the particle's centre, world axes [kg m^2/s], shape [n]

  [[nodiscard]] std::size_t size() const noexcept { return position.size(); }
  void resize(std::size_t n);
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

/// Forces [N] and torques about each particle's centre [N m], world axes, shape [n].
struct Loads {
  std::vector<Vec3> force;
  std::vector<Vec3> torque;
  void reset(std::size_t n);  ///< n zeros in both
};

/// omega = Q I^-1 Q^T L [rad/s].
[[nodiscard]] Vec3 angular_velocity(const ParticleSet& set, const ParticleState& state, std::size_t i);

}  // namespace supple::core
