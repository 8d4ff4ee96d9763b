/// @file tests/implicit/analytic_fields.h
/// Scalar fields with known surfaces, for tests of what only sees a FieldView.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include "implicit/bodies.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit::testing {

/// A field from a function of the point, with bounds from its Lipschitz constant. F(p, gradient).
struct FunctionField {
  std::function<double(const Vec3&, Vec3&)> function;
  double lipschitz = 1.0;
  Box box;
  bool bounds_everything = false;  ///< bound() excludes nothing

  void evaluate(std::span<const Vec3> points, std::span<double> values) const {
    Vec3 gradient;
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = function(points[i], gradient);
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = function(points[i], gradients[i]);
  }
  void evaluate_parts(std::span<const Vec3>, FieldParts& parts) const { parts = {}; }
  [[nodiscard]] Interval bound(const Box& b) const {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    if (bounds_everything) return {-kInfinity, kInfinity};
    Vec3 gradient;
    const double reach = 0.5 * b.extent().norm() * lipschitz * (1.0 + 1e-9), f = function(b.centre(), gradient);
    return {f - reach, f + reach};
  }
  [[nodiscard]] double gradient_bound(const Box&) const { return lipschitz; }
  [[nodiscard]] Box surface_box() const { return box; }
  [[nodiscard]] double feature_size() const { return 0.5 * box.extent().minCoeff(); }
};

/// F = r - |x - c|
inline FunctionField sphere(const Vec3& centre, double radius) {
  return {.function =
              [=](const Vec3& p, Vec3& gradient) {
                const Vec3 d = p - centre;
                const double n = d.norm();
                gradient = n > 0.0 ? Vec3(-d / n) : Vec3::Zero();
                return radius - n;
              },
          .lipschitz = 1.0,
          .box = Box{centre, centre}.inflated(radius * (1.0 + 1e-12))};
}

/// F = r - distance to the circle of radius `ring` around z.
inline FunctionField torus(double ring, double radius) {
  return {.function =
              [=](const Vec3& p, Vec3& gradient) {
                const double axis = std::hypot(p.x(), p.y());
                const double out = axis - ring, n = std::hypot(out, p.z());
                gradient = n > 0.0 && axis > 0.0
                               ? Vec3(-out / n * p.x() / axis, -out / n * p.y() / axis, -p.z() / n)
                               : Vec3::Zero();
                return radius - n;
              },
          .lipschitz = 1.0,
          .box = Box{Vec3(-ring - radius, -ring - radius, -radius), Vec3(ring + radius, ring + radius, radius)}};
}

/// F = max of both, a union.
inline FunctionField either(const FunctionField& a, const FunctionField& b) {
  return {.function =
              [=](const Vec3& p, Vec3& gradient) {
                Vec3 ga, gb;
                const double fa = a.function(p, ga), fb = b.function(p, gb);
                gradient = fa >= fb ? ga : gb;
                return std::max(fa, fb);
              },
          .lipschitz = std::max(a.lipschitz, b.lipschitz),
          .box = a.box.united(b.box)};
}

/// Noise with features of about a cell, inside a ball: every case of the case table, many times.
inline FunctionField noise(std::uint64_t seed, double wavelength) {
  Random random(seed);
  std::vector<std::pair<Vec3, double>> waves;
  for (int i = 0; i < 12; ++i) {
    waves.emplace_back(random.direction() * (2.0 * std::numbers::pi / (wavelength * random.uniform(0.7, 2.0))),
                       random.uniform(0.0, 6.28));
  }
  return {.function =
              [=](const Vec3& p, Vec3& gradient) {
                const double n = p.norm(), ball = 2.0 * (1.0 - n);
                double sum = 0.0;
                gradient.setZero();
                for (const auto& [k, phase] : waves) {
                  sum += std::sin(k.dot(p) + phase);
                  gradient += std::cos(k.dot(p) + phase) * k;
                }
                if (sum <= ball) return sum;
                gradient = n > 0.0 ? Vec3(-2.0 * p / n) : Vec3::Zero();
                return ball;
              },
          .lipschitz = 12.0 * 2.0 * std::numbers::pi / (0.7 * wavelength),
          .box = Box{Vec3::Constant(-1.0), Vec3::Constant(1.0)}};
}

/// The half-space z <= height with unbounded box.
inline FunctionField below(double height) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {.function =
              [=](const Vec3& p, Vec3& gradient) {
                gradient = -Vec3::UnitZ();
                return height - p.z();
              },
          .lipschitz = 1.0,
          .box = {Vec3::Constant(-kInfinity), Vec3(kInfinity, kInfinity, height)}};
}

}  // namespace supple::implicit::testing
