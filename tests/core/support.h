// Random poses and the ten-particle spiral that the tests of core share.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "supple/core/interactions.h"
#include "supple/core/particles.h"

namespace supple::core::test {

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}
  double uniform(double lower, double upper) {
    return lower + (upper - lower) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  Vec3 vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  Vec3 direction() {
    for (;;) {
      const Vec3 v = vector(1.0);
      const double length = v.norm();
      if (length > 0.1 && length < 1.0) return v / length;
    }
  }
  Quat rotation() {
    for (;;) {
      const Eigen::Vector4d v(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      if (v.norm() < 0.1 || v.norm() > 1.0) continue;
      Quat q;
      q.coeffs() = v / v.norm();
      return q;
    }
  }

 private:
  std::mt19937_64 engine_;
};

inline Quat turn_about(const Vec3& axis, double angle) {
  const Vec3 u = std::sin(0.5 * angle) * axis.normalized();
  return Quat(std::cos(0.5 * angle), u.x(), u.y(), u.z());
}

/// Particles and their state; all of one object, free, isotropic, at rest, normal +z.
struct Particles {
  ParticleSet set;
  ParticleState state;

  void add(const Vec3& position, double mass = 1.0, double inertia = 1.0) {
    set.mass.push_back(mass);
    set.inertia.push_back(Vec3::Constant(inertia));
    set.normal.push_back(Vec3::UnitZ());
    set.object.push_back(0);
    set.pinned.push_back(0);
    state.resize(set.size());
    state.position.back() = position;
  }
};

/// Archimedean spiral r = 0.15 theta, theta in [2, 9], at equal arc length, normals outward (theory: reference scene).
inline Particles make_spiral(int count = 10, double mass = 0.02, double inertia = 2e-4) {
  constexpr double kPitch = 0.15;
  const auto arc = [](double t) { return 0.5 * kPitch * (t * std::sqrt(1.0 + t * t) + std::asinh(t)); };
  Particles spiral;
  for (int k = 0; k < count; ++k) {
    const double target = arc(2.0) + (arc(9.0) - arc(2.0)) * k / (count - 1);
    double t = 2.0 + 7.0 * k / (count - 1);
    for (int n = 0; n < 50; ++n) t -= (arc(t) - target) / (kPitch * std::sqrt(1.0 + t * t));
    spiral.add(kPitch * t * Vec3(std::cos(t), std::sin(t), 0.0), mass, inertia);
    const Vec3 tangent = Vec3(std::cos(t) - t * std::sin(t), std::sin(t) + t * std::cos(t), 0.0).normalized();
    const Vec3 normal(tangent.y(), -tangent.x(), 0.0);
    Mat3 frame;
    frame << tangent, Vec3::UnitZ(), normal;
    if (frame.determinant() < 0.0) frame.col(1) *= -1.0;
    spiral.state.orientation.back() = Quat(frame);
  }
  return spiral;
}

inline PairPose pair_pose(const Particles& p, std::uint32_t a, std::uint32_t b) {
  return core::pair_pose(p.set, p.state, a, b);
}

inline std::uint64_t hash_of(const Loads& loads) {
  Hasher hasher;
  hasher.add(loads.force);
  hasher.add(loads.torque);
  return hasher.value();
}

/// Hands what a checkpoint holds of `from` to `to`; whether all of it was taken.
template <class System>
[[nodiscard]] bool restart(const System& from, System& to) {
  StateWriter out;
  from.p.state.save(out);
  from.kick.save(out);
  from.ledger.save(out);
  StateReader in(out.bytes());
  to.time = from.time;
  to.p.state.load(in);
  to.kick.load(in);
  to.ledger.load(in);
  return in.at_end();
}

/// Calls visit(a, b) for all pairs at most `steps` apart in their order.
template <class Visit>
void along_chain(std::size_t count, std::size_t steps, const Visit& visit) {
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = a + 1; b <= a + steps && b < count; ++b) {
      visit(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
    }
  }
}

inline BondedLaw<BondFrame> bond_frames(const Particles& p, double stretch, double rotation, std::size_t steps = 2) {
  BondedLaw<BondFrame> list;
  list.name = "bond_frame";
  along_chain(p.set.size(), steps, [&](std::uint32_t a, std::uint32_t b) {
    list.first.push_back(a);
    list.second.push_back(b);
    list.law.push_back(BondFrame::from_rest(stretch, rotation, pair_pose(p, a, b)));
  });
  return list;
}

inline BondedLaw<Coplanarity> coplanarities(const Particles& p, double strength, std::size_t steps = 2) {
  BondedLaw<Coplanarity> list;
  list.name = "coplanarity";
  along_chain(p.set.size(), steps, [&](std::uint32_t a, std::uint32_t b) {
    list.first.push_back(a);
    list.second.push_back(b);
    list.law.push_back({.strength = strength, .weight = {}});
  });
  return list;
}

}  // namespace supple::core::test
