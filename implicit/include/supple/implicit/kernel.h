/// @file supple/implicit/kernel.h
/// Compact field functions f(d) of the distance d to a skeleton primitive: 1-dimensional, decreasing, 0 beyond R.
#pragma once

#include <cstdint>

namespace supple::implicit {

enum class KernelKind : std::uint8_t {
  Wyvill,   ///< (1 - d^2/R^2)^3; C^2; at iso 0.5 the surface of a point is at 0.454202019 R
  Gascuel,  ///< linear with slope -k down to the thickness e, then cubic to 0 at R; C^1 (Gascuel 1993, field function)
};

/// Value and derivative with respect to q = d^2: every caller has q, and grad f = 2 slope (p - foot).
struct KernelSample {
  double value;  ///< f [1]
  double slope;  ///< df/dq [1/m^2]
};

struct Kernel {
  KernelKind kind = KernelKind::Wyvill;
  double radius = 0.0;     ///< support R [m], > 0
  double thickness = 0.0;  ///< Gascuel: e [m], 0 < e < R, where f = iso
  double slope = 0.0;      ///< Gascuel: -f'(e) = -f'(d <= e) [1/m], > 0; needs slope (R - e) <= 3 iso
  double iso = 0.5;        ///< the iso value c that Gascuel's kernel is scaled to: f(e) = c

  [[nodiscard]] static Kernel wyvill(double radius);
  /// @throws Error{Scene} when slope (R - e) > 3 iso (the field would dip below zero), or 0 < e < R does not hold.
  [[nodiscard]] static Kernel gascuel(double thickness, double radius, double slope, double iso = 0.5);
};

/// Wyvill: f = (1 - q/R^2)^3.
/// Gascuel: f = c (1 + k' (e - d)) for d <= e, c (d - R)^2 (D d + G) for e <= d <= R, k' = slope / c, w = R - e,
/// D = (2/w - k') / w^2, G = 1/w^2 - D e. At d = 0 its slope (a cone) is given as 0.
/// @param q  squared distance [m^2], >= 0
[[nodiscard]] KernelSample evaluate(const Kernel& kernel, double q) noexcept;
/// Second derivative d2f/dq2 [1/m^4].
[[nodiscard]] double second_slope(const Kernel& kernel, double q) noexcept;
/// max over d of |df/dd| [1/m] (Wyvill: 96 / (25 sqrt 5) / R).
[[nodiscard]] double lipschitz(const Kernel& kernel) noexcept;
/// max of |df/dd| for d in [near, far] [1/m].
[[nodiscard]] double lipschitz(const Kernel& kernel, double near, double far) noexcept;
/// Distance at which f = iso [m]. @pre 0 < iso < f(0)
[[nodiscard]] double iso_distance(const Kernel& kernel, double iso);
/// -df/dd at that distance [1/m]: the stiffness k of contact.
[[nodiscard]] double iso_slope(const Kernel& kernel, double iso);

}  // namespace supple::implicit
