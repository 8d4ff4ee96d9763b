/// @file contact_shapes.h
/// Bodies for contact queries in random poses, and the closed forms of spheres of linear pressure: the isobar at
/// pressure p is a circle.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <limits>
#include <numbers>
#include <random>
#include <string_view>

#include "supple/collision/contact_surface.h"
#include "supple/core/math.h"
#include "supple/implicit/field.h"

namespace supple::benchmarks {

inline constexpr double kPi = std::numbers::pi;

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}
  double uniform(double lower, double upper) {
    return lower + (upper - lower) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  double logarithmic(double lower, double upper) { return std::exp(uniform(std::log(lower), std::log(upper))); }
  Vec3 direction() {
    const double z = uniform(-1.0, 1.0), r = std::sqrt(1.0 - z * z);
    const auto [s, c] = math::sin_cos(uniform(0.0, 2.0 * kPi));
    return {r * c, r * s, z};
  }
  Quat rotation() {
    const Vec3 axis = direction();
    return Quat(Eigen::AngleAxisd(uniform(0.0, kPi), axis));
  }

 private:
  std::mt19937_64 engine_;
};

/// @param name  of a rule, as a command line has it; any other: the cheapest that fits
constexpr std::array<std::string_view, 4> kRuleNames{"auto", "polar", "march", "panels"};
inline collision::ContactRule rule_named(std::string_view name) {
  using collision::ContactRule;
  if (name == "panels") return ContactRule::Panels;
  return name == "polar" ? ContactRule::Polar : name == "march" ? ContactRule::March : ContactRule::None;
}

/// A body at rest. @param pose  of its parts, ten at most
inline collision::ContactBody at_rest(const implicit::FieldView& field, double modulus, std::span<const Pose> pose) {
  static const std::vector<Vec3> kStill(10, Vec3::Zero());
  collision::ContactBody body;
  body.field = field;
  body.material.modulus = modulus;
  body.pose = pose;
  body.velocity = std::span(kStill).first(pose.size());
  body.angular_velocity = body.velocity;
  return body;
}
/// One part of a body that moves as a whole; only pose and field differ.
inline collision::ContactBody single_part(const implicit::FieldView& field, double modulus, const Pose& pose) {
  return at_rest(field, modulus, {&pose, 1});
}

/// The same two bodies in the other order and with poses that are not theirs: their contact is the same, but what a query chooses by
/// how bodies lie comes out otherwise, so that its nodes are other points.
inline std::array<collision::ContactBody, 2> seen_otherwise(const std::array<collision::ContactBody, 2>& bodies) {
  static const Pose kElsewhere{Vec3(0.7, -1.1, 0.4), Quat(0.6, -0.2, 0.5, 0.3).normalized()};
  std::array<collision::ContactBody, 2> others{bodies[1], bodies[0]};
  for (collision::ContactBody& body : others) {
    body.pose = {&kElsewhere, 1};
    body.skeleton = nullptr;
  }
  return others;
}

/// Where all bodies of a scene are put, and in which size.
struct Stage {
  double length = 1.0;  ///< of a metre of theirs [m]
  Pose pose;
  [[nodiscard]] Pose place(const Pose& inner) const {
    return {pose.position + length * (pose.orientation * inner.position), pose.orientation * inner.orientation};
  }
  [[nodiscard]] implicit::HalfSpace place(const implicit::HalfSpace& inner) const {
    return {pose.position + length * (pose.orientation * inner.point), pose.orientation * inner.normal, inner.slope / length};
  }
  [[nodiscard]] implicit::Skeleton scaled(implicit::Skeleton skeleton) const {
    if (length == 1.0) return skeleton;
    for (implicit::Primitive& p : skeleton.primitive) {
      p.size *= length;
      for (Vec3& x : p.control) x *= length;
      p.offset.position *= length;
      p.kernel.radius *= length;
      p.kernel.thickness *= length;
      p.kernel.slope /= length;
      p.kernel.steepest *= length;
    }
    return skeleton;
  }
};

/// A rigid body: its field and samples in the pose it was put in, which is that of all of its parts.
class Rigid {
 public:
  Rigid(implicit::Skeleton skeleton, double modulus, double spacing, const Stage& stage = {})
      : stage_(stage), skeleton_(stage.scaled(std::move(skeleton))), modulus_(modulus), layout_(implicit::make_sample_layout(skeleton_, stage.length * spacing)), poses_(skeleton_.part_count) {
    implicit::place_skeleton(skeleton_, poses_, placed_);
    implicit::index_field(skeleton_, placed_, field_);
    implicit::SampleState kept;
    implicit::sample_surface({skeleton_, layout_, poses_, field_}, {}, Executor(1), kept, rest_);
  }
  /// @param pose  on the stage
  void put(const Pose& pose) {
    const Pose here = stage_.place(pose);
    poses_.assign(poses_.size(), here);
    implicit::place_skeleton(skeleton_, poses_, placed_);
    implicit::index_field(skeleton_, placed_, field_);
    samples_ = rest_;
    for (std::size_t i = 0; i < samples_.point.size(); ++i) {
      samples_.point[i] = here.position + here.orientation * rest_.point[i];
      samples_.normal[i] = here.orientation * rest_.normal[i];
    }
  }
  /// A random place of the surface and its normal, on the stage with the body at rest.
  std::pair<Vec3, Vec3> surface_point(Draw& draw) const {
    std::size_t i = 0;
    do {
      i = static_cast<std::size_t>(draw.uniform(0.0, 1.0) * static_cast<double>(rest_.point.size()));
    } while (rest_.valid[i] == 0);
    return {rest_.point[i] / stage_.length, rest_.normal[i]};
  }
  [[nodiscard]] implicit::FieldView field() const { return field_; }
  /// Largest value of another body's field at the samples.
  [[nodiscard]] double deepest_in(const implicit::FieldView& other) const {
    std::vector<double> value(samples_.point.size());
    other.evaluate(samples_.point, value);
    double deepest = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < value.size(); ++i) deepest = samples_.valid[i] != 0 ? std::max(deepest, value[i]) : deepest;
    return deepest;
  }
  [[nodiscard]] collision::ContactBody body() const {
    collision::ContactBody b = at_rest(field_, modulus_, poses_);
    b.samples = &samples_;
    b.skeleton = &skeleton_;
    return b;
  }

 private:
  Stage stage_;
  implicit::Skeleton skeleton_;
  double modulus_;
  implicit::SampleLayout layout_;
  implicit::PlacedSkeleton placed_;
  implicit::Field field_;
  implicit::SurfaceSamples rest_, samples_;
  std::vector<Pose> poses_;
};

/// Sphere of radius r with p = E (1 - d / r) inside: Gascuel's kernel, linear as far as the surface.
inline implicit::Skeleton linear_shape(implicit::ShapeKind shape, const Vec3& size, double r) {
  implicit::Skeleton skeleton;
  implicit::Primitive p;
  p.shape = shape;
  p.size = size;
  p.kernel = implicit::Kernel::gascuel(r, 1.5 * r, 0.5 / r);
  skeleton.primitive.push_back(p);
  skeleton.part_count = 1;
  return skeleton;
}
inline implicit::Skeleton linear_sphere(double r) { return linear_shape(implicit::ShapeKind::Point, Vec3::Zero(), r); }
/// F = slope (r - d) there, so that p = E (1 - d / r) has the modulus E / (slope r) = 2 E.
inline constexpr double kLinearModulus = 2.0;

inline implicit::Skeleton wyvill_shape(implicit::ShapeKind shape, const Vec3& size, double support) {
  implicit::Skeleton skeleton;
  implicit::Primitive p;
  p.shape = shape;
  p.size = size;
  p.kernel = implicit::Kernel::wyvill(support);
  skeleton.primitive.push_back(p);
  skeleton.part_count = 1;
  return skeleton;
}

/// Ten blobs in a lump, their supports overlapping. @param apart  each is a part of its own
inline implicit::Skeleton ten_blobs(std::uint64_t seed, bool apart = false) {
  Draw draw(seed);
  implicit::Skeleton skeleton;
  for (int i = 0; i < 10; ++i) {
    implicit::Primitive p;
    p.kernel = implicit::Kernel::wyvill(0.1 * draw.uniform(0.8, 1.2));
    p.offset.position = 0.05 * draw.direction();
    if (apart) p.part = static_cast<std::uint32_t>(i);
    skeleton.primitive.push_back(p);
  }
  skeleton.part_count = apart ? 10 : 1;
  return skeleton;
}

/// One primitive of any shape, kernel, taper and stretch, about 0.1 to 0.6 across.
inline implicit::Skeleton any_shape(Draw& draw) {
  using implicit::Kernel;
  using implicit::ShapeKind;
  const auto one_of = [&draw](std::size_t count) { return static_cast<std::size_t>(draw.uniform(0.0, static_cast<double>(count))); };
  const auto sizes = [&draw](double lower, double upper) { return Vec3(draw.uniform(lower, upper), draw.uniform(lower, upper), draw.uniform(lower, upper)); };
  implicit::Primitive p;
  p.shape = static_cast<ShapeKind>(one_of(static_cast<std::size_t>(ShapeKind::Directed) + 1));
  const double support = draw.uniform(0.08, 0.2);
  const std::array<Kernel, 5> kernels{Kernel::wyvill(support), Kernel::soft_object(support), Kernel::murakami(support), Kernel::nishimura(support),
                                      Kernel::blanc_schlick(support, draw.uniform(0.3, 3.0))};
  p.kernel = draw.uniform(0.0, 1.0) < 0.5 ? kernels[0] : kernels[one_of(kernels.size())];
  p.size = sizes(0.03, 0.2);
  if (p.shape == ShapeKind::Ellipsoid || p.shape == ShapeKind::Superquadric || p.shape == ShapeKind::Directed) p.size = sizes(0.1, 0.25);
  if (p.shape == ShapeKind::Arc) p.size.y() = draw.uniform(0.5, 3.0);
  if (p.shape == ShapeKind::Directed) p.control = {sizes(0.1, 0.25)};
  if (p.shape == ShapeKind::Superquadric) p.exponent = {draw.uniform(0.4, 1.0), draw.uniform(0.4, 1.0)};
  if (p.shape == ShapeKind::Segment || p.shape == ShapeKind::Curve) p.taper = draw.uniform(0.6, 1.4);
  if (p.shape == ShapeKind::Triangle) p.control = {sizes(-0.2, 0.2), sizes(-0.2, 0.2), sizes(-0.2, 0.2)};
  if (p.shape == ShapeKind::Curve) {
    for (std::size_t i = 0, count = 2 + one_of(3); i < count; ++i) p.control.push_back(sizes(-0.2, 0.2));
  }
  if (p.shape == ShapeKind::Polygon) {
    const double across = draw.uniform(0.08, 0.2);
    for (int i = 0; i < 5; ++i) {
      const auto [sine, cosine] = math::sin_cos(2.0 * kPi * i / 5.0);
      p.control.emplace_back(across * cosine, across * sine, 0.0);
    }
  }
  if (draw.uniform(0.0, 1.0) < 0.3) p.stretch = sizes(0.7, 1.4);
  implicit::Skeleton skeleton;
  skeleton.primitive.push_back(p);
  skeleton.part_count = 1;
  return skeleton;
}

/// What a query answers, for comparison.
struct Answer {
  double force = 0.0;
  double area = 0.0;
  Vec3 centre = Vec3::Zero();
};

/// Integrals over z of a stack of discs: pressures from 0 to p_max, radius^2 rho2(p), height z(p) over the origin along
/// `axis`; dz/dp by `slope`. F = pi integral of rho^2 dp; area = 2 pi integral of sqrt(rho^2 z'^2 + (rho rho')^2) dp.
template <class Disc>
Answer stack_of_discs(double p_max, const Vec3& origin, const Vec3& axis, const Disc& disc) {
  // p = p_max sin^2(t) is smooth at both ends; Simpson's rule with enough nodes for round-off.
  constexpr int kNodes = 4000;
  Answer sum;
  double load = 0.0, first = 0.0;
  for (int i = 0; i <= kNodes; ++i) {
    const double t = 0.5 * kPi * i / kNodes;
    const double weight = (i == 0 || i == kNodes ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * 0.5 * kPi / kNodes / 3.0;
    const double s = std::sin(t), c = std::cos(t);
    const double p = p_max * s * s, dp = 2.0 * p_max * s * c * weight;
    const auto [rho2, rho_rate, z, z_rate] = disc(p);  // rho^2, d(rho^2)/dp / 2, z, dz/dp
    const double ring = 2.0 * kPi * std::sqrt(std::max(rho2, 0.0) * z_rate * z_rate + rho_rate * rho_rate);
    sum.force += kPi * rho2 * dp;
    sum.area += ring * dp;
    load += p * ring * dp;
    first += p * z * ring * dp;
  }
  sum.centre = origin + (first / load) * axis;
  return sum;
}

/// Two spheres of linear pressure: A at `centre`, B a distance D along `axis`.
inline Answer spheres(double ra, double ea, double rb, double eb, double D, const Vec3& centre, const Vec3& axis) {
  const double p_max = (ra + rb - D) / (ra / ea + rb / eb);
  return stack_of_discs(p_max, centre, axis, [=](double p) {
    const double a = ra * (1.0 - p / ea), b = rb * (1.0 - p / eb);
    const double da = -ra / ea, db = -rb / eb;
    const double z = (D * D + a * a - b * b) / (2.0 * D), dz = (a * da - b * db) / D;
    return std::array<double, 4>{a * a - z * z, a * da - z * dz, z, dz};
  });
}

/// A sphere of linear pressure at height h over a body whose pressure is k times the depth.
inline Answer sphere_on_flat(double r, double e, double k, double h, const Vec3& centre, const Vec3& down) {
  const double p_max = (r - h) / (r / e + 1.0 / k);
  return stack_of_discs(p_max, centre, down, [=](double p) {
    const double a = r * (1.0 - p / e), z = h + p / k;
    return std::array<double, 4>{a * a - z * z, -a * r / e - z / k, z, 1.0 / k};
  });
}

/// The face [-a, a] x [-b, b] of a box with edges of radius r, p = e (1 - d / r) at the distance d from the core, at height h
/// over a body whose pressure is k times the depth: an isobar is a rectangle with round corners.
inline Answer face_on_flat(double a, double b, double r, double e, double k, double h, const Vec3& centre, const Vec3& down) {
  const double p_max = (r - h) / (r / e + 1.0 / k);
  Answer sum;
  double load = 0.0, first = 0.0;
  const auto add = [&](double p, double z, double area) {
    sum.area += area;
    load += p * area;
    first += p * z * area;
  };
  add(p_max, h + p_max / k, 4.0 * a * b);
  sum.force = 4.0 * a * b * p_max;
  constexpr int kNodes = 4000;
  for (int i = 0; i <= kNodes; ++i) {  // Simpson's rule in t, p = p_max cos^2 t: the width rises with t
    const double t = 0.5 * kPi * i / kNodes;
    const double weight = (i == 0 || i == kNodes ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * 0.5 * kPi / kNodes / 3.0;
    const double s = std::sin(t), c = std::cos(t);
    const double p = p_max * c * c, z = h + p / k, d = r * (1.0 - p / e);
    // d^2 - z^2 = (d + z) (r / e + 1 / k) (p_max - p)
    const double root = std::sqrt((d + z) * (r - h)), width = s * root, dp = 2.0 * p_max * s * c;
    const double widens = (d * r / e + z / k) * 2.0 * p_max * c / root;
    sum.force += (4.0 * (a + b) * width + kPi * width * width) * dp * weight;
    add(p, z, (4.0 * (a + b) + 2.0 * kPi * width) * std::hypot(widens, dp / k) * weight);
  }
  sum.centre = centre + (first / load) * down;
  return sum;
}

inline double cpu_microseconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

/// As ContactSettings::error measures it.
inline double difference(const collision::ContactSurface::Summary& s, const Answer& exact) {
  return std::max({std::abs(s.force.norm() - exact.force) / std::max(exact.force, 1e-3 * s.load), std::abs(s.area / exact.area - 1.0),
                   (s.centre_of_pressure - exact.centre).norm() / std::sqrt(exact.area)});
}

/// One query of two bodies, from the broad phase on. @return a summary without points where they do not touch
inline collision::ContactSurface::Summary contact_between(const std::array<collision::ContactBody, 2>& bodies, double error) {
  const Executor executor(1);
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
  return surface.summary.empty() ? collision::ContactSurface::Summary{} : surface.summary.front();
}

/// One pose: the bodies in it, and the closed form where there is one.
struct Pair {
  std::array<collision::ContactBody, 2> bodies;
  bool known = false;
  Answer exact;
};

/// Places B such that a surface point of it is pressed into one of A by `depth`, normal against normal.
/// @return whether no other sample of either lies much deeper in the other one
inline bool press(Rigid& a, Rigid& b, double depth, Draw& draw) {
  const Pose pose{draw.uniform(0.0, 1.0) * draw.direction(), draw.rotation()};
  a.put(pose);
  const auto [rest, outward] = a.surface_point(draw);
  const Vec3 x = pose.position + pose.orientation * rest, n = pose.orientation * outward;
  const auto [y, m] = b.surface_point(draw);
  const Quat spin(Eigen::AngleAxisd(draw.uniform(-kPi, kPi), n));
  const Quat turn = (spin * Quat::FromTwoVectors(m, -n)).normalized();
  b.put({x - depth * n - turn * y, turn});
  constexpr double kDeeper = 1.5;
  return a.deepest_in(b.field()) <= kDeeper * b.field().value(x) && b.deepest_in(a.field()) <= kDeeper * a.field().value(x - depth * n);
}

}  // namespace supple::benchmarks
