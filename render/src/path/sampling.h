/// @file sampling.h
/// Random numbers and directions of the path tracer. A number is a function of pixel, sample and dimension alone, so that
/// neither threads nor the order of the work change a bit.
#pragma once

#include <Eigen/Core>
#include <algorithm>
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

/// Owen's scrambling by a hash (Laine & Karras 2011; constants of Vegdahl 2021), of numbers whose bits are reversed.
[[nodiscard]] inline std::uint32_t scramble_reversed(std::uint32_t x, std::uint32_t seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  return x ^ (x * 0x53a22864u);
}

/// Second dimension of Sobol's sequence, of an index whose bits are reversed: Pascal's matrix mod 2 is a Kronecker power, so
/// bits meet as in a fast transform. The first dimension is the reversed index itself.
[[nodiscard]] inline std::uint32_t sobol_second(std::uint32_t reversed) {
  std::uint32_t x = reversed;
  x ^= (x & 0x55555555u) << 1;
  x ^= (x & 0x33333333u) << 2;
  x ^= (x & 0x0f0f0f0fu) << 4;
  x ^= (x & 0x00ff00ffu) << 8;
  return x ^ (x << 16);
}

/// Bits of x spread to the even places.
[[nodiscard]] inline std::uint32_t spread_bits(std::uint32_t x) {
  x = (x | (x << 8)) & 0x00ff00ffu;
  x = (x | (x << 4)) & 0x0f0f0f0fu;
  x = (x | (x << 2)) & 0x33333333u;
  return (x | (x << 1)) & 0x55555555u;
}

/// The first two dimensions of Sobol's sequence, shuffled anew for every pair of dimensions (Burley 2020); digits are
/// exchanged at random (Kollig & Keller 2002), which costs less than nested scrambling and keeps every net. Pixels take
/// consecutive parts of one sequence along Morton's curve (Ahmed & Wonka 2020): what square blocks of them take together
/// is a net too, so that little of their error is left where a filter joins neighbours.
class Sampler {
 public:
  Sampler() = default;
  /// Of sample `number` of `count`, a power of two, that each pixel takes from the sequence `stream`.
  Sampler(int x, int y, std::uint32_t stream, std::uint32_t count, std::uint32_t number) {
    constexpr std::uint32_t kInside = (1u << kBlockBits) - 1u;
    const auto px = static_cast<std::uint32_t>(x), py = static_cast<std::uint32_t>(y);
    const std::uint32_t place = spread_bits(px & kInside) | (spread_bits(py & kInside) << 1);
    seed_ = hash(hash(px >> kBlockBits, py >> kBlockBits) + stream);
    reversed_ = reverse_bits(place * count + number);
  }

  [[nodiscard]] Eigen::Vector2f pair() {
    const std::uint32_t seed = next_seed();
    const std::uint32_t index = scramble_reversed(reversed_, seed);
    return {unit(index ^ (seed * 0x9e3779b1u)), unit(sobol_second(index) ^ ((seed ^ (seed >> 15)) * 0x85ebca6bu))};
  }
  [[nodiscard]] float number() {
    const std::uint32_t seed = next_seed();
    return unit(scramble_reversed(reversed_, seed) ^ (seed * 0x9e3779b1u));
  }

 private:
  static constexpr int kBlockBits = 8;  // 256 x 256 pixels of up to 2^16 samples are the 2^32 numbers of a sequence
  std::uint32_t next_seed() { return hash(seed_ + 0x9e3779b9u * ++dimension_); }
  static float unit(std::uint32_t x) { return static_cast<float>(x >> 8) * 0x1p-24F; }
  std::uint32_t seed_ = 0;
  std::uint32_t reversed_ = 0;
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
  // Sine and cosine of at most pi / 4 by their series: 3e-7.
  const float angle = kPi / 4.0F * (wide ? v.y() / v.x() : v.x() / v.y());
  const float a2 = angle * angle;
  const float sine = angle * (1.0F - a2 * (1.0F / 6.0F - a2 * (1.0F / 120.0F - a2 * (1.0F / 5040.0F))));
  const float cosine = 1.0F - a2 * (0.5F - a2 * (1.0F / 24.0F - a2 * (1.0F / 720.0F - a2 * (1.0F / 40320.0F))));
  return r * (wide ? Eigen::Vector2f(cosine, sine) : Eigen::Vector2f(sine, cosine));
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
