// Forces and torques of the pair laws as the step computes them, for one pair (T = double) or four (T = Lanes).
// Each kernel packs a law into numbers that save work per step; evaluate() in pair_laws.cpp is the reference.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <limits>

#include "laws/lanes.h"
#include "supple/core/cohesion_variants.h"
#include "supple/core/directed_form.h"
#include "supple/core/lennard_jones.h"
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

/// psi and psi' / d of a weight divided by d^2, both holding the gain.
template <class T>
struct NormalisedKernelWeight {
  T psi, slope_over_d;
  NormalisedKernelWeight(const T& gain, const T& d2, const T& inverse_h2) {
    const KernelWeight<T> weight(d2, inverse_h2);
    const T inverse = T(1.0) / d2;
    psi = gain * weight.psi * inverse;
    slope_over_d = (gain * weight.slope_over_d - T(2.0) * psi) * inverse;
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
struct PairKernel<LinearCohesion> {
  static constexpr bool kOrientation = false, kNormal = false, kTorque = false;
  static constexpr std::size_t kNumbers = 4;
  static void pack(const LinearCohesion& law, double* p) {
    p[0] = 1.0 / law.r0;
    p[1] = -law.f0 / law.r0;
    p[2] = -law.a;
    p[3] = law.eta;
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const T s = sqrt(dot(pair.r, pair.r)) * p[0];
    const T v = s - T(1.0);
    const T v2 = v * v;
    return {.force_b = (p[1] * v * (p[3] + v2) * exp(p[2] * v2) / s) * pair.r, .torque_a = {}, .torque_b = {}};
  }
};

/// s = d^2 / (h_A + h_B) with h = sqrt(r . M r), M = Q D^2 Q^T, so that no unit vector is needed.
template <>
struct PairKernel<DirectedCohesion> {
  static constexpr bool kOrientation = true, kNormal = false, kTorque = true;
  static constexpr std::size_t kNumbers = 8;
  static void pack(const DirectedCohesion& law, double* p) {
    p[0] = law.scale;
    p[1] = -law.a;
    for (int k = 0; k < 3; ++k) {
      p[2 + k] = law.semi_axes_a[k] * law.semi_axes_a[k];
      p[5 + k] = law.semi_axes_b[k] * law.semi_axes_b[k];
    }
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const Ellipsoid<T> a(p + 2, pair.orientation_a, pair.r);
    const Ellipsoid<T> b(p + 5, pair.orientation_b, pair.r);
    const T inverse = T(1.0) / (a.h + b.h);
    const T d2 = dot(pair.r, pair.r);
    const T s = d2 * inverse;
    const T v = s - T(1.0);
    const T v2 = v * v;
    const T slope = p[0] * (v2 * v) * exp(p[1] * v2) / s;  // W'
    const T turning = slope * s * inverse;
    return {.force_b = scaled_sum(T(-2.0) * slope * inverse, pair.r, turning * (a.gradient + b.gradient)),
            .torque_a = T(-1.0) * turning * cross(pair.r, a.gradient),
            .torque_b = T(-1.0) * turning * cross(pair.r, b.gradient)};
  }

 private:
  template <class T>
  struct Ellipsoid {
    T h;
    Vector<T> gradient;  ///< of h with respect to r
    Ellipsoid(const T* squares, const Rotation<T>& q, const Vector<T>& r) {
      const Vector<T> y = rotate(Rotation<T>{T(-1.0) * q.u, q.w}, r);
      const Vector<T> m_y{squares[0] * y.x, squares[1] * y.y, squares[2] * y.z};
      h = sqrt(dot(y, m_y));
      gradient = (T(1.0) / h) * rotate(q, m_y);
    }
  };
};

/// The address of the table travels in a number.
template <>
struct PairKernel<TabulatedCohesion> {
  static constexpr bool kOrientation = false, kNormal = false, kTorque = false;
  static constexpr std::size_t kNumbers = 3;
  static void pack(const TabulatedCohesion& law, double* p) {
    p[0] = 1.0 / law.r0;
    p[1] = law.f0;
    p[2] = std::bit_cast<double>(law.table.get());
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const T d = sqrt(dot(pair.r, pair.r));
    const T force = lane_by_lane(
        [](double s, double table) { return std::bit_cast<const CohesionTable*>(table)->force(s); }, d * p[0], p[2]);
    return {.force_b = (p[1] * force / d) * pair.r, .torque_a = {}, .torque_b = {}};
  }
  static_assert(sizeof(double) == sizeof(const CohesionTable*));
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

/// The exponents are packed in binary, highest bit first.
template <>
struct PairKernel<LennardJones> {
  static constexpr bool kOrientation = false, kNormal = false, kTorque = false;
  static constexpr std::size_t kNumbers = 10;
  static void pack(const LennardJones& law, double* p) {
    const double n = law.repulsive, m = law.attractive;
    const bool shifted = law.cut_off > 0.0 && law.switch_from == 0.0;
    const bool switched = law.cut_off > 0.0 && law.switch_from > 0.0;
    p[0] = law.r0;
    p[1] = packed_exponent(law.repulsive);
    p[2] = packed_exponent(law.attractive);
    p[3] = law.depth * n * m / (n - m);
    p[4] = law.depth * m / (n - m);
    p[5] = law.depth * n / (n - m);
    LennardJones whole = law;
    whole.cut_off = 0.0;
    p[6] = shifted ? whole.force(law.cut_off) : 0.0;
    p[7] = law.cut_off > 0.0 ? law.cut_off : std::numeric_limits<double>::infinity();
    p[8] = law.switch_from;
    p[9] = switched ? 1.0 / (law.cut_off - law.switch_from) : 0.0;
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const T d = sqrt(dot(pair.r, pair.r));
    const T inverse = T(1.0) / d;
    const T x = p[0] * inverse;
    const T repulsive = binary_power<kExponentBits>(x, p[1]);
    const T attractive = binary_power<kExponentBits>(x, p[2]);
    return truncated(p, pair, d, inverse, {repulsive, attractive}, true);
  }
  /// The same bits where all pairs have the numbers `one`, of which `p` are lanes: only what these numbers ask for is done.
  template <class T>
  static KernelLoads<T> loads_of_one(const double* one, const T* p, const KernelPair<T>& pair) {
    const T d = sqrt(dot(pair.r, pair.r));
    const T inverse = T(1.0) / d;
    const T x = p[0] * inverse;
    const T repulsive = whole_power(x, exponent_of(one[1]));
    const T attractive = whole_power(x, exponent_of(one[2]));
    return truncated(p, pair, d, inverse, {repulsive, attractive}, one[9] != 0.0);
  }

 private:
  template <class T>
  static KernelLoads<T> truncated(const T* p, const KernelPair<T>& pair, const T& d, const T& inverse,
                                  const std::array<T, 2>& power, bool switched) {
    const T force = p[3] * (power[0] - power[1]) * inverse;
    T total = force - p[6];
    if (switched) {
      const T energy = fms(p[4], power[0], p[5] * power[1]);
      const T t = least(positive((d - p[8]) * p[9]), T(1.0));
      const T rest = T(1.0) - t;
      const T share = T(1.0) - t * t * t * (T(10.0) - t * (T(15.0) - T(6.0) * t));
      const T slope = T(-30.0) * p[9] * (t * t) * (rest * rest);
      total = fms(force, share, fma(energy, slope, p[6]));
    }
    return {.force_b = where_less(d, p[7], total * inverse) * pair.r, .torque_a = {}, .torque_b = {}};
  }
  static int exponent_of(double packed) {
    return static_cast<int>(std::bit_cast<std::uint64_t>(packed) >> (64 - kExponentBits));
  }
  static constexpr int kExponentBits = 6;
  static_assert(LennardJones::kLargestExponent == (1 << kExponentBits) - 1);
  static double packed_exponent(int exponent) {
    return std::bit_cast<double>(static_cast<std::uint64_t>(exponent) << (64 - kExponentBits));
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
    const NormalisedKernelWeight<T> weight(p[0], dot(pair.r, pair.r), p[2]);
    return form_loads(weight.psi, weight.slope_over_d, p[1], T(1.0), pair);
  }
};

/// A symmetric matrix: xx, yy, zz, xy, xz, yz.
template <class T>
Vector<T> symmetric_product(const T* m, const Vector<T>& v) {
  return {fma(m[0], v.x, fma(m[3], v.y, m[4] * v.z)), fma(m[3], v.x, fma(m[1], v.y, m[5] * v.z)),
          fma(m[4], v.x, fma(m[5], v.y, m[2] * v.z))};
}

template <>
struct PairKernel<DirectedForm> {
  static constexpr bool kOrientation = true, kNormal = true, kTorque = true;
  static constexpr std::size_t kNumbers = 14;
  static void pack(const DirectedForm& law, double* p) {
    p[0] = law.strength;
    p[1] = packed_range(law.weight);
    for (const Mat3* m : {&law.shape_a, &law.shape_b}) {
      double* const out = p + (m == &law.shape_a ? 2 : 8);
      for (int k = 0; k < 3; ++k) out[k] = (*m)(k, k);
      out[3] = (*m)(0, 1);
      out[4] = (*m)(0, 2);
      out[5] = (*m)(1, 2);
    }
  }
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const NormalisedKernelWeight<T> weight(p[0], dot(pair.r, pair.r), p[1]);
    const auto shape = [](const T* m, const Rotation<T>& q, const Vector<T>& v) {
      return rotate(q, symmetric_product(m, rotate(Rotation<T>{T(-1.0) * q.u, q.w}, v)));
    };
    const T half(0.5);
    const Vector<T> r_a = half * shape(p + 2, pair.orientation_a, pair.r);
    const Vector<T> r_b = half * shape(p + 8, pair.orientation_b, pair.r);
    const Vector<T> w = (r_a + r_b) + (pair.normal_a - pair.normal_b);
    const Vector<T> w_a = half * shape(p + 2, pair.orientation_a, w);
    const Vector<T> w_b = half * shape(p + 8, pair.orientation_b, w);
    const T gain = T(-2.0) * weight.psi;
    return {.force_b = scaled_sum(gain, w_a + w_b, -(weight.slope_over_d * dot(w, w)) * pair.r),
            .torque_a = gain * (cross(pair.normal_a + r_a, w) - cross(pair.r, w_a)),
            .torque_b = gain * (cross(r_b - pair.normal_b, w) - cross(pair.r, w_b))};
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

/// The laws of the two normals and r that hold a gain and a weight.
struct NormalLawKernel {
  static constexpr bool kOrientation = false, kNormal = true, kTorque = true;
  static constexpr std::size_t kNumbers = 2;
  template <class Law>
  static void pack(const Law& law, double* p) {
    p[0] = law.strength;
    p[1] = packed_range(law.weight);
  }
};

/// Loads of U = psi ((n_A . r)^2 + (n_B . r)^2), psi holding the gain.
template <class T>
KernelLoads<T> coplanarity_loads(const T& psi, const T& slope_over_d, const KernelPair<T>& pair) {
  const T c_a = dot(pair.normal_a, pair.r);
  const T c_b = dot(pair.normal_b, pair.r);
  const T gain = T(-2.0) * psi;
  const T gain_a = gain * c_a;
  const T gain_b = gain * c_b;
  const T central = -(slope_over_d * fma(c_a, c_a, c_b * c_b));
  return {.force_b = scaled_sum(gain_a, pair.normal_a, scaled_sum(gain_b, pair.normal_b, central * pair.r)),
          .torque_a = gain_a * cross(pair.normal_a, pair.r),
          .torque_b = gain_b * cross(pair.normal_b, pair.r)};
}

template <>
struct PairKernel<Coplanarity> : NormalLawKernel {
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const KernelWeight<T> weight(dot(pair.r, pair.r), p[1]);
    return coplanarity_loads(p[0] * weight.psi, p[0] * weight.slope_over_d, pair);
  }
};

template <>
struct PairKernel<NormalisedCoplanarity> : NormalLawKernel {
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const NormalisedKernelWeight<T> weight(p[0], dot(pair.r, pair.r), p[1]);
    return coplanarity_loads(weight.psi, weight.slope_over_d, pair);
  }
};

template <>
struct PairKernel<CoNormality> : NormalLawKernel {
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const KernelWeight<T> weight(dot(pair.r, pair.r), p[1]);
    const Vector<T> change = pair.normal_a - pair.normal_b;
    const Vector<T> couple = (T(2.0) * p[0] * weight.psi) * cross(pair.normal_a, pair.normal_b);
    return {.force_b = -(p[0] * weight.slope_over_d * dot(change, change)) * pair.r,
            .torque_a = couple,
            .torque_b = T(-1.0) * couple};
  }
};

/// Loads of U = psi ((n_A + n_B) . r)^2, psi holding the gain.
template <class T>
KernelLoads<T> co_circularity_loads(const T& psi, const T& slope_over_d, const KernelPair<T>& pair) {
  const Vector<T> sum = pair.normal_a + pair.normal_b;
  const T c = dot(sum, pair.r);
  const T gain = T(-2.0) * psi * c;
  return {.force_b = scaled_sum(gain, sum, -(slope_over_d * c * c) * pair.r),
          .torque_a = gain * cross(pair.normal_a, pair.r),
          .torque_b = gain * cross(pair.normal_b, pair.r)};
}

template <>
struct PairKernel<CoCircularity> : NormalLawKernel {
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const KernelWeight<T> weight(dot(pair.r, pair.r), p[1]);
    return co_circularity_loads(p[0] * weight.psi, p[0] * weight.slope_over_d, pair);
  }
};

template <>
struct PairKernel<NormalisedCoCircularity> : NormalLawKernel {
  template <class T>
  static KernelLoads<T> loads(const T* p, const KernelPair<T>& pair) {
    const NormalisedKernelWeight<T> weight(p[0], dot(pair.r, pair.r), p[1]);
    return co_circularity_loads(weight.psi, weight.slope_over_d, pair);
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
