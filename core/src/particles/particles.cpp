#include "supple/core/particles.h"

#include "supple/core/error.h"

namespace supple::core {

void ParticleState::resize(std::size_t n) {
  position.resize(n, Vec3::Zero());
  orientation.resize(n, Quat::Identity());
  velocity.resize(n, Vec3::Zero());
  angular_momentum.resize(n, Vec3::Zero());
}

void ParticleState::save(StateWriter& out) const {
  out.write(position);
  out.write(orientation);
  out.write(velocity);
  out.write(angular_momentum);
}

void ParticleState::load(StateReader& in) {
  in.read(position);
  in.read(orientation);
  in.read(velocity);
  in.read(angular_momentum);
  const std::size_t n = position.size();
  if (orientation.size() != n || velocity.size() != n || angular_momentum.size() != n) {
    throw Error(ErrorKind::Corrupt, Fault{.place = {},
                                          .key = "particles",
                                          .expected = "expected arrays of one length in the saved state",
                                          .found = {},
                                          .hint = {}});
  }
}

void ParticleState::hash(Hasher& hasher) const {
  hasher.add(position);
  hasher.add(orientation);
  hasher.add(velocity);
  hasher.add(angular_momentum);
}

void Loads::reset(std::size_t n) {
  force.assign(n, Vec3::Zero());
  torque.assign(n, Vec3::Zero());
}

Vec3 angular_velocity(const ParticleSet& set, const ParticleState& state, std::size_t i) {
  const Quat& q = state.orientation[i];
  const Vec3 body = (q.conjugate() * state.angular_momentum[i]).cwiseQuotient(set.inertia[i]);
  return q * body;
}

}  // namespace supple::core
