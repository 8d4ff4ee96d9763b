/// @file lights.h
/// Lights of the path tracer: the sun as a disc in the sky, a sky of even radiance, rectangles.
#pragma once

#include <vector>

#include "path/sampling.h"

namespace supple::render::path {

struct Sun {
  Vec3f to_light = Vec3f::UnitZ();
  Vec3f irradiance = Vec3f::Zero();  ///< at normal incidence
  float cosine = 1.0F;               ///< of its angular radius; 1: a point

  [[nodiscard]] bool shines() const { return irradiance.maxCoeff() > 0.0F; }
  [[nodiscard]] float solid_angle() const { return 2.0F * kPi * (1.0F - cosine); }
  [[nodiscard]] bool is_point() const { return cosine >= 1.0F; }
  /// Uniform in the cone, in axes whose z points to the light.
  [[nodiscard]] Vec3Lanes sample(const Pair<Lanes>& u) const {
    const Pair<Lanes> d = on_disc(u);
    const Lanes fall = (d.x * d.x + d.y * d.y) * (1.0F - cosine);
    const Lanes scale = root((1.0F - cosine) * (2.0F - fall));
    return {d.x * scale, d.y * scale, 1.0F - fall};
  }
  /// Radiance such that a face towards the sun gets its irradiance: E / (pi sin^2).
  [[nodiscard]] Vec3f radiance() const { return irradiance / (kPi * (1.0F - cosine * cosine)); }
  [[nodiscard]] LaneMask contains(const Vec3Lanes& direction) const {
    return is_point() ? LaneMask{} : direction.dot(Vec3Lanes(to_light)) >= cosine;
  }
};

/// Density over solid angle of a uniform point of a face, seen from `distance` away. @param facing  cosine at the face
[[nodiscard]] inline Lanes density_of_face(Lanes area, Lanes facing, Lanes distance) {
  return distance * distance / (area * larger(facing, 1e-6F));
}

struct Rectangle {
  Vec3f centre, u, v, front;  ///< halves of its edges; where it shines
  Vec3f radiance;
  [[nodiscard]] float area() const { return 4.0F * u.norm() * v.norm(); }
  /// Distance along rays to the lit side, or infinity.
  [[nodiscard]] Lanes distance(const Vec3Lanes& from, const Vec3Lanes& direction) const {
    const Vec3Lanes middle(centre), out(front), along_u(u), along_v(v);
    const Lanes facing = direction.dot(out);
    const Lanes t = (middle - from).dot(out) / facing;
    const Vec3Lanes p = from + t * direction - middle;
    const LaneMask inside = both(magnitude(p.dot(along_u)) <= u.squaredNorm(), magnitude(p.dot(along_v)) <= v.squaredNorm());
    return select(both(both(facing < 0.0F, t > 0.0F), inside), t, INFINITY);
  }
};

struct Lights {
  Sun sun;
  Vec3f above = Vec3f::Zero();  ///< radiance of the sky
  Vec3f below = Vec3f::Zero();  ///< from below the horizon, where there is no ground
  std::vector<Rectangle> rectangles;
  [[nodiscard]] Vec3Lanes sky(const Vec3Lanes& direction) const {
    return select(direction.z() >= 0.0F, Vec3Lanes(above), Vec3Lanes(below));
  }
};

}  // namespace supple::render::path
