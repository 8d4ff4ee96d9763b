/// @file sampling.h
/// Random numbers and directions of the path tracer. A number is a function of pixel, sample and dimension alone, so that
/// neither threads nor the order of the work change a bit.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace supple::render::path {

using Vec3f = Eigen::Vector3f;
inline constexpr float kPi = std::numbers::pi_v<float>;

/// Mixes all bits (Wellons 2018, "lowbias32").
[[nodiscard]] inline std::uint32_t hash(std::uint32_t x) {
  x = (x ^ (x >> 16)) * 0x7feb352du;
  x = (x ^ (x >> 15)) * 0x846ca68bu;
  return x ^ (x >> 16);
}
[[nodiscard]] inline std::uint32_t hash(std::uint32_t a, std::uint32_t b) { return hash(a ^ (hash(b) + 0x9e3779b9u)); }

[[nodiscard]] inline std::uint32_t reverse_bits(std::uint32_t x) {
  x = __builtin_bswap32(x);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
}

/// Owen's scrambling by a hash (Laine & Karras 2011; constants of Vegdahl 2021).
[[nodiscard]] inline std::uint32_t scramble(std::uint32_t x, std::uint32_t seed) {
  x = reverse_bits(x);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reverse_bits(x);
}

/// Second dimension of Sobol's sequence: Pascal's matrix mod 2 is a Kronecker power, so bits meet as in a fast transform.
[[nodiscard]] inline std::uint32_t sobol_second(std::uint32_t index) {
  std::uint32_t x = reverse_bits(index);
  x ^= (x & 0x55555555u) << 1;
  x ^= (x & 0x33333333u) << 2;
  x ^= (x & 0x0f0f0f0fu) << 4;
  x ^= (x & 0x00ff00ffu) << 8;
  return x ^ (x << 16);
}

/// The first two dimensions of Sobol's sequence, scrambled and shuffled anew for every pair of dimensions (Burley 2020).
class Sampler {
 public:
  Sampler(int x, int y, std::uint32_t sample)
      : pixel_(hash(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y))), sample_(sample) {}

  [[nodiscard]] Eigen::Vector2f pair() {
    const std::uint32_t seed = hash(pixel_, dimension_++);
    const std::uint32_t index = scramble(sample_, seed);
    return {unit(scramble(reverse_bits(index), hash(seed, 1))), unit(scramble(sobol_second(index), hash(seed, 2)))};
  }
  [[nodiscard]] float number() {
    const std::uint32_t seed = hash(pixel_, dimension_++);
    return unit(scramble(reverse_bits(scramble(sample_, seed)), hash(seed, 1)));
  }

 private:
  static float unit(std::uint32_t x) { return static_cast<float>(x >> 8) * 0x1p-24F; }
  std::uint32_t pixel_;
  std::uint32_t sample_;
  std::uint32_t dimension_ = 0;
};

/// Orthonormal axes with z along n (Duff et al. 2017).
struct Axes {
  Vec3f x, y, z;
  explicit Axes(const Vec3f& n) : z(n) {
    const float sign = std::copysign(1.0F, n.z());
    const float a = -1.0F / (sign + n.z());
    const float b = n.x() * n.y() * a;
    x = Vec3f(1.0F + sign * n.x() * n.x() * a, sign * b, -sign * n.x());
    y = Vec3f(b, sign + n.y() * n.y() * a, -n.y());
  }
  [[nodiscard]] Vec3f to_world(const Vec3f& v) const { return v.x() * x + v.y() * y + v.z() * z; }
  [[nodiscard]] Vec3f to_local(const Vec3f& v) const { return {v.dot(x), v.dot(y), v.dot(z)}; }
};

/// Uniform on the unit disc (Shirley & Chiu 1997).
[[nodiscard]] inline Eigen::Vector2f on_disc(const Eigen::Vector2f& u) {
  const Eigen::Vector2f v = 2.0F * u - Eigen::Vector2f::Ones();
  if (v.x() == 0.0F && v.y() == 0.0F) return v;
  const bool wide = std::abs(v.x()) > std::abs(v.y());
  const float r = wide ? v.x() : v.y();
  const float angle = wide ? kPi / 4.0F * (v.y() / v.x()) : kPi / 2.0F - kPi / 4.0F * (v.x() / v.y());
  return r * Eigen::Vector2f(std::cos(angle), std::sin(angle));
}

/// About +z with density cos / pi.
[[nodiscard]] inline Vec3f cosine_direction(const Eigen::Vector2f& u) {
  const Eigen::Vector2f d = on_disc(u);
  return {d.x(), d.y(), std::sqrt(std::max(0.0F, 1.0F - d.squaredNorm()))};
}

/// Share of the first of two ways to sample (Veach 1997, power heuristic).
[[nodiscard]] inline float power_share(float a, float b) {
  const float a2 = a * a;
  return a2 > 0.0F ? a2 / (a2 + b * b) : 0.0F;
}

[[nodiscard]] inline float luminance(const Vec3f& c) { return 0.2126F * c.x() + 0.7152F * c.y() + 0.0722F * c.z(); }

}  // namespace supple::render::path
