#include "supple/implicit/skeleton.h"

#include <algorithm>
#include <cmath>

#include "skeleton/shapes.h"
#include "supple/core/error.h"
#include "supple/implicit/convolution.h"

namespace supple::implicit {
namespace {

/// Largest n r with n on the unit sphere and r = r_axis n^2 + m (1 - n^2): how far a Directed support reaches along an
/// axis of radius r_axis when no other radius exceeds m.
double directed_reach(double r_axis, double m) noexcept {
  if (r_axis >= 2.0 / 3.0 * m) return std::max(r_axis, 0.0);
  return 2.0 / 3.0 * m * std::sqrt(m / (3.0 * (m - r_axis)));
}

/// The control points of a segment, curve or polygon with the support radius there; the support is the hull of these
/// balls at most.
template <class Use>
void for_control(const Primitive& p, const Use& use) {
  if (p.shape == ShapeKind::Segment) {
    use(Vec3(-p.size.x(), 0.0, 0.0), 1.0);
    use(Vec3(p.size.x(), 0.0, 0.0), p.taper);
    return;
  }
  if (p.shape != ShapeKind::Curve) {
    for (const Vec3& corner : p.control) use(corner, 1.0);
    return;
  }
  // The control points of pieces of the curve lie closer to it.
  constexpr int kPieces = 4;
  const double h = 1.0 / kPieces;
  const double degree = static_cast<double>(p.control.size()) - 1.0;
  const auto width = [&](double t) { return 1.0 + (p.taper - 1.0) * t; };
  for (int i = 0; i <= kPieces; ++i) {
    const BezierPoint at = bezier(p.control, i * h);
    use(at.point, width(i * h));
    if (i > 0) use(at.point - h / degree * at.first, width((i - 1.0 / degree) * h));
    if (i < kPieces) use(at.point + h / degree * at.first, width((i + 1.0 / degree) * h));
  }
}

bool has_control(ShapeKind shape) noexcept {
  return shape == ShapeKind::Segment || shape == ShapeKind::Triangle || shape == ShapeKind::Polygon ||
         shape == ShapeKind::Curve;
}

/// Box of the shape itself (q = 0), own frame [m].
Box shape_box(const Primitive& primitive) noexcept {
  const Vec3& s = primitive.size;
  Vec3 half = Vec3::Zero();
  switch (primitive.shape) {
    case ShapeKind::Point:
    case ShapeKind::Ellipsoid:
    case ShapeKind::Superquadric:
    case ShapeKind::Directed: break;
    case ShapeKind::Segment: half = {s.x(), 0.0, 0.0}; break;
    case ShapeKind::Rectangle: half = {s.x(), s.y(), 0.0}; break;
    case ShapeKind::Disc:
    case ShapeKind::Ring:
    case ShapeKind::Arc: half = {s.x(), s.x(), 0.0}; break;
    case ShapeKind::Box: half = s; break;
    case ShapeKind::Triangle:
    case ShapeKind::Polygon:
    case ShapeKind::Curve: {
      Box box;
      for (const Vec3& p : primitive.control) box.include(p.cwiseProduct(primitive.stretch));
      return box;
    }
  }
  half = half.cwiseProduct(primitive.stretch);
  Box box{-half, half};
  if (primitive.shape == ShapeKind::Arc) {
    const auto [cos, sin] = view_of(primitive).pair;
    box.lower.x() = cos * half.x();
    if (cos > 0.0) {
      box.lower.y() = -sin * half.y();
      box.upper.y() = sin * half.y();
    }
  }
  return box;
}

}  // namespace

Box support_box(const Primitive& primitive) noexcept { return support_of(primitive, Mat3::Identity()).whole; }

ShapeSample evaluate(const Primitive& primitive, const Vec3& y) noexcept {
  const FootSample sample = foot(view_of(primitive), y.cwiseQuotient(primitive.stretch));
  return {.q = sample.q, .gradient = 2.0 * sample.half_gradient.cwiseQuotient(primitive.stretch)};
}

Mat3 second_derivative(const Primitive& primitive, const Vec3& y) noexcept {
  Mat3 second;
  static_cast<void>(foot(view_of(primitive), y.cwiseQuotient(primitive.stretch), &second));
  const Vec3 inverse = primitive.stretch.cwiseInverse();
  return inverse.asDiagonal() * second * inverse.asDiagonal();
}

Potential potential(const Primitive& primitive, const Vec3& y) noexcept {
  if (primitive.convolved) {
    const Potential own = convolve(view_of(primitive), primitive.kernel, y.cwiseQuotient(primitive.stretch));
    return {own.value, own.gradient.cwiseQuotient(primitive.stretch)};
  }
  const ShapeSample shape = evaluate(primitive, y);
  const KernelSample kernel = evaluate(primitive.kernel, shape.q);
  return {kernel.value, kernel.slope * shape.gradient};
}

double distance_scale(const Primitive& primitive) noexcept {
  const double R = primitive.kernel.radius;
  double scale = 1.0;
  switch (primitive.shape) {
    case ShapeKind::Ellipsoid:
    case ShapeKind::Superquadric: scale = R / primitive.size.minCoeff(); break;  // u is a norm whose unit ball holds the ellipsoid
    case ShapeKind::Directed: {
      // |grad d|^2 = 1/r^2 + |tangential grad r|^2 / r^4; the latter is twice the deviation of r_k under the weights n_k^2.
      const double least = std::min(primitive.size.minCoeff(), primitive.control[0].minCoeff());
      const double most = std::max(primitive.size.maxCoeff(), primitive.control[0].maxCoeff());
      const double turn = (most - least) / least;
      scale = R / least * std::sqrt(1.0 + turn * turn);
      break;
    }
    case ShapeKind::Segment:
    case ShapeKind::Curve: scale = 1.0 / std::min(1.0, primitive.taper); break;
    default: break;
  }
  return scale / primitive.stretch.minCoeff();
}

Support support_of(const Primitive& p, const Mat3& rotation) noexcept {
  const double R = p.kernel.radius;
  if (p.shape == ShapeKind::Point && p.stretch == Vec3::Ones()) {  // a plain ball, by far the most common
    const Vec3 ball = Vec3::Constant(R);
    return {.core = {Vec3::Zero(), Vec3::Zero()}, .reach = R, .whole = {-ball, ball}, .rounding = ball};
  }
  const auto turned = [&](const Vec3& half) -> Vec3 { return rotation.cwiseAbs() * half; };
  const auto spun = [&](const Vec3& semi_axes) -> Vec3 { return (rotation * semi_axes.asDiagonal()).rowwise().norm(); };
  if (p.shape == ShapeKind::Ellipsoid) {
    // By Minkowski's inequality the ellipsoid lies within its least semi-axis b of the one with semi-axes size - b.
    const Vec3 axes = p.size.cwiseProduct(p.stretch);
    const double b = axes.minCoeff();
    const Vec3 core = spun(axes - Vec3::Constant(b)), whole = spun(axes);
    return {.core = {-core, core}, .reach = b, .whole = {-whole, whole}, .rounding = whole};
  }
  if (p.shape == ShapeKind::Superquadric || p.shape == ShapeKind::Directed) {
    Box own{-p.size, p.size};
    if (p.shape == ShapeKind::Directed) {
      const double most = std::max(p.size.maxCoeff(), p.control[0].maxCoeff());
      for (int k = 0; k < 3; ++k) {
        own.lower[k] = -directed_reach(p.control[0][k], most);
        own.upper[k] = directed_reach(p.size[k], most);
      }
    }
    own = {own.lower.cwiseProduct(p.stretch), own.upper.cwiseProduct(p.stretch)};
    const Vec3 middle = rotation * own.centre();
    const Vec3 half = turned(0.5 * own.extent());
    const Box whole{middle - half, middle + half};
    return {.core = whole, .reach = 0.0, .whole = whole, .rounding = half};
  }
  // The shape, swept by the ellipsoid with semi-axes R stretch, which in turn is a ball swept by a smaller ellipsoid.
  const Vec3 axes = R * p.stretch;
  const double b = axes.minCoeff();
  const Vec3 core_axes = spun(axes - Vec3::Constant(b)), whole_axes = spun(axes);
  Support support;
  if (has_control(p.shape)) {
    double widest = 0.0;
    for_control(p, [&](const Vec3& point, double w) {
      const Vec3 at = rotation * point.cwiseProduct(p.stretch);
      widest = std::max(widest, w);
      support.core = support.core.united({at, at});
      support.whole = support.whole.united({at - w * whole_axes, at + w * whole_axes});
    });
    support.core = {support.core.lower - widest * core_axes, support.core.upper + widest * core_axes};
    support.reach = widest * b;
    support.rounding = widest * whole_axes;
    return support;
  }
  Box shape;
  if (p.shape == ShapeKind::Disc || p.shape == ShapeKind::Ring) {
    // A disc reaches r sqrt(1 - n_k^2) = r |(t1_k, t2_k)| along world axis k.
    const Vec3 half = spun(p.size.x() * Vec3(p.stretch.x(), p.stretch.y(), 0.0));
    shape = {-half, half};
  } else {
    const Box own = shape_box(p);
    const Vec3 middle = rotation * own.centre();
    const Vec3 half = turned(0.5 * own.extent());
    shape = {middle - half, middle + half};
  }
  return {.core = {shape.lower - core_axes, shape.upper + core_axes},
          .reach = b,
          .whole = {shape.lower - whole_axes, shape.upper + whole_axes},
          .rounding = whole_axes};
}

bool has_convex_core(const Skeleton& skeleton) noexcept {
  if (!has_convex_levels(skeleton)) return false;
  const Primitive& p = skeleton.primitive.front();
  return p.shape != ShapeKind::Ellipsoid && p.stretch == Vec3::Ones();
}

bool has_convex_levels(const Skeleton& skeleton) noexcept {
  if (skeleton.primitive.size() != 1) return false;
  const Primitive& p = skeleton.primitive.front();
  if (p.taper != 1.0 || p.convolved) return false;
  switch (p.shape) {
    case ShapeKind::Point:
    case ShapeKind::Segment:
    case ShapeKind::Rectangle:
    case ShapeKind::Disc:
    case ShapeKind::Box:
    case ShapeKind::Triangle:
    case ShapeKind::Polygon:
    case ShapeKind::Ellipsoid:
      return true;
    case ShapeKind::Ring:
    case ShapeKind::Arc:
    case ShapeKind::Curve:
    case ShapeKind::Superquadric:
    case ShapeKind::Directed:
      break;
  }
  return false;
}

namespace {

/// Rotated in the same way in all directions.
bool is_wyvill_ball(const Primitive& p) noexcept {
  return p.shape == ShapeKind::Point && p.kernel.kind == KernelKind::Wyvill && p.stretch == Vec3::Ones() && !p.convolved;
}

/// Round-off of a support that reaches this far, and of its place.
double slack_of(double reach) noexcept { return 1e-12 * reach; }
Vec3 slack_at(const Vec3& position) noexcept { return 1e-15 * position.cwiseAbs(); }

}  // namespace

Box placed_support(const Primitive& primitive, const Vec3& position, const Mat3& rotation) noexcept {
  const Box own = support_of(primitive, rotation).whole;
  const double reach = std::max(-own.lower.minCoeff(), own.upper.maxCoeff());
  const Vec3 slack = Vec3::Constant(slack_of(reach)) + slack_at(position);
  return {position + own.lower - slack, position + own.upper + slack};
}

namespace {

/// Bodies of more primitives than this have a way of their own where all are balls: reading and writing is then what costs.
constexpr std::size_t kManyPrimitives = 64;

/// @return whether all are balls, and placed
bool place_balls(const Skeleton& skeleton, std::span<const Pose> parts, PlacedSkeleton& out) {
  const std::size_t n = skeleton.primitive.size();
  out.rotation.clear();
  out.radius.resize(n);
  out.part.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Primitive& primitive = skeleton.primitive[i];
    if (!is_wyvill_ball(primitive)) return false;
    const double R = primitive.kernel.radius;
    SUPPLE_EXPECTS(primitive.part < parts.size() && R > 0.0 && primitive.taper > 0.0);
    const Vec3 position = parts[primitive.part].to_world(primitive.offset.position);
    const Vec3 reach = Vec3::Constant(R + slack_of(R)) + slack_at(position);
    out.position[i] = position;
    out.support[i] = {position - reach, position + reach};
    out.radius[i] = R;
    out.part[i] = primitive.part;
  }
  return true;
}

}  // namespace

void place_skeleton(const Skeleton& skeleton, std::span<const Pose> parts, PlacedSkeleton& out) {
  SUPPLE_EXPECTS(parts.size() == skeleton.part_count);
  const std::size_t n = skeleton.primitive.size();
  out.position.resize(n);
  out.support.resize(n);
  if (n > kManyPrimitives && place_balls(skeleton, parts, out)) return;
  out.radius.clear();
  out.part.clear();
  out.rotation.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Primitive& primitive = skeleton.primitive[i];
    SUPPLE_EXPECTS(primitive.part < parts.size() && well_formed(primitive));
    const Pose& part = parts[primitive.part];
    out.position[i] = part.to_world(primitive.offset.position);
    out.rotation[i] = primitive.offset.orientation.coeffs() == Quat::Identity().coeffs()
                          ? part.orientation.toRotationMatrix()
                          : Mat3(part.orientation.toRotationMatrix() * primitive.offset.orientation.toRotationMatrix());
    out.support[i] = placed_support(primitive, out.position[i], out.rotation[i]);
  }
}

// By parts, so that a member that is added cannot be left out.

void add_content(const Kernel& kernel, ContentWords& words) {
  const auto& [kind, radius, thickness, slope, iso, shape, floor, tilt, gain, steepest] = kernel;
  words.add(kind);
  for (const double x : {radius, thickness, slope, iso, shape, floor, tilt, gain, steepest}) words.add(x);
}

void add_content(const Skeleton& skeleton, const PlacedSkeleton& placed, ContentWords& words) {
  const auto& [primitives, part_count, iso, blend] = skeleton;
  words.add(primitives.size());
  for (const Primitive& primitive : primitives) {
    const auto& [part, shape, size, offset, kernel, control, taper, exponent, stretch, convolved] = primitive;
    words.add(part);
    words.add(shape);
    words.add(size);
    words.add(offset);
    add_content(kernel, words);
    words.add(control);
    for (const double x : {taper, exponent[0], exponent[1]}) words.add(x);
    words.add(stretch);
    words.add(convolved);
  }
  words.add(part_count);
  words.add(iso);
  const auto& [rule, node, edges, sharpness, opening] = blend;
  words.add(rule);
  words.add(node);
  words.add(edges.size());
  for (const auto& [a, b, weight] : edges) {
    words.add(a);
    words.add(b);
    words.add(weight);
  }
  words.add(sharpness);
  words.add(opening);
  const auto& [position, rotation, support, radius, part] = placed;
  words.add(position);
  words.add(rotation);
  words.add(support.size());
  for (const auto& [lower, upper] : support) {
    words.add(lower);
    words.add(upper);
  }
  words.add(radius);
  words.add(part);
}

bool well_formed(const Primitive& p) noexcept {
  const auto positive = [](const Vec3& v) { return (v.array() > 0.0).all() && v.allFinite(); };
  if (!(p.kernel.radius > 0.0) || !positive(p.stretch) || !(p.taper > 0.0)) return false;
  if (p.convolved) {
    const bool can = p.shape == ShapeKind::Segment || p.shape == ShapeKind::Triangle || p.shape == ShapeKind::Polygon ||
                     p.shape == ShapeKind::Ring || p.shape == ShapeKind::Arc;
    if (!can || p.taper != 1.0 || !convolves(p.kernel.kind)) return false;
  }
  switch (p.shape) {
    case ShapeKind::Ellipsoid: return positive(p.size);
    case ShapeKind::Superquadric: {
      const auto [least, most] = std::minmax(p.exponent[0], p.exponent[1]);
      return positive(p.size) && least >= 0.2 && most <= 1.0;
    }
    case ShapeKind::Directed: return positive(p.size) && p.control.size() == 1 && positive(p.control[0]);
    case ShapeKind::Ring: return p.size.x() > 0.0;
    case ShapeKind::Arc: return p.size.x() > 0.0 && p.size.y() > 0.0 && p.size.y() <= 3.1415926535897936;
    case ShapeKind::Triangle: return p.control.size() == 3;
    case ShapeKind::Polygon: return p.control.size() >= 3;
    case ShapeKind::Curve: return p.control.size() >= 2 && p.control.size() <= 4;
    default: return true;
  }
}

}  // namespace supple::implicit
