#include "supple/implicit/kernel.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "supple/core/error.h"
#include "supple/core/math.h"

namespace supple::implicit {
namespace {

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", x);
  return text;
}

/// The two coefficients of Gascuel's outer cubic (d - R)^2 (D d + G), for a kernel scaled to 1 at e.
struct OuterCubic {
  double D, G;
  explicit OuterCubic(const Kernel& k) {
    const double w = k.radius - k.thickness;
    D = (2.0 / w - k.slope / k.iso) / (w * w);
    G = 1.0 / (w * w) - D * k.thickness;
  }
};

/// f and df/dd of Gascuel's kernel at distance d.
struct InDistance {
  double value, derivative;
};
InDistance gascuel_at(const Kernel& k, double d) noexcept {
  if (d >= k.radius) return {0.0, 0.0};
  if (d <= k.thickness) return {k.iso + k.slope * (k.thickness - d), -k.slope};
  const auto [D, G] = OuterCubic(k);
  const double u = d - k.radius;
  return {k.iso * u * u * (D * d + G), k.iso * u * (2.0 * (D * d + G) + D * u)};
}

}  // namespace

Kernel Kernel::wyvill(double radius) {
  if (!(radius > 0.0) || !std::isfinite(radius)) {
    throw Error(ErrorKind::Scene, Fault{.place = "",
                                        .key = "kernel.radius",
                                        .expected = "expected a length > 0 [m]",
                                        .found = number(radius),
                                        .hint = ""});
  }
  return {.kind = KernelKind::Wyvill, .radius = radius};
}

Kernel Kernel::gascuel(double thickness, double radius, double slope, double iso) {
  const auto fail = [](const char* key, std::string expected, double found, std::string hint) {
    throw Error(ErrorKind::Scene, Fault{.place = "",
                                        .key = key,
                                        .expected = std::move(expected),
                                        .found = number(found),
                                        .hint = std::move(hint)});
  };
  if (!(iso > 0.0) || !std::isfinite(iso)) fail("kernel.iso", "expected an iso value > 0", iso, "");
  if (!(radius > 0.0) || !std::isfinite(radius)) fail("kernel.radius", "expected a length > 0 [m]", radius, "");
  if (!(thickness > 0.0 && thickness < radius)) {
    fail("kernel.thickness", "expected 0 < thickness < radius = " + number(radius) + " [m]", thickness, "");
  }
  if (!(slope > 0.0) || !std::isfinite(slope)) fail("kernel.slope", "expected a slope > 0 [1/m]", slope, "");
  const double w = radius - thickness;
  if (slope * w > 3.0 * iso) {
    fail("kernel.slope",
         "expected slope (radius - thickness) <= 3 iso = " + number(3.0 * iso) +
             ", so that the field does not dip below zero",
         slope * w,
         "use a slope of at most " + number(3.0 * iso / w) + " or a radius of at most " +
             number(thickness + 3.0 * iso / slope));
  }
  return {.kind = KernelKind::Gascuel, .radius = radius, .thickness = thickness, .slope = slope, .iso = iso};
}

KernelSample evaluate(const Kernel& kernel, double q) noexcept {
  const double R2 = kernel.radius * kernel.radius;
  if (kernel.kind == KernelKind::Wyvill) {
    if (q >= R2) return {.value = 0.0, .slope = 0.0};
    const double t = 1.0 - q / R2;
    return {.value = t * t * t, .slope = -3.0 / R2 * t * t};
  }
  const double d = std::sqrt(q);
  const InDistance g = gascuel_at(kernel, d);
  return {.value = g.value, .slope = d > 0.0 ? g.derivative / (2.0 * d) : 0.0};
}

double second_slope(const Kernel& kernel, double q) noexcept {
  const double R2 = kernel.radius * kernel.radius;
  if (q >= R2) return 0.0;
  if (kernel.kind == KernelKind::Wyvill) return 6.0 / (R2 * R2) * (1.0 - q / R2);
  if (q <= 0.0) return 0.0;
  const double d = std::sqrt(q);
  const double g1 = gascuel_at(kernel, d).derivative;
  double g2 = 0.0;  // of the cubic: 2 (D d + G) + 4 D (d - R)
  if (d > kernel.thickness) {
    const auto [D, G] = OuterCubic(kernel);
    g2 = kernel.iso * (2.0 * (D * d + G) + 4.0 * D * (d - kernel.radius));
  }
  return (g2 - g1 / d) / (4.0 * q);
}

double lipschitz(const Kernel& kernel) noexcept { return lipschitz(kernel, 0.0, kernel.radius); }

double lipschitz(const Kernel& kernel, double near, double far) noexcept {
  const double R = kernel.radius;
  if (near >= R || far < near) return 0.0;
  near = std::max(near, 0.0);
  far = std::min(far, R);
  if (kernel.kind == KernelKind::Wyvill) {
    const double d = std::clamp(R / std::sqrt(5.0), near, far);  // where |df/dd| peaks
    const double t = 1.0 - d * d / (R * R);
    return 6.0 * d / (R * R) * t * t;
  }
  double largest = near <= kernel.thickness ? kernel.slope : 0.0;
  if (far <= kernel.thickness) return largest;
  // Outside e the derivative (d - R)(3 D d + 2 G - D R) is a parabola: its extremes are the ends and the vertex.
  const auto [D, G] = OuterCubic(kernel);
  const double from = std::max(near, kernel.thickness);
  const auto steepness = [&](double d) { return std::abs(gascuel_at(kernel, d).derivative); };
  largest = std::max({largest, steepness(from), steepness(far)});
  if (D != 0.0) {
    const double vertex = 0.5 * (R + (D * R - 2.0 * G) / (3.0 * D));
    if (vertex > from && vertex < far) largest = std::max(largest, steepness(vertex));
  }
  return largest;
}

double iso_distance(const Kernel& kernel, double iso) {
  const double R = kernel.radius;
  if (kernel.kind == KernelKind::Wyvill) {
    SUPPLE_EXPECTS(iso > 0.0 && iso < 1.0);
    double root = math::pow(iso, 1.0 / 3.0);
    root -= (root * root * root - iso) / (3.0 * root * root);
    return R * std::sqrt(1.0 - root);
  }
  SUPPLE_EXPECTS(iso > 0.0 && iso < kernel.iso + kernel.slope * kernel.thickness);
  if (iso >= kernel.iso) return kernel.thickness - (iso - kernel.iso) / kernel.slope;
  double low = kernel.thickness;  // f(low) >= iso > f(high)
  double high = R;
  double d = 0.5 * (low + high);
  for (int i = 0; i < 100 && low < high; ++i) {
    const InDistance g = gascuel_at(kernel, d);
    (g.value >= iso ? low : high) = d;
    double next = d - (g.value - iso) / g.derivative;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - d) <= 1e-16 * R) return next;
    d = next;
  }
  return d;
}

double iso_slope(const Kernel& kernel, double iso) {
  const double d = iso_distance(kernel, iso);
  if (kernel.kind == KernelKind::Gascuel) return -gascuel_at(kernel, d).derivative;
  return -2.0 * d * evaluate(kernel, d * d).slope;
}

}  // namespace supple::implicit
