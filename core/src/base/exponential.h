// e^x as math::exp computes it, for doubles and for lanes of them: the same operations, so the same bits.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace supple::math {

/// A constant as an unevaluated sum of two doubles.
struct Split {
  double high;
  double low;
};

inline constexpr double kInverseLn2 = 0x1.71547652b82fep+0;
inline constexpr Split kLn2{0x1.62e42fefa39efp-1, 0x1.abc9e3b39803fp-56};
/// Below the first e^x is taken as 0, above the other it is infinite.
inline constexpr double kLeastExponent = -708.0;
inline constexpr double kLargestExponent = 0x1.62e42fefa39efp+9;

/// 1/2!, 1/3!, ... 1/13!: e^r = 1 + r + r^2 sum_i c_i r^i; the rest is below 4e-18 for |r| <= ln 2 / 2.
inline constexpr auto kExpSeries = [] {
  std::array<double, 12> c{};
  double factorial = 1.0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    factorial *= static_cast<double>(i + 2);
    c[i] = 1.0 / factorial;
  }
  return c;
}();

/// e^x = 2^k times the mantissa, for x from kLeastExponent to kLargestExponent.
template <class T>
struct Exponential {
  T mantissa, k;

  explicit Exponential(const T& x) {
    using std::fma;
    // Nearest integer, ties to even: adding 3 2^51 leaves no bits for a fraction.
    constexpr double kShift = 0x1.8p52;
    k = (x * T(kInverseLn2) + T(kShift)) - T(kShift);
    // x = k ln 2 + r + rest, the first step exact because k has 11 bits and the difference cancels.
    const T high = fma(-k, T(kLn2.high), x);
    const T low = -k * T(kLn2.low);
    const T r = high + low;
    const T rest = (high - r) + low;
    T sum(kExpSeries.back());
    for (std::size_t i = kExpSeries.size() - 1; i-- > 0;) sum = fma(sum, r, T(kExpSeries[i]));
    mantissa = T(1.0) + (r + fma(r * r, sum, rest));
  }
};

}  // namespace supple::math
