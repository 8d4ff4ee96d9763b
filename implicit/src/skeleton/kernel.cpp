#include "supple/implicit/kernel.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
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

/// f of u = d^2 / R^2 with its first two derivatives, 0 <= u < 1; every kernel but Gascuel's.
struct InSquare {
  double value, first, second;
};
InSquare in_square(const Kernel& k, double u) noexcept {
  const double w = 1.0 - u;
  switch (k.kind) {
    case KernelKind::Gascuel: break;
    case KernelKind::Wyvill: return {w * w * w, -3.0 * w * w, 6.0 * w};
    case KernelKind::SoftObject:
      return {1.0 + u * (-22.0 / 9.0 + u * (17.0 / 9.0 - u * (4.0 / 9.0))),
              -22.0 / 9.0 + u * (34.0 / 9.0 - u * (12.0 / 9.0)), 34.0 / 9.0 - u * (24.0 / 9.0)};
    case KernelKind::Murakami: return {w * w, -2.0 * w, 2.0};
    case KernelKind::Nishimura: {
      if (u <= 1.0 / 9.0) return {1.0 - 3.0 * u, -3.0, 0.0};
      const double rho = std::sqrt(u);
      return {1.5 * (1.0 - rho) * (1.0 - rho), -1.5 * (1.0 - rho) / rho, 0.75 / (rho * u)};
    }
    case KernelKind::Blinn: {
      const double a = k.shape * k.shape;
      const double g = math::exp(-a * u);
      return {k.gain * std::max(g - k.floor * (1.0 + k.tilt * w), 0.0), -k.gain * (a * g - k.floor * k.tilt), k.gain * a * a * g};
    }
    case KernelKind::Cauchy: {
      const double a = k.shape * k.shape;
      const double r = 1.0 / (1.0 + a * u);
      const double g = r * r;
      return {k.gain * std::max(g - k.floor * (1.0 + k.tilt * w), 0.0), -k.gain * (2.0 * a * g * r - k.floor * k.tilt),
              k.gain * 6.0 * a * a * g * g};
    }
    case KernelKind::BlancSchlick: {
      const double p = k.shape;
      const double beyond = u - 0.25;  // both denominators are 9/8 at the joint
      if (beyond <= 0.0) {
        const double b = 4.5 - 4.0 * p;
        const double D = 1.125 + b * beyond;
        return {1.0 - 9.0 * u * u / D, -9.0 * u * (2.0 * p + b * u) / (D * D), -18.0 * p * p / (D * D * D)};
      }
      const double b = 1.5 + 4.0 * p;
      const double D = 1.125 + b * beyond;
      const double end = 2.25 + 3.0 * p;  // D at u = 1
      return {w * w / D, -w * (2.0 * D + b * w) / (D * D), 2.0 * end * end / (D * D * D)};
    }
  }
  return {0.0, 0.0, 0.0};
}

[[noreturn]] void refuse(const char* key, std::string expected, double found, std::string hint = "") {
  throw Error(ErrorKind::Scene, Fault{.place = "",
                                      .key = key,
                                      .expected = std::move(expected),
                                      .found = number(found),
                                      .hint = std::move(hint)});
}

void expect_radius(double radius) {
  if (!(radius > 0.0) || !std::isfinite(radius)) refuse("kernel.radius", "expected a length > 0 [m]", radius);
}

void expect_within(const char* key, double value, double least, double largest) {
  if (value >= least && value <= largest) return;
  refuse(key, "expected a number in [" + number(least) + ", " + number(largest) + "]", value);
}

/// Where d2f/dd2 = 2 df/du + 4 u d2f/du2 (over R^2) changes its sign from - to +; it does once.
double inflection(const Kernel& k) {
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < 200; ++i) {
    const double u = 0.5 * (low + high);
    if (u <= low || u >= high) break;
    const InSquare g = in_square(k, u);
    (g.first + 2.0 * u * g.second < 0.0 ? low : high) = u;
  }
  return k.radius * std::sqrt(low);
}

/// Its second derivative is 0 within the thickness and linear outside; the first is bounded as in `lipschitz`.
CurvatureRange gascuel_curvature(const Kernel& k, double near, double far) noexcept {
  CurvatureRange range{.lower = -lipschitz(k, near, far) / near};
  if (far <= k.thickness) return range;
  const auto [D, G] = OuterCubic(k);
  for (const double d : {std::max(near, k.thickness), far}) {
    const double second = k.iso * (2.0 * (D * d + G) + 4.0 * D * (d - k.radius));
    range = {std::min(range.lower, second), std::max(range.upper, second)};
  }
  return range;
}

/// Bounds of 2 f' and e = 2 f' + 4 u f'' over R^2 by interval arithmetic on either side of the joint: both derivatives keep
/// their signs there, and their parts are linear in u. @param p  hardness
CurvatureRange blanc_schlick_inner(double p, double from, double to) noexcept {
  if (from > to) return {};
  const double b = 4.5 - 4.0 * p;
  const double D = 1.125 + std::min(b * (from - 0.25), b * (to - 0.25));
  const double largest = 2.0 * p + std::max(b * from, b * to);
  return {-to * (18.0 * largest / (D * D) + 72.0 * p * p / (D * D * D)), 0.0};
}
CurvatureRange blanc_schlick_outer(double p, double from, double to) noexcept {
  if (from > to) return {};
  const double b = 1.5 + 4.0 * p, end = 2.25 + 3.0 * p;
  const double D = 1.125 + b * (from - 0.25), D_end = 1.125 + b * (to - 0.25);
  const double least = -2.0 * (1.0 - from) * (2.25 + b * (to + 0.5)) / (D * D);
  const double largest = -2.0 * (1.0 - to) * (2.25 + b * (from + 0.5)) / (D_end * D_end);
  return {least, std::max(largest + 8.0 * to * end * end / (D * D * D), 0.0)};
}

}  // namespace

Kernel Kernel::wyvill(double radius) {
  expect_radius(radius);
  return {.kind = KernelKind::Wyvill, .radius = radius, .steepest = radius / std::sqrt(5.0)};
}

Kernel Kernel::soft_object(double radius) {
  expect_radius(radius);
  // f'' = 0: 30 u^2 - 51 u + 11 = 0.
  const double u = (51.0 - std::sqrt(1281.0)) / 60.0;
  return {.kind = KernelKind::SoftObject, .radius = radius, .steepest = radius * std::sqrt(u)};
}

Kernel Kernel::murakami(double radius) {
  expect_radius(radius);
  return {.kind = KernelKind::Murakami, .radius = radius, .steepest = radius / std::sqrt(3.0)};
}

Kernel Kernel::nishimura(double radius) {
  expect_radius(radius);
  return {.kind = KernelKind::Nishimura, .radius = radius, .steepest = radius / 3.0};
}

Kernel Kernel::blinn(double radius, double sharpness) {
  expect_radius(radius);
  expect_within("kernel.sharpness", sharpness, kLeastSharpness, kLargestSharpness);
  const double a = sharpness * sharpness;
  Kernel k{.kind = KernelKind::Blinn, .radius = radius, .shape = sharpness, .floor = math::exp(-a), .tilt = a};
  k.gain = 1.0 / (1.0 - k.floor * (1.0 + k.tilt));
  k.steepest = inflection(k);
  return k;
}

Kernel Kernel::cauchy(double radius, double sharpness) {
  expect_radius(radius);
  expect_within("kernel.sharpness", sharpness, kLeastSharpness, kLargestSharpness);
  const double a = sharpness * sharpness;
  Kernel k{.kind = KernelKind::Cauchy,
           .radius = radius,
           .shape = sharpness,
           .floor = 1.0 / ((1.0 + a) * (1.0 + a)),
           .tilt = 2.0 * a / (1.0 + a)};
  k.gain = 1.0 / (1.0 - k.floor * (1.0 + k.tilt));
  k.steepest = inflection(k);
  return k;
}

Kernel Kernel::blanc_schlick(double radius, double hardness) {
  expect_radius(radius);
  expect_within("kernel.hardness", hardness, kLeastHardness, kLargestHardness);
  // |df/dd| rises up to the joint and falls after it, for every hardness in this range.
  return {.kind = KernelKind::BlancSchlick, .radius = radius, .shape = hardness, .steepest = 0.5 * radius};
}

Kernel Kernel::gascuel(double thickness, double radius, double slope, double iso) {
  if (!(iso > 0.0) || !std::isfinite(iso)) refuse("kernel.iso", "expected an iso value > 0", iso);
  expect_radius(radius);
  if (!(thickness > 0.0 && thickness < radius)) {
    refuse("kernel.thickness", "expected 0 < thickness < radius = " + number(radius) + " [m]", thickness);
  }
  if (!(slope > 0.0) || !std::isfinite(slope)) refuse("kernel.slope", "expected a slope > 0 [1/m]", slope);
  const double w = radius - thickness;
  if (slope * w > 3.0 * iso) {
    refuse("kernel.slope",
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
  if (kernel.kind != KernelKind::Gascuel) {
    if (q >= R2) return {.value = 0.0, .slope = 0.0};
    const InSquare g = in_square(kernel, q / R2);
    return {.value = g.value, .slope = g.first / R2};
  }
  const double d = std::sqrt(q);
  const InDistance g = gascuel_at(kernel, d);
  return {.value = g.value, .slope = d > 0.0 ? g.derivative / (2.0 * d) : 0.0};
}

double second_slope(const Kernel& kernel, double q) noexcept {
  const double R2 = kernel.radius * kernel.radius;
  if (q >= R2) return 0.0;
  if (kernel.kind != KernelKind::Gascuel) return in_square(kernel, q / R2).second / (R2 * R2);
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

double peak(const Kernel& kernel) noexcept {
  return kernel.kind == KernelKind::Gascuel ? kernel.iso + kernel.slope * kernel.thickness : 1.0;
}

double lipschitz(const Kernel& kernel) noexcept { return lipschitz(kernel, 0.0, kernel.radius); }

double lipschitz(const Kernel& kernel, double near, double far) noexcept {
  const double R = kernel.radius;
  if (near >= R || far < near) return 0.0;
  near = std::max(near, 0.0);
  far = std::min(far, R);
  if (kernel.kind != KernelKind::Gascuel) {
    const double d = std::clamp(kernel.steepest, near, far);
    return 2.0 * d / (R * R) * std::abs(in_square(kernel, d * d / (R * R)).first);
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

CurvatureRange curvature_range(const Kernel& kernel, double near, double far) noexcept {
  const double R2 = kernel.radius * kernel.radius;
  const double from = near * near / R2;
  const double to = std::min(far * far / R2, 1.0);
  if (from >= 1.0) return {};
  // In u, over R^2: d2f/dd2 is e = 2 f' + 4 u f'', (df/dd)/d is 2 f', which rises with u; e has one extremum at most.
  double extremum = 2.0;
  const double a = kernel.shape * kernel.shape;
  switch (kernel.kind) {
    case KernelKind::Wyvill: extremum = 0.6; break;
    case KernelKind::SoftObject: extremum = 0.85; break;
    case KernelKind::Murakami: break;
    case KernelKind::Blinn: extremum = 1.5 / a; break;
    case KernelKind::Cauchy: extremum = 0.6 / a; break;
    case KernelKind::Nishimura: return {from < 1.0 / 9.0 ? -6.0 / R2 : 2.0 * in_square(kernel, from).first / R2, to > 1.0 / 9.0 ? 3.0 / R2 : 0.0};
    case KernelKind::Gascuel: return gascuel_curvature(kernel, near, std::min(far, kernel.radius));
    case KernelKind::BlancSchlick: {
      const CurvatureRange inner = blanc_schlick_inner(kernel.shape, from, std::min(to, 0.25));
      const CurvatureRange outer = blanc_schlick_outer(kernel.shape, std::max(from, 0.25), to);
      return {std::min(inner.lower, outer.lower) / R2, std::max(inner.upper, outer.upper) / R2};
    }
  }
  const auto radial = [&](double u) {
    const InSquare g = in_square(kernel, u);
    return 2.0 * g.first + 4.0 * u * g.second;
  };
  double least = std::min({radial(from), radial(to), 2.0 * in_square(kernel, from).first, 0.0});
  double largest = std::max({radial(from), radial(to), 0.0});
  if (extremum > from && extremum < to) {
    least = std::min(least, radial(extremum));
    largest = std::max(largest, radial(extremum));
  }
  return {least / R2, largest / R2};
}

double iso_distance(const Kernel& kernel, double iso) {
  const double R = kernel.radius;
  SUPPLE_EXPECTS(iso > 0.0 && iso < peak(kernel));
  if (kernel.kind == KernelKind::Wyvill) {
    double root = math::pow(iso, 1.0 / 3.0);
    root -= (root * root * root - iso) / (3.0 * root * root);
    return R * std::sqrt(1.0 - root);
  }
  if (kernel.kind == KernelKind::Gascuel && iso >= kernel.iso) return kernel.thickness - (iso - kernel.iso) / kernel.slope;
  const auto at = [&](double d) -> InDistance {
    if (kernel.kind == KernelKind::Gascuel) return gascuel_at(kernel, d);
    const KernelSample g = evaluate(kernel, d * d);
    return {g.value, 2.0 * d * g.slope};
  };
  double low = kernel.thickness;  // f(low) >= iso > f(high); thickness is 0 but for Gascuel's
  double high = R;
  double d = 0.5 * (low + high);
  for (int i = 0; i < 100 && low < high; ++i) {
    const InDistance g = at(d);
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
