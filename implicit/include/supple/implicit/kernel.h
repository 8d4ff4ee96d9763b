/// @file supple/implicit/kernel.h
/// Compact field functions f(d) of the distance d to a skeleton primitive: 1-dimensional, decreasing, 0 beyond R.
#pragma once

#include <cstdint>

namespace supple::implicit {

/// With rho = d/R and u = rho^2; all but Gascuel's are 1 at d = 0. rho_c is where f = 0.5, so where the surface of a single
/// point lies at that iso value.
enum class KernelKind : std::uint8_t {
  Wyvill,        ///< (1 - u)^3; C^2; rho_c = 0.454202019
  Gascuel,       ///< linear with slope -k down to the thickness e, then cubic to 0 at R; C^1 (Gascuel 1993, field function)
  SoftObject,    ///< 1 - 22/9 u + 17/9 u^2 - 4/9 u^3; C^1; rho_c = 0.5 (Wyvill, McPheeters & Wyvill 1986)
  Murakami,      ///< (1 - u)^2; C^1; rho_c = 0.541196100 (Murakami & Ichihara 1987)
  Nishimura,     ///< 1 - 3 u up to rho = 1/3, then 3/2 (1 - rho)^2; C^1; rho_c = 0.422649731 (Nishimura et al. 1985)
  Blinn,         ///< exp(-s^2 u), made compact; C^1 (Blinn 1982)
  Cauchy,        ///< (1 + s^2 u)^-2, made compact; C^1 (McCormack & Sherstyuk 1998)
  BlancSchlick,  ///< 1 - 9 u^2 / (p + (9/2 - 4p) u) up to rho = 1/2, then (1-u)^2 / (3/4 - p + (3/2 + 4p) u); C^1;
                 ///< rho_c = 0.5 and slope 2 + 16 p/9 there for every hardness p (Blanc & Schlick 1995)
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
  double shape = 0.0;      ///< Blinn, Cauchy: sharpness s [1]; BlancSchlick: hardness p [1]
  /// Blinn, Cauchy: f = gain (g(u) - floor (1 + tilt (1 - u))) with g convex in u: its tangent at the support is subtracted,
  /// so that value and slope vanish there, and f(0) = 1.
  double floor = 0.0;
  double tilt = 0.0;
  double gain = 1.0;
  double steepest = 0.0;  ///< distance of the largest |df/dd| [m]; all but Gascuel, whose slope has a plateau

  bool operator==(const Kernel&) const = default;

  static constexpr double kLeastSharpness = 1.0, kLargestSharpness = 10.0;
  static constexpr double kLeastHardness = 0.02, kLargestHardness = 20.0;

  /// All throw Error{Scene} for a radius that is not > 0, and where a number leaves the range given here.
  [[nodiscard]] static Kernel wyvill(double radius);
  /// @throws Error{Scene} when slope (R - e) > 3 iso (the field would dip below zero), or 0 < e < R does not hold.
  [[nodiscard]] static Kernel gascuel(double thickness, double radius, double slope, double iso = 0.5);
  [[nodiscard]] static Kernel soft_object(double radius);
  [[nodiscard]] static Kernel murakami(double radius);
  [[nodiscard]] static Kernel nishimura(double radius);
  /// @param sharpness  s in [1, 10]
  [[nodiscard]] static Kernel blinn(double radius, double sharpness);
  [[nodiscard]] static Kernel cauchy(double radius, double sharpness);
  /// @param hardness  p in [0.02, 20]
  [[nodiscard]] static Kernel blanc_schlick(double radius, double hardness);
};

/// Gascuel: f = c (1 + k' (e - d)) for d <= e, c (d - R)^2 (D d + G) for e <= d <= R, k' = slope / c, w = R - e,
/// D = (2/w - k') / w^2, G = 1/w^2 - D e. At d = 0 its slope (a cone) is given as 0. The others: see KernelKind.
/// @param q  squared distance [m^2], >= 0
[[nodiscard]] KernelSample evaluate(const Kernel& kernel, double q) noexcept;
/// Second derivative d2f/dq2 [1/m^4].
[[nodiscard]] double second_slope(const Kernel& kernel, double q) noexcept;
/// f at d = 0 [1]: upper limit of iso values.
[[nodiscard]] double peak(const Kernel& kernel) noexcept;
/// max over d of |df/dd| [1/m] (Wyvill: 96 / (25 sqrt 5) / R).
[[nodiscard]] double lipschitz(const Kernel& kernel) noexcept;
/// max of |df/dd| for d in [near, far] [1/m].
[[nodiscard]] double lipschitz(const Kernel& kernel, double near, double far) noexcept;
/// Bounds of the second derivatives of f of a point by place, for distances in [near, far]: they lie between the least and
/// largest of d2f/dd2 and (df/dd)/d, and 0 [1/m^2]. The lower one is infinite at the tip of Gascuel's cone, near = 0.
struct CurvatureRange {
  double lower = 0.0, upper = 0.0;
};
[[nodiscard]] CurvatureRange curvature_range(const Kernel& kernel, double near, double far) noexcept;
/// Distance at which f = iso [m]. @pre 0 < iso < f(0)
[[nodiscard]] double iso_distance(const Kernel& kernel, double iso);
/// -df/dd at that distance [1/m]: the stiffness k of contact.
[[nodiscard]] double iso_slope(const Kernel& kernel, double iso);

}  // namespace supple::implicit
