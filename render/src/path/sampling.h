/// @file sampling.h
/// Random numbers and directions of the path tracer. A number is a function of pixel, sample and dimension alone, so that
/// neither threads nor the order of the work change a bit.
#pragma once

#include <cstdint>
#include <numbers>

#include "path/lanes.h"

namespace supple::render::path {

inline constexpr float kPi = std::numbers::pi_v<float>;

/// Mixes all bits (Wellons 2018, "lowbias32").
template <class Bits>
[[nodiscard]] Bits hash(Bits x) {
  x = (x ^ (x >> 16)) * 0x7feb352du;
  x = (x ^ (x >> 15)) * 0x846ca68bu;
  return x ^ (x >> 16);
}
template <class Bits>
[[nodiscard]] Bits hash(Bits a, Bits b) {
  return hash(a ^ (hash(b) + 0x9e3779b9u));
}

template <class Bits>
[[nodiscard]] Bits reverse_bits(Bits x) {
  x = (x >> 16) | (x << 16);
  x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
}

/// Owen's scrambling by a hash (Laine & Karras 2011; constants of Vegdahl 2021), of numbers whose bits are reversed.
template <class Bits>
[[nodiscard]] Bits scramble_reversed(Bits x, Bits seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  return x ^ (x * 0x53a22864u);
}

/// Second dimension of Sobol's sequence, of an index whose bits are reversed: Pascal's matrix mod 2 is a Kronecker power, so
/// bits meet as in a fast transform. The first dimension is the reversed index itself.
template <class Bits>
[[nodiscard]] Bits sobol_second(Bits reversed) {
  Bits x = reversed;
  x ^= (x & 0x55555555u) << 1;
  x ^= (x & 0x33333333u) << 2;
  x ^= (x & 0x0f0f0f0fu) << 4;
  x ^= (x & 0x00ff00ffu) << 8;
  return x ^ (x << 16);
}

/// Bits of x spread to the even places.
template <class Bits>
[[nodiscard]] Bits spread_bits(Bits x) {
  x = (x | (x << 8)) & 0x00ff00ffu;
  x = (x | (x << 4)) & 0x0f0f0f0fu;
  x = (x | (x << 2)) & 0x33333333u;
  return (x | (x << 1)) & 0x55555555u;
}

/// The first two dimensions of Sobol's sequence, shuffled anew for every pair of dimensions (Burley 2020); digits are
/// exchanged at random (Kollig & Keller 2002), which costs less than nested scrambling and keeps every net. Pixels take
/// consecutive parts of one sequence along Morton's curve (Ahmed & Wonka 2020): what square blocks of them take together
/// is a net too, so that little of their error is left where a filter joins neighbours.
template <class Number>
class SamplerOf {
 public:
  using Bits = typename LaneTypes<Number>::Bits;
  /// Of sample `number` of `count`, a power of two, that each pixel takes from the sequence `stream`.
  SamplerOf(Bits x, Bits y, Bits stream, Bits count, Bits number) {
    constexpr std::uint32_t kInside = (1u << kBlockBits) - 1u;
    const Bits place = spread_bits(Bits(x & kInside)) | (spread_bits(Bits(y & kInside)) << 1);
    seed_ = hash(hash(Bits(x >> kBlockBits), Bits(y >> kBlockBits)) + stream);
    reversed_ = reverse_bits(Bits(place * count + number));
  }

  [[nodiscard]] Pair<Number> pair() {
    const Bits seed = next_seed();
    const Bits index = scramble_reversed(reversed_, seed);
    return {unit(index ^ (seed * 0x9e3779b1u)), unit(sobol_second(index) ^ ((seed ^ (seed >> 15)) * 0x85ebca6bu))};
  }
  [[nodiscard]] Number number() {
    const Bits seed = next_seed();
    return unit(scramble_reversed(reversed_, seed) ^ (seed * 0x9e3779b1u));
  }

 private:
  static constexpr int kBlockBits = 8;  // 256 x 256 pixels of up to 2^16 samples are the 2^32 numbers of a sequence
  Bits next_seed() { return hash(Bits(seed_ + 0x9e3779b9u * ++dimension_)); }
  static Number unit(Bits x) { return number_of(Bits(x >> 8)) * 0x1p-24F; }
  Bits seed_{};
  Bits reversed_{};
  std::uint32_t dimension_ = 0;
};
using Sampler = SamplerOf<float>;

/// Orthonormal axes with z along n (Duff et al. 2017).
template <class Number>
struct AxesOf {
  using Vector = typename LaneTypes<Number>::Vector;
  Vector x, y, z;
  explicit AxesOf(const Vector& n) : z(n) {
    const Number s = sign(n.z());
    const Number a = -1.0F / (s + n.z());
    const Number b = n.x() * n.y() * a;
    x = Vector(1.0F + s * n.x() * n.x() * a, s * b, -s * n.x());
    y = Vector(b, s + n.y() * n.y() * a, -n.y());
  }
  [[nodiscard]] Vector to_world(const Vector& v) const { return v.x() * x + v.y() * y + v.z() * z; }
  [[nodiscard]] Vector to_local(const Vector& v) const { return {v.dot(x), v.dot(y), v.dot(z)}; }
};

/// Uniform on the unit disc (Shirley & Chiu 1997).
template <class Number>
[[nodiscard]] Pair<Number> on_disc(const Pair<Number>& u) {
  const Number x = 2.0F * u.x - 1.0F, y = 2.0F * u.y - 1.0F;
  const auto wide = magnitude(x) > magnitude(y);
  const Number r = select(wide, x, y), across = select(wide, y, x);
  // Sine and cosine of at most pi / 4 by their series: 3e-7.
  const Number angle = kPi / 4.0F * select(r == 0.0F, r, across / r);
  const Number a2 = angle * angle;
  const Number sine = angle * (1.0F - a2 * (1.0F / 6.0F - a2 * (1.0F / 120.0F - a2 * (1.0F / 5040.0F))));
  const Number cosine = 1.0F - a2 * (0.5F - a2 * (1.0F / 24.0F - a2 * (1.0F / 720.0F - a2 * (1.0F / 40320.0F))));
  return {r * select(wide, cosine, sine), r * select(wide, sine, cosine)};
}

/// About +z with density cos / pi.
template <class Number>
[[nodiscard]] typename LaneTypes<Number>::Vector cosine_direction(const Pair<Number>& u) {
  const Pair<Number> d = on_disc(u);
  return {d.x, d.y, root(larger(1.0F - (d.x * d.x + d.y * d.y), 0.0F))};
}

/// Share of the first of two ways to sample (Veach 1997, power heuristic).
template <class Number>
[[nodiscard]] Number power_share(Number a, Number b) {
  const Number a2 = a * a;
  return select(a2 > 0.0F, a2 / (a2 + b * b), 0.0F);
}

template <class Vector>
[[nodiscard]] auto luminance(const Vector& c) {
  return 0.2126F * c.x() + 0.7152F * c.y() + 0.0722F * c.z();
}

}  // namespace supple::render::path
