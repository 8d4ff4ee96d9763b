/// @file tests/collision/bodies.h
/// Bodies with pressures in closed form, one part each, and helpers to put them in contact.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "supple/collision/react.h"
#include "supple/core/math.h"
#include "supple/implicit/field.h"

namespace supple::collision::testing {

/// A field with f(|x - centre|) given by `Profile`: F and dF/drho.
template <class Profile>
struct RadialField {
  Vec3 centre = Vec3::Zero();
  Profile profile;

  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = profile.value((points[i] - centre).norm());
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 d = points[i] - centre;
      const double rho = d.norm();
      values[i] = profile.value(rho);
      gradients[i] = rho > 0.0 ? Vec3(profile.slope(rho) / rho * d) : Vec3::Zero().eval();
    }
  }
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const {
    const std::size_t n = points.size();
    parts.offset.resize(n + 1);
    for (std::size_t i = 0; i <= n; ++i) parts.offset[i] = static_cast<std::uint32_t>(i);
    parts.part.assign(n, 0);
    parts.value.resize(n);
    parts.gradient.resize(n);
    evaluate(points, parts.value, parts.gradient);
  }
  [[nodiscard]] Interval bound(const Box& box) const {
    const Vec3 outside = (box.lower - centre).cwiseMax(centre - box.upper).cwiseMax(0.0);
    const Vec3 farthest = (box.upper - centre).cwiseAbs().cwiseMax((box.lower - centre).cwiseAbs());
    return {profile.value(farthest.norm()), profile.value(outside.norm())};
  }
  [[nodiscard]] double gradient_bound(const Box&) const { return profile.steepest(); }
  [[nodiscard]] Box surface_box() const {
    const double r = profile.radius();
    return {centre - Vec3::Constant(r), centre + Vec3::Constant(r)};
  }
  [[nodiscard]] double feature_size() const { return profile.radius(); }
};

/// p = K (a - rho).
struct Linear {
  double a = 1.0, K = 1.0;
  [[nodiscard]] double value(double rho) const { return K * (a - rho); }
  [[nodiscard]] double slope(double) const { return -K; }
  [[nodiscard]] double steepest() const { return K; }
  [[nodiscard]] double radius() const { return a; }
};

/// p = 1 - rho^2 / R^2 - c.
struct Quadratic {
  double R = 1.0, c = 0.5;
  [[nodiscard]] double value(double rho) const { return 1.0 - rho * rho / (R * R) - c; }
  [[nodiscard]] double slope(double rho) const { return -2.0 * rho / (R * R); }
  [[nodiscard]] double steepest() const { return 100.0 / R; }
  [[nodiscard]] double radius() const { return R * std::sqrt(1.0 - c); }
};

/// p = (1 - rho^2 / R^2)^3 - c, compact.
struct Wyvill {
  double R = 1.0, c = 0.5;
  [[nodiscard]] double value(double rho) const {
    const double s = std::max(0.0, 1.0 - rho * rho / (R * R));
    return s * s * s - c;
  }
  [[nodiscard]] double slope(double rho) const {
    const double s = std::max(0.0, 1.0 - rho * rho / (R * R));
    return -6.0 * rho / (R * R) * s * s;
  }
  [[nodiscard]] double steepest() const { return 1.7173002071 / R; }
  [[nodiscard]] double radius() const { return R * std::sqrt(1.0 - std::cbrt(c)); }
};

using LinearSphere = RadialField<Linear>;
using QuadraticSphere = RadialField<Quadratic>;
using WyvillSphere = RadialField<Wyvill>;

/// F = c - |D^-1 Q^T (x - centre)|^2 with semi-axes sqrt(c) D.
struct Ellipsoid {
  Vec3 centre = Vec3::Zero();
  Quat orientation = Quat::Identity();
  Vec3 axes = Vec3::Ones();  ///< D [m]
  double c = 0.5;

  [[nodiscard]] Mat3 form() const {
    const Mat3 Q = orientation.toRotationMatrix();
    return Q * axes.cwiseProduct(axes).cwiseInverse().asDiagonal() * Q.transpose();
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    const Mat3 M = form();
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = c - (points[i] - centre).dot(M * (points[i] - centre));
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    const Mat3 M = form();
    evaluate(points, values);
    for (std::size_t i = 0; i < points.size(); ++i) gradients[i] = -2.0 * (M * (points[i] - centre));
  }
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const {
    const std::size_t n = points.size();
    parts.offset.resize(n + 1);
    for (std::size_t i = 0; i <= n; ++i) parts.offset[i] = static_cast<std::uint32_t>(i);
    parts.part.assign(n, 0);
    parts.value.resize(n);
    parts.gradient.resize(n);
    evaluate(points, parts.value, parts.gradient);
  }
  [[nodiscard]] Interval bound(const Box& box) const {
    const double r = (box.centre() - centre).norm() + 0.5 * box.extent().norm();
    return {c - r * r / (axes.minCoeff() * axes.minCoeff()), c};
  }
  [[nodiscard]] double gradient_bound(const Box& box) const {
    const double r = (box.centre() - centre).norm() + 0.5 * box.extent().norm();
    return 2.0 * r / (axes.minCoeff() * axes.minCoeff());
  }
  [[nodiscard]] Box surface_box() const {
    const Mat3 inverse = form().inverse();
    const Vec3 half = std::sqrt(c) * inverse.diagonal().cwiseSqrt();
    return {centre - half, centre + half};
  }
  [[nodiscard]] double feature_size() const { return std::sqrt(c) * axes.minCoeff(); }
};

/// Points spread evenly over a sphere, as surface samples.
inline implicit::SurfaceSamples sphere_samples(const Vec3& centre, double radius, int count) {
  implicit::SurfaceSamples samples;
  constexpr double kGoldenAngle = 2.399963229728653;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double r = std::sqrt(1.0 - z * z);
    const auto [s, c] = math::sin_cos(kGoldenAngle * i);
    const Vec3 n(r * c, r * s, z);
    samples.point.push_back(centre + radius * n);
    samples.normal.push_back(n);
    samples.area.push_back(4.0 * 3.141592653589793 * radius * radius / count);
    samples.valid.push_back(1);
  }
  return samples;
}

/// Wyvill points, one part each: a body of particles.
struct Blobs {
  implicit::Skeleton skeleton;
  std::vector<Vec3> centre;
  implicit::PlacedSkeleton placed;
  implicit::Field field;

  Blobs(std::vector<Vec3> centres, double radius) : centre(std::move(centres)) {
    skeleton.part_count = static_cast<std::uint32_t>(centre.size());
    for (std::uint32_t k = 0; k < centre.size(); ++k) {
      implicit::Primitive p;
      p.part = k;
      p.kernel = implicit::Kernel::wyvill(radius);
      skeleton.primitive.push_back(p);
    }
    place();
  }
  void place() {
    std::vector<Pose> parts;
    for (const Vec3& x : centre) parts.push_back(Pose{x, Quat::Identity()});
    implicit::place_skeleton(skeleton, parts, placed);
    implicit::index_field(skeleton, placed, field);
  }
};

/// Bodies by value with what ContactBody views.
class Stage {
 public:
  /// @param field  must outlive the stage   @param parts  centres of the parts
  ContactBody& add(const implicit::FieldView& field, std::vector<Vec3> parts = {Vec3::Zero()}, double modulus = 1.0) {
    auto body = std::make_unique<Body>();
    for (const Vec3& x : parts) body->pose.push_back(Pose{x, Quat::Identity()});
    body->velocity.assign(parts.size(), Vec3::Zero());
    body->spin.assign(parts.size(), Vec3::Zero());
    bodies_.push_back(ContactBody{});
    ContactBody& view = bodies_.back();
    view.field = field;
    view.material.modulus = modulus;
    view.pose = body->pose;
    view.velocity = body->velocity;
    view.angular_velocity = body->spin;
    kept_.push_back(std::move(body));
    return view;
  }
  [[nodiscard]] std::vector<Pose>& pose(std::size_t i) { return kept_[i]->pose; }
  [[nodiscard]] std::vector<Vec3>& velocity(std::size_t i) { return kept_[i]->velocity; }
  [[nodiscard]] std::vector<Vec3>& spin(std::size_t i) { return kept_[i]->spin; }
  [[nodiscard]] std::vector<ContactBody>& bodies() { return bodies_; }

  const ContactSurface& solve(const ContactSettings& settings = {}, int threads = 1) {
    const Executor executor(threads);
    find_contacts(bodies_, broad_phase(bodies_, rules, executor), executor, candidates);
    solve_contact_surface(bodies_, candidates, settings, executor, surface);
    return surface;
  }
  std::vector<PartLoads> react(const ReactionSettings& settings = {}, ReactionReport* report = nullptr, int threads = 1) {
    std::vector<PartLoads> loads(bodies_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      loads[i].force.assign(bodies_[i].pose.size(), Vec3::Zero());
      loads[i].torque.assign(bodies_[i].pose.size(), Vec3::Zero());
    }
    const ReactionReport result = collision::react({bodies_, rules, surface, settings}, Executor(threads), {loads});
    if (report != nullptr) *report = result;
    return loads;
  }

  ContactRules rules;
  ContactCandidates candidates;
  ContactSurface surface;

 private:
  struct Body {
    std::vector<Pose> pose;
    std::vector<Vec3> velocity, spin;
  };
  std::vector<std::unique_ptr<Body>> kept_;
  std::vector<ContactBody> bodies_;
};

}  // namespace supple::collision::testing
