/// @file supple/core/particles.h
/// Oriented particles (Lombardo & Puech 1995, sec. 2): rigid bodies with full frames, one array per attribute.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/hash.h"
#include "supple/core/types.h"

namespace supple::core {

/// Constant properties of particles; index i is the same particle in every array. Part of a Scene.
struct ParticleSet {
  std::vector<double> mass;            ///< [kg], > 0, shape [n]
  std::vector<Vec3> inertia;           ///< principal moments in body axes [kg m^2], > 0, shape [n]
  std::vector<Vec3> normal;            ///< the fixed unit body vector e, n = Q e, shape [n]
  std::vector<std::uint32_t> object;   ///< which object the particle belongs to, shape [n]
  std::vector<std::uint8_t> pinned;    ///< kPinPosition, kPinOrientation, kPlanar, shape [n]
  std::vector<std::uint32_t> kind;     ///< kHinge, or the type of a standard particle, shape [n]; empty: all of one type

  [[nodiscard]] std::size_t size() const noexcept { return mass.size(); }
};

inline constexpr std::uint8_t kPinPosition = 1;     ///< position held
inline constexpr std::uint8_t kPinOrientation = 2;  ///< orientation held
/// Moves in its plane z = const and rotates about z only. @pre a principal axis is along z, or all moments are equal
inline constexpr std::uint8_t kPlanar = 4;

/// Lombardo & Puech 1995, sec. 5: a hinge interacts with particles of all types, standard particles of different types repel.
inline constexpr std::uint32_t kHinge = 0xffffffff;

/// Whether two particles of one object have all laws between them; if not, they only repel. The paper leaves two hinges
/// open: `hinges_join` decides.
[[nodiscard]] inline bool interact_completely(std::uint32_t kind_a, std::uint32_t kind_b, bool hinges_join) {
  if (kind_a == kHinge && kind_b == kHinge) return hinges_join;
  return kind_a == kHinge || kind_b == kHinge || kind_a == kind_b;
}

/// The part of a force, impulse or velocity that the pins of a particle leave free.
[[nodiscard]] inline Vec3 free_translation(std::uint8_t pinned, const Vec3& v) {
  if ((pinned & kPinPosition) != 0) return Vec3::Zero();
  return (pinned & kPlanar) != 0 ? Vec3(v.x(), v.y(), 0.0) : v;
}

/// The part of a torque, angular impulse or angular momentum that the pins of a particle leave free.
[[nodiscard]] inline Vec3 free_rotation(std::uint8_t pinned, const Vec3& v) {
  if ((pinned & kPinOrientation) != 0) return Vec3::Zero();
  return (pinned & kPlanar) != 0 ? Vec3(0.0, 0.0, v.z()) : v;
}

/// State of motion. Angular velocity is derived: omega = Q I^-1 Q^T L. Part of State.
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
