/// @file lanes.h
/// Numbers of eight rays at once, as vectors of the compiler: operators work lane by lane, so that what a lane holds never
/// depends on its neighbours. What is written for a `Number` works for one ray (float) and for eight (Lanes).
#pragma once

#include <immintrin.h>

#include <Eigen/Core>
#include <bit>
#include <cmath>
#include <cstdint>

namespace supple::render::path {

using Vec3f = Eigen::Vector3f;

inline constexpr std::size_t kLanes = 8;
using Lanes = float __attribute__((vector_size(32)));
using LaneBits = std::uint32_t __attribute__((vector_size(32)));
using LaneMask = std::int32_t __attribute__((vector_size(32)));  ///< all bits of a lane, or none

[[nodiscard]] inline Lanes all_lanes(float x) { return x - Lanes{}; }
inline constexpr LaneBits kLaneNumbers = {0, 1, 2, 3, 4, 5, 6, 7};
[[nodiscard]] inline LaneBits all_lanes(std::uint32_t x) { return x - LaneBits{}; }
/// None where count <= 0.
[[nodiscard]] inline LaneMask first_lanes(int count) { return LaneMask{0, 1, 2, 3, 4, 5, 6, 7} < count; }
[[nodiscard]] inline bool any(LaneMask mask) { return _mm256_movemask_epi8(std::bit_cast<__m256i>(mask)) != 0; }
[[nodiscard]] inline bool any(bool mask) { return mask; }

[[nodiscard]] inline Lanes select(LaneMask mask, Lanes yes, Lanes no) { return mask ? yes : no; }
[[nodiscard]] inline Lanes select(LaneMask mask, Lanes yes, float no) { return mask ? yes : all_lanes(no); }
[[nodiscard]] inline float select(bool mask, float yes, float no) { return mask ? yes : no; }
[[nodiscard]] inline LaneMask both(LaneMask a, LaneMask b) { return a & b; }
[[nodiscard]] inline bool both(bool a, bool b) { return a && b; }

[[nodiscard]] inline Lanes larger(Lanes a, Lanes b) { return a > b ? a : b; }
[[nodiscard]] inline Lanes larger(Lanes a, float b) { return larger(a, all_lanes(b)); }
[[nodiscard]] inline float larger(float a, float b) { return a > b ? a : b; }
[[nodiscard]] inline Lanes smaller(Lanes a, Lanes b) { return a < b ? a : b; }
[[nodiscard]] inline Lanes smaller(Lanes a, float b) { return smaller(a, all_lanes(b)); }
[[nodiscard]] inline float smaller(float a, float b) { return a < b ? a : b; }
template <class Number>
[[nodiscard]] Number clamped(Number x, float low, float high) {
  return smaller(larger(x, low), high);
}
[[nodiscard]] inline Lanes root(Lanes x) { return _mm256_sqrt_ps(x); }
[[nodiscard]] inline float root(float x) { return std::sqrt(x); }
[[nodiscard]] inline Lanes magnitude(Lanes x) { return std::bit_cast<Lanes>(std::bit_cast<LaneBits>(x) & 0x7fffffffu); }
[[nodiscard]] inline float magnitude(float x) { return std::abs(x); }
/// 1 with the sign of x.
[[nodiscard]] inline Lanes sign(Lanes x) { return std::bit_cast<Lanes>((std::bit_cast<LaneBits>(x) & 0x80000000u) | 0x3f800000u); }
[[nodiscard]] inline float sign(float x) { return std::copysign(1.0F, x); }
/// The lanes that `from` names, each below kLanes.
[[nodiscard]] inline Lanes permuted(Lanes x, LaneBits from) { return _mm256_permutevar8x32_ps(x, std::bit_cast<__m256i>(from)); }
/// Sum over all lanes.
[[nodiscard]] inline float total(Lanes x) { return ((x[0] + x[4]) + (x[1] + x[5])) + ((x[2] + x[6]) + (x[3] + x[7])); }
/// Of an integer below 2^31.
[[nodiscard]] inline Lanes number_of(LaneBits x) { return _mm256_cvtepi32_ps(std::bit_cast<__m256i>(x)); }
[[nodiscard]] inline float number_of(std::uint32_t x) { return static_cast<float>(x); }

/// Vectors of eight rays; members are named as those of Vec3f.
class Vec3Lanes {
 public:
  Vec3Lanes() = default;
  Vec3Lanes(Lanes x, Lanes y, Lanes z) : x_(x), y_(y), z_(z) {}
  explicit Vec3Lanes(const Vec3f& v) : x_(all_lanes(v.x())), y_(all_lanes(v.y())), z_(all_lanes(v.z())) {}
  [[nodiscard]] static Vec3Lanes Zero() { return {Lanes{}, Lanes{}, Lanes{}}; }
  [[nodiscard]] static Vec3Lanes Constant(Lanes v) { return {v, v, v}; }
  [[nodiscard]] static Vec3Lanes Ones() { return Constant(all_lanes(1.0F)); }

  [[nodiscard]] Lanes x() const { return x_; }
  [[nodiscard]] Lanes y() const { return y_; }
  [[nodiscard]] Lanes z() const { return z_; }
  [[nodiscard]] Vec3f lane(std::size_t k) const { return {x_[k], y_[k], z_[k]}; }
  void set_lane(std::size_t k, const Vec3f& v) {
    x_[k] = v.x();
    y_[k] = v.y();
    z_[k] = v.z();
  }

  friend Vec3Lanes operator+(const Vec3Lanes& a, const Vec3Lanes& b) { return {a.x_ + b.x_, a.y_ + b.y_, a.z_ + b.z_}; }
  friend Vec3Lanes operator-(const Vec3Lanes& a, const Vec3Lanes& b) { return {a.x_ - b.x_, a.y_ - b.y_, a.z_ - b.z_}; }
  friend Vec3Lanes operator-(const Vec3Lanes& a) { return {-a.x_, -a.y_, -a.z_}; }
  friend Vec3Lanes operator*(const Vec3Lanes& a, Lanes s) { return {a.x_ * s, a.y_ * s, a.z_ * s}; }
  friend Vec3Lanes operator*(Lanes s, const Vec3Lanes& a) { return a * s; }
  friend Vec3Lanes operator*(float s, const Vec3Lanes& a) { return a * all_lanes(s); }
  friend Vec3Lanes operator*(const Vec3Lanes& a, float s) { return a * all_lanes(s); }
  friend Vec3Lanes operator/(const Vec3Lanes& a, Lanes s) { return a * (1.0F / s); }
  Vec3Lanes& operator+=(const Vec3Lanes& b) { return *this = *this + b; }

  [[nodiscard]] Lanes dot(const Vec3Lanes& b) const { return x_ * b.x_ + y_ * b.y_ + z_ * b.z_; }
  [[nodiscard]] Vec3Lanes cross(const Vec3Lanes& b) const {
    return {y_ * b.z_ - z_ * b.y_, z_ * b.x_ - x_ * b.z_, x_ * b.y_ - y_ * b.x_};
  }
  [[nodiscard]] Vec3Lanes cwiseProduct(const Vec3Lanes& b) const { return {x_ * b.x_, y_ * b.y_, z_ * b.z_}; }
  [[nodiscard]] Vec3Lanes cwiseQuotient(const Vec3Lanes& b) const { return {x_ / b.x_, y_ / b.y_, z_ / b.z_}; }
  [[nodiscard]] Vec3Lanes cwiseMax(float b) const { return {larger(x_, b), larger(y_, b), larger(z_, b)}; }
  [[nodiscard]] Lanes norm() const { return root(dot(*this)); }
  [[nodiscard]] Vec3Lanes normalized() const { return *this * (1.0F / norm()); }
  [[nodiscard]] Lanes maxCoeff() const { return larger(larger(x_, y_), z_); }

 private:
  Lanes x_, y_, z_;
};

[[nodiscard]] inline Vec3Lanes select(LaneMask mask, const Vec3Lanes& yes, const Vec3Lanes& no) {
  return {select(mask, yes.x(), no.x()), select(mask, yes.y(), no.y()), select(mask, yes.z(), no.z())};
}
[[nodiscard]] inline Vec3f select(bool mask, const Vec3f& yes, const Vec3f& no) { return mask ? yes : no; }
[[nodiscard]] inline Vec3f total(const Vec3Lanes& v) { return {total(v.x()), total(v.y()), total(v.z())}; }

template <class Number>
[[nodiscard]] Number constant(float x) {
  return x - Number{};
}

template <class Number>
struct Pair {
  Number x, y;
};

/// Types that belong to a number.
template <class Number>
struct LaneTypes;
template <>
struct LaneTypes<float> {
  using Bits = std::uint32_t;
  using Vector = Vec3f;
};
template <>
struct LaneTypes<Lanes> {
  using Bits = LaneBits;
  using Vector = Vec3Lanes;
};

}  // namespace supple::render::path
