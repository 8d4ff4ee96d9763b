// Gay-Berne ellipsoids as the step computes them, for one pair or four (pair_kernels.h); evaluate() in gay_berne.cpp is the
// reference.
#pragma once

#include <cmath>

#include "laws/pair_kernels.h"
#include "supple/core/gay_berne.h"
#include "supple/core/math.h"

namespace supple::core {

inline Vec3 squared_radii(const GayBerne& law) { return law.radii.cwiseAbs2(); }

/// well^(-1/mu).
inline Vec3 softness_of(const GayBerne& law) {
  Vec3 out;
  for (int k = 0; k < 3; ++k) out[k] = math::pow(law.well[k], -1.0 / law.mu);
  return out;
}

/// l of the law.
inline double size_of(const GayBerne& law) {
  const double ab = law.radii[0] * law.radii[1];
  return (ab + law.radii[2] * law.radii[2]) * std::sqrt(ab);
}

/// A symmetric matrix by its rows.
template <class T>
struct SymmetricRows {
  Vector<T> x, y, z;

  friend SymmetricRows operator+(const SymmetricRows& a, const SymmetricRows& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  [[nodiscard]] Vector<T> times(const Vector<T>& v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
  /// The inverse times the determinant.
  [[nodiscard]] SymmetricRows adjugate() const { return {cross(y, z), cross(z, x), cross(x, y)}; }
};

/// Q diag(d) Q^T.
template <class T>
SymmetricRows<T> turned_diagonal(const Rotation<T>& q, const T* d) {
  const Vector<T> a = rotate(q, {T(1.0), T(0.0), T(0.0)});
  const Vector<T> b = rotate(q, {T(0.0), T(1.0), T(0.0)});
  const Vector<T> c = rotate(q, {T(0.0), T(0.0), T(1.0)});
  const Vector<T> da = d[0] * a, db = d[1] * b, dc = d[2] * c;
  return {scaled_sum(da.x, a, scaled_sum(db.x, b, dc.x * c)), scaled_sum(da.y, a, scaled_sum(db.y, b, dc.y * c)),
          scaled_sum(da.z, a, scaled_sum(db.z, b, dc.z * c))};
}

/// The vector of the antisymmetric part of A M: (AM)_yz - (AM)_zy and so on.
template <class T>
Vector<T> twist(const SymmetricRows<T>& a, const SymmetricRows<T>& m) {
  return {dot(a.y, m.z) - dot(a.z, m.y), dot(a.z, m.x) - dot(a.x, m.z), dot(a.x, m.y) - dot(a.y, m.x)};
}

template <>
struct PairKernel<SwitchedGayBerne> {
  static constexpr bool kOrientation = true, kNormal = false, kTorque = true;
  static constexpr std::size_t kNumbers = 16;
  static void pack(const SwitchedGayBerne& law, double* p) {
    const GayBerne& e = law.ellipsoid;
    const Vec3 radii2 = squared_radii(e), softness = softness_of(e);
    for (int k = 0; k < 3; ++k) {
      p[k] = radii2[k];
      p[3 + k] = softness[k];
    }
    p[6] = 4.0 * e.epsilon;
    p[7] = e.sigma;
    p[8] = e.gamma * e.sigma;
    p[9] = 2.0 * size_of(e) * size_of(e);
    p[10] = e.upsilon;
    p[11] = e.mu;
    p[12] = packed_exponent(e.upsilon);
    p[13] = packed_exponent(e.mu);
    p[14] = law.switch_from;
    p[15] = 1.0 / (law.cut_off - law.switch_from);
  }
  /// G_X and B_X of a particle.
  template <class T>
  struct Own {
    SymmetricRows<T> g, b;
  };
  template <class T>
  static Own<T> own(const T* p, const Rotation<T>& orientation) {
    return {turned_diagonal(orientation, p), turned_diagonal(orientation, p + 3)};
  }
  /// What a neighbour at r does to a particle: -force_b and torque_a. From the other particle force_b is the opposite, to the bit.
  template <class T>
  static KernelLoads<T> loads_on(const Own<T>& a, const T* p, const Rotation<T>& orientation, const Vector<T>& r) {
    const Own<T> other = own(p, orientation);
    const SymmetricRows<T> g = a.g + other.g, b = a.b + other.b;
    const SymmetricRows<T> g_adjugate = g.adjugate(), b_adjugate = b.adjugate();
    const T inverse_g = T(1.0) / dot(g.x, g_adjugate.x), inverse_b = T(1.0) / dot(b.x, b_adjugate.x);
    const T d2 = dot(r, r);
    const T d = sqrt(d2);
    const Vector<T> u = (T(1.0) / d) * r;
    const Vector<T> kappa = inverse_g * g_adjugate.times(u), iota = inverse_b * b_adjugate.times(u);
    const T u_kappa = dot(u, kappa), u_iota = dot(u, iota);

    const T touch = sqrt(T(2.0) / u_kappa);
    const T rho = p[7] / (d - touch + p[8]);
    const T rho2 = rho * rho;
    const T rho6 = rho2 * rho2 * rho2;
    const T shape = binary_power<kExponentBits>(sqrt(p[9] * inverse_g), p[12]) *
                    binary_power<kExponentBits>(T(2.0) * u_iota, p[13]);
    const T energy = p[6] * (rho6 * rho6 - rho6) * shape;
    const T slope = p[6] * (T(6.0) - T(12.0) * rho6) * rho6 * rho / p[7] * shape;
    const T by_touch = T(0.25) * slope * touch * touch * touch;
    const T by_chi = p[11] * energy / u_iota;
    const T by_eta = T(-0.5) * p[10] * energy;

    const T t = least(positive((d - p[14]) * p[15]), T(1.0));
    const T rest = T(1.0) - t;
    const T share = T(1.0) - t * t * t * (T(10.0) - t * (T(15.0) - T(6.0) * t));
    const T share_slope = T(-30.0) * p[15] * (t * t) * (rest * rest);

    const Vector<T> along = (T(2.0) / d) * scaled_sum(by_touch, kappa, by_chi * iota);
    const T radial = share * (dot(along, u) - slope) - energy * share_slope;
    const auto torque = [&](const SymmetricRows<T>& g_x, const SymmetricRows<T>& b_x) {
      const Vector<T> touching = by_touch * cross(g_x.times(kappa), kappa);
      const Vector<T> deepening = by_chi * cross(b_x.times(iota), iota);
      return (T(2.0) * share) * (touching + deepening - (by_eta * inverse_g) * twist(g_x, g_adjugate));
    };
    return {.force_b = scaled_sum(radial, u, T(-1.0) * share * along),
            .torque_a = torque(a.g, a.b),
            .torque_b = {}};
  }

 private:
  static constexpr int kExponentBits = 6;
  static_assert(SwitchedGayBerne::kLargestExponent == (1 << kExponentBits) - 1);
  static double packed_exponent(int exponent) {
    return std::bit_cast<double>(static_cast<std::uint64_t>(exponent) << (64 - kExponentBits));
  }
};

}  // namespace supple::core
