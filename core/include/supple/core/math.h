/// @file supple/core/math.h
/// Transcendental functions with the same bits on every CPU: the C library chooses variants by CPU, so code that affects
/// State calls these instead. They use correctly rounded operations and explicit fma only. sqrt is IEEE and is used
/// directly. Errors are bounded in units in the last place (ulp) and tested against extended precision.
#pragma once

namespace supple::math {

struct SinCos {
  double sin;
  double cos;
};

/// e^x; error <= 1 ulp in [-708, 709]; 0 below, +inf above.
[[nodiscard]] double exp(double x) noexcept;
/// Natural logarithm; error <= 1.5 ulp for x > 0; -inf at 0, NaN below.
[[nodiscard]] double log(double x) noexcept;
/// sin and cos together; error <= 1.5 ulp for |x| <= 1e5 [rad].
[[nodiscard]] SinCos sin_cos(double x) noexcept;
/// Angle of (x, y) in (-pi, pi]; error <= 2 ulp.
[[nodiscard]] double atan2(double y, double x) noexcept;
/// x^y for x > 0; relative error <= 1e-15 (1 + |y log x|).
[[nodiscard]] double pow(double x, double y) noexcept;
/// Error function; absolute error <= 2e-16.
[[nodiscard]] double erf(double x) noexcept;

}  // namespace supple::math
