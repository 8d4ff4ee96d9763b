#include "shapes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "supple/core/math.h"
#include "supple/implicit/convolution.h"

namespace supple::implicit {
namespace {

/// x less its nearest point of [-h, h].
double outside(double x, double h) noexcept { return std::copysign(std::max(std::abs(x) - h, 0.0), x); }

FootSample from_foot(const Vec3& v) noexcept { return {v.squaredNorm(), v}; }

FootSample slab(const Vec3& half, const Vec3& y, Mat3* second) noexcept {
  Vec3 v;
  for (int k = 0; k < 3; ++k) {
    v[k] = outside(y[k], half[k]);
    if (second != nullptr && half[k] > 0.0 && std::abs(y[k]) <= half[k]) (*second)(k, k) = 0.0;
  }
  return from_foot(v);
}

/// Nearest point of the circle of radius r; where `only_outside`, of the disc it bounds.
FootSample circle(double r, bool only_outside, const Vec3& y, Mat3* second) noexcept {
  const double rho = std::sqrt(y.x() * y.x() + y.y() * y.y());
  const double gap = only_outside ? std::max(rho - r, 0.0) : rho - r;
  const double share = rho > 0.0 ? gap / rho : 0.0;
  if (second != nullptr) {
    second->topLeftCorner<2, 2>().setZero();
    if (rho > 0.0 && (gap != 0.0 || !only_outside)) {
      const Eigen::Vector2d n = y.head<2>() / rho;
      const Eigen::Matrix2d along = n * n.transpose();
      second->topLeftCorner<2, 2>() = 2.0 * (along + share * (Eigen::Matrix2d::Identity() - along));
    }
  }
  return {gap * gap + y.z() * y.z(), {share * y.x(), share * y.y(), y.z()}};
}

FootSample arc(const ShapeView& shape, const Vec3& y, Mat3* second) noexcept {
  const auto [cos, sin] = shape.pair;
  const double side = std::copysign(1.0, y.y());
  // sin(angle - half angle) <= 0: the nearest point of the circle lies on the arc.
  if (cos * std::abs(y.y()) - sin * y.x() <= 0.0) return circle(shape.size.x(), false, y, second);
  return from_foot(y - shape.size.x() * Vec3(cos, side * sin, 0.0));
}

/// Plane convex polygon, its corners in order.
FootSample polygon(std::span<const Vec3> corner, const Vec3& y, Mat3* second) noexcept {
  const std::size_t n = corner.size();
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < n; ++i) normal += (corner[i] - corner[0]).cross(corner[i + 1] - corner[0]);
  bool within = true;
  double least = std::numeric_limits<double>::infinity();
  Vec3 nearest = Vec3::Zero();
  Vec3 along = Vec3::Zero();  // the edge whose inside is nearest; zero at a corner
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& a = corner[i];
    const Vec3 edge = corner[i + 1 < n ? i + 1 : 0] - a;
    const Vec3 w = y - a;
    within = within && normal.cross(edge).dot(w) >= 0.0;
    const double t = w.dot(edge) / edge.squaredNorm();
    const double s = std::clamp(t, 0.0, 1.0);
    const Vec3 v = w - s * edge;
    const double q = v.squaredNorm();
    if (q < least) {
      least = q;
      nearest = v;
      along = s == t ? edge : Vec3::Zero();
    }
  }
  if (within) {
    const Vec3 unit = normal.normalized();
    if (second != nullptr) *second = 2.0 * unit * unit.transpose();
    return from_foot(unit.dot(y - corner[0]) * unit);
  }
  if (second != nullptr && !along.isZero()) *second -= 2.0 * along * along.transpose() / along.squaredNorm();
  return from_foot(nearest);
}

/// Monomial coefficients of a curve of two to four control points.
struct Curve {
  std::array<Vec3, 4> c{Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  int degree = 1;

  explicit Curve(std::span<const Vec3> p) noexcept : degree(static_cast<int>(p.size()) - 1) {
    c[0] = p[0];
    const double n = degree;
    c[1] = n * (p[1] - p[0]);
    if (degree == 2) c[2] = (p[2] - p[1]) - (p[1] - p[0]);
    if (degree == 3) {
      c[2] = 3.0 * ((p[2] - p[1]) - (p[1] - p[0]));
      c[3] = (p[3] - p[0]) - 3.0 * (p[2] - p[1]);
    }
  }
  [[nodiscard]] BezierPoint at(double t) const noexcept {
    return {c[0] + t * (c[1] + t * (c[2] + t * c[3])), c[1] + t * (2.0 * c[2] + 3.0 * t * c[3]), 2.0 * c[2] + 6.0 * t * c[3]};
  }
};

constexpr int kMostDegree = 6;

/// Real roots of sum_i c_i t^i in (0, 1), in rising order: between two roots of the derivative the polynomial is monotone,
/// so that a change of sign brackets exactly one.
int roots_in_unit(const double* c, int degree, double* roots) noexcept {
  while (degree > 0 && c[degree] == 0.0) --degree;
  if (degree == 0) return 0;
  if (degree == 1) {
    const double t = -c[0] / c[1];
    if (!(t > 0.0 && t < 1.0)) return 0;
    roots[0] = t;
    return 1;
  }
  double derivative[kMostDegree] = {};
  for (int i = 0; i < degree; ++i) derivative[i] = (i + 1) * c[i + 1];
  double knot[kMostDegree + 2] = {};
  const int inner = roots_in_unit(derivative, degree - 1, knot + 1);
  knot[0] = 0.0;
  knot[inner + 1] = 1.0;
  const auto at = [&](double t, double& slope) {
    double value = c[degree];
    slope = 0.0;
    for (int i = degree - 1; i >= 0; --i) {
      slope = slope * t + value;
      value = value * t + c[i];
    }
    return value;
  };
  int count = 0;
  double slope = 0.0;
  double f_low = at(0.0, slope);
  for (int k = 0; k <= inner; ++k) {
    double low = knot[k], high = knot[k + 1];
    const double f_high = at(high, slope);
    const bool rises = f_high > f_low;
    if ((f_low < 0.0 && f_high > 0.0) || (f_low > 0.0 && f_high < 0.0)) {
      double t = low + (high - low) * (f_low / (f_low - f_high));
      for (int i = 0; i < 60; ++i) {
        if (!(t > low && t < high)) t = 0.5 * (low + high);
        const double f = at(t, slope);
        if (f == 0.0) break;
        ((f < 0.0) == rises ? low : high) = t;
        double next = t - f / slope;
        // Newton from the bracket's bad side may crawl: every third step halves.
        if (!(next > low && next < high) || i % 3 == 2) next = 0.5 * (low + high);
        const double step = std::abs(next - t);
        t = next;
        if (step < 1e-15) break;
      }
      roots[count++] = t;
    } else if (f_high == 0.0 && high < 1.0) {
      roots[count++] = high;
    }
    f_low = f_high;
  }
  return count;
}

/// q = min over t of |y - g(t)|^2 / w(t)^2, w = 1 + (taper - 1) t. As the minimum over t its gradient is that at fixed t.
FootSample curve(std::span<const Vec3> control, double taper, const Vec3& y, Mat3* second) noexcept {
  const Curve curve(control);
  const double k = taper - 1.0;
  const int m = curve.degree;
  // Stationary: (g - y).g' w - |g - y|^2 w' = 0.
  std::array<Vec3, 4> v = curve.c;
  v[0] -= y;
  double along[kMostDegree + 1] = {}, square[kMostDegree + 1] = {};
  for (int i = 0; i <= m; ++i) {
    for (int j = 0; j <= m; ++j) {
      const double product = v[static_cast<std::size_t>(i)].dot(v[static_cast<std::size_t>(j)]);
      square[i + j] += product;
      if (j > 0) along[i + j - 1] += j * product;
    }
  }
  double c[kMostDegree + 2] = {};
  for (int i = 0; i <= 2 * m; ++i) {
    c[i] += along[i] - k * square[i];
    c[i + 1] += k * along[i];
  }
  double candidate[kMostDegree + 2] = {0.0, 1.0};
  const int count = 2 + roots_in_unit(c, std::min(2 * m, kMostDegree), candidate + 2);
  double least = std::numeric_limits<double>::infinity();
  double best = 0.0;
  for (int i = 0; i < count; ++i) {
    const double w = 1.0 + k * candidate[i];
    const double q = (y - curve.at(candidate[i]).point).squaredNorm() / (w * w);
    if (q < least) {
      least = q;
      best = candidate[i];
    }
  }
  // The polynomial's coefficients cancel; one Newton step on the geometry itself mends what that cost.
  const bool interior = best > 0.0 && best < 1.0;
  BezierPoint p = curve.at(best);
  Vec3 gap = y - p.point;
  double w = 1.0 + k * best;
  const auto stationary_slope = [&] { return w * (p.first.squaredNorm() - gap.dot(p.second)) + k * gap.dot(p.first); };
  if (interior) {
    const double slope = stationary_slope();
    if (slope > 0.0) {
      const double t = std::clamp(best - (-gap.dot(p.first) * w - k * gap.squaredNorm()) / slope, 0.0, 1.0);
      p = curve.at(t);
      gap = y - p.point;
      w = 1.0 + k * t;
    }
  }
  if (second != nullptr) {
    *second = 2.0 / (w * w) * Mat3::Identity();
    const double slope = stationary_slope();
    if (interior && slope > 0.0) {
      // H = phi_yy - phi_yt phi_ty / phi_tt for phi = |y - g|^2 / w^2, phi_t = 2 / w^3 (what vanishes).
      const Vec3 mixed = -2.0 / (w * w) * (p.first + 2.0 * k / w * gap);
      *second -= mixed * mixed.transpose() / (2.0 * slope / (w * w * w));
    }
  }
  return {gap.squaredNorm() / (w * w), gap / (w * w)};
}

FootSample tapered_segment(double h, double taper, const Vec3& y, Mat3* second) noexcept {
  const std::array<Vec3, 2> ends{Vec3(-h, 0.0, 0.0), Vec3(h, 0.0, 0.0)};
  const double k = taper - 1.0;
  const Vec3 w = y - ends[0];
  const double along = 2.0 * h * w.x();
  // The stationary condition of the curve is linear in t here; without a root ahead the nearer end is it.
  const double top = along + k * w.squaredNorm();
  const double bottom = 4.0 * h * h + k * along;
  const double t = bottom > 0.0 ? std::clamp(top / bottom, 0.0, 1.0) : top < 0.0 ? 0.0 : 1.0;
  const Vec3 gap = w - Vec3(2.0 * h * t, 0.0, 0.0);
  const double scale = 1.0 / ((1.0 + k * t) * (1.0 + k * t));
  if (second != nullptr) {
    *second = 2.0 * scale * Mat3::Identity();
    if (t > 0.0 && t < 1.0) {
      const double width = 1.0 + k * t;
      const Vec3 mixed = -2.0 * scale * (Vec3(2.0 * h, 0.0, 0.0) + 2.0 * k / width * gap);
      *second -= mixed * mixed.transpose() / (2.0 * bottom * scale / width);
    }
  }
  return {gap.squaredNorm() * scale, gap * scale};
}

double power(double x, double exponent) noexcept { return x > 0.0 ? math::pow(x, exponent) : 0.0; }

/// u = ((|x/a|^m + |y/b|^m)^(n/m) + |z/c|^n)^(1/n), m = 2 / e2, n = 2 / e1; q = R^2 u^2.
FootSample superquadric(const ShapeView& shape, const Vec3& y, Mat3* second) noexcept {
  const double n = 2.0 / shape.pair[0];
  const double m = 2.0 / shape.pair[1];
  const double R2 = shape.radius * shape.radius;
  const Vec3 scaled = y.cwiseQuotient(shape.size);
  const double s = scaled.cwiseAbs().maxCoeff();
  if (!(s > 0.0)) {
    if (second != nullptr) *second = Vec3(2.0 * R2 * shape.size.cwiseAbs2().cwiseInverse()).asDiagonal();
    return {};
  }
  // u is homogeneous of degree one: powers are taken of numbers up to 1.
  const Vec3 p = scaled.cwiseAbs() / s;
  const double xm = power(p.x(), m), ym = power(p.y(), m), zn = power(p.z(), n);
  const double A = xm + ym;
  const double B = power(A, n / m);
  const double W = B + zn;
  const double root = power(W, 1.0 / n);
  const auto over = [](double a, double b) { return b > 0.0 ? a / b : 0.0; };
  // dW / n: B/A x^(m-1), B/A y^(m-1), z^(n-1).
  const double ratio = over(B, A);
  const Vec3 slope(ratio * over(xm, p.x()), ratio * over(ym, p.y()), over(zn, p.z()));
  const Vec3 sign(std::copysign(1.0, y.x()), std::copysign(1.0, y.y()), std::copysign(1.0, y.z()));
  const Vec3 factor = sign.cwiseQuotient(shape.size);
  const Vec3 du = root / W * slope;
  const double u = s * root;
  if (second != nullptr) {
    const double share = over(ratio, A);
    const auto twice_over = [&over](double a, double b, double e) { return b > 0.0 ? over(over(a, b), b) : e == 2.0 ? 1.0 : 0.0; };
    const Vec3 e(over(xm, p.x()), over(ym, p.y()), 0.0);
    Mat3 d2w = (n - m) * share * e * e.transpose();  // of W / n
    d2w(0, 0) += (m - 1.0) * ratio * twice_over(xm, p.x(), m);
    d2w(1, 1) += (m - 1.0) * ratio * twice_over(ym, p.y(), m);
    d2w(2, 2) = (n - 1.0) * twice_over(zn, p.z(), n);
    const Mat3 d2u = root / W * (d2w - (n - 1.0) / W * slope * slope.transpose());
    *second = factor.asDiagonal() * (2.0 * R2 * (du * du.transpose() + root * d2u)) * factor.asDiagonal();
  }
  return {R2 * u * u, R2 * u * factor.cwiseProduct(du)};
}

/// u = |y| / rho(y / |y|) with rho = sum_k r_k n_k^2, r_k the radius on the side where n_k points; q = R^2 u^2.
FootSample directed(const ShapeView& shape, const Vec3& y, Mat3* second) noexcept {
  const double R2 = shape.radius * shape.radius;
  const double d = y.norm();
  if (!(d > 0.0)) {
    const double r = (shape.size + shape.control[0]).sum() / 6.0;
    if (second != nullptr) *second = 2.0 * R2 / (r * r) * Mat3::Identity();
    return {};
  }
  Vec3 r;
  for (int k = 0; k < 3; ++k) r[k] = y[k] >= 0.0 ? shape.size[k] : shape.control[0][k];
  const Vec3 n = y / d;
  const double rho = r.dot(n.cwiseAbs2());
  const Vec3 drho = 2.0 * r.cwiseProduct(n);  // gradient of the quadratic form at n
  const double u = d / rho;
  const Vec3 du = (3.0 * n - drho / rho) / rho;
  if (second != nullptr) {
    const Mat3 cross = n * drho.transpose();
    Mat3 d2u = 3.0 * (Mat3::Identity() + n * n.transpose()) - 3.0 * (cross + cross.transpose()) / rho +
               2.0 * drho * drho.transpose() / (rho * rho);
    d2u -= Mat3((2.0 * r / rho).asDiagonal());
    *second = 2.0 * R2 * (du * du.transpose() + d2u / (rho * rho));
  }
  return {R2 * u * u, R2 * u * du};
}

}  // namespace

BezierPoint bezier(std::span<const Vec3> control, double t) noexcept { return Curve(control).at(t); }

ShapeView view_of(const Primitive& primitive) noexcept {
  ShapeView view{.kind = primitive.shape,
                 .size = primitive.size,
                 .radius = primitive.kernel.radius,
                 .taper = primitive.taper,
                 .pair = primitive.exponent,
                 .control = primitive.control};
  if (primitive.shape == ShapeKind::Arc) {
    const auto [sin, cos] = math::sin_cos(primitive.size.y());
    view.pair = {cos, sin};
  }
  if (primitive.convolved) {
    const double distance = iso_distance(primitive.kernel, 0.5);
    const bool flat = primitive.shape == ShapeKind::Triangle || primitive.shape == ShapeKind::Polygon;
    view.gain = 0.5 / (flat ? convolve_plane(primitive.kernel, distance) : convolve_line(primitive.kernel, distance));
  }
  return view;
}

Potential convolve(const ShapeView& shape, const Kernel& kernel, const Vec3& y) noexcept {
  // Exactly zero out of reach, whatever rounding makes of sums over edges.
  if (foot(shape, y).q >= kernel.radius * kernel.radius) return {};
  Convolution sum;
  if (shape.kind == ShapeKind::Segment) {
    sum = convolve_segment(kernel, shape.size.x(), y);
  } else if (shape.kind == ShapeKind::Triangle || shape.kind == ShapeKind::Polygon) {
    sum = convolve_polygon(kernel, shape.control, y);
  } else {
    sum = convolve_arc(kernel, shape.size.x(), shape.kind == ShapeKind::Ring ? std::numbers::pi : shape.size.y(), y);
  }
  return {std::max(shape.gain * sum.value, 0.0), shape.gain * sum.gradient};
}

ConvolutionLimits convolution_limits(const ShapeView& shape, const Kernel& kernel) noexcept {
  const double R = kernel.radius;
  double measure = 0.0;  // of the shape within one support, at most
  switch (shape.kind) {
    case ShapeKind::Segment: measure = 2.0 * std::min(shape.size.x(), R); break;
    case ShapeKind::Ring: measure = 2.0 * std::numbers::pi * shape.size.x(); break;
    case ShapeKind::Arc: measure = 2.0 * shape.size.y() * shape.size.x(); break;
    default: measure = std::numbers::pi * R * R; break;
  }
  return {shape.gain * measure, shape.gain * measure * lipschitz(kernel)};
}

FootSample foot(const ShapeView& shape, const Vec3& y, Mat3* second) noexcept {
  if (second != nullptr) *second = 2.0 * Mat3::Identity();
  const Vec3& size = shape.size;
  switch (shape.kind) {
    case ShapeKind::Point: return from_foot(y);
    case ShapeKind::Segment:
      if (shape.taper != 1.0) return tapered_segment(size.x(), shape.taper, y, second);
      return slab({size.x(), 0.0, 0.0}, y, second);
    case ShapeKind::Rectangle: return slab({size.x(), size.y(), 0.0}, y, second);
    case ShapeKind::Box: return slab(size, y, second);
    case ShapeKind::Disc: return circle(size.x(), true, y, second);
    case ShapeKind::Ring: return circle(size.x(), false, y, second);
    case ShapeKind::Arc: return arc(shape, y, second);
    case ShapeKind::Triangle:
    case ShapeKind::Polygon: return polygon(shape.control, y, second);
    case ShapeKind::Curve: return curve(shape.control, shape.taper, y, second);
    case ShapeKind::Superquadric: return superquadric(shape, y, second);
    case ShapeKind::Directed: return directed(shape, y, second);
    case ShapeKind::Ellipsoid: break;
  }
  const double R2 = shape.radius * shape.radius;
  const Vec3 u = y.cwiseQuotient(size);
  if (second != nullptr) *second = Vec3(2.0 * R2 * size.cwiseAbs2().cwiseInverse()).asDiagonal();
  return {R2 * u.squaredNorm(), R2 * u.cwiseQuotient(size)};
}

}  // namespace supple::implicit
