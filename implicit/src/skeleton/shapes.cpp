#include "skeleton/shapes.h"

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
  // On its axis all of an arc is equally near: less than half of a circle lies to the side of its middle.
  if (cos > 0.0 && y.x() == 0.0 && y.y() == 0.0) return from_foot(y - shape.size.x() * Vec3::UnitX());
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

/// sum_i c_i t^i of a fixed degree.
struct Polynomial {
  std::array<double, kMostDegree + 1> c{};
  int degree = kMostDegree;

  [[nodiscard]] double at(double t, double& slope) const noexcept {
    double value = coefficient(degree);
    slope = 0.0;
    for (int i = degree - 1; i >= 0; --i) {
      slope = slope * t + value;
      value = value * t + coefficient(i);
    }
    return value;
  }
  [[nodiscard]] double coefficient(int i) const noexcept { return c[static_cast<std::size_t>(i)]; }
};

/// Where the polynomial rises through zero between low, where it is negative, and high: Newton's steps, or halves where those
/// leave the bracket or do not shrink by half.
double rising_root(const Polynomial& polynomial, double low, double high) noexcept {
  double t = 0.5 * (low + high), before = high - low, step = before;
  for (int i = 0; i < 120; ++i) {
    double slope = 0.0;
    const double f = polynomial.at(t, slope);
    if (f == 0.0) break;
    (f < 0.0 ? low : high) = t;
    double next = t - f / slope;
    if (!(next > low && next < high) || std::abs(next - t) > 0.5 * before) next = 0.5 * (low + high);
    before = step;
    step = std::abs(next - t);
    t = next;
    if (step < 1e-15) break;
  }
  return t;
}

/// Where a polynomial rises through zero in (0, 1), by the signs of its coefficients after Bernstein: without a change of sign there is
/// no root, with one there is one, with more the interval is halved.
class RisingRoots {
 public:
  explicit RisingRoots(const Polynomial& polynomial) noexcept : polynomial_(polynomial) {
    const int n = polynomial.degree;
    Coefficients b{};
    for (int i = 0; i <= n; ++i) {
      double share = 1.0;  // C(i, k) / C(n, k)
      for (int k = 0; k <= i; ++k) {
        b[static_cast<std::size_t>(i)] += share * polynomial.coefficient(k);
        share *= static_cast<double>(i - k) / static_cast<double>(n - k);
      }
    }
    search(b, 0.0, 1.0);
  }
  [[nodiscard]] std::span<const double> roots() const noexcept { return {roots_.data(), count_}; }

 private:
  using Coefficients = std::array<double, kMostDegree + 1>;

  void search(Coefficients& b, double low, double high) noexcept {
    const auto n = static_cast<std::size_t>(polynomial_.degree);
    int changes = 0;
    double last = 0.0;
    bool rises = false;
    for (std::size_t i = 0; i <= n; ++i) {
      if (b[i] == 0.0) continue;
      if (last * b[i] < 0.0) ++changes;
      rises = b[i] > 0.0;
      last = std::copysign(1.0, b[i]);
    }
    if (changes == 0 || count_ == roots_.size()) return;
    if (changes == 1) {
      if (rises) roots_[count_++] = rising_root(polynomial_, low, high);
      return;
    }
    constexpr double kLeast = 0x1p-40;  // roots that lie nearer together count as one
    if (high - low < kLeast) {
      roots_[count_++] = 0.5 * (low + high);
      return;
    }
    Coefficients left{};
    for (std::size_t k = 0; k <= n; ++k) {  // de Casteljau's triangle: its sides are the coefficients of both halves
      left[k] = b[0];
      for (std::size_t i = 0; i < n - k; ++i) b[i] = 0.5 * (b[i] + b[i + 1]);
    }
    Coefficients& right = b;
    const double middle = 0.5 * (low + high);
    if (right[0] == 0.0 && count_ < roots_.size()) roots_[count_++] = middle;
    search(left, low, middle);
    search(right, middle, high);
  }

  const Polynomial& polynomial_;
  std::array<double, kMostDegree + 1> roots_{};
  std::size_t count_ = 0;
};

/// Derivative by t of what vanishes where |y - g|^2 / w^2 is stationary: (g - y).g' w - |g - y|^2 w'.
double stationary_slope(const BezierPoint& p, const Vec3& gap, double w, double k) noexcept {
  return w * (p.first.squaredNorm() - gap.dot(p.second)) + k * gap.dot(p.first);
}

/// Where |y - g(t)|^2 / w(t)^2 is least on [0, 1], w = 1 + (taper - 1) t.
double nearest_parameter(const Curve& curve, double taper, const Vec3& y) noexcept {
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
  Polynomial stationary{.degree = k != 0.0 ? 2 * m : 2 * m - 1};
  for (int i = 0; i <= 2 * m; ++i) {
    const auto at = static_cast<std::size_t>(i);
    stationary.c[at] += along[i] - k * square[i];
    if (i < 2 * m) stationary.c[at + 1] += k * along[i];
  }
  double least = std::numeric_limits<double>::infinity();
  double best = 0.0;
  const auto consider = [&](double t) {
    const double w = 1.0 + k * t, q = (y - curve.at(t).point).squaredNorm() / (w * w);
    if (q < least) {
      least = q;
      best = t;
    }
  };
  consider(0.0);
  consider(1.0);
  const RisingRoots rising(stationary);
  for (const double t : rising.roots()) consider(t);
  // The polynomial's coefficients cancel; one Newton step on the geometry itself mends what that cost.
  if (!(best > 0.0 && best < 1.0)) return best;
  const BezierPoint p = curve.at(best);
  const Vec3 gap = y - p.point;
  const double w = 1.0 + k * best, slope = stationary_slope(p, gap, w, k);
  return slope > 0.0 ? std::clamp(best - (-gap.dot(p.first) * w - k * gap.squaredNorm()) / slope, 0.0, 1.0) : best;
}

/// q = min over t of |y - g(t)|^2 / w(t)^2. As the minimum over t its gradient is that at fixed t.
FootSample curve(std::span<const Vec3> control, double taper, const Vec3& y, Mat3* second) noexcept {
  const Curve curve(control);
  const double k = taper - 1.0, t = nearest_parameter(curve, taper, y);
  const BezierPoint p = curve.at(t);
  const Vec3 gap = y - p.point;
  const double w = 1.0 + k * t;
  if (second != nullptr) {
    *second = 2.0 / (w * w) * Mat3::Identity();
    const double slope = stationary_slope(p, gap, w, k);
    if (t > 0.0 && t < 1.0 && slope > 0.0) {
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

double nearest_on_curve(const ShapeView& shape, const Vec3& y) noexcept { return nearest_parameter(Curve(shape.control), shape.taper, y); }

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

double peak(const Primitive& primitive) noexcept {
  if (!primitive.convolved) return peak(primitive.kernel);
  const ShapeView shape = view_of(primitive);
  const double limit = convolution_limits(shape, primitive.kernel).peak;
  if (shape.control.empty()) return limit;
  Vec3 area = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < shape.control.size(); ++i) {
    area += 0.5 * (shape.control[i] - shape.control[0]).cross(shape.control[i + 1] - shape.control[0]);
  }
  return std::min(limit, shape.gain * area.norm());
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
