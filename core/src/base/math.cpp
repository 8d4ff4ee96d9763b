#include "supple/core/math.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "base/exponential.h"

namespace supple::math {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

constexpr double kTwoOverPi = 0x1.45f306dc9c883p-1;
constexpr Split kHalfPi{0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54};
constexpr double kHalfPiRest = -0x1.f1976b7ed8fbcp-110;  ///< pi/2 less both parts of kHalfPi

/// a + b as a double and its exact rounding error (Knuth 1969).
Split exact_sum(double a, double b) {
  const double sum = a + b;
  const double b_part = sum - a;
  return {sum, (a - (sum - b_part)) + (b - b_part)};
}

/// Nearest integer, ties to even, for |x| < 2^51: adding 3 2^51 leaves no bits for a fraction.
double nearest_integer(double x) {
  constexpr double kShift = 0x1.8p52;
  return (x + kShift) - kShift;
}

/// 2^k for a normal result.
double power_of_two(int k) { return std::bit_cast<double>(static_cast<std::uint64_t>(k + 1023) << 52); }

/// Value of sum_i coefficient[i] x^i by Horner's rule.
template <std::size_t N>
double polynomial(const std::array<double, N>& coefficient, double x) {
  double value = coefficient[N - 1];
  for (std::size_t i = N - 1; i-- > 0;) value = std::fma(value, x, coefficient[i]);
  return value;
}

/// 2/3, 2/5, ... 2/23: 2 atanh(s) = 2 s + s sum_i c_i s^(2i+2); the rest is below 2e-18 relative for s <= 0.1716.
constexpr auto kAtanhSeries = [] {
  std::array<double, 11> c{};
  for (std::size_t i = 0; i < c.size(); ++i) c[i] = 2.0 / static_cast<double>(2 * i + 3);
  return c;
}();

/// -1/3!, 1/5!, ... 1/17! of the sine and 1/4!, -1/6!, ... 1/16! of the cosine; exact factorials up to 18!.
template <std::size_t N>
constexpr std::array<double, N> alternating_series(std::size_t first, double sign) {
  std::array<double, N> c{};
  double factorial = 1.0;
  for (std::size_t k = 2; k <= first; ++k) factorial *= static_cast<double>(k);
  for (std::size_t i = 0; i < N; ++i) {
    c[i] = sign / factorial;
    sign = -sign;
    factorial *= static_cast<double>((first + 2 * i + 1) * (first + 2 * i + 2));
  }
  return c;
}
constexpr auto kSinSeries = alternating_series<8>(3, -1.0);
constexpr auto kCosSeries = alternating_series<7>(4, 1.0);

/// -1/3, 1/5, ... : atan(u) = u + u^3 sum_i c_i u^(2i); the rest is below 2e-18 relative for |u| <= 1/16.
constexpr auto kAtanSeries = [] {
  std::array<double, 7> c{};
  for (std::size_t i = 0; i < c.size(); ++i) {
    c[i] = (i % 2 == 0 ? -1.0 : 1.0) / static_cast<double>(2 * i + 3);
  }
  return c;
}();

/// atan(i / 8).
constexpr std::array<Split, 9> kAtan{{{0x0.0p+0, 0x0.0p+0},
                                      {0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59},
                                      {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
                                      {0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56},
                                      {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                      {0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58},
                                      {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
                                      {0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56},
                                      {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}}};

/// erf and its derivative at i / 2.
struct ErfNode {
  Split value;
  double slope;
};
constexpr std::array<ErfNode, 13> kErf{{{{0x0.0p+0, 0x0.0p+0}, 0x1.20dd750429b6dp+0},
                                        {{0x1.0a7ef5c18edd2p-1, 0x1.5e809f1a31a28p-56}, 0x1.c1efca49a5011p-1},
                                        {{0x1.af767a741088bp-1, -0x1.c97f778122797p-56}, 0x1.a911f096fbc26p-2},
                                        {{0x1.eea5557137ae0p-1, -0x1.385e445f2c96dp-55}, 0x1.e723726b824a9p-4},
                                        {{0x1.fd9ae142795e3p-1, 0x1.972801904b9a3p-56}, 0x1.529b9e8cf9a1ep-6},
                                        {{0x1.ffcaa8f4c9beap-1, 0x1.b0cee160116f9p-55}, 0x1.1d83170fbf6fbp-9},
                                        {{0x1.fffd1ac4135f9p-1, 0x1.eeafa1ecd6cefp-55}, 0x1.2408e9ba3327fp-13},
                                        {{0x1.ffffe710d565ep-1, 0x1.c9ea52d76dc04p-55}, 0x1.6a597219a93dap-18},
                                        {{0x1.ffffff7b91176p-1, 0x1.0b2865615db40p-56}, 0x1.10b1488aeb235p-23},
                                        {{0x1.fffffffe4fa30p-1, 0x1.d166bcb681c7bp-57}, 0x1.f1e3523b41d7dp-30},
                                        {{0x1.fffffffffc9e8p-1, -0x1.a759f7738935fp-56}, 0x1.13af4f04f9998p-36},
                                        {{0x1.fffffffffffbep-1, -0x1.182b326b228dcp-55}, 0x1.7258610b3b233p-44},
                                        {{0x1.0000000000000p+0, -0x1.8cf81557d20b6p-56}, 0x1.2dc119095729fp-52}}};

}  // namespace

double exp(double x) noexcept {
  if (!(x >= kLeastExponent)) return x != x ? x : 0.0;
  if (x > kLargestExponent) return kInfinity;
  const Exponential<double> e(x);
  // In two factors: 2^1024 is not a double, yet e^709.5 is.
  const int exponent = static_cast<int>(e.k);
  const int half = exponent / 2;
  return e.mantissa * power_of_two(half) * power_of_two(exponent - half);
}

double log(double x) noexcept {
  if (!(x > 0.0)) return x == 0.0 ? -kInfinity : kNaN;
  if (x == kInfinity) return x;
  int exponent = 0;
  if (x < std::numeric_limits<double>::min()) {
    x *= 0x1p54;
    exponent = -54;
  }
  // x = 2^k m with m in [sqrt(1/2), sqrt(2)).
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x);
  exponent += static_cast<int>(bits >> 52) - 1023;
  double m = std::bit_cast<double>((bits & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL);
  if (m > 0x1.6a09e667f3bcdp+0) {
    m *= 0.5;
    ++exponent;
  }
  // log(1 + f) = 2 atanh(s) with s = f / (2 + f), written as f - s (f - series) so that f enters unrounded.
  const double f = m - 1.0;
  const double s = f / (2.0 + f);
  const double s2 = s * s;
  const double correction = s * (f - s2 * polynomial(kAtanhSeries, s2));
  const double k = exponent;
  return std::fma(k, kLn2.high, f - std::fma(-k, kLn2.low, correction));
}

SinCos sin_cos(double x) noexcept {
  if (!(std::abs(x) < kInfinity)) return {kNaN, kNaN};
  // x = n pi/2 + r + rest in three parts (Cody & Waite); the first fma is exact, the others keep their errors.
  const double n = nearest_integer(x * kTwoOverPi);
  const double first = std::fma(-n, kHalfPi.high, x);
  const double product = n * kHalfPi.low;
  const Split reduced = exact_sum(first, -product);
  const double r = reduced.high;
  const double rest = reduced.low - std::fma(n, kHalfPi.low, -product) - n * kHalfPiRest;

  const double z = r * r;
  const double sine = r + std::fma(r * z, polynomial(kSinSeries, z), std::fma(-0.5 * z, rest, rest));
  const double half_z = 0.5 * z;
  const double w = 1.0 - half_z;
  const double cosine = w + (((1.0 - w) - half_z) + std::fma(z * z, polynomial(kCosSeries, z), -r * rest));

  constexpr double kFirstTooLarge = 0x1p63;  // for an integer; digits of n that tell the quarter are lost before
  switch (std::abs(n) < kFirstTooLarge ? static_cast<std::int64_t>(n) & 3 : 0) {
    case 0: return {sine, cosine};
    case 1: return {cosine, -sine};
    case 2: return {-sine, -cosine};
    default: return {-cosine, sine};
  }
}

double atan2(double y, double x) noexcept {
  if (x != x || y != y) return kNaN;
  double ax = std::abs(x);
  double ay = std::abs(y);
  if (ax == kInfinity || ay == kInfinity) {
    ax = ax == kInfinity ? 1.0 : 0.0;
    ay = ay == kInfinity ? 1.0 : 0.0;
  }
  const bool steep = ay > ax;
  double large = steep ? ay : ax;
  double small = steep ? ax : ay;
  if (large == 0.0) return std::signbit(x) ? 2.0 * kHalfPi.high : y;
  // Scaled by a power of two so that no product below leaves the range.
  if (large > 0x1p500) {
    large *= 0x1p-600;
    small *= 0x1p-600;
  } else if (large < 0x1p-500) {
    large *= 0x1p500;
    small *= 0x1p500;
  }

  // atan(small / large) = atan(c) + atan(u) with c the nearest eighth.
  const double eighths = nearest_integer(8.0 * (small / large));
  const double c = 0.125 * eighths;
  const double u = std::fma(-c, large, small) / std::fma(c, small, large);
  const double u2 = u * u;
  const double tail = u * u2 * polynomial(kAtanSeries, u2);
  const Split node = kAtan[static_cast<std::size_t>(eighths)];

  // The angle is base + sign (node + u + tail), base a multiple of pi/2.
  const bool behind = std::signbit(x);
  const double base = steep ? 1.0 : (behind ? 2.0 : 0.0);
  const double sign = steep != behind ? -1.0 : 1.0;
  const Split sum = exact_sum(base * kHalfPi.high, sign * node.high);
  const double low = sum.low + std::fma(base, kHalfPi.low, sign * node.low);
  const double angle = sum.high + (sign * u + (sign * tail + low));
  return std::signbit(y) && !(y == 0.0 && behind) ? -angle : angle;
}

double pow(double x, double y) noexcept {
  if (y == 0.0) return 1.0;
  return exp(y * log(x));
}

double erf(double x) noexcept {
  if (x != x) return x;
  const double magnitude = std::abs(x);
  if (magnitude >= 6.0) return std::copysign(1.0, x);
  // Taylor about the nearest half c: g = erf' obeys g' = -2 x g, so its coefficients follow
  // g_{n+1} = -2 (c g_n + g_{n-1}) / (n + 1). Twenty terms leave less than 1e-18 for |h| <= 1/4.
  const double halves = nearest_integer(2.0 * magnitude);
  const double c = 0.5 * halves;
  const double h = magnitude - c;
  const ErfNode& node = kErf[static_cast<std::size_t>(halves)];
  double previous = 0.0;
  double current = node.slope;
  double power = h;
  double sum = node.slope * h;
  for (int n = 0; n < 20; ++n) {
    const double next = -2.0 * std::fma(c, current, previous) / (n + 1);
    previous = current;
    current = next;
    power *= h;
    sum = std::fma(current / (n + 2), power, sum);
  }
  return std::copysign(node.value.high + (node.value.low + sum), x);
}

}  // namespace supple::math
