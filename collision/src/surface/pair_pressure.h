/// @file pair_pressure.h
/// The pressures p = P F of two bodies at batches of points, and what they cost.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "numbers.h"
#include "supple/collision/bodies.h"
#include "supple/implicit/field.h"
#include "supple/implicit/kinks.h"

namespace supple::collision {

/// Pressures [Pa] and their gradients [Pa/m] at `point`; index i is the same point in every array.
struct PressureBatch {
  std::vector<Vec3> point;
  std::vector<double> a, b;
  std::vector<Vec3> slope_a, slope_b;

  [[nodiscard]] std::size_t size() const noexcept { return point.size(); }
  void resize(std::size_t n) {
    point.resize(n);
    a.resize(n);
    b.resize(n);
    slope_a.resize(n);
    slope_b.resize(n);
  }
};

/// Third bodies, which take what they press harder on.
using Thirds = std::span<const ContactBody* const>;

/// What both pressures at a place, and their slopes, tell to first order of Sigma along an axis through it. The slopes are only looked at.
struct AlongAxis {
  const Vec3 &slope_a, &slope_b;  // [Pa/m]
  double up_a, up_b, rate;        // along the axis; of p_B - p_A

  AlongAxis(const Vec3& of_a, const Vec3& of_b, const Vec3& axis) : slope_a(of_a), slope_b(of_b), up_a(of_a.dot(axis)), up_b(of_b.dot(axis)), rate(up_b - up_a) {}
  /// Whether Sigma is a graph along the axis. @param least  cosine between its normal and the axis
  [[nodiscard]] bool upright(double least) const { return rate > least * (slope_b - slope_a).norm(); }
  /// How far Sigma lies along the axis [m], and the pressure there.
  [[nodiscard]] double lift(double a, double b) const { return (a - b) / rate; }
  [[nodiscard]] double pressure(double a, double b) const { return (a * up_b - b * up_a) / rate; }
  /// Along Sigma above a way: derivatives of the pressure and of the height.
  [[nodiscard]] double slope(const Vec3& way) const { return (slope_a.dot(way) * up_b - slope_b.dot(way) * up_a) / rate; }
  [[nodiscard]] double rise(const Vec3& way) const { return (slope_a - slope_b).dot(way) / rate; }
};

/// One step of Newton's method towards p_A = p_B along its gradient, no longer than `longest` [m], from each place of a batch that has been evaluated.
void step_to_sigma(PressureBatch& batch, double longest);

class PairPressure {
 public:
  PairPressure(const ContactBody& a, const ContactBody& b)
      : field_{a.field, b.field}, body_{&a, &b}, modulus_{a.material.modulus, b.material.modulus} {}

  /// A direction across `normal` that is told by the bodies alone: it turns with them and is the same whichever comes first, so that a choice that
  /// nothing else decides, and what it leaves of the error asked for, are the same in every view.
  /// @param from  the place [m] that bodies are seen from   @param normal  [unit]
  /// @param apart  a direction across the normal [unit] that it is not at right angles to; or null
  /// @return [unit]; nothing where bodies do not say how they lie, or lie alike all around
  [[nodiscard]] std::optional<Vec3> tangent(const Vec3& from, const Vec3& normal, const Vec3* apart = nullptr) const;

  /// A becomes B.
  void reverse() {
    std::swap(field_[0], field_[1]);
    std::swap(body_[0], body_[1]);
    std::swap(modulus_[0], modulus_[1]);
  }
  [[nodiscard]] const ContactBody& body(int side) const noexcept { return *body_[side]; }

  /// Values and gradients of both bodies at batch.point.
  void evaluate(PressureBatch& batch) {
    evaluate(0, batch.point, batch.a, batch.slope_a);
    evaluate(1, batch.point, batch.b, batch.slope_b);
  }
  /// The same at the points `which` alone. @param some  room for them
  void evaluate(PressureBatch& batch, std::span<const std::size_t> which, PressureBatch& some) {
    if (which.size() == batch.size()) return evaluate(batch);
    some.resize(which.size());
    for (std::size_t k = 0; k < which.size(); ++k) some.point[k] = batch.point[which[k]];
    evaluate(some);
    for (std::size_t k = 0; k < which.size(); ++k) {
      const std::size_t i = which[k];
      batch.a[i] = some.a[k];
      batch.b[i] = some.b[k];
      batch.slope_a[i] = some.slope_a[k];
      batch.slope_b[i] = some.slope_b[k];
    }
  }
  /// Whether both bodies are known to be convex, whatever the pressure from which they are seen.
  [[nodiscard]] bool convex() const { return field_[0].convex() && field_[1].convex(); }

  /// Values of both bodies.
  void evaluate_values(PressureBatch& batch) {
    evaluate(0, batch.point, batch.a);
    evaluate(1, batch.point, batch.b);
  }
  /// One body (side 0: A, 1: B).
  void evaluate(int side, std::span<const Vec3> points, std::span<double> values, std::span<Vec3> slopes) {
    field_[side].evaluate(points, values, slopes);
    for (double& v : values) v *= modulus_[side];
    for (Vec3& g : slopes) g *= modulus_[side];
    evaluations_ += points.size();
  }
  void evaluate(int side, std::span<const Vec3> points, std::span<double> values) {
    field_[side].evaluate(points, values);
    for (double& v : values) v *= modulus_[side];
    evaluations_ += points.size();
  }
  [[nodiscard]] double value(int side, const Vec3& x) {
    double p;
    evaluate(side, {&x, 1}, {&p, 1});
    return p;
  }
  [[nodiscard]] double value(int side, const Vec3& x, Vec3& slope) {
    double p;
    evaluate(side, {&x, 1}, {&p, 1}, {&slope, 1});
    return p;
  }

  /// Whether the box may hold a place where both bodies press, and equally hard, by their bounds. @param least  by more than that [Pa]
  [[nodiscard]] bool may_meet(const Box& box, double least = 0.0) const {
    const Interval a = field_[0].bound(box);
    if (!(modulus_[0] * a.upper > least)) return false;
    const Interval b = field_[1].bound(box);
    return modulus_[1] * b.upper > least && modulus_[0] * a.lower <= modulus_[1] * b.upper && modulus_[1] * b.lower <= modulus_[0] * a.upper;
  }

  /// Appends where derivatives of either pressure jump, as far as the fields tell. @return whether these are all
  bool kinks(const Box& box, std::vector<implicit::Kink>& out) const {
    bool all = true;
    for (const implicit::FieldView& view : field_) {
      if (const implicit::Field* field = view.as_field()) {
        all = kinks_of(*field, box, out) && all;
      } else {
        const std::optional<implicit::CorePoint> core = view.core_point(box.centre());
        all = all && core && core->round;
      }
    }
    return all;
  }

  [[nodiscard]] const implicit::FieldView& field(int side) const noexcept { return field_[side]; }
  [[nodiscard]] double modulus(int side) const noexcept { return modulus_[side]; }
  [[nodiscard]] double largest_modulus() const noexcept { return std::max(modulus_[0], modulus_[1]); }
  /// Round-off of the pressures at x [Pa], which that of the coordinates adds to. @param steepness  of their difference [Pa/m]
  [[nodiscard]] double noise(const Vec3& x, double steepness) const {
    return 16.0 * kEpsilon * std::max(largest_modulus(), steepness * x.lpNorm<Eigen::Infinity>());
  }
  /// The same of what both are on Sigma, in which the softer body has the larger say. @param slope_a, slope_b  along the normal, either way [Pa/m]
  [[nodiscard]] double noise_on_sigma(const Vec3& x, double slope_a, double slope_b) const {
    const double a = std::abs(slope_a), b = std::abs(slope_b), modulus = modulus_[0] * b + modulus_[1] * a;
    return 16.0 * kEpsilon * std::max(modulus, 4.0 * a * b * x.lpNorm<Eigen::Infinity>()) / (a + b);
  }
  /// Length [m] that steps are limited by: the smaller feature size of the two bodies.
  [[nodiscard]] double feature_size() const {
    return std::min(field_[0].feature_size(), field_[1].feature_size());
  }
  /// Distance from a place of Sigma along the way [unit] out of a body to where it ends, or the other one before. @param longest  step [m]
  [[nodiscard]] double overlap_out_of(int side, const Vec3& from, const Vec3& way, double longest);
  [[nodiscard]] std::uint64_t evaluations() const noexcept { return evaluations_; }

 private:
  implicit::FieldView field_[2];
  const ContactBody* body_[2];
  double modulus_[2];
  std::uint64_t evaluations_ = 0;  // of one body at one point
};

}  // namespace supple::collision
