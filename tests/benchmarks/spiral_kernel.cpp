#include "spiral_kernel.h"

#include <cmath>

namespace supple::benchmarks {
namespace {

struct V {
  double x, y, z;
};
struct Q {
  V u;
  double w;
};

inline V load(const double* p) { return {p[0], p[1], p[2]}; }
inline Q load_q(const double* p) { return {{p[0], p[1], p[2]}, p[3]}; }
inline void store(double* p, V v) { p[0] = v.x, p[1] = v.y, p[2] = v.z; }
inline void add(double* p, V v) { p[0] += v.x, p[1] += v.y, p[2] += v.z; }
inline V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V operator*(double s, V a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline V rotate(Q q, V v) {
  const V t = 2.0 * cross(q.u, v);
  return v + q.w * t + cross(q.u, t);
}
inline Q conjugate(Q q) { return {-1.0 * q.u, q.w}; }
inline Q product(Q a, Q b) { return {a.w * b.u + b.w * a.u + cross(a.u, b.u), a.w * b.w - dot(a.u, b.u)}; }

/// (1 + z/2) / (1 + z + z^2/2), the share of a velocity that friction turns into impulse.
inline double share(double z) { return (1.0 + 0.5 * z) / (1.0 + z + 0.5 * z * z); }

}  // namespace

Chain::Chain(const ChainNumbers& numbers, const ChainState& rest)
    : state(rest), numbers_(numbers), count_(rest.position.size() / 3) {
  for (std::size_t a = 0; a < count_; ++a) {
    for (std::size_t b = a + 1; b <= a + 2 && b < count_; ++b) {
      const V r = load(&rest.position[3 * b]) - load(&rest.position[3 * a]);
      const Q q_a = conjugate(load_q(&rest.orientation[4 * a]));
      const Q q_b = load_q(&rest.orientation[4 * b]);
      Bond bond{.a = a, .b = b, .arm_a = {}, .arm_b = {}, .between = {}};
      store(bond.arm_a, rotate(q_a, r));
      store(bond.arm_b, rotate(conjugate(q_b), -1.0 * r));
      const Q between = product(q_a, q_b);
      store(bond.between, between.u);
      bond.between[3] = between.w;
      bond_.push_back(bond);
    }
  }
  normal_.resize(3 * count_);
  force_.resize(3 * count_);
  torque_.resize(3 * count_);
}

void Chain::start() { forces(); }

void Chain::forces() {
  for (std::size_t i = 0; i < count_; ++i) {
    store(&normal_[3 * i], rotate(load_q(&state.orientation[4 * i]), {0.0, 0.0, 1.0}));
    store(&force_[3 * i], {0.0, 0.0, 0.0});
    store(&torque_[3 * i], {0.0, 0.0, 0.0});
  }
  const double half_stretch = 0.5 * numbers_.stretch, rotation = 4.0 * numbers_.rotation;
  for (const Bond& bond : bond_) {
    const V r = load(&state.position[3 * bond.b]) - load(&state.position[3 * bond.a]);
    const Q q_a = load_q(&state.orientation[4 * bond.a]), q_b = load_q(&state.orientation[4 * bond.b]);
    const V arm_a = rotate(q_a, load(bond.arm_a)), arm_b = rotate(q_b, load(bond.arm_b));
    const Q turn = product(product(q_a, load_q(bond.between)), conjugate(q_b));
    const V couple = (rotation * turn.w) * turn.u;
    const V n_a = load(&normal_[3 * bond.a]), n_b = load(&normal_[3 * bond.b]);
    const double gain_a = -2.0 * numbers_.coplanarity * dot(n_a, r);
    const double gain_b = -2.0 * numbers_.coplanarity * dot(n_b, r);
    const V force = gain_a * n_a + gain_b * n_b - half_stretch * (2.0 * r - arm_a + arm_b);
    add(&force_[3 * bond.a], -1.0 * force);
    add(&force_[3 * bond.b], force);
    add(&torque_[3 * bond.a], cross(half_stretch * arm_a + gain_a * n_a, r) - couple);
    add(&torque_[3 * bond.b], cross(gain_b * n_b - half_stretch * arm_b, r) + couple);
  }
  add(&force_[0], load(numbers_.load));
}

void Chain::rub(const Bond& bond, double h) {
  const double mass = 2.0 * numbers_.inverse_mass, spin = 2.0 * numbers_.inverse_inertia;
  double* const v_a = &state.velocity[3 * bond.a];
  double* const v_b = &state.velocity[3 * bond.b];
  double* const l_a = &state.angular_momentum[3 * bond.a];
  double* const l_b = &state.angular_momentum[3 * bond.b];
  const V r = load(&state.position[3 * bond.b]) - load(&state.position[3 * bond.a]);
  const double d2 = dot(r, r);
  const double c = h * numbers_.friction, c_spin = h * numbers_.angular_friction;
  const V u = load(v_b) - load(v_a) - (0.5 * numbers_.inverse_inertia) * cross(load(l_a) + load(l_b), r);
  const V along = (dot(u, r) / d2) * r;
  const double across = share(c * (mass + 0.25 * spin * d2));
  const V impulse = -c * (share(c * mass) * along + across * (u - along));
  const V angular = -0.5 * cross(r, impulse);
  add(v_a, -numbers_.inverse_mass * impulse);
  add(v_b, numbers_.inverse_mass * impulse);
  // Both sides turn by the same, so their relative spin is that of before.
  const V couple = (-c_spin * share(c_spin * spin) * numbers_.inverse_inertia) * (load(l_b) - load(l_a));
  add(l_a, angular - couple);
  add(l_b, angular + couple);
}

void Chain::kick(double dt) {
  for (std::size_t k = 0; k < 3 * count_; ++k) {
    state.velocity[k] += dt * numbers_.inverse_mass * force_[k];
    state.angular_momentum[k] += dt * torque_[k];
  }
}

void Chain::drift(double dt) {
  for (std::size_t k = 0; k < 3 * count_; ++k) state.position[k] += dt * state.velocity[k];
  for (std::size_t i = 0; i < count_; ++i) {
    const V half = (0.5 * dt * numbers_.inverse_inertia) * load(&state.angular_momentum[3 * i]);
    // sin(x)/x and cos x of the half angle, to rounding errors below x = 1/4.
    const double x2 = dot(half, half);
    const double sinc = 1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362880.0))));
    const double cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40320.0))));
    Q q = product({sinc * half, cos}, load_q(&state.orientation[4 * i]));
    const double scale = 1.5 - 0.5 * (dot(q.u, q.u) + q.w * q.w);
    store(&state.orientation[4 * i], scale * q.u);
    state.orientation[4 * i + 3] = scale * q.w;
  }
}

void Chain::step(double dt) {
  const bool rubs = numbers_.friction > 0.0 || numbers_.angular_friction > 0.0;
  if (rubs) {
    for (const Bond& bond : bond_) rub(bond, 0.5 * dt);
  }
  kick(0.5 * dt);
  drift(dt);
  forces();
  kick(0.5 * dt);
  if (rubs) {
    for (std::size_t k = bond_.size(); k-- > 0;) rub(bond_[k], 0.5 * dt);
  }
}

}  // namespace supple::benchmarks
