// The cohesion force of Lombardo & Puech 1995 and its energy, with s = d / r0 and v = s - 1.
#include <array>
#include <cmath>
#include <numbers>

#include "supple/core/error.h"
#include "supple/core/math.h"
#include "supple/core/pair_laws.h"

namespace supple::core {
namespace {

/// Gauss-Legendre rule of 16 points on [-1, 1]: the positive nodes and their weights.
struct Node {
  double x;
  double weight;
};
constexpr std::array<Node, 8> kGauss{{{0.09501250983763744, 0.1894506104550685},
                                      {0.2816035507792589, 0.1826034150449236},
                                      {0.4580167776572274, 0.1691565193950025},
                                      {0.6178762444026438, 0.1495959888165767},
                                      {0.7554044083550030, 0.1246289712555339},
                                      {0.8656312023878318, 0.09515851168249278},
                                      {0.9445750230732326, 0.06225352393864789},
                                      {0.9894009349916499, 0.02715245941175409}}};

/// t^3 / (1 + t) exp(-a t^2), the negative of f / F0 at v = t.
double attraction(double a, double t) { return t * t * t / (1.0 + t) * math::exp(-a * t * t); }

double integrate_panel(double a, double begin, double end) {
  const double centre = 0.5 * (begin + end);
  const double half = 0.5 * (end - begin);
  double sum = 0.0;
  for (const Node& node : kGauss) {
    sum += node.weight * (attraction(a, centre - half * node.x) + attraction(a, centre + half * node.x));
  }
  return half * sum;
}

/// Dawson's integral exp(-x^2) int_0^x exp(t^2) dt by sampling (Rybicki 1989): with step h the error is
/// exp(-(pi / 2h)^2), below 1e-26 for h = 0.2.
double dawson(double x) {
  constexpr double kStep = 0.2;
  const int centre = static_cast<int>(std::lround(x / kStep));
  double sum = 0.0;
  for (int n = centre - 33; n <= centre + 33; ++n) {
    if (n % 2 == 0) continue;
    const double distance = x - n * kStep;
    sum += math::exp(-distance * distance) / n;
  }
  return sum * std::numbers::inv_sqrtpi;
}

/// exp(-x) Ei(x) for x > 0: the power series, or the asymptotic one cut at its smallest term (below 1e-17 for x > 40).
double scaled_exponential_integral(double x) {
  if (x > 40.0) {
    double term = 1.0 / x;
    double sum = term;
    for (int k = 1; k < 40 && term > 1e-18 * sum; ++k) {
      term *= k / x;
      sum += term;
    }
    return sum;
  }
  double power = 1.0;
  double sum = std::numbers::egamma + math::log(x);
  for (int k = 1; k < 200; ++k) {
    power *= x / k;
    const double term = power / k;
    sum += term;
    if (k > x && term < 1e-17 * std::abs(sum)) break;
  }
  return sum * math::exp(-x);
}

/// ln(v^3 / (1 + v)) - a v^2: the logarithm of the attraction, falling for v > v_m.
double log_attraction(double a, double v) { return 3.0 * math::log(v) - math::log(1.0 + v) - a * v * v; }

/// The positive root of 2 a v^3 + 2 a v^2 - 2 v - 3. sqrt(3 / 2a) lies above it and the cubic is convex there, so
/// Newton's iteration falls onto the root.
double strongest_attraction(double a) {
  double v = std::sqrt(1.5 / a);
  for (int k = 0; k < 60; ++k) {
    const double value = ((2.0 * a * v + 2.0 * a) * v - 2.0) * v - 3.0;
    const double next = v - value / ((6.0 * a * v + 4.0 * a) * v - 2.0);
    if (!(next < v)) break;
    v = next;
  }
  return v;
}

/// a of the law that attracts most at v.
double shape_of(double v) { return (2.0 * v + 3.0) / (2.0 * v * v * (1.0 + v)); }

}  // namespace

Cohesion Cohesion::from_gain(double r0, double gain, double alpha) {
  SUPPLE_EXPECTS(r0 > 0.0 && gain > 0.0 && alpha > 0.0);
  return {.r0 = r0, .f0 = gain * r0 * r0, .a = alpha * r0 * r0};
}

Cohesion Cohesion::from_maximum(double r0, double r_m, double f_max) {
  SUPPLE_EXPECTS(r0 > 0.0 && r_m > r0 && f_max > 0.0);
  const double v = r_m / r0 - 1.0;
  const double a = shape_of(v);
  return {.r0 = r0, .f0 = f_max * (1.0 + v) / (v * v * v) * math::exp(a * v * v), .a = a};
}

Cohesion Cohesion::from_ratio(double r0, double ratio, double f0) {
  SUPPLE_EXPECTS(r0 > 0.0 && ratio > 1.0 && f0 > 0.0);
  return {.r0 = r0, .f0 = f0, .a = shape_of(ratio - 1.0)};
}

double Cohesion::force(double distance) const { return -f0 * attraction(a, distance / r0 - 1.0); }

double Cohesion::slope(double distance) const {
  const double s = distance / r0;
  const double v = s - 1.0;
  const double bracket = 3.0 + 2.0 * v - 2.0 * a * v * v * s;
  return -f0 / r0 * math::exp(-a * v * v) * v * v * bracket / (s * s);
}

double Cohesion::energy(double distance) const {
  // Panels are at most one width of the Gaussian and half the distance to the pole at v = -1 wide: the rule then
  // converges like 5.8^-32.
  constexpr double kNearest = 1e-12;  // of r0: nearer by, panels would be lost in the rounding of v
  const double v = std::max(distance / r0, kNearest) - 1.0;
  const double width = std::min(1.0, 1.0 / std::sqrt(a));
  double sum = 0.0;
  if (v >= 0.0) {
    const double end = std::min(v, std::sqrt(45.0 / a));  // exp(-45) is below the last place of the sum
    const int panels = static_cast<int>(std::ceil(end / width));
    for (int k = 0; k < panels; ++k) sum += integrate_panel(a, end * k / panels, end * (k + 1) / panels);
  } else {
    const double last = std::max(v, -std::sqrt(150.0 / a));  // beyond it exp(-150) outweighs the pole
    double begin = 0.0;
    while (begin > last) {
      const double end = std::max(last, begin - std::min(width, 0.5 * (1.0 + begin)));
      sum += integrate_panel(a, begin, end);
      begin = end;
    }
  }
  return f0 * r0 * sum;
}

double Cohesion::binding_energy() const {
  const double root = std::sqrt(a);
  const double root_pi = std::sqrt(std::numbers::pi);
  return f0 * r0 *
         (root_pi / (4.0 * a * root) - 0.5 / a + 0.5 * root_pi / root - root_pi * dawson(root) +
          0.5 * scaled_exponential_integral(a));
}

double Cohesion::maximum_distance() const { return r0 * (1.0 + strongest_attraction(a)); }

double Cohesion::influence_radius(double epsilon) const {
  SUPPLE_EXPECTS(epsilon > 0.0 && epsilon < 1.0);
  const double v_m = strongest_attraction(a);
  const double target = log_attraction(a, v_m) + math::log(epsilon);
  double lower = v_m;
  double upper = v_m + std::sqrt((8.0 - math::log(epsilon)) / a);
  while (log_attraction(a, upper) > target) upper += upper - v_m;
  double v = upper;
  for (int k = 0; k < 100; ++k) {
    const double value = log_attraction(a, v) - target;
    (value > 0.0 ? lower : upper) = v;
    const double newton = v - value / (3.0 / v - 1.0 / (1.0 + v) - 2.0 * a * v);
    const double next = newton > lower && newton < upper ? newton : 0.5 * (lower + upper);
    if (std::abs(next - v) <= 1e-15 * v) break;
    v = next;
  }
  return r0 * (1.0 + v);
}

}  // namespace supple::core
