/// @file lights.h
/// What shines, for the path tracer: the sun as a disc in the sky, a sky of even radiance, rectangles.
#pragma once

#include <vector>

#include "sampling.h"

namespace supple::render::path {

struct Sun {
  Vec3f to_light = Vec3f::UnitZ();
  Vec3f irradiance = Vec3f::Zero();  ///< at normal incidence
  float cosine = 1.0F;               ///< of its angular radius; 1: a point

  [[nodiscard]] bool shines() const { return irradiance.maxCoeff() > 0.0F; }
  [[nodiscard]] float solid_angle() const { return 2.0F * kPi * (1.0F - cosine); }
  [[nodiscard]] bool is_point() const { return cosine >= 1.0F; }
  /// Uniform in the cone, in axes whose z points to the light.
  [[nodiscard]] Vec3f sample(const Eigen::Vector2f& u) const {
    const Eigen::Vector2f d = on_disc(u);
    const float fall = d.squaredNorm() * (1.0F - cosine);
    const Eigen::Vector2f across = d * std::sqrt((1.0F - cosine) * (2.0F - fall));
    return {across.x(), across.y(), 1.0F - fall};
  }
  /// Radiance such that a face towards the sun gets its irradiance: E / (pi sin^2).
  [[nodiscard]] Vec3f radiance() const { return irradiance / (kPi * (1.0F - cosine * cosine)); }
  [[nodiscard]] bool contains(const Vec3f& direction) const { return !is_point() && direction.dot(to_light) >= cosine; }
};

struct Rectangle {
  Vec3f centre, u, v, front;  ///< halves of its edges; where it shines
  Vec3f radiance;
  [[nodiscard]] float area() const { return 4.0F * u.norm() * v.norm(); }
  /// Distance along a ray to the lit side, or infinity.
  [[nodiscard]] float distance(const Vec3f& from, const Vec3f& direction) const {
    const float facing = direction.dot(front);
    if (facing >= 0.0F) return INFINITY;
    const float t = (centre - from).dot(front) / facing;
    const Vec3f p = from + t * direction - centre;
    const bool inside = std::abs(p.dot(u)) <= u.squaredNorm() && std::abs(p.dot(v)) <= v.squaredNorm();
    return t > 0.0F && inside ? t : INFINITY;
  }
  /// Density over solid angle of a uniform point, seen from `distance` away along `direction`.
  [[nodiscard]] float density(float distance, const Vec3f& direction) const {
    return distance * distance / (area() * std::max(-direction.dot(front), 1e-6F));
  }
};

struct Lights {
  Sun sun;
  Vec3f above = Vec3f::Zero();  ///< radiance of the sky
  Vec3f below = Vec3f::Zero();  ///< from below the horizon, where there is no ground
  std::vector<Rectangle> rectangles;
  [[nodiscard]] const Vec3f& sky(const Vec3f& direction) const { return direction.z() >= 0.0F ? above : below; }
};

}  // namespace supple::render::path
