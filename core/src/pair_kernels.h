// Forces and torques of the pair laws as the step computes them, for one pair (T = double) or four (T = Lanes).
// Each kernel packs a law into numbers that save work per step; evaluate() in pair_laws.cpp is the reference.
#pragma once

#include "lanes.h"
#include "supple/core/pair_laws.h"

namespace supple::core {

template <class T>
struct KernelPair {
  Vector<T> r;
  Rotation<T> orientation_a, orientation_b;
  Vector<T> normal_a, normal_b;
};

template <class T>
struct KernelLoads {
  Vector<T> force_b, torque_a, torque_b;
};

/// What a kernel of `Law` reads, and its packed numbers.
template <class Law>
struct PairKernel;

/// 1 / h^2 of a weight, 0 for psi = 1: with it one formula covers both.
inline double packed_range(const Weight& weight) {
  return weight.range > 0.0 ? 1.0 / (weight.range * weight.range) : 0.0;
}

/// psi and psi' / d from the squared distance.
template <class T>
struct KernelWeight {
  T psi, slope_over_d;
  KernelWeight(const T& d2, const T& inverse_h2) {
    const T rest = positive(T(1.0) - d2 * inverse_h2);
    const T rest2 = rest * rest;
    psi = rest2 * rest;
    slope_over_d = T(-6.0) * inverse_h2 * rest2;
  }
};

/// Loads of U = psi |w|^2, psi holding the gain, with w = kappa r + radius (n_A - n_B).
template <class T>
KernelLoads<T> form_loads(const T& psi, const T& slope_over_d, const T& kappa, const T& radius,
                          const KernelPair<T>& pair) {
  const Vector<T> w = scaled_sum(kappa, pair.r, radius * (pair.normal_a - pair.normal_b));
  const T gain = T(2.0) * psi;
  const T central = -(slope_over_d * dot(w, w));
  const T lever = gain * radius;
  return {.force_b = scaled_sum(central, pair.r, -(gain * kappa) * w),
          .torque_a = -lever * cross(pair.normal_a, w),
          .torque_b = lever * cross(pair.normal_b, w)};
}

template <>
struct PairKernel<Cohesion> {
  static constexpr bool kOrientation = false, kNormal = false, kTorque = false;
  static constexpr std::size_t kNumbers = 3;
  static void pack(const Cohesion& law, double* p) {
    p[0] = 1.0 / law.r0;
    p[1] = -law.f0 / law.r0;
    p[2] = -law.a;
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const T s = sqrt(dot(pair.r, pair.r)) * p[0];
    const T v = s - T(1.0);
    const T v2 = v * v;
    return {.force_b = (p[1] * (v2 * v) * exp(p[2] * v2) / (s * s)) * pair.r, .torque_a = {}, .torque_b = {}};
  }
};

template <>
struct PairKernel<Repulsion> {
  static constexpr bool kOrientation = false, kNormal = false, kTorque = false;
  static constexpr std::size_t kNumbers = 4;
  static void pack(const Repulsion& law, double* p) {
    p[0] = law.distance;
    p[1] = 1.0 / law.length;
    p[2] = law.tolerance;
    p[3] = law.force;
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const T d = sqrt(dot(pair.r, pair.r));
    const T excess = positive(exp((p[0] - d) * p[1]) - p[2]);
    return {.force_b = (p[3] * excess / d) * pair.r, .torque_a = {}, .torque_b = {}};
  }
};

template <>
struct PairKernel<Form> {
  static constexpr bool kOrientation = false, kNormal = true, kTorque = true;
  static constexpr std::size_t kNumbers = 3;
  static void pack(const Form& law, double* p) {
    p[0] = law.strength;
    p[1] = law.curvature;
    p[2] = packed_range(law.weight);
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const T d2 = dot(pair.r, pair.r);
    const KernelWeight<T> weight(d2, p[2]);
    const T inverse = T(1.0) / d2;
    const T psi = p[0] * weight.psi * inverse;
    const T slope_over_d = (p[0] * weight.slope_over_d - T(2.0) * psi) * inverse;
    return form_loads(psi, slope_over_d, p[1], T(1.0), pair);
  }
};

template <>
struct PairKernel<FormRadius> {
  static constexpr bool kOrientation = false, kNormal = true, kTorque = true;
  static constexpr std::size_t kNumbers = 3;
  static void pack(const FormRadius& law, double* p) {
    p[0] = law.strength;
    p[1] = law.radius;
    p[2] = packed_range(law.weight);
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const KernelWeight<T> weight(dot(pair.r, pair.r), p[2]);
    return form_loads(p[0] * weight.psi, p[0] * weight.slope_over_d, T(1.0), p[1], pair);
  }
};

template <>
struct PairKernel<Coplanarity> {
  static constexpr bool kOrientation = false, kNormal = true, kTorque = true;
  static constexpr std::size_t kNumbers = 2;
  static void pack(const Coplanarity& law, double* p) {
    p[0] = law.strength;
    p[1] = packed_range(law.weight);
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const KernelWeight<T> weight(dot(pair.r, pair.r), p[1]);
    const T c_a = dot(pair.normal_a, pair.r);
    const T c_b = dot(pair.normal_b, pair.r);
    const T gain = T(-2.0) * p[0] * weight.psi;
    const T gain_a = gain * c_a;
    const T gain_b = gain * c_b;
    const T central = -(p[0] * weight.slope_over_d * fma(c_a, c_a, c_b * c_b));
    return {.force_b = scaled_sum(gain_a, pair.normal_a, scaled_sum(gain_b, pair.normal_b, central * pair.r)),
            .torque_a = gain_a * cross(pair.normal_a, pair.r),
            .torque_b = gain_b * cross(pair.normal_b, pair.r)};
  }
};

/// The rotation term with quaternions: p = q_A (q_A0* q_B0) q_B* = (v, w) turns the frame of B into that of A, the
/// energy is 4 k_theta |v|^2 and sum_k a_k x b_k = -4 w v.
template <>
struct PairKernel<BondFrame> {
  static constexpr bool kOrientation = true, kNormal = false, kTorque = true;
  static constexpr std::size_t kNumbers = 12;
  static void pack(const BondFrame& law, double* p) {
    const Quat between = law.rest_orientation_a.conjugate() * law.rest_orientation_b;
    p[0] = 0.5 * law.stretch;
    p[1] = 4.0 * law.rotation;
    for (int k = 0; k < 3; ++k) {
      p[2 + k] = law.rest_a[k];
      p[5 + k] = law.rest_b[k];
    }
    for (int k = 0; k < 4; ++k) p[8 + k] = between.coeffs()[k];
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const Rotation<T>& q_a = pair.orientation_a;
    const Rotation<T>& q_b = pair.orientation_b;
    const Vector<T> arm_a = rotate(q_a, Vector<T>{p[2], p[3], p[4]});
    const Vector<T> arm_b = rotate(q_b, Vector<T>{p[5], p[6], p[7]});
    const Rotation<T> between{{p[8], p[9], p[10]}, p[11]};
    const Rotation<T> turn = product_conjugate(product(q_a, between), q_b);
    const Vector<T> couple = (p[1] * turn.w) * turn.u;
    // arm_A x u_A = arm_A x r and arm_B x u_B = arm_B x r: an arm does not turn about itself.
    return {.force_b = -p[0] * ((pair.r - arm_a) + (pair.r + arm_b)),
            .torque_a = p[0] * cross(arm_a, pair.r) - couple,
            .torque_b = couple - p[0] * cross(arm_b, pair.r)};
  }
};

}  // namespace supple::core
