#include "supple/implicit/convolution.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "supple/core/math.h"

namespace supple::implicit {
namespace {

/// k(q) = w^m with w = 1 - q/R^2, or gain ((1 + s q)^-2 - constant + linear q).
struct Form {
  int power = 0;  ///< m; 0 for Cauchy's
  double R2, gain = 1.0;
  double s = 0.0, constant = 0.0, linear = 0.0;

  explicit Form(const Kernel& k) : R2(k.radius * k.radius) {
    if (k.kind == KernelKind::Cauchy) {
      gain = k.gain;
      s = k.shape * k.shape / R2;
      constant = k.floor * (1.0 + k.tilt);
      linear = k.floor * k.tilt / R2;
    } else {
      power = k.kind == KernelKind::Murakami ? 2 : 3;
    }
  }
};

/// An integral of k and one of dk/dq.
struct Pair {
  double value = 0.0, slope = 0.0;
  Pair& operator+=(const Pair& o) {
    value += o.value;
    slope += o.slope;
    return *this;
  }
};

/// Integral of (c2 - t^2)^m from 0 to t.
double line_power(int m, double c2, double t) noexcept {
  const double t2 = t * t;
  if (m == 1) return t * (c2 - t2 / 3.0);
  if (m == 2) return t * (c2 * c2 + t2 * (-2.0 / 3.0 * c2 + t2 / 5.0));
  return t * (c2 * c2 * c2 + t2 * (-c2 * c2 + t2 * (0.6 * c2 - t2 / 7.0)));
}

/// Integrals of (b + s t^2)^-n from 0 to t for n = 1, 2, 3.
std::array<double, 3> line_inverse(double b, double s, double t) noexcept {
  const double root = std::sqrt(s * b);
  const double u = b + s * t * t;
  const double first = math::atan2(s * t, root) / root;
  const double second = (t / u + first) / (2.0 * b);
  return {first, second, (t / (u * u) + 3.0 * second) / (4.0 * b)};
}

/// Over t in [from, to] of a line at squared distance rho2.
Pair line(const Form& k, double rho2, double from, double to) noexcept {
  const double c2 = k.R2 - rho2;
  if (!(c2 > 0.0)) return {};
  const double c = std::sqrt(c2);
  from = std::max(from, -c);
  to = std::min(to, c);
  if (!(from < to)) return {};
  if (k.power > 0) {
    const double scale = k.power == 2 ? 1.0 / (k.R2 * k.R2) : 1.0 / (k.R2 * k.R2 * k.R2);
    const auto over = [&](int m) { return line_power(m, c2, to) - line_power(m, c2, from); };
    return {scale * over(k.power), -k.power * scale * over(k.power - 1)};
  }
  const double b = 1.0 + k.s * rho2;
  const auto high = line_inverse(b, k.s, to), low = line_inverse(b, k.s, from);
  const double length = to - from;
  const double squares = rho2 * length + (to * to * to - from * from * from) / 3.0;
  return {k.gain * (high[1] - low[1] - k.constant * length + k.linear * squares),
          k.gain * (-2.0 * k.s * (high[2] - low[2]) + k.linear * length)};
}

/// Integral of ((c2)^n - (c2 - u)^n) / u, u = h2 + t^2, from 0 to t, for n = 2, 3, 4.
double edge_power(int n, double c2, double h2, double t) noexcept {
  const double t2 = t * t;
  const double u1 = t * (h2 + t2 / 3.0);
  if (n == 2) return 2.0 * c2 * t - u1;
  const double u2 = t * (h2 * h2 + t2 * (2.0 / 3.0 * h2 + t2 / 5.0));
  if (n == 3) return c2 * (3.0 * c2 * t - 3.0 * u1) + u2;
  const double u3 = t * (h2 * h2 * h2 + t2 * (h2 * h2 + t2 * (0.6 * h2 + t2 / 7.0)));
  return c2 * (c2 * (4.0 * c2 * t - 6.0 * u1) + 4.0 * u2) - u3;
}

/// What an edge adds to the integral over a plane region around the foot of y: H(u) / u integrated over h dt, where
/// 2 pi H(u) is the integral over the disc of squared radius u; beyond the support H stays and only the angle counts.
Pair edge(const Form& k, double z2, double h, double from, double to) noexcept {
  const double c2 = k.R2 - z2;
  if (!(c2 > 0.0) || h == 0.0) return {};
  const double h2 = h * h;
  const double A = 1.0 + k.s * z2;
  // H and its analogue for dk/dq at the boundary of the support.
  Pair rim;
  double scale = 0.0;
  const int m = k.power;
  if (m > 0) {
    scale = (m == 2 ? 1.0 / (k.R2 * k.R2) : 1.0 / (k.R2 * k.R2 * k.R2)) / 2.0;
    const double top = m == 2 ? c2 * c2 * c2 : c2 * c2 * c2 * c2;
    rim = {scale * top / (m + 1), -scale * top / c2};
  } else {
    const double B = A + k.s * c2;
    rim = {k.gain * c2 * (0.5 / (A * B) - 0.5 * k.constant + 0.25 * k.linear * (2.0 * z2 + c2)),
           k.gain * c2 * (-0.5 * k.s / (A * A) * (1.0 / B + A / (B * B)) + 0.5 * k.linear)};
  }
  Pair sum;
  const auto outside = [&](double a, double b) {
    if (!(a < b)) return;
    const double angle = math::atan2(h * (b - a), h2 + a * b);
    sum += {angle * rim.value, angle * rim.slope};
  };
  const double w2 = c2 - h2;
  if (!(w2 > 0.0)) {
    outside(from, to);
    return sum;
  }
  const double w = std::sqrt(w2);
  outside(from, std::min(to, -w));
  outside(std::max(from, w), to);
  const double a = std::max(from, -w), b = std::min(to, w);
  if (!(a < b)) return sum;
  if (m > 0) {
    const auto over = [&](int n) { return edge_power(n, c2, h2, b) - edge_power(n, c2, h2, a); };
    sum += {h * scale / (m + 1) * over(m + 1), -h * scale * over(m)};
  } else {
    const double base = A + k.s * h2;
    const auto high = line_inverse(base, k.s, b), low = line_inverse(base, k.s, a);
    const double length = b - a;
    const double squares = h2 * length + (b * b * b - a * a * a) / 3.0;
    const double first = high[0] - low[0], second = high[1] - low[1];
    sum += {h * k.gain * (0.5 / A * first + (0.5 * k.linear * z2 - 0.5 * k.constant) * length + 0.25 * k.linear * squares),
            h * k.gain * (-0.5 * k.s / (A * A) * (first + A * second) + 0.5 * k.linear * length)};
  }
  return sum;
}

/// Over the angles [from, to] in [-pi, pi] from the direction of y: the integrals of k, and of dk/dq times 1, cos and sin.
struct ArcSums {
  double value = 0.0, slope = 0.0, slope_cos = 0.0, slope_sin = 0.0;
};

/// @param B, D  squared distance B - D cos(angle)
void add_window(const Form& k, double B, double D, double from, double to, ArcSums& sums) noexcept {
  const auto a = math::sin_cos(from), b = math::sin_cos(to);
  const double angle = to - from;
  const double cos1 = b.sin - a.sin;
  const double cos2 = 0.5 * (angle + b.sin * b.cos - a.sin * a.cos);
  const auto powers = [](double s) { return s - s * s * s / 3.0; };
  const double cos3 = powers(b.sin) - powers(a.sin);
  if (k.power > 0) {
    const double C = 1.0 - B / k.R2, E = D / k.R2;  // w = C + E cos
    const double sin0 = a.cos - b.cos;
    const double sin1 = C * sin0 + 0.5 * E * (a.cos * a.cos - b.cos * b.cos);
    if (k.power == 2) {
      sums.value += C * C * angle + 2.0 * C * E * cos1 + E * E * cos2;
      sums.slope -= 2.0 / k.R2 * (C * angle + E * cos1);
      sums.slope_cos -= 2.0 / k.R2 * (C * cos1 + E * cos2);
      sums.slope_sin -= 2.0 / k.R2 * sin1;
    } else {
      const double sin2 = C * C * sin0 + C * E * (a.cos * a.cos - b.cos * b.cos) +
                          E * E / 3.0 * (a.cos * a.cos * a.cos - b.cos * b.cos * b.cos);
      sums.value += C * C * C * angle + 3.0 * C * E * (C * cos1 + E * cos2) + E * E * E * cos3;
      sums.slope -= 3.0 / k.R2 * (C * C * angle + 2.0 * C * E * cos1 + E * E * cos2);
      sums.slope_cos -= 3.0 / k.R2 * (C * C * cos1 + 2.0 * C * E * cos2 + E * E * cos3);
      sums.slope_sin -= 3.0 / k.R2 * sin2;
    }
    return;
  }
  // 1 + s q = p - g cos; I_n is the integral of its n-th inverse power.
  const double p = 1.0 + k.s * B, g = k.s * D;
  const double delta = (p - g) * (p + g);
  const double stretch = std::sqrt((p + g) / (p - g));
  const auto half = [&](double x) {
    const auto t = math::sin_cos(0.5 * x);
    return 2.0 * math::atan2(stretch * t.sin, t.cos);
  };
  const double ua = p - g * a.cos, ub = p - g * b.cos;
  const double I1 = (half(to) - half(from)) / std::sqrt(delta);
  const double I2 = (g * (b.sin / ub - a.sin / ua) + p * I1) / delta;
  const double I3 = (g * (b.sin / (ub * ub) - a.sin / (ua * ua)) + 3.0 * p * I2 - I1) / (2.0 * delta);
  const double I3_cos = g > 1e-5 * p ? (p * I3 - I2) / g : (cos1 + 3.0 * g / p * cos2) / (p * p * p);
  const double I3_sin = (a.cos - b.cos) * (ua + ub) / (2.0 * ua * ua * ub * ub);
  sums.value += k.gain * (I2 - k.constant * angle + k.linear * (B * angle - D * cos1));
  sums.slope += k.gain * (-2.0 * k.s * I3 + k.linear * angle);
  sums.slope_cos += k.gain * (-2.0 * k.s * I3_cos + k.linear * cos1);
  sums.slope_sin += k.gain * (-2.0 * k.s * I3_sin + k.linear * (a.cos - b.cos));
}

}  // namespace

bool convolves(KernelKind kind) noexcept {
  return kind == KernelKind::Wyvill || kind == KernelKind::Murakami || kind == KernelKind::Cauchy;
}

Convolution convolve_segment(const Kernel& kernel, double half_length, const Vec3& y) noexcept {
  const Form k(kernel);
  const double rho2 = y.y() * y.y() + y.z() * y.z();
  const double from = -half_length - y.x(), to = half_length - y.x();
  const Pair sum = line(k, rho2, from, to);
  // By x only the ends move.
  const double along = evaluate(kernel, rho2 + from * from).value - evaluate(kernel, rho2 + to * to).value;
  return {sum.value, {along, 2.0 * sum.slope * y.y(), 2.0 * sum.slope * y.z()}};
}

Convolution convolve_polygon(const Kernel& kernel, std::span<const Vec3> corner, const Vec3& y) noexcept {
  const Form k(kernel);
  const std::size_t n = corner.size();
  Vec3 area = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < n; ++i) area += (corner[i] - corner[0]).cross(corner[i + 1] - corner[0]);
  const Vec3 normal = area.normalized();
  const double z = normal.dot(y - corner[0]);
  Pair sum;
  Convolution out;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 a = corner[i] - y, b = corner[i + 1 < n ? i + 1 : 0] - y;
    const Vec3 along = (b - a).normalized();
    const Vec3 outward = along.cross(normal);
    const double h = a.dot(outward), from = a.dot(along), to = b.dot(along);
    sum += edge(k, z * z, h, from, to);
    out.gradient -= line(k, z * z + h * h, from, to).value * outward;  // the divergence theorem in the plane
  }
  out.value = sum.value;
  out.gradient += 2.0 * sum.slope * z * normal;
  return out;
}

Convolution convolve_arc(const Kernel& kernel, double radius, double half_angle, const Vec3& y) noexcept {
  const Form k(kernel);
  const double rho = std::sqrt(y.x() * y.x() + y.y() * y.y());
  const double B = radius * radius + y.squaredNorm();
  const double D = 2.0 * radius * rho;
  const double towards = rho > 0.0 ? math::atan2(y.y(), y.x()) : 0.0;
  double window = std::numbers::pi;  // how far the support reaches on either side of the direction of y
  if (B - k.R2 >= D) return {};
  if (B - k.R2 > -D) {
    const double c = (B - k.R2) / D;
    window = math::atan2(std::sqrt((1.0 - c) * (1.0 + c)), c);
  }
  ArcSums sums;
  for (const double turn : {-2.0 * std::numbers::pi, 0.0, 2.0 * std::numbers::pi}) {
    const double from = std::max(-half_angle - towards + turn, -window);
    const double to = std::min(half_angle - towards + turn, window);
    if (from < to) add_window(k, B, D, from, to, sums);
  }
  const auto [sin, cos] = math::sin_cos(towards);
  const Vec3 radial(cos, sin, 0.0), tangential(-sin, cos, 0.0);
  return {radius * sums.value,
          2.0 * radius * (sums.slope * y - radius * (sums.slope_cos * radial + sums.slope_sin * tangential))};
}

double convolve_line(const Kernel& kernel, double distance) noexcept {
  return line(Form(kernel), distance * distance, -2.0 * kernel.radius, 2.0 * kernel.radius).value;
}

double convolve_plane(const Kernel& kernel, double distance) noexcept {
  const Form k(kernel);
  const double z2 = distance * distance;
  const double c2 = k.R2 - z2;
  if (!(c2 > 0.0)) return 0.0;
  if (k.power > 0) return std::numbers::pi * k.R2 / (k.power + 1) * math::pow(c2 / k.R2, k.power + 1);
  const double A = 1.0 + k.s * z2;
  return std::numbers::pi * k.gain * c2 *
         (1.0 / (A * (A + k.s * c2)) - k.constant + 0.5 * k.linear * (2.0 * z2 + c2));
}

}  // namespace supple::implicit
