// Four doubles that are worked on at once. Lanes never exchange values, so a result does not depend on its neighbours;
// every operation is the IEEE one of a double, so a kernel written for both types gives the same bits.
#pragma once

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/exponential.h"
#include "supple/core/math.h"

namespace supple::core {

inline constexpr std::size_t kLanes = 4;

struct Lanes {
  static constexpr std::size_t kCount = kLanes;
  __m256d v;

  Lanes() = default;
  Lanes(__m256d value) : v(value) {}
  Lanes(double value) : v(_mm256_set1_pd(value)) {}
  static Lanes load(const double* aligned) { return _mm256_load_pd(aligned); }
  static Lanes load_any(const double* at) { return _mm256_loadu_pd(at); }
  void store(double* aligned) const { _mm256_store_pd(aligned, v); }
  void store_any(double* at) const { _mm256_storeu_pd(at, v); }

  friend Lanes operator+(Lanes a, Lanes b) { return _mm256_add_pd(a.v, b.v); }
  friend Lanes operator-(Lanes a, Lanes b) { return _mm256_sub_pd(a.v, b.v); }
  friend Lanes operator*(Lanes a, Lanes b) { return _mm256_mul_pd(a.v, b.v); }
  friend Lanes operator/(Lanes a, Lanes b) { return _mm256_div_pd(a.v, b.v); }
  friend Lanes operator&(Lanes a, Lanes b) { return _mm256_and_pd(a.v, b.v); }
  friend Lanes operator^(Lanes a, Lanes b) { return _mm256_xor_pd(a.v, b.v); }
  friend Lanes operator-(Lanes a) { return _mm256_xor_pd(a.v, _mm256_set1_pd(-0.0)); }
};

inline Lanes fma(Lanes a, Lanes b, Lanes c) { return _mm256_fmadd_pd(a.v, b.v, c.v); }
inline Lanes fms(Lanes a, Lanes b, Lanes c) { return _mm256_fmsub_pd(a.v, b.v, c.v); }
inline Lanes sqrt(Lanes a) { return _mm256_sqrt_pd(a.v); }
/// The positive part; 0 where a is NaN or negative.
inline Lanes positive(Lanes a) { return _mm256_max_pd(a.v, _mm256_setzero_pd()); }
inline Lanes least(Lanes a, Lanes b) { return _mm256_min_pd(a.v, b.v); }
/// All bits set where a < b.
inline Lanes less(Lanes a, Lanes b) { return _mm256_cmp_pd(a.v, b.v, _CMP_LT_OQ); }
/// The highest bit of each lane, that of the first lowest.
inline unsigned bits_of(Lanes a) { return static_cast<unsigned>(_mm256_movemask_pd(a.v)); }
/// Whole numbers below 2^31.
inline Lanes lanes_of_indices(const std::uint32_t* at) {
  return _mm256_cvtepi32_pd(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at)));
}
/// value where a < b, else 0.
inline Lanes where_less(Lanes a, Lanes b, Lanes value) { return less(a, b) & value; }
/// The first `count` lanes, the others 0.
inline Lanes first_lanes(Lanes a, std::size_t count) {
  const __m256i lane = _mm256_set_epi64x(3, 2, 1, 0);
  const __m256i keep = _mm256_cmpgt_epi64(_mm256_set1_epi64x(static_cast<std::int64_t>(count)), lane);
  return _mm256_and_pd(a.v, _mm256_castsi256_pd(keep));
}
/// `set` where the highest bit is 1, else `clear`.
inline Lanes by_highest_bit(Lanes bits, Lanes set, Lanes clear) { return _mm256_blendv_pd(clear.v, set.v, bits.v); }
/// The 64 bits of each lane moved one up.
inline Lanes next_bit(Lanes bits) {
  return _mm256_castsi256_pd(_mm256_slli_epi64(_mm256_castpd_si256(bits.v), 1));
}
/// 2^k of whole numbers whose result is a normal double.
inline __m256d power_of_two(__m128i k) {
  return _mm256_castsi256_pd(_mm256_slli_epi64(_mm256_cvtepi32_epi64(_mm_add_epi32(k, _mm_set1_epi32(1023))), 52));
}
/// math::exp of each lane.
inline Lanes exp(Lanes a) {
  const Lanes least_exponent(math::kLeastExponent), largest(math::kLargestExponent);
  const math::Exponential<Lanes> e(_mm256_min_pd(_mm256_max_pd(a.v, least_exponent.v), largest.v));
  const __m128i exponent = _mm256_cvtpd_epi32(e.k.v);
  const __m128i half = _mm_srai_epi32(_mm_add_epi32(exponent, _mm_srli_epi32(exponent, 31)), 1);  // towards 0
  const __m256d value =
      _mm256_mul_pd(_mm256_mul_pd(e.mantissa.v, power_of_two(half)), power_of_two(_mm_sub_epi32(exponent, half)));
  const __m256d finite = _mm256_andnot_pd(less(a, least_exponent).v, value);
  const __m256d infinite = _mm256_set1_pd(std::numeric_limits<double>::infinity());
  const __m256d known = _mm256_blendv_pd(finite, infinite, less(largest, a).v);
  return _mm256_blendv_pd(known, a.v, _mm256_cmp_pd(a.v, a.v, _CMP_UNORD_Q));
}

/// function(a, b) of each lane.
template <class Function>
Lanes lane_by_lane(const Function& function, Lanes a, Lanes b) {
  alignas(32) std::array<double, kLanes> x;
  alignas(32) std::array<double, kLanes> y;
  a.store(x.data());
  b.store(y.data());
  for (std::size_t k = 0; k < kLanes; ++k) x[k] = function(x[k], y[k]);
  return Lanes::load(x.data());
}

inline double fma(double a, double b, double c) { return std::fma(a, b, c); }
inline double fms(double a, double b, double c) { return std::fma(a, b, -c); }
inline double positive(double a) { return a > 0.0 ? a : 0.0; }
inline double least(double a, double b) { return a < b ? a : b; }
inline double where_less(double a, double b, double value) { return a < b ? value : 0.0; }
inline double by_highest_bit(double bits, double set, double clear) { return std::signbit(bits) ? set : clear; }
inline double next_bit(double bits) { return std::bit_cast<double>(std::bit_cast<std::uint64_t>(bits) << 1); }
template <class Function>
double lane_by_lane(const Function& function, double a, double b) {
  return function(a, b);
}
inline double exp(double a) { return math::exp(a); }
using std::sqrt;

/// x to the power whose binary digits are the `count` highest bits of `digits`.
template <int count, class T>
T binary_power(const T& x, T digits) {
  T power = by_highest_bit(digits, x, T(1.0));
  for (int k = 1; k < count; ++k) {
    digits = next_bit(digits);
    power = power * power;
    power = by_highest_bit(digits, power * x, power);
  }
  return power;
}

/// The same for all lanes. @pre exponent > 0
template <class T>
T whole_power(const T& x, int exponent) {
  T power = x;
  for (unsigned bit = std::bit_floor(static_cast<unsigned>(exponent)) >> 1U; bit != 0; bit >>= 1U) {
    power = power * power;
    if ((static_cast<unsigned>(exponent) & bit) != 0) power = power * x;
  }
  return power;
}

template <class T>
struct Vector {
  T x, y, z;

  friend Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vector operator*(const T& s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
};

template <class T>
T dot(const Vector<T>& a, const Vector<T>& b) {
  return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}

template <class T>
Vector<T> cross(const Vector<T>& a, const Vector<T>& b) {
  return {fms(a.y, b.z, a.z * b.y), fms(a.z, b.x, a.x * b.z), fms(a.x, b.y, a.y * b.x)};
}

/// s a + b.
template <class T>
Vector<T> scaled_sum(const T& s, const Vector<T>& a, const Vector<T>& b) {
  return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.z, b.z)};
}

/// A rotation: vector part u and scalar part w.
template <class T>
struct Rotation {
  Vector<T> u;
  T w;
};

template <class T>
Vector<T> rotate(const Rotation<T>& q, const Vector<T>& v) {
  const Vector<T> half = cross(q.u, v);
  const Vector<T> t = half + half;
  return scaled_sum(q.w, t, v + cross(q.u, t));
}

template <class T>
Rotation<T> product(const Rotation<T>& a, const Rotation<T>& b) {
  return {scaled_sum(a.w, b.u, scaled_sum(b.w, a.u, cross(a.u, b.u))), fms(a.w, b.w, dot(a.u, b.u))};
}

/// a times the conjugate of b.
template <class T>
Rotation<T> product_conjugate(const Rotation<T>& a, const Rotation<T>& b) {
  return {scaled_sum(b.w, a.u, cross(b.u, a.u)) - a.w * b.u, fma(a.w, b.w, dot(a.u, b.u))};
}

/// Rows and columns of a 4 x 4 block exchanged.
inline void transpose(Lanes& a, Lanes& b, Lanes& c, Lanes& d) {
  const __m256d ab_low = _mm256_unpacklo_pd(a.v, b.v);
  const __m256d ab_high = _mm256_unpackhi_pd(a.v, b.v);
  const __m256d cd_low = _mm256_unpacklo_pd(c.v, d.v);
  const __m256d cd_high = _mm256_unpackhi_pd(c.v, d.v);
  a = _mm256_permute2f128_pd(ab_low, cd_low, 0x20);
  b = _mm256_permute2f128_pd(ab_high, cd_high, 0x20);
  c = _mm256_permute2f128_pd(ab_low, cd_low, 0x31);
  d = _mm256_permute2f128_pd(ab_high, cd_high, 0x31);
}

/// Four vectors in a row, x y z x y z ..., and lanes of each coordinate.
inline Vector<Lanes> load_vectors(const double* at) {
  const __m256d a = _mm256_loadu_pd(at), b = _mm256_loadu_pd(at + 4), c = _mm256_loadu_pd(at + 8);
  const __m256d x = _mm256_blend_pd(_mm256_blend_pd(a, b, 0b0100), c, 0b0010);
  const __m256d y = _mm256_blend_pd(_mm256_blend_pd(a, b, 0b1001), c, 0b0100);
  const __m256d z = _mm256_blend_pd(_mm256_blend_pd(a, b, 0b0010), c, 0b1001);
  return {_mm256_permute4x64_pd(x, 0b01101100), _mm256_permute4x64_pd(y, 0b10110001),
          _mm256_permute4x64_pd(z, 0b11000110)};
}

inline void store_vectors(const Vector<Lanes>& v, double* at) {
  const __m256d x = _mm256_permute4x64_pd(v.x.v, 0b01101100);
  const __m256d y = _mm256_permute4x64_pd(v.y.v, 0b10110001);
  const __m256d z = _mm256_permute4x64_pd(v.z.v, 0b11000110);
  _mm256_storeu_pd(at, _mm256_blend_pd(_mm256_blend_pd(x, y, 0b0010), z, 0b0100));
  _mm256_storeu_pd(at + 4, _mm256_blend_pd(_mm256_blend_pd(y, z, 0b0010), x, 0b0100));
  _mm256_storeu_pd(at + 8, _mm256_blend_pd(_mm256_blend_pd(z, x, 0b0010), y, 0b0100));
}

}  // namespace supple::core
